/* Implements the functions of POSIX for memory (os_windows.h) with functions of Windows: pages,
 * mapped files, aligned blocks, and the machine's memory and cores. */
#define WIN32_LEAN_AND_MEAN
#include <windows.h>

#include <psapi.h>

#include "core/os.h"
#include "core/os_windows_parts.h"

#undef free /* in this file, `free` is the function of the C library */

/* --- pages --- */

/* A mapped file. Its handle stays open, because a temporary file is removed when its last handle is
 * closed. */
typedef struct mapped_file {
    void *at;
    HANDLE file;
    struct mapped_file *next;
} mapped_file;

static pthread_mutex_t mapped_lock = PTHREAD_MUTEX_INITIALIZER;
static mapped_file *mapped_files;

static void *map_file(mapped_file *m, int fd, size_t bytes, off_t offset)
{
    HANDLE own = GetCurrentProcess(),
           section = CreateFileMappingW((HANDLE)_get_osfhandle(fd), NULL, PAGE_READWRITE,
                                        (DWORD)((uint64_t)bytes >> 32), (DWORD)bytes, NULL);
    if (!section)
        return NULL;
    void *at = MapViewOfFile(section, FILE_MAP_READ | FILE_MAP_WRITE,
                             (DWORD)((uint64_t)offset >> 32), (DWORD)offset, bytes);
    if (at && !DuplicateHandle(own, (HANDLE)_get_osfhandle(fd), own, &m->file, 0, FALSE,
                               DUPLICATE_SAME_ACCESS)) {
        UnmapViewOfFile(at);
        at = NULL;
    }
    CloseHandle(section);
    return at;
}

void *mmap(void *at, size_t bytes, int protection, int flags, int fd, off_t offset)
{
    (void)at, (void)protection;
    if (flags & MAP_ANONYMOUS) {
        void *memory = VirtualAlloc(NULL, bytes, MEM_RESERVE | MEM_COMMIT, PAGE_READWRITE);
        return memory ? memory : ((void)ebpo_windows_fail(), MAP_FAILED);
    }
    mapped_file *m = calloc(1, sizeof *m);
    m = m && (m->at = map_file(m, fd, bytes, offset)) ? m : (free(m), NULL);
    if (!m) {
        (void)ebpo_windows_fail();
        return MAP_FAILED;
    }
    pthread_mutex_lock(&mapped_lock);
    m->next = mapped_files;
    mapped_files = m;
    pthread_mutex_unlock(&mapped_lock);
    return m->at;
}

int munmap(void *at, size_t bytes)
{
    (void)bytes;
    pthread_mutex_lock(&mapped_lock);
    mapped_file **link = &mapped_files, *m;
    while (*link && (*link)->at != at)
        link = &(*link)->next;
    if ((m = *link))
        *link = m->next;
    pthread_mutex_unlock(&mapped_lock);
    if (!m)
        return VirtualFree(at, 0, MEM_RELEASE) ? 0 : ebpo_windows_fail();
    UnmapViewOfFile(at);
    CloseHandle(m->file);
    free(m);
    return 0;
}

/* Gives the pages of a mapped file back to the system. VirtualUnlock of pages that were never
 * locked removes the pages from the working set of the process. Windows writes these pages to the
 * file when it needs their memory. */
int msync(void *at, size_t bytes, int flags)
{
    (void)flags;
    VirtualUnlock(at, bytes);
    return 0;
}

static int not_provided(void)
{
    errno = ENOSYS;
    return -1;
}

int mincore(void *at, size_t bytes, unsigned char *flags)
{
    (void)at, (void)bytes, (void)flags;
    return not_provided();
}

int mlockall(int flags)
{
    (void)flags;
    return not_provided();
}

int munlockall(void) { return not_provided(); }

/* --- aligned blocks --- */

/* A block of aligned_alloc: `at` is the address that the caller uses, and `from` is the address to
 * free. A hash table with linear probing, with the key `at`, has all blocks. There are at most some
 * thousand blocks. */
typedef struct aligned_block {
    void *at, *from;
} aligned_block;

static pthread_mutex_t aligned_lock = PTHREAD_MUTEX_INITIALIZER;
static aligned_block *aligned;
static size_t aligned_count, aligned_capacity; /* capacity: a power of two */

/* Returns the entry at which the search for a block begins. */
static size_t home_of(const void *at)
{
    return (size_t)((uint64_t)(uintptr_t)at * UINT64_C(0x9e3779b97f4a7c15) >> 20) &
           (aligned_capacity - 1);
}

static void put_block(aligned_block b)
{
    size_t i = home_of(b.at);
    while (aligned[i].at)
        i = (i + 1) & (aligned_capacity - 1);
    aligned[i] = b;
}

static bool reserve_entry(void)
{
    if (2 * (aligned_count + 1) <= aligned_capacity)
        return true;
    size_t former = aligned_capacity;
    aligned_block *old = aligned, *wider = calloc(former ? 2 * former : 256, sizeof *wider);
    if (!wider)
        return false;
    aligned = wider;
    aligned_capacity = former ? 2 * former : 256;
    for (size_t i = 0; i < former; i++)
        if (old[i].at)
            put_block(old[i]);
    free(old);
    return true;
}

/* Removes a block from the table. Returns the address to free, or NULL if `at` is no block of
 * aligned_alloc. */
static void *take_block(const void *at)
{
    size_t i = aligned_capacity ? home_of(at) : 0, mask = aligned_capacity - 1;
    while (aligned_capacity && aligned[i].at && aligned[i].at != at)
        i = (i + 1) & mask;
    if (!aligned_capacity || !aligned[i].at)
        return NULL;
    void *from = aligned[i].from;
    aligned[i].at = NULL;
    aligned_count--;
    /* entries after the gap are put again, so that a search still finds them */
    for (size_t j = (i + 1) & mask; aligned[j].at; j = (j + 1) & mask) {
        aligned_block moved = aligned[j];
        aligned[j].at = NULL;
        put_block(moved);
    }
    return from;
}

void *aligned_alloc(size_t alignment, size_t bytes)
{
    void *from = bytes < SIZE_MAX - alignment ? malloc(bytes + alignment) : NULL;
    if (!from)
        return NULL;
    void *at = (void *)(((uintptr_t)from + alignment - 1) & ~(uintptr_t)(alignment - 1));
    pthread_mutex_lock(&aligned_lock);
    bool recorded = reserve_entry();
    if (recorded)
        put_block((aligned_block){ at, from });
    aligned_count += recorded;
    pthread_mutex_unlock(&aligned_lock);
    if (!recorded)
        free(from);
    return recorded ? at : NULL;
}

/* Only addresses that are multiples of 64 are looked up, because all blocks of aligned_alloc have
 * such addresses. */
void ebpo_windows_free(void *block)
{
    void *from = NULL;
    if (block && (uintptr_t)block % 64 == 0) {
        pthread_mutex_lock(&aligned_lock);
        from = take_block(block);
        pthread_mutex_unlock(&aligned_lock);
    }
    free(from ? from : block);
}

/* --- the machine --- */

long sysconf(int name)
{
    SYSTEM_INFO system;
    MEMORYSTATUSEX memory = { .dwLength = sizeof memory };
    GetSystemInfo(&system);
    if (name == _SC_PAGESIZE)
        return (long)system.dwPageSize;
    if (name == _SC_NPROCESSORS_ONLN)
        return (long)system.dwNumberOfProcessors;
    uint64_t pages = GlobalMemoryStatusEx(&memory) ? memory.ullTotalPhys / system.dwPageSize : 0;
    return pages < LONG_MAX ? (long)pages : LONG_MAX;
}

int getrusage(int who, struct rusage *out)
{
    PROCESS_MEMORY_COUNTERS counters;
    (void)who;
    if (!GetProcessMemoryInfo(GetCurrentProcess(), &counters, sizeof counters))
        return ebpo_windows_fail();
    *out = (struct rusage){ .ru_minflt = counters.PageFaultCount };
    return 0;
}
