/* Lets system calls fail, as a preloaded library; see faults.h. */
#undef _FILE_OFFSET_BITS /* defines both names of each call */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include "faults.h"

#include <dlfcn.h>
#include <errno.h>
#include <execinfo.h>
#include <fcntl.h>
#include <link.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/types.h>
#include <unistd.h>

static const char *const names[FAULT_KINDS] = { "malloc",      "read",  "short-read", "write",
                                                "short-write", "fsync", "rename",     "truncate",
                                                "close",       "mmap",  "open",       "allocate",
                                                "thread" };

/* --- the original calls --- */

static struct {
    void *(*malloc)(size_t);
    void *(*calloc)(size_t, size_t);
    void *(*realloc)(void *, size_t);
    void *(*aligned_alloc)(size_t, size_t);
    int (*posix_memalign)(void **, size_t, size_t);
    ssize_t (*read)(int, void *, size_t);
    ssize_t (*pread64)(int, void *, size_t, off64_t);
    ssize_t (*write)(int, const void *, size_t);
    ssize_t (*pwrite64)(int, const void *, size_t, off64_t);
    int (*fsync)(int);
    int (*rename)(const char *, const char *);
    int (*renameat2)(int, const char *, int, const char *, unsigned);
    int (*ftruncate64)(int, off64_t);
    int (*close)(int);
    void *(*mmap64)(void *, size_t, int, int, int, off64_t);
    int (*open64)(const char *, int, ...);
    int (*posix_fallocate64)(int, off64_t, off64_t);
    int (*pthread_create)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
    int (*unlink)(const char *);
    FILE *(*fopen64)(const char *, const char *);
    FILE *(*fdopen)(int, const char *);
} real;

/* Finds the original function. Copies the bytes of the pointer, as standard C does not convert a
 * pointer to an object into a pointer to a function. */
static void find(const char *name, void *call)
{
    void *found = dlsym(RTLD_NEXT, name);
    memcpy(call, &found, sizeof found);
}
#define REAL(name)                   \
    do {                             \
        if (!real.name)              \
            find(#name, &real.name); \
    } while (0)

/* --- callers --- */

enum { MODULES = 64 };
typedef enum module_kind { FOREIGN, OURS, NEUTRAL } module_kind;
static struct {
    uintptr_t begin, end;
    module_kind kind;
} modules[MODULES];
static int module_count;

/* Returns the kind of a module. The C library, C++ and sanitizers are neutral: they make calls for
 * others. */
static module_kind kind_of(const char *path)
{
    static const char *const neutral[] = { "/libc.so",   "/libstdc++",  "/libasan",
                                           "/libubsan",  "/ld-linux",   "/libgcc_s",
                                           "/faults.so", "/libpthread", "/liblsan" };
    if (!*path || strstr(path, "/libebpo"))
        return OURS;
    for (size_t i = 0; i < sizeof neutral / sizeof *neutral; i++)
        if (strstr(path, neutral[i]))
            return NEUTRAL;
    return FOREIGN;
}

static int note_module(struct dl_phdr_info *info, size_t size, void *user)
{
    (void)size;
    (void)user;
    for (int i = 0; i < info->dlpi_phnum && module_count < MODULES; i++) {
        const ElfW(Phdr) *part = &info->dlpi_phdr[i];
        if (part->p_type != PT_LOAD || !(part->p_flags & PF_X))
            continue;
        modules[module_count].begin = info->dlpi_addr + part->p_vaddr;
        modules[module_count].end = info->dlpi_addr + part->p_vaddr + part->p_memsz;
        modules[module_count++].kind = kind_of(info->dlpi_name);
    }
    return 0;
}

static module_kind who(const void *address)
{
    for (int i = 0; i < module_count; i++)
        if ((uintptr_t)address >= modules[i].begin && (uintptr_t)address < modules[i].end)
            return modules[i].kind;
    return FOREIGN;
}

/* --- selection of the failing call --- */

static atomic_bool armed, paused;
static unsigned wanted;
static _Atomic uint64_t failing;
static bool onward, foreign;
static int error_number;
static uint64_t own_counts[2];
static _Atomic uint64_t *counts = (_Atomic uint64_t *)own_counts; /* calls, failed */
static __thread bool busy;

enum { PLACES = 1 << 16 };
static _Atomic uint64_t *places; /* hash table of the places that have failed; 0: empty */

/* Returns the module on whose behalf the C library makes the call. */
static module_kind behind(void)
{
    enum { DEPTH = 64 };
    void *frame[DEPTH];
    busy = true;
    int depth = backtrace(frame, DEPTH);
    busy = false;
    for (int i = 0; i < depth; i++)
        if (who(frame[i]) != NEUTRAL)
            return who(frame[i]);
    return NEUTRAL;
}

/* Returns true if no call from this place has failed, and records the place: the kind of the call,
 * and the innermost functions of this project that lead to it. *at: its entry in the table. */
static bool is_new_place(unsigned kind, _Atomic uint64_t **at)
{
    enum { DEPTH = 16, FUNCTIONS = 3 };
    void *frame[DEPTH];
    busy = true;
    int depth = backtrace(frame, DEPTH), used = 0;
    busy = false;
    uint64_t hash = kind;
    for (int i = 0; i < depth && used < FUNCTIONS; i++)
        if (who(frame[i]) != NEUTRAL) {
            hash = (hash ^ (uintptr_t)frame[i]) * 0x9e3779b97f4a7c15u;
            hash ^= hash >> 29;
            used++;
        }
    hash |= 1;
    for (uint64_t i = hash >> 20, tries = 0; tries < PLACES; i++, tries++) {
        uint64_t found = 0;
        *at = &places[i % PLACES];
        if (atomic_compare_exchange_strong(*at, &found, hash))
            return true;
        if (found == hash)
            return false;
    }
    return false;
}

static bool fails(unsigned kind, const void *caller)
{
    if (!atomic_load_explicit(&armed, memory_order_relaxed) || !(wanted & kind) || paused || busy)
        return false;
    module_kind from = caller ? who(caller) : OURS;
    if (from == NEUTRAL && kind == FAULT_MALLOC)
        from = behind();
    if (from == NEUTRAL || (from == FOREIGN) != foreign)
        return false;
    uint64_t n = atomic_fetch_add(&counts[0], 1) + 1;
    uint64_t first = atomic_load(&failing);
    _Atomic uint64_t *place;
    if (first == FAULTS_NEW_PLACE && is_new_place(kind, &place)) {
        if (atomic_compare_exchange_strong(&failing, &first, n))
            first = n;
        else
            atomic_store(place, 0); /* another thread was first, so this place does not fail */
    }
    bool now = first && (n == first || (onward && n > first));
    if (now) {
        atomic_fetch_add(&counts[1], 1);
        errno = error_number;
    }
    return now;
}
#define CALLER __builtin_return_address(0)

/* --- control --- */

#pragma GCC visibility push(default) /* the project's own symbols are hidden */

void faults_begin(unsigned kinds, uint64_t n, bool all_after, int error)
{
    wanted = kinds;
    failing = n;
    onward = all_after;
    error_number = error;
    atomic_store(&counts[0], 0);
    atomic_store(&counts[1], 0);
    armed = kinds != 0;
}

uint64_t faults_end(void)
{
    armed = false;
    return atomic_load(&counts[1]) ? atomic_load(&failing) : 0;
}

void faults_pause(void) { paused = true; }
void faults_resume(void) { paused = false; }

/* Returns zeroed memory that is shared with child processes. */
static void *shared(size_t size)
{
    REAL(mmap64);
    void *there =
        real.mmap64(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (there == MAP_FAILED)
        abort();
    return there;
}

static void map_counts(const char *path)
{
    REAL(open64);
    REAL(mmap64);
    REAL(ftruncate64);
    REAL(close);
    int fd = real.open64(path, O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    if (fd < 0 || real.ftruncate64(fd, 16) != 0)
        abort();
    void *there = real.mmap64(NULL, 16, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    if (there == MAP_FAILED)
        abort();
    counts = there;
    real.close(fd);
}

__attribute__((constructor)) static void begin(void)
{
    void *frame[2];
    (void)backtrace(frame, 2); /* the first backtrace allocates memory */
    dl_iterate_phdr(note_module, NULL);
    const char *order = getenv("EBPO_TEST_FAULT"), *path = getenv("EBPO_TEST_FAULT_COUNT");
    if (path)
        map_counts(path);
    else
        counts = shared(2 * sizeof *counts);
    places = shared(PLACES * sizeof *places);
    foreign = getenv("EBPO_TEST_FAULT_FOREIGN") != NULL;
    if (!order)
        return;
    size_t length = strcspn(order, ":");
    unsigned kind = 0;
    for (int i = 0; i < FAULT_KINDS; i++)
        if (strlen(names[i]) == length && memcmp(names[i], order, length) == 0)
            kind = 1u << i;
    char *end;
    uint64_t n = order[length] ? strtoull(order + length + 1, &end, 10) : 0;
    bool all_after = order[length] && *end == '+';
    if (!kind || !order[length] || end[all_after] != ':') {
        fprintf(stderr, "EBPO_TEST_FAULT=%s: not understood\n", order);
        abort();
    }
    faults_begin(kind, n, all_after, atoi(end + all_after + 1));
}

/* Calls at exit never fail. */
__attribute__((destructor)) static void end(void) { armed = false; }

/* --- memory --- */

void *malloc(size_t size)
{
    REAL(malloc);
    return fails(FAULT_MALLOC, CALLER) ? NULL : real.malloc(size);
}

void *calloc(size_t count, size_t size)
{
    REAL(calloc);
    return fails(FAULT_MALLOC, CALLER) ? NULL : real.calloc(count, size);
}

void *realloc(void *block, size_t size)
{
    REAL(realloc);
    return fails(FAULT_MALLOC, CALLER) ? NULL : real.realloc(block, size);
}

void *aligned_alloc(size_t alignment, size_t size)
{
    REAL(aligned_alloc);
    return fails(FAULT_MALLOC, CALLER) ? NULL : real.aligned_alloc(alignment, size);
}

int posix_memalign(void **block, size_t alignment, size_t size)
{
    REAL(posix_memalign);
    return fails(FAULT_MALLOC, CALLER) ? ENOMEM : real.posix_memalign(block, alignment, size);
}

static void *map(void *at, size_t size, int protection, int flags, int fd, off64_t offset,
                 const void *caller)
{
    REAL(mmap64);
    return fails(FAULT_MMAP, caller) ? MAP_FAILED
                                     : real.mmap64(at, size, protection, flags, fd, offset);
}

void *mmap64(void *at, size_t size, int protection, int flags, int fd, off64_t offset)
{
    return map(at, size, protection, flags, fd, offset, CALLER);
}

void *mmap(void *at, size_t size, int protection, int flags, int fd, off_t offset)
{
    return map(at, size, protection, flags, fd, offset, CALLER);
}

int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *),
                   void *argument)
{
    REAL(pthread_create);
    return fails(FAULT_THREAD, CALLER) ? EAGAIN
                                       : real.pthread_create(thread, attributes, run, argument);
}

/* --- reading and writing; output on standard error is not a file --- */

static bool shortened(unsigned kind, size_t size, const void *caller)
{
    return size > 1 && fails(kind, caller);
}

static ssize_t read_as(int fd, void *data, size_t size, const void *caller)
{
    REAL(read);
    if (fails(FAULT_READ, caller))
        return -1;
    return real.read(fd, data, shortened(FAULT_SHORT_READ, size, caller) ? size / 2 : size);
}

static ssize_t write_as(int fd, const void *data, size_t size, const void *caller)
{
    REAL(write);
    if (fd != STDERR_FILENO && fails(FAULT_WRITE, caller))
        return -1;
    bool less = fd != STDERR_FILENO && shortened(FAULT_SHORT_WRITE, size, caller);
    return real.write(fd, data, less ? size / 2 : size);
}

ssize_t read(int fd, void *data, size_t size) { return read_as(fd, data, size, CALLER); }
ssize_t write(int fd, const void *data, size_t size) { return write_as(fd, data, size, CALLER); }

static ssize_t pread_as(int fd, void *data, size_t size, off64_t at, const void *caller)
{
    REAL(pread64);
    if (fails(FAULT_READ, caller))
        return -1;
    bool less = shortened(FAULT_SHORT_READ, size, caller);
    return real.pread64(fd, data, less ? size / 2 : size, at);
}

ssize_t pread64(int fd, void *data, size_t size, off64_t at)
{
    return pread_as(fd, data, size, at, CALLER);
}

ssize_t pread(int fd, void *data, size_t size, off_t at)
{
    return pread_as(fd, data, size, at, CALLER);
}

static ssize_t pwrite_as(int fd, const void *data, size_t size, off64_t at, const void *caller)
{
    REAL(pwrite64);
    if (fails(FAULT_WRITE, caller))
        return -1;
    bool less = shortened(FAULT_SHORT_WRITE, size, caller);
    return real.pwrite64(fd, data, less ? size / 2 : size, at);
}

ssize_t pwrite64(int fd, const void *data, size_t size, off64_t at)
{
    return pwrite_as(fd, data, size, at, CALLER);
}

ssize_t pwrite(int fd, const void *data, size_t size, off_t at)
{
    return pwrite_as(fd, data, size, at, CALLER);
}

int fsync(int fd)
{
    REAL(fsync);
    if (getenv("EBPO_TEST_SLOW_DISK"))
        sleep(2);
    return fails(FAULT_SYNC, CALLER) ? -1 : real.fsync(fd);
}

int rename(const char *from, const char *to)
{
    REAL(rename);
    return fails(FAULT_RENAME, CALLER) ? -1 : real.rename(from, to);
}

int renameat2(int from_folder, const char *from, int to_folder, const char *to, unsigned flags)
{
    REAL(renameat2);
    return fails(FAULT_RENAME, CALLER) ? -1
                                       : real.renameat2(from_folder, from, to_folder, to, flags);
}

int ftruncate64(int fd, off64_t size)
{
    REAL(ftruncate64);
    return fails(FAULT_TRUNCATE, CALLER) ? -1 : real.ftruncate64(fd, size);
}

int ftruncate(int fd, off_t size)
{
    REAL(ftruncate64);
    return fails(FAULT_TRUNCATE, CALLER) ? -1 : real.ftruncate64(fd, size);
}

static int close_as(int fd, const void *caller)
{
    REAL(close);
    bool failed = fd > STDERR_FILENO && fails(FAULT_CLOSE, caller);
    int code = real.close(fd);
    if (failed)
        errno = error_number;
    return failed ? -1 : code;
}

int close(int fd) { return close_as(fd, CALLER); }

int posix_fallocate64(int fd, off64_t offset, off64_t size)
{
    REAL(posix_fallocate64);
    return fails(FAULT_ALLOCATE, CALLER) ? error_number : real.posix_fallocate64(fd, offset, size);
}

int posix_fallocate(int fd, off_t offset, off_t size)
{
    REAL(posix_fallocate64);
    return fails(FAULT_ALLOCATE, CALLER) ? error_number : real.posix_fallocate64(fd, offset, size);
}

/* --- names --- */

static int open_as(const char *path, int flags, mode_t mode, const void *caller)
{
    REAL(open64);
    if (getenv("EBPO_TEST_NAMED") && (flags & O_TMPFILE) == O_TMPFILE) {
        errno = EOPNOTSUPP;
        return -1;
    }
    return fails(FAULT_OPEN, caller) ? -1 : real.open64(path, flags, mode);
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
    return open_as(path, flags, mode, CALLER);
}

int open(const char *path, int flags, ...)
{
    va_list arguments;
    va_start(arguments, flags);
    mode_t mode = mode_of(flags, arguments);
    va_end(arguments);
    return open_as(path, flags, mode, CALLER);
}

int unlink(const char *path)
{
    REAL(unlink);
    if (getenv("EBPO_TEST_PAUSE") && strstr(path, "/.ebpo-"))
        sleep(1);
    return real.unlink(path);
}

/* --- streams: the C library reads and writes its own streams by internal calls, but not cookies
 * --- */

/* The C library's own streams continue after a short write, but not after a short write of a
 * cookie. Interrupted calls do not occur on disks. */
static ssize_t cookie_read(void *cookie, char *data, size_t size)
{
    ssize_t bytes;
    do
        bytes = read_as((int)(intptr_t)cookie, data, size, NULL);
    while (bytes < 0 && errno == EINTR);
    return bytes;
}

static ssize_t cookie_write(void *cookie, const char *data, size_t size)
{
    size_t done = 0;
    while (done < size) {
        ssize_t put = write_as((int)(intptr_t)cookie, data + done, size - done, NULL);
        if (put < 0 && errno == EINTR)
            continue;
        if (put <= 0)
            return 0; /* cookies report a failure in this way */
        done += (size_t)put;
    }
    return (ssize_t)done;
}

static int cookie_seek(void *cookie, off64_t *at, int whence)
{
    off64_t now = lseek64((int)(intptr_t)cookie, *at, whence);
    if (now < 0)
        return -1;
    *at = now;
    return 0;
}

static int cookie_close(void *cookie) { return close_as((int)(intptr_t)cookie, NULL); }

static FILE *stream_of(int fd, const char *mode)
{
    static const cookie_io_functions_t functions = { cookie_read, cookie_write, cookie_seek,
                                                     cookie_close };
    return fopencookie((void *)(intptr_t)fd, mode, functions);
}

FILE *fdopen(int fd, const char *mode)
{
    REAL(fdopen);
    bool ours = armed && who(CALLER) == OURS;
    if (ours && fails(FAULT_MALLOC, CALLER))
        return NULL;
    return ours ? stream_of(fd, mode) : real.fdopen(fd, mode);
}

static FILE *fopen_as(const char *path, const char *mode, const void *caller)
{
    REAL(fopen64);
    if (!armed || who(caller) != OURS)
        return real.fopen64(path, mode);
    REAL(close);
    int flags = *mode == 'r' ? O_RDONLY : O_WRONLY | O_CREAT | O_TRUNC;
    int fd = open_as(path, flags | O_CLOEXEC, 0666, caller);
    FILE *stream = fd < 0 ? NULL : stream_of(fd, mode);
    if (fd >= 0 && !stream)
        real.close(fd);
    return stream;
}

FILE *fopen64(const char *path, const char *mode) { return fopen_as(path, mode, CALLER); }
FILE *fopen(const char *path, const char *mode) { return fopen_as(path, mode, CALLER); }
