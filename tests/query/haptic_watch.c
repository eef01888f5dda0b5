/* Counts calls that could delay a haptic step: memory, locks, files, sleep. The linker redirects
 * these calls of the library, the tests and GMP to this file (tests/query/meson.build lists them).
 * Only the thread of the steps counts. */
#include "haptic_watch.h"

#include <gmp.h>
#include <pthread.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

_Thread_local bool in_step;
unsigned long forbidden;

static void watch_call(void)
{
    if (in_step)
        forbidden++;
}

#define WATCH(type, name, parameters, arguments) \
    type __real_##name parameters;               \
    type __wrap_##name parameters;               \
    type __wrap_##name parameters                \
    {                                            \
        watch_call();                            \
        return __real_##name arguments;          \
    }
WATCH(void *, malloc, (size_t n), (n))
WATCH(void *, calloc, (size_t n, size_t m), (n, m))
WATCH(void *, realloc, (void *p, size_t n), (p, n))
WATCH(void *, aligned_alloc, (size_t a, size_t n), (a, n))
WATCH(int, pthread_mutex_lock, (pthread_mutex_t * m), (m))
WATCH(int, pthread_cond_wait, (pthread_cond_t * c, pthread_mutex_t *m), (c, m))
WATCH(int, pthread_cond_signal, (pthread_cond_t * c), (c))
WATCH(int, pthread_cond_broadcast, (pthread_cond_t * c), (c))
WATCH(ssize_t, pread64, (int fd, void *p, size_t n, off_t at), (fd, p, n, at))
WATCH(ssize_t, read, (int fd, void *p, size_t n), (fd, p, n))
WATCH(ssize_t, write, (int fd, const void *p, size_t n), (fd, p, n))
WATCH(int, pthread_rwlock_rdlock, (pthread_rwlock_t * l), (l))
WATCH(int, pthread_rwlock_wrlock, (pthread_rwlock_t * l), (l))
WATCH(int, posix_memalign, (void **p, size_t a, size_t n), (p, a, n))
WATCH(int, nanosleep, (const struct timespec *t, struct timespec *left), (t, left))

void __real_free(void *p);
void __wrap_free(void *p);
void __wrap_free(void *p)
{
    watch_call();
    __real_free(p);
}

static void *gmp_take(size_t n)
{
    watch_call();
    return __real_malloc(n);
}
static void *gmp_more(void *p, size_t old, size_t n)
{
    (void)old;
    watch_call();
    return __real_realloc(p, n);
}
static void gmp_give(void *p, size_t n)
{
    (void)n;
    watch_call();
    __real_free(p);
}

void watch_gmp(void) { mp_set_memory_functions(gmp_take, gmp_more, gmp_give); }

void pause_a_little(void)
{
    const struct timespec t = { 0, 300000 };
    nanosleep(&t, NULL);
}
