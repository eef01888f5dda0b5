/* Manages workspaces, the owners of large arrays. A large array is an extent (a range of whole
 * pages). A new extent is in memory if the extents in memory, including the new extent, take at
 * most a quarter of the budget, or at most half of it while all memory of the process without pages
 * of files takes at most 5/8. Otherwise the new extent is in an unnamed temporary file. Arrays
 * smaller than LEAST_EXTENT share an extent (a pool), and arrays smaller than a page come from
 * malloc. Each extent counts as a holder of its workspace, so the workspace and its extents may be
 * freed in any order. Pages of a file count towards the budget only while they are in memory
 * (resident). Loops release these pages between pieces of work (ebpo_release_pages); the written
 * data stay in the file. Any thread may allocate and free. docs/develop/building.md describes how a
 * build keeps to a budget. */
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#ifdef EBPO_HAVE_RUSAGE_THREAD
#include <sys/resource.h>
#endif
#include <unistd.h>

#include <ebpo/workspace.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/os.h"
#include "core/workspace.h"

enum {
    PAGE_BYTES = 4096,      /* smaller arrays come from malloc */
    LEAST_EXTENT = 1 << 16, /* smaller arrays are parts of a pool, because a build has thousands of
                               such arrays */
    POOL_BYTES = 1 << 20,   /* size of a pool */
    BUCKET_BITS = 10        /* the table of extents has 2^BUCKET_BITS buckets */
};

/* OWN: one array. POOL: several arrays. PART: one array in a pool. */
typedef enum extent_kind { EXTENT_OWN, EXTENT_POOL, EXTENT_PART } extent_kind;

/* A range of pages, or a part of a pool. */
typedef struct extent {
    void *at; /* address */
    size_t bytes;
    extent_kind kind;
    bool filed;          /* true: in a file; false: in memory */
    struct extent *pool; /* if PART: the pool of this part */
    size_t used;         /* if POOL: bytes of all parts, including freed parts */
    uint64_t parts;      /* if POOL: number of parts that are not freed */
    struct extent *next; /* next extent in the bucket of the table */
} extent;

struct ebpo_workspace {
    pthread_mutex_t lock;      /* protects `usage` and `holders` */
    pthread_mutex_t pool_lock; /* protects `pool` */
    ebpo_workspace_stats usage;
    uint64_t holders;   /* number of holders: the owner and the extents */
    extent *pool;       /* pool for the next part; NULL: none */
    _Atomic int failed; /* reason of the last failure: errno for a file; 0: out of memory */
    int statm;          /* descriptor of /proc/self/statm; -1: the system does not have this file */
    /* bytes of files, including libraries, that stay resident after pages are released */
    _Atomic uint64_t floor;
    size_t page;                     /* size of the system's pages */
    char folder[EBPO_FOLDER_BYTES];  /* folder of the temporary files */
    pthread_mutex_t table_lock;      /* protects `table`; writers of `floor` hold it */
    extent *table[1 << BUCKET_BITS]; /* extents by address; there are thousands at most */
};

/* Returns the bucket of the table for an address. */
static inline extent **extent_bucket(ebpo_workspace *w, const void *at)
{
    uint64_t page = (uint64_t)((uintptr_t)at / PAGE_BYTES);
    return &w->table[page * UINT64_C(0x9e3779b97f4a7c15) >> (64 - BUCKET_BITS)];
}

/* Chooses the folder of temporary files, and checks that a file can be created there. */
static ebpo_status choose_folder(ebpo_workspace *w, const char *wanted, ebpo_error *error)
{
    const char *folder = wanted ? wanted : getenv("TMPDIR");
    if (!folder || !*folder)
        folder = "/var/tmp";
    if (strlen(folder) >= sizeof w->folder)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the name of the folder for temporary files is longer than %zu bytes",
                         sizeof w->folder - 1);
    strcpy(w->folder, folder);
    int fd = ebpo_open_unnamed(folder);
    if (fd < 0)
        return ebpo_fail_file(error, EBPO_E_IO, folder,
                              "cannot hold temporary files: %s; name another folder for them",
                              strerror(errno));
    close(fd);
    return EBPO_OK;
}

ebpo_status ebpo_workspace_new(const ebpo_workspace_options *options, ebpo_workspace **out,
                               ebpo_error *error)
{
    ebpo_workspace_options wanted = EBPO_WORKSPACE_OPTIONS_INIT;
    *out = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_workspace_options, &wanted, options, error);
    if (status != EBPO_OK)
        return status;
    uint64_t memory = wanted.memory ? wanted.memory : ebpo_machine_memory() / 2;
    if (memory < EBPO_WORKSPACE_MIN && wanted.memory)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "a budget of %llu bytes of memory is too small; use at least %d MB",
                         (unsigned long long)memory, EBPO_WORKSPACE_MIN / 1000000);
    if (memory < EBPO_WORKSPACE_MIN)
        memory = EBPO_WORKSPACE_MIN;
    return ebpo_workspace_make_any(out, memory, wanted.temp_dir, error);
}

ebpo_status ebpo_workspace_make_any(ebpo_workspace **out, uint64_t memory, const char *temp_dir,
                                    ebpo_error *error)
{
    *out = NULL;
    ebpo_workspace *w = ebpo_alloc_zero(1, sizeof *w);
    if (!w)
        return ebpo_fail_memory(error, sizeof *w);
    pthread_mutex_init(&w->lock, NULL);
    pthread_mutex_init(&w->pool_lock, NULL);
    pthread_mutex_init(&w->table_lock, NULL);
    w->usage.memory = memory;
    w->holders = 1;
    w->page = (size_t)sysconf(_SC_PAGESIZE);
    w->statm = open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
    ebpo_status status = choose_folder(w, temp_dir, error);
    if (status != EBPO_OK)
        ebpo_workspace_free(w);
    else
        *out = w;
    return status;
}

/* Removes one holder of the workspace (its owner or an extent). The last holder frees the
 * workspace. */
static void leave_workspace(ebpo_workspace *w)
{
    pthread_mutex_lock(&w->lock);
    bool last = --w->holders == 0;
    pthread_mutex_unlock(&w->lock);
    if (!last)
        return;
    if (w->statm >= 0)
        close(w->statm);
    pthread_mutex_destroy(&w->lock);
    pthread_mutex_destroy(&w->pool_lock);
    pthread_mutex_destroy(&w->table_lock);
    free(w);
}

void ebpo_workspace_free(ebpo_workspace *workspace)
{
    if (workspace)
        leave_workspace(workspace);
}

ebpo_status ebpo_workspace_get_stats(const ebpo_workspace *workspace, ebpo_workspace_stats *out)
{
    ebpo_workspace *w = (ebpo_workspace *)workspace;
    pthread_mutex_lock(&w->lock);
    ebpo_workspace_stats usage = w->usage;
    pthread_mutex_unlock(&w->lock);
    return EBPO_GIVE(ebpo_workspace_stats, out, &usage);
}

const char *ebpo_workspace_folder(const ebpo_workspace *workspace) { return workspace->folder; }

uint64_t ebpo_workspace_memory(const ebpo_workspace *workspace) { return workspace->usage.memory; }

ebpo_status ebpo_workspace_fail(const ebpo_workspace *workspace, uint64_t bytes, ebpo_error *error)
{
    int fault = workspace ? workspace->failed : 0;
    if (!fault)
        return ebpo_fail_memory(error, bytes);
    return ebpo_fail_file(error, EBPO_E_IO, workspace->folder,
                          "the folder cannot hold %llu bytes of temporary files: %s; name another "
                          "folder, or allow more memory",
                          (unsigned long long)bytes, strerror(fault));
}

ebpo_status ebpo_workspace_fail_while(const ebpo_workspace *workspace, const char *what,
                                      ebpo_error *error)
{
    int fault = workspace ? workspace->failed : 0;
    if (!fault)
        return ebpo_fail(error, EBPO_E_MEMORY, "out of memory %s", what);
    return ebpo_fail_file(
        error, EBPO_E_IO, workspace->folder,
        "the folder cannot hold more temporary files (%s): %s; name another folder, or allow more "
        "memory",
        what, strerror(fault));
}

/* Adds an extent to the table. */
static void enter_extent(ebpo_workspace *w, extent *b)
{
    pthread_mutex_lock(&w->table_lock);
    extent **bucket = extent_bucket(w, b->at);
    b->next = *bucket;
    *bucket = b;
    pthread_mutex_unlock(&w->table_lock);
}

static bool is_at(const extent *b, const void *at) { return b->at == at && b->kind != EXTENT_POOL; }

/* Removes the extent that begins at `at` from the table and returns it. Returns NULL if no extent
 * begins there. Never returns a pool, but may return the pool's first part, which begins at the
 * same address. */
static extent *remove_extent(ebpo_workspace *w, const void *at)
{
    pthread_mutex_lock(&w->table_lock);
    extent **link = extent_bucket(w, at), *found = NULL;
    while (*link && !is_at(*link, at))
        link = &(*link)->next;
    if (*link) {
        found = *link;
        *link = found->next;
    }
    pthread_mutex_unlock(&w->table_lock);
    return found;
}

/* Resident memory of this process in bytes. */
typedef struct residency {
    uint64_t all;   /* all resident memory */
    uint64_t files; /* resident pages of mapped files, including libraries */
} residency;

/* Returns the resident memory of this process. */
static residency read_residency(const ebpo_workspace *w)
{
    char text[128], *at = text;
    uint64_t pages[3]; /* numbers of pages: all pages of the process; resident pages; resident pages
                          of files */
    ssize_t size = w->statm >= 0 ? pread(w->statm, text, sizeof text - 1, 0) : -1;
    text[size > 0 ? size : 0] = 0;
    for (int i = 0; i < 3; i++) {
        char *end;
        pages[i] = strtoull(at, &end, 10);
        if (end == at)
            /* not known; with so large values, the caller releases pages */
            return (residency){ UINT64_MAX, UINT64_MAX };
        at = end;
    }
    return (residency){ pages[1] * w->page, pages[2] * w->page };
}

/* Chooses memory or a file for a new extent, and counts its bytes. Returns true for a file. */
static bool choose_and_count(ebpo_workspace *w, size_t bytes)
{
    ebpo_workspace_stats *f = &w->usage;
    pthread_mutex_lock(&w->lock);
    bool filed = f->held + bytes > f->memory / 2;
    if (!filed && f->held + bytes > f->memory / 4) {
        residency now = read_residency(w);
        filed = now.all - now.files + bytes > f->memory / 8 * 5;
    }
    if (filed) {
        f->filed += bytes;
        f->filed_total += bytes;
        f->filed_peak = f->filed > f->filed_peak ? f->filed : f->filed_peak;
    } else {
        f->held += bytes;
        f->held_peak = f->held > f->held_peak ? f->held : f->held_peak;
    }
    w->holders++;
    pthread_mutex_unlock(&w->lock);
    return filed;
}

/* Reverses choose_and_count. */
static void subtract_bytes(ebpo_workspace *w, size_t bytes, bool filed)
{
    pthread_mutex_lock(&w->lock);
    *(filed ? &w->usage.filed : &w->usage.held) -= bytes;
    pthread_mutex_unlock(&w->lock);
    leave_workspace(w);
}

/* Allocates disk space for a file. Returns 0 or an errno value. */
static int allocate_blocks(int fd, size_t bytes)
{
#ifdef EBPO_HAVE_POSIX_FALLOCATE
    int fault;
    do /* on some file systems signals interrupt this */
        fault = posix_fallocate(fd, 0, (off_t)bytes);
    while (fault == EINTR);
    return fault;
#else
    static const char zeros[1 << 16];
    for (size_t remaining = bytes; remaining > 0;) {
        ssize_t done = write(fd, zeros, remaining < sizeof zeros ? remaining : sizeof zeros);
        if (done < 0 && errno != EINTR)
            return errno;
        remaining -= done > 0 ? (size_t)done : 0;
    }
    return 0;
#endif
}

/* Maps a new file. First allocates disk space, because writing to a mapping on a full disk would
 * raise a signal. */
static void *map_file(ebpo_workspace *w, size_t bytes)
{
    int fd = ebpo_open_unnamed(w->folder), fault = fd < 0 ? errno : allocate_blocks(fd, bytes);
    void *at = MAP_FAILED;
    if (fault == 0) {
        at = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
        fault = at == MAP_FAILED ? errno : 0;
    }
    if (fd >= 0)
        close(fd);
    if (at == MAP_FAILED)
        w->failed = fault;
    return at;
}

static void *map_memory(ebpo_workspace *w, size_t bytes)
{
    void *at = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (at == MAP_FAILED)
        w->failed = 0;
    return at;
}

/* Makes an extent. Returns NULL on failure, with the reason in w->failed. */
static extent *make_extent(ebpo_workspace *w, size_t bytes, extent_kind kind)
{
    /* Pages are released here, because some callers make many extents without releasing pages. */
    ebpo_release_pages(w);
    extent *b = ebpo_alloc_zero(1, sizeof *b);
    if (!b) {
        w->failed = 0;
        return NULL;
    }
    bytes = (bytes + w->page - 1) / w->page * w->page;
    *b = (extent){ .bytes = bytes, .kind = kind, .filed = choose_and_count(w, bytes) };
    b->at = b->filed ? map_file(w, bytes) : map_memory(w, bytes);
    if (b->at == MAP_FAILED) {
        subtract_bytes(w, bytes, b->filed);
        free(b);
        return NULL;
    }
    enter_extent(w, b);
    return b;
}

static void unmap_extent(ebpo_workspace *w, extent *b)
{
    munmap(b->at, b->bytes);
    subtract_bytes(w, b->bytes, b->filed);
    free(b);
}

/* --- parts of pools --- */

/* Makes a part in the current pool, or in a new pool if the part does not fit. A pool never reuses
 * the bytes of a freed part, so the bytes of a new part are 0. Returns NULL on failure, with the
 * reason in w->failed. */
static extent *make_part(ebpo_workspace *w, size_t bytes)
{
    extent *part = ebpo_alloc_zero(1, sizeof *part);
    bytes = (bytes + PAGE_BYTES - 1) / PAGE_BYTES * PAGE_BYTES;
    pthread_mutex_lock(&w->pool_lock);
    if (part && (!w->pool || w->pool->bytes - w->pool->used < bytes))
        w->pool = make_extent(w, POOL_BYTES, EXTENT_POOL);
    extent *pool = part ? w->pool : NULL;
    if (pool) {
        *part = (extent){ .at = (char *)pool->at + pool->used,
                          .bytes = bytes,
                          .kind = EXTENT_PART,
                          .filed = pool->filed,
                          .pool = pool };
        pool->used += bytes;
        pool->parts++;
    }
    pthread_mutex_unlock(&w->pool_lock);
    if (!pool) {
        w->failed = part ? w->failed : 0;
        free(part);
        return NULL;
    }
    enter_extent(w, part);
    return part;
}

/* Counts a freed part of a pool; frees the pool after its last part. */
static void leave_pool(ebpo_workspace *w, extent *pool)
{
    pthread_mutex_lock(&w->pool_lock);
    bool last = --pool->parts == 0;
    if (last && w->pool == pool)
        w->pool = NULL;
    pthread_mutex_unlock(&w->pool_lock);
    if (!last)
        return;
    pthread_mutex_lock(&w->table_lock);
    extent **link = extent_bucket(w, pool->at);
    while (*link != pool)
        link = &(*link)->next;
    *link = pool->next;
    pthread_mutex_unlock(&w->table_lock);
    unmap_extent(w, pool);
}

/* Gives the memory of a part back to the system. The space of a part in a file remains until the
 * pool is freed, because the system waits for the disk when it makes a hole in a file. */
static void discard_pages(const extent *b)
{
#ifdef EBPO_HAVE_MADVISE
    if (!b->filed)
        madvise(b->at, b->bytes, MADV_DONTNEED);
#else
    (void)b;
#endif
}

static void free_extent(ebpo_workspace *w, extent *b)
{
    if (b->kind != EXTENT_PART) {
        unmap_extent(w, b);
        return;
    }
    /* If the system's pages are larger than PAGE_BYTES, a part may share a page with another part.
     * This page must not be discarded. */
    if (w->page == PAGE_BYTES)
        discard_pages(b);
    extent *pool = b->pool;
    free(b);
    leave_pool(w, pool);
}

/* Allocates an array. Arrays smaller than a page and arrays without a workspace come from malloc
 * and are not in the table. */
static void *alloc_array(ebpo_workspace *w, uint64_t count, size_t size, bool zero)
{
    uint64_t bytes;
    if (w && ebpo_mul_ok(count, size, &bytes) && bytes >= LEAST_EXTENT && bytes < PTRDIFF_MAX) {
        extent *b = make_extent(w, (size_t)bytes, EXTENT_OWN);
        return b ? b->at : NULL;
    }
    if (w && ebpo_mul_ok(count, size, &bytes) && bytes >= PAGE_BYTES && bytes < LEAST_EXTENT) {
        extent *part = make_part(w, (size_t)bytes);
        return part ? part->at : NULL;
    }
    void *at = zero ? ebpo_alloc_zero(count, size) : ebpo_alloc(count, size);
    if (!at && w)
        w->failed = 0;
    return at;
}

void *ebpo_array_alloc(ebpo_workspace *workspace, uint64_t count, size_t size)
{
    return alloc_array(workspace, count, size, false);
}

void *ebpo_array_zero(ebpo_workspace *workspace, uint64_t count, size_t size)
{
    return alloc_array(workspace, count, size, true);
}

void ebpo_array_free(ebpo_workspace *workspace, void *array)
{
    /* Extents begin at a page. An array of malloc may do so by chance, so the table decides. */
    extent *b = workspace && array && (uintptr_t)array % PAGE_BYTES == 0
                    ? remove_extent(workspace, array)
                    : NULL;
    if (b)
        free_extent(workspace, b);
    else
        free(array);
}

enum { STEP = 4 << 20 }; /* bytes between two releases of pages */

void ebpo_array_fill(ebpo_workspace *workspace, void *array, int byte, uint64_t bytes)
{
    EBPO_FOR_PIECES(workspace, at, bytes, STEP)
        memset((char *)array + at, byte, bytes - at < STEP ? (size_t)(bytes - at) : STEP);
}

void ebpo_array_copy(ebpo_workspace *workspace, void *to, const void *from, uint64_t bytes)
{
    EBPO_FOR_PIECES(bytes > STEP ? workspace : NULL, at, bytes, STEP)
        memcpy((char *)to + at, (const char *)from + at,
               bytes - at < STEP ? (size_t)(bytes - at) : STEP);
}

bool ebpo_array_grow(ebpo_workspace *workspace, void *array, uint64_t *capacity, uint64_t need,
                     size_t size)
{
    if (need <= *capacity)
        return true;
    uint64_t wanted = *capacity + *capacity / 2 + 16;
    if (wanted < need)
        wanted = need;
    void *old, *bigger = ebpo_array_alloc(workspace, wanted, size);
    if (!bigger)
        return false;
    memcpy(&old, array, sizeof old);
    if (old)
        ebpo_array_copy(workspace, bigger, old, *capacity * size);
    ebpo_array_free(workspace, old);
    memcpy(array, &bigger, sizeof bigger);
    *capacity = wanted;
    return true;
}

bool ebpo_array_grow_late(ebpo_workspace *workspace, void *array, uint64_t *capacity, uint64_t need,
                          size_t size)
{
    enum { LATE = 1 << 20 }; /* arrays of more bytes are allocated in the workspace */
    if (need <= *capacity)
        return true;
    return workspace && need > LATE / size ? ebpo_array_grow(workspace, array, capacity, need, size)
                                           : ebpo_grow(array, capacity, need, size);
}

/* Gives the memory of an extent in a file back to the system; the data stay in the file. */
static void release_extent(const extent *b)
{
#ifdef EBPO_HAVE_MADVISE
    madvise(b->at, b->bytes, MADV_DONTNEED);
#else
    msync(b->at, b->bytes, MS_ASYNC); /* the system reclaims the pages when it needs memory */
#endif
}

/* Returns true if so many pages are resident that their release is worthwhile. */
static bool should_release(const ebpo_workspace *w)
{
    residency current = read_residency(w);
    return current.all > w->usage.memory / 4 * 3 &&
           current.files >= w->floor + w->usage.memory / 16;
}

/* Returns false if this thread has had fewer than FAULTS_MIN page faults since the function last
 * returned true to it for this workspace, or within PAUSE after it last read their number. In most
 * file systems, a fault maps at most 64 KiB of a file. Reading the number of faults takes a third
 * of the time of reading statm. The clock takes a tenth of that time: a fault takes half a
 * microsecond or more, so a thread has few faults within PAUSE. */
static bool has_faulted(const ebpo_workspace *w)
{
#ifdef EBPO_HAVE_RUSAGE_THREAD
    enum { FAULTS_MIN = 8 };
    static const double PAUSE = 20e-6; /* seconds between two readings of the number of faults */
    static _Thread_local const ebpo_workspace *last;
    static _Thread_local double last_reading;
    static _Thread_local long faults;
    struct rusage usage;
    double time = ebpo_seconds();
    if (last == w && time - last_reading < PAUSE)
        return false;
    last_reading = time;
    if (getrusage(RUSAGE_THREAD, &usage) == 0) {
        long now = usage.ru_minflt + usage.ru_majflt;
        if (last == w && now - faults < FAULTS_MIN)
            return false;
        last = w;
        faults = now;
    }
#else
    (void)w;
#endif
    return true;
}

void ebpo_release_pages(ebpo_workspace *workspace)
{
    ebpo_workspace *w = workspace;
    if (!w || !has_faulted(w) || !should_release(w))
        return;
    pthread_mutex_lock(&w->table_lock);
    if (!should_release(w)) { /* another thread has released pages meanwhile */
        pthread_mutex_unlock(&w->table_lock);
        return;
    }
    for (int i = 0; i < 1 << BUCKET_BITS; i++)
        for (extent *b = w->table[i]; b; b = b->next)
            if (b->kind != EXTENT_PART && b->filed)
                release_extent(b);
    /* The floor rises slowly, because `resident` also counts pages that other threads have brought
     * into memory meanwhile, and the floor must not include these pages. */
    uint64_t resident = read_residency(w).files, floor_max = w->floor + w->usage.memory / 64;
    w->floor = resident < floor_max ? resident : floor_max;
    pthread_mutex_unlock(&w->table_lock);
}
