#include "base/arrays.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/sized.h"

/* Arrays smaller than a page are malloc's; those smaller than a block are parts of a pool, which is
 * a block: a build has thousands of them. */
enum { PAGE = 4096, LEAST_BLOCK = 1 << 16, POOL_BYTES = 1 << 20, PATH_BYTES = 4096 };

typedef enum block_kind {
    BLOCK_OWN,
    BLOCK_POOL,
    BLOCK_PART,
    BLOCK_FOREIGN /* not ours to free */
} block_kind;

typedef struct block {
    void *at;
    size_t bytes;
    block_kind kind;
    bool filed; /* in a file */
    ebpo_workspace *workspace;
    struct block *pool; /* of a part */
    size_t used;        /* of a pool: bytes given out; and the parts that are not freed */
    uint64_t parts;
    struct block *next;
} block;

struct ebpo_workspace {
    pthread_mutex_t lock; /* guards the figures */
    pthread_mutex_t pool_lock;
    ebpo_workspace_stats figures;
    uint64_t blocks;    /* and the owner is one */
    block *pool;        /* that the next part comes from; NULL: none */
    _Atomic int failed; /* errno of the last allocation in a file that failed, 0: memory */
    int statm;          /* /proc/self/statm */
    /* bytes of files, libraries among them, that stayed resident when pages were let go of */
    uint64_t floor;
    size_t page;
    char folder[PATH_BYTES];
    ebpo_workspace *next; /* in the list of all */
};

static pthread_mutex_t list_lock = PTHREAD_MUTEX_INITIALIZER;
static ebpo_workspace *list;
static int listed; /* read without the lock */

/* All blocks of the process, by address: who frees an array need not know where it comes from.
 * Pieces of a build have their arrays freed one by one, so there are thousands at most. */
enum { BUCKETS = 1 << 10 };
static pthread_mutex_t table_lock = PTHREAD_MUTEX_INITIALIZER;
static block *table[BUCKETS];

static block **bucket_of(const void *at)
{
    return &table[(uint64_t)((uintptr_t)at / PAGE) * UINT64_C(0x9e3779b97f4a7c15) >> 54];
}

static void enter(block *b)
{
    pthread_mutex_lock(&table_lock);
    block **bucket = bucket_of(b->at);
    b->next = *bucket;
    *bucket = b;
    pthread_mutex_unlock(&table_lock);
}

static bool is_at(const block *b, const void *at, bool foreign)
{
    return b->at == at && b->kind != BLOCK_POOL && (b->kind == BLOCK_FOREIGN) == foreign;
}

/* Not pools: their first parts begin where they do. */
static block *take(const void *at, bool foreign)
{
    pthread_mutex_lock(&table_lock);
    block **link = bucket_of(at), *found = NULL;
    while (*link && !is_at(*link, at, foreign))
        link = &(*link)->next;
    if (*link) {
        found = *link;
        *link = found->next;
    }
    pthread_mutex_unlock(&table_lock);
    return found;
}

/* --- making --- */

/* The number that a file holds; 0 when it holds none ("max"), or is not there. */
static uint64_t number_in(const char *path)
{
    unsigned long long value = 0;
    FILE *f = fopen(path, "re");
    if (!f)
        return 0;
    if (fscanf(f, "%llu", &value) != 1)
        value = 0;
    fclose(f);
    return value;
}

/* The least limit of the group `path` (it is cut short) and of those above it. */
static uint64_t least_limit(const char *mounted, char *path, const char *file, uint64_t least)
{
    for (;;) {
        char name[PATH_BYTES + 128];
        snprintf(name, sizeof name, "%s%s/%s", mounted, path, file);
        uint64_t limit = number_in(name);
        least = limit && limit < least ? limit : least;
        char *slash = strrchr(path, '/');
        if (!slash)
            return least;
        *slash = 0;
    }
}

/* Of the control groups of this process (cgroups(7): lines "0::/path", or of version 1
 * "4:memory:/path"); within a container the path may not be there, but the topmost group is its
 * own. */
static uint64_t group_memory(const char *groups, uint64_t least)
{
    char line[PATH_BYTES];
    FILE *f = fopen(groups, "re");
    while (f && fgets(line, sizeof line, f)) {
        line[strcspn(line, "\n")] = 0;
        char *controller = strchr(line, ':'),
             *path = controller ? strchr(controller + 1, ':') : NULL;
        if (!path)
            continue;
        *path++ = 0;
        if (!controller[1])
            least = least_limit("/sys/fs/cgroup", path, "memory.max", least);
        else if (strstr(controller, "memory"))
            least = least_limit("/sys/fs/cgroup/memory", path, "memory.limit_in_bytes", least);
    }
    if (f)
        fclose(f);
    return least;
}

static uint64_t machine_memory(void)
{
    long pages = sysconf(_SC_PHYS_PAGES), page = sysconf(_SC_PAGESIZE);
    return group_memory("/proc/self/cgroup", pages > 0 && page > 0
                                                 ? (uint64_t)pages * (uint64_t)page
                                                 : UINT64_C(1) << 32);
}

/* The name that a file has for a moment, where files cannot be made without one: a signal may come
 * in that moment. One at a time. */
static pthread_mutex_t passing_lock = PTHREAD_MUTEX_INITIALIZER;
static atomic_bool is_passing;
static char passing[PATH_BYTES + 64];

void ebpo_workspace_abandon(void)
{
    int saved = errno;
    if (atomic_load(&is_passing))
        unlink(passing);
    errno = saved;
}

static int open_and_unlink(const char *folder)
{
    static unsigned counter;
    int fd = -1;
    pthread_mutex_lock(&passing_lock);
    for (int attempt = 0; attempt < 100 && fd < 0; attempt++) {
        snprintf(passing, sizeof passing, "%s/.ebpo-%ld-%u.tmp", folder, (long)getpid(), counter++);
        /* before it exists, so that there is no moment in which it would be left behind */
        atomic_store(&is_passing, true);
        fd = open(passing, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600);
        if (fd >= 0)
            unlink(passing);
        atomic_store(&is_passing, false);
        if (fd < 0 && errno != EEXIST)
            break;
    }
    int fault = errno;
    pthread_mutex_unlock(&passing_lock);
    errno = fault;
    return fd;
}

/* A file that no name leads to. */
static int open_unnamed(const char *folder)
{
    int fd = open(folder, O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    return fd >= 0 || (errno != EOPNOTSUPP && errno != EISDIR && errno != EINVAL)
               ? fd
               : open_and_unlink(folder);
}

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
    int fd = open_unnamed(folder);
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
    uint64_t memory = wanted.memory ? wanted.memory : machine_memory() / 2;
    if (memory < EBPO_WORKSPACE_MIN && wanted.memory)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "%llu bytes of memory are too few; %d MiB are the least",
                         (unsigned long long)memory, EBPO_WORKSPACE_MIN >> 20);
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
    w->figures.memory = memory;
    w->blocks = 1;
    w->page = (size_t)sysconf(_SC_PAGESIZE);
    w->statm = open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
    pthread_mutex_lock(&list_lock);
    w->next = list;
    list = w;
    __atomic_fetch_add(&listed, 1, __ATOMIC_RELAXED);
    pthread_mutex_unlock(&list_lock);
    ebpo_status status = choose_folder(w, temp_dir, error);
    if (status != EBPO_OK)
        ebpo_workspace_free(w);
    else
        *out = w;
    return status;
}

static void unlist(ebpo_workspace *w)
{
    pthread_mutex_lock(&list_lock);
    ebpo_workspace **link = &list;
    while (*link != w)
        link = &(*link)->next;
    *link = w->next;
    __atomic_fetch_sub(&listed, 1, __ATOMIC_RELAXED);
    pthread_mutex_unlock(&list_lock);
}

static void leave(ebpo_workspace *w)
{
    pthread_mutex_lock(&w->lock);
    bool last = --w->blocks == 0;
    pthread_mutex_unlock(&w->lock);
    if (!last)
        return;
    unlist(w);
    if (w->statm >= 0)
        close(w->statm);
    pthread_mutex_destroy(&w->lock);
    pthread_mutex_destroy(&w->pool_lock);
    free(w);
}

void ebpo_workspace_free(ebpo_workspace *workspace)
{
    if (workspace)
        leave(workspace);
}

ebpo_status ebpo_workspace_get_stats(const ebpo_workspace *workspace, ebpo_workspace_stats *out)
{
    ebpo_workspace *w = (ebpo_workspace *)workspace;
    pthread_mutex_lock(&w->lock);
    ebpo_workspace_stats figures = w->figures;
    pthread_mutex_unlock(&w->lock);
    return EBPO_GIVE(ebpo_workspace_stats, out, &figures);
}

/* --- blocks --- */

/* Says where it goes, and counts it. */
static bool admit(ebpo_workspace *w, size_t bytes)
{
    ebpo_workspace_stats *f = &w->figures;
    pthread_mutex_lock(&w->lock);
    bool filed = f->held + bytes > f->memory / 2;
    if (filed) {
        f->filed += bytes;
        f->filed_total += bytes;
        f->filed_most = f->filed > f->filed_most ? f->filed : f->filed_most;
    } else {
        f->held += bytes;
        f->held_most = f->held > f->held_most ? f->held : f->held_most;
    }
    w->blocks++;
    pthread_mutex_unlock(&w->lock);
    return filed;
}

static void dismiss(ebpo_workspace *w, size_t bytes, bool filed)
{
    pthread_mutex_lock(&w->lock);
    *(filed ? &w->figures.filed : &w->figures.held) -= bytes;
    pthread_mutex_unlock(&w->lock);
    leave(w);
}

/* The file's blocks are had before it is written to: a full disk would otherwise show as a signal.
 */
static void *map_file(ebpo_workspace *w, size_t bytes)
{
    int fd = open_unnamed(w->folder), fault = fd < 0 ? errno : EINTR;
    while (fault == EINTR) /* some file systems give way to signals */
        fault = posix_fallocate(fd, 0, (off_t)bytes);
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

static block *make_block(ebpo_workspace *w, size_t bytes, block_kind kind)
{
    ebpo_workspace_settle(w); /* those who make many write to them without more ado */
    block *b = ebpo_alloc_zero(1, sizeof *b);
    if (!b) {
        w->failed = 0;
        return NULL;
    }
    bytes = (bytes + w->page - 1) / w->page * w->page;
    *b = (block){ .bytes = bytes, .kind = kind, .filed = admit(w, bytes), .workspace = w };
    b->at = b->filed ? map_file(w, bytes) : map_memory(w, bytes);
    if (b->at == MAP_FAILED) {
        dismiss(w, bytes, b->filed);
        free(b);
        return NULL;
    }
    enter(b);
    return b;
}

static void free_block(block *b)
{
    munmap(b->at, b->bytes);
    dismiss(b->workspace, b->bytes, b->filed);
    free(b);
}

static void leave_pool(block *pool)
{
    ebpo_workspace *w = pool->workspace;
    pthread_mutex_lock(&w->pool_lock);
    bool last = --pool->parts == 0;
    if (last && w->pool == pool)
        w->pool = NULL;
    pthread_mutex_unlock(&w->pool_lock);
    if (!last)
        return;
    pthread_mutex_lock(&table_lock);
    block **link = bucket_of(pool->at);
    while (*link != pool)
        link = &(*link)->next;
    *link = pool->next;
    pthread_mutex_unlock(&table_lock);
    free_block(pool);
}

/* No place is given out twice, so parts are zero. */
static void *make_part(ebpo_workspace *w, size_t bytes)
{
    block *part = ebpo_alloc_zero(1, sizeof *part);
    bytes = (bytes + PAGE - 1) / PAGE * PAGE;
    pthread_mutex_lock(&w->pool_lock);
    if (part && (!w->pool || w->pool->bytes - w->pool->used < bytes))
        w->pool = make_block(w, POOL_BYTES, BLOCK_POOL);
    block *pool = part ? w->pool : NULL;
    if (pool) {
        *part = (block){ .at = (char *)pool->at + pool->used,
                         .bytes = bytes,
                         .kind = BLOCK_PART,
                         .filed = pool->filed,
                         .workspace = w,
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
    enter(part);
    return part->at;
}

static void free_part(block *part)
{
    block *pool = part->pool;
    if (part->workspace->page ==
        PAGE) /* whole pages, so none of a neighbour's; whether it can be done or not */
        madvise(part->at, part->bytes, part->filed ? MADV_REMOVE : MADV_DONTNEED);
    free(part);
    leave_pool(pool);
}

/* Small ones and those without a workspace are not in the table: malloc never gives whole pages. */
static void *alloc(ebpo_workspace *w, uint64_t count, size_t size, bool zero)
{
    uint64_t bytes;
    if (w && ebpo_mul_ok(count, size, &bytes) && bytes >= LEAST_BLOCK && bytes < PTRDIFF_MAX) {
        block *b = make_block(w, (size_t)bytes, BLOCK_OWN);
        return b ? b->at : NULL;
    }
    if (w && ebpo_mul_ok(count, size, &bytes) && bytes >= PAGE && bytes < LEAST_BLOCK)
        return make_part(w, (size_t)bytes);
    void *at = zero ? ebpo_alloc_zero(count, size) : ebpo_alloc(count, size);
    if (!at && w)
        w->failed = 0;
    return at;
}

void *ebpo_array_alloc(ebpo_workspace *workspace, uint64_t count, size_t size)
{
    return alloc(workspace, count, size, false);
}

void *ebpo_array_zero(ebpo_workspace *workspace, uint64_t count, size_t size)
{
    return alloc(workspace, count, size, true);
}

void ebpo_array_free(void *at)
{
    block *b = (uintptr_t)at % PAGE == 0 && at ? take(at, false) : NULL;
    if (!b)
        free(at);
    else if (b->kind == BLOCK_PART)
        free_part(b);
    else
        free_block(b);
}

enum { STEP = 4 << 20 };

void ebpo_array_fill(ebpo_workspace *workspace, void *array, int byte, uint64_t bytes)
{
    for (uint64_t at = 0; at < bytes; at += STEP) {
        memset((char *)array + at, byte, bytes - at < STEP ? (size_t)(bytes - at) : STEP);
        ebpo_workspace_settle(workspace);
    }
}

void ebpo_array_copy(ebpo_workspace *workspace, void *to, const void *from, uint64_t bytes)
{
    for (uint64_t at = 0; at < bytes; at += STEP) {
        memcpy((char *)to + at, (const char *)from + at,
               bytes - at < STEP ? (size_t)(bytes - at) : STEP);
        if (bytes > STEP)
            ebpo_workspace_settle(workspace);
    }
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
    ebpo_array_free(old);
    memcpy(array, &bigger, sizeof bigger);
    *capacity = wanted;
    return true;
}

bool ebpo_array_grow_late(ebpo_workspace *workspace, void *array, uint64_t *capacity, uint64_t need,
                          size_t size)
{
    enum { LATE = 1 << 20 };
    if (need <= *capacity)
        return true;
    return workspace && need > LATE / size ? ebpo_array_grow(workspace, array, capacity, need, size)
                                           : ebpo_grow(array, capacity, need, size);
}

ebpo_status ebpo_workspace_fail(const ebpo_workspace *workspace, uint64_t bytes, ebpo_error *error)
{
    int fault = workspace ? workspace->failed : 0;
    if (!fault)
        return ebpo_fail_memory(error, bytes);
    return ebpo_fail_file(error, EBPO_E_IO, workspace->folder,
                          "cannot hold %llu bytes of temporary files: %s; name another folder, or "
                          "allow more memory",
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
        "cannot hold the temporary files %s: %s; name another folder, or allow more memory", what,
        strerror(fault));
}

/* --- residency --- */

typedef struct residency {
    uint64_t all, files; /* bytes */
} residency;

static residency resident(const ebpo_workspace *w)
{
    char text[128];
    unsigned long long size, pages, of_files;
    ssize_t got = w->statm >= 0 ? pread(w->statm, text, sizeof text - 1, 0) : -1;
    text[got > 0 ? got : 0] = 0;
    if (sscanf(text, "%llu %llu %llu", &size, &pages, &of_files) != 3)
        return (residency){ UINT64_MAX, UINT64_MAX }; /* not known: let go always */
    return (residency){ pages * w->page, of_files * w->page };
}

void ebpo_workspace_settle(ebpo_workspace *workspace)
{
    ebpo_workspace *w = workspace;
    if (!w || resident(w).all <= w->figures.memory / 4 * 3)
        return;
    pthread_mutex_lock(&table_lock);
    residency now = resident(w); /* another thread may have done it meanwhile */
    if (now.all <= w->figures.memory / 4 * 3 ||
        now.files < w->floor + w->figures.memory / 16) { /* there is hardly anything to let go of */
        pthread_mutex_unlock(&table_lock);
        return;
    }
    for (int i = 0; i < BUCKETS; i++)
        for (block *b = table[i]; b; b = b->next)
            if (b->workspace == w && b->kind != BLOCK_PART &&
                (b->filed || b->kind == BLOCK_FOREIGN))
                /* of a file: what was written stays in it */
                madvise(b->at, b->bytes, MADV_DONTNEED);
    /* Other threads bring pages in meanwhile, which are no floor: it rises slowly. */
    uint64_t left = resident(w).files, most = w->floor + w->figures.memory / 64;
    w->floor = left < most ? left : most;
    pthread_mutex_unlock(&table_lock);
}

void ebpo_settle_all(void)
{
    if (!__atomic_load_n(&listed, __ATOMIC_RELAXED))
        return;
    pthread_mutex_lock(&list_lock);
    for (ebpo_workspace *w = list; w; w = w->next)
        ebpo_workspace_settle(w);
    pthread_mutex_unlock(&list_lock);
}

void ebpo_workspace_watch(ebpo_workspace *workspace, void *mapped, size_t bytes)
{
    block *b = workspace && mapped ? ebpo_alloc_zero(1, sizeof *b) : NULL;
    if (!b)
        return;
    *b = (block){ .at = mapped, .bytes = bytes, .kind = BLOCK_FOREIGN, .workspace = workspace };
    enter(b);
}

void ebpo_workspace_unwatch(ebpo_workspace *workspace, void *mapped)
{
    if (workspace && mapped)
        free(take(mapped, true));
}
