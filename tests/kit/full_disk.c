/* Preloaded: a disk that is full, and file systems that know no files without names.
 *   EBPO_TEST_FULL_AT=N   the N-th reservation of room for a file fails with ENOSPC, and all after
 * it EBPO_TEST_NAMED=1     O_TMPFILE is not known EBPO_TEST_PAUSE=1     a file that is about to
 * lose its name keeps it for a second */
#undef _FILE_OFFSET_BITS /* both names of each call are made here */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

#pragma GCC visibility push(default) /* the project's own symbols are hidden */
int posix_fallocate64(int fd, off64_t offset, off64_t length);
int posix_fallocate(int fd, off_t offset, off_t length);
int open64(const char *path, int flags, ...);
int open(const char *path, int flags, ...);
int unlink(const char *path);

static atomic_int calls;

/* `call` points to a function pointer. */
static void find_real(const char *name, void *call)
{
    void *found = dlsym(RTLD_NEXT, name);
    memcpy(call, &found, sizeof found);
}

static int reserve(int fd, off64_t offset, off64_t length)
{
    const char *full_at = getenv("EBPO_TEST_FULL_AT");
    if (full_at && atomic_fetch_add(&calls, 1) + 1 >= atoi(full_at))
        return ENOSPC;
    int (*real)(int, off64_t, off64_t);
    find_real("posix_fallocate64", &real);
    return real(fd, offset, length);
}

int posix_fallocate64(int fd, off64_t offset, off64_t length)
{
    return reserve(fd, offset, length);
}

int posix_fallocate(int fd, off_t offset, off_t length) { return reserve(fd, offset, length); }

static int open_really(const char *path, int flags, mode_t mode)
{
    if (getenv("EBPO_TEST_NAMED") && (flags & O_TMPFILE) == O_TMPFILE) {
        errno = EOPNOTSUPP;
        return -1;
    }
    int (*real)(const char *, int, ...);
    find_real("open64", &real);
    return real(path, flags, mode);
}

static mode_t mode_of(int flags, va_list arguments)
{
    return flags & O_CREAT || (flags & O_TMPFILE) == O_TMPFILE ? va_arg(arguments, mode_t) : 0;
}

int open64(const char *path, int flags, ...)
{
    va_list arguments;
    va_start(arguments, flags);
    mode_t mode = mode_of(flags, arguments);
    va_end(arguments);
    return open_really(path, flags, mode);
}

int open(const char *path, int flags, ...)
{
    va_list arguments;
    va_start(arguments, flags);
    mode_t mode = mode_of(flags, arguments);
    va_end(arguments);
    return open_really(path, flags, mode);
}

int unlink(const char *path)
{
    int (*real)(const char *);
    find_real("unlink", &real);
    if (getenv("EBPO_TEST_PAUSE") && strstr(path, "/.ebpo-"))
        sleep(1);
    return real(path);
}
