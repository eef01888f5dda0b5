/* Caches fetched parts of a file on a server, in memory and in a folder on disk. The ranges in
 * memory are in order and without overlaps. One request fetches a range, which stays in memory
 * while the memory limit allows. A prefetch hint is a list of ranges that will be read soon. Ranges
 * that were read least recently are dropped first. Ranges of a hint that are not read yet are
 * dropped last. The cache folder, if the caller has named one, contains blocks (parts of equal
 * size) as files. The file of a block contains a SHA-256, and the name of this file contains a
 * digest of URL and version. Blocks are written under temporary names, so any number of processes
 * may share the folder. When the folder's limit is reached, the blocks that were used least
 * recently are removed. Missing or damaged blocks are fetched from the server. */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "core/alloc.h"
#include "core/checksum.h"
#include "core/endian.h"
#include "core/error.h"
#include "core/os.h"
#include "io/http_cache.h"

/* The file of a block consists of a magic number, the block's index, its size, a digest, and the
 * block's bytes. The digest is the SHA-256 of all other bytes of the file. */
enum {
    MAGIC_BYTES = 8,
    DIGEST_AT = 24,  /* offset of the digest */
    HEAD_BYTES = 56, /* bytes before the block's bytes */
    NAME_BYTES = 128 /* size of a file name */
};
static const char MAGIC[MAGIC_BYTES + 1] = "EBPOBLK2", SUFFIX[] = ".ebpo-block",
                                      TEMPORARY[] = ".ebpo-part-";
/* a temporary file that is older than this was left by a process that has ended */
static const double STALE_SECONDS = 3600;

struct ebpo_disk {
    int folder;     /* descriptor of the folder */
    uint64_t limit; /* maximum number of bytes of all blocks in the folder */
    char key[65];   /* digest of URL and version; the names of the blocks' files begin with it */
    pthread_mutex_t lock;  /* protects `written` and `number` */
    uint64_t written;      /* bytes that were written since the last trim_folder */
    uint64_t number;       /* number of the next temporary file */
    uint64_t held, others; /* results of ebpo_disk_held */
};

/* Computes the digest of a block's file. */
static void digest_block(const uint8_t head[DIGEST_AT], const void *data, size_t size,
                         uint8_t out[32])
{
    ebpo_sha256 sha;
    ebpo_sha256_begin(&sha);
    ebpo_sha256_add(&sha, head, DIGEST_AT);
    ebpo_sha256_add(&sha, data, size);
    ebpo_sha256_end(&sha, out);
}

/* Makes the key. The digest includes the block size only if this size is not the default. So blocks
 * of the default size keep the names that they had before other sizes existed. */
static void make_key(ebpo_disk *d, size_t block, const char *url, const ebpo_http_version *v)
{
    uint8_t size[8], of_block[8], out[32];
    ebpo_store64(of_block, block);
    ebpo_sha256 sha;
    ebpo_store64(size, v->size);
    ebpo_sha256_begin(&sha);
    ebpo_sha256_add(&sha, url, strlen(url) + 1);
    ebpo_sha256_add(&sha, v->etag, strlen(v->etag) + 1);
    ebpo_sha256_add(&sha, v->modified, strlen(v->modified) + 1);
    ebpo_sha256_add(&sha, size, sizeof size);
    if (block != EBPO_DISK_BLOCK)
        ebpo_sha256_add(&sha, of_block, sizeof of_block);
    ebpo_sha256_end(&sha, out);
    ebpo_sha256_hex(out, d->key);
}

/* --- removing old blocks --- */

/* A block in the folder. */
typedef struct entry {
    struct timespec used; /* time of the last use */
    uint64_t bytes;
    char name[NAME_BYTES];
} entry;

static bool ends_with(const char *name, const char *end)
{
    size_t n = strlen(name), e = strlen(end);
    return n >= e && strcmp(name + n - e, end) == 0;
}

/* Compares entries for qsort: the least recently used entry comes first. */
static int compare_use_times(const void *a, const void *b)
{
    const struct timespec *x = &((const entry *)a)->used, *y = &((const entry *)b)->used;
    if (x->tv_sec != y->tv_sec)
        return x->tv_sec < y->tv_sec ? -1 : 1;
    return x->tv_nsec < y->tv_nsec ? -1 : x->tv_nsec > y->tv_nsec;
}

/* Lists the blocks in the folder. Removes old temporary files of this library. Ignores other files.
 */
static entry *list_entries(const ebpo_disk *d, uint64_t *count, uint64_t *bytes)
{
    entry *entries = NULL;
    uint64_t capacity = 0;
    int fd = openat(d->folder, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    DIR *folder = fd < 0 ? NULL : fdopendir(fd);
    *count = *bytes = 0;
    if (!folder && fd >= 0)
        close(fd);
    for (struct dirent *f; folder && (f = readdir(folder)) != NULL;) {
        struct stat st;
        bool block = ends_with(f->d_name, SUFFIX),
             part = strncmp(f->d_name, TEMPORARY, sizeof TEMPORARY - 1) == 0;
        if ((!block && !part) || strlen(f->d_name) >= NAME_BYTES ||
            fstatat(d->folder, f->d_name, &st, AT_SYMLINK_NOFOLLOW) != 0 || !S_ISREG(st.st_mode))
            continue;
        if (part) {
            if (difftime(time(NULL), st.st_mtime) > STALE_SECONDS)
                unlinkat(d->folder, f->d_name, 0);
            continue;
        }
        if (!ebpo_grow(&entries, &capacity, *count + 1, sizeof *entries))
            break;
        entry *e = &entries[(*count)++];
        e->used = st.st_mtim;
        e->bytes = (uint64_t)st.st_size;
        strcpy(e->name, f->d_name);
        *bytes += e->bytes;
    }
    if (folder)
        closedir(folder);
    return entries;
}

/* Counts the bytes of the blocks in the folder. */
static void count_held(ebpo_disk *d)
{
    uint64_t count, bytes;
    entry *entries = list_entries(d, &count, &bytes);
    for (uint64_t i = 0; i < count; i++) {
        uint64_t bytes_in_block = entries[i].bytes > HEAD_BYTES ? entries[i].bytes - HEAD_BYTES : 0;
        *(strncmp(entries[i].name, d->key, sizeof d->key - 1) == 0 ? &d->held : &d->others) +=
            bytes_in_block;
    }
    free(entries);
}

void ebpo_disk_held(const ebpo_disk *d, uint64_t *held, uint64_t *others)
{
    *held = d->held;
    *others = d->others;
}

/* If the blocks take more than 7/8 of the limit, removes the least recently used blocks until the
 * rest takes at most 3/4 of the limit. Called whenever an eighth of the limit has been written, so
 * that the blocks of a single process stay below the limit. */
static void trim_folder(ebpo_disk *d)
{
    uint64_t count, bytes;
    entry *entries = list_entries(d, &count, &bytes);
    if (bytes > d->limit / 8 * 7) {
        qsort(entries, count, sizeof *entries, compare_use_times);
        for (uint64_t i = 0; i < count && bytes > d->limit / 4 * 3; i++)
            if (unlinkat(d->folder, entries[i].name, 0) == 0)
                bytes -= entries[i].bytes;
    }
    free(entries);
}

/* --- opening --- */

static bool is_writable(int folder)
{
    char name[NAME_BYTES];
    snprintf(name, sizeof name, "%s%ld-try", TEMPORARY, (long)getpid());
    int fd = openat(folder, name, O_CREAT | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (fd < 0)
        return false;
    close(fd);
    unlinkat(folder, name, 0);
    return true;
}

/* Makes the folder and its missing parents. */
static bool make_folder(const char *folder)
{
    char path[PATH_MAX];
    size_t length = strlen(folder);
    if (length >= sizeof path) {
        errno = ENAMETOOLONG;
        return false;
    }
    memcpy(path, folder, length + 1);
    for (char *slash = strchr(path + 1, '/'); length && slash; slash = strchr(slash + 1, '/')) {
        *slash = 0;
        (void)mkdir(path, 0777); /* if this fails, the last mkdir fails too and reports the error */
        *slash = '/';
    }
    return mkdir(path, 0777) == 0 || errno == EEXIST;
}

ebpo_status ebpo_disk_open(ebpo_disk **out, const char *folder, uint64_t bytes, size_t block,
                           const char *url, const ebpo_http_version *version, ebpo_error *error)
{
    *out = NULL;
    int fd = make_folder(folder) ? open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC) : -1;
    if (fd < 0 || !is_writable(fd)) {
        /* false if too many files are open or memory is short, because then another folder does not
         * help */
        bool by_folder = errno != EMFILE && errno != ENFILE && errno != ENOMEM;
        ebpo_status status =
            ebpo_fail_file(error, by_folder ? EBPO_E_ARGUMENT : EBPO_E_IO, folder,
                           "cannot be used as a cache folder: %s%s", strerror(errno),
                           by_folder ? "; name another folder" : "");
        if (fd >= 0)
            close(fd);
        return status;
    }
    ebpo_disk *d = ebpo_alloc_zero(1, sizeof *d);
    if (!d) {
        close(fd);
        return ebpo_fail_memory(error, sizeof *d);
    }
    d->folder = fd;
    d->limit = bytes;
    pthread_mutex_init(&d->lock, NULL);
    make_key(d, block, url, version);
    trim_folder(d);
    count_held(d);
    *out = d;
    return EBPO_OK;
}

void ebpo_disk_close(ebpo_disk *d)
{
    if (!d)
        return;
    if (d->written)
        trim_folder(d);
    close(d->folder);
    pthread_mutex_destroy(&d->lock);
    free(d);
}

/* --- blocks --- */

static void block_name(const ebpo_disk *d, uint64_t block, char name[NAME_BYTES])
{
    snprintf(name, NAME_BYTES, "%s-%" PRIx64 "%s", d->key, block, SUFFIX);
}

static bool read_fully(int fd, void *data, size_t size)
{
    uint8_t *to = data;
    while (size) {
        ssize_t received = read(fd, to, size);
        if (received <= 0 && !(received < 0 && errno == EINTR))
            return false;
        if (received > 0) {
            to += received;
            size -= (size_t)received;
        }
    }
    return true;
}

static bool write_fully(int fd, const void *data, size_t size)
{
    const uint8_t *from = data;
    while (size) {
        ssize_t written = write(fd, from, size);
        if (written < 0 && errno != EINTR)
            return false;
        if (written > 0) {
            from += written;
            size -= (size_t)written;
        }
    }
    return true;
}

/* Reads a block of `size` bytes (the last block of the file is smaller). Returns false if the block
 * is missing or damaged. */
static bool get_block(ebpo_disk *d, uint64_t block, void *data, size_t size)
{
    char name[NAME_BYTES];
    uint8_t head[HEAD_BYTES], sum[32], more;
    block_name(d, block, name);
    int fd = openat(d->folder, name, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (fd < 0)
        return false;
    bool good = read_fully(fd, head, sizeof head) && memcmp(head, MAGIC, MAGIC_BYTES) == 0 &&
                ebpo_load64(head + 8) == block && ebpo_load64(head + 16) == size &&
                read_fully(fd, data, size) && read(fd, &more, 1) == 0;
    if (good) {
        digest_block(head, data, size, sum);
        good = memcmp(sum, head + DIGEST_AT, sizeof sum) == 0;
    }
    if (good)
        (void)!futimens(fd, NULL); /* marks the block as used now; fails in a read-only folder */
    close(fd);
    if (!good)
        unlinkat(d->folder, name, 0);
    return good;
}

/* Writes a block. Ignores failures. */
static void put_block(ebpo_disk *d, uint64_t block, const void *data, size_t size)
{
    char name[NAME_BYTES], temporary[NAME_BYTES];
    uint8_t head[HEAD_BYTES];
    pthread_mutex_lock(&d->lock);
    uint64_t number = d->number++;
    pthread_mutex_unlock(&d->lock);
    block_name(d, block, name);
    snprintf(temporary, sizeof temporary, "%s%.16s-%ld-%p-%" PRIu64, TEMPORARY, d->key,
             (long)getpid(), (void *)d, number);
    memcpy(head, MAGIC, MAGIC_BYTES);
    ebpo_store64(head + 8, block);
    ebpo_store64(head + 16, size);
    digest_block(head, data, size, head + DIGEST_AT);
    int fd =
        openat(d->folder, temporary, O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (fd < 0)
        return;
    bool good = write_fully(fd, head, sizeof head) && write_fully(fd, data, size);
    good = close(fd) == 0 && good;
    if (!good || renameat(d->folder, temporary, d->folder, name) != 0) {
        unlinkat(d->folder, temporary, 0);
        return;
    }
    pthread_mutex_lock(&d->lock);
    d->written += size + HEAD_BYTES;
    bool full = d->written > d->limit / 8;
    if (full)
        d->written = 0;
    pthread_mutex_unlock(&d->lock);
    if (full)
        trim_folder(d);
}

/* --- ranges in memory --- */

enum {
    /* If the gap between two hinted ranges is at most this, the gap is also fetched, because this
     * takes less time than another request. */
    GAP_BYTES = 16384,
    MANY = 256, /* if a hint has more ranges, GAP_BYTES_OF_MANY is used instead */
    GAP_BYTES_OF_MANY = 32768,
    GAP_BYTES_JOINED = 1024, /* if one request fetches several ranges */
    STALE_AFTER =
        64 /* after this number of later hints, a hinted range will probably not be read */
};

typedef enum range_state {
    RANGE_NOTED,    /* the range is recorded, but nothing is fetched or requested yet */
    RANGE_LOADING,  /* a thread reads the range from disk */
    RANGE_COMING,   /* `request` is sent or done */
    RANGE_IN_MEMORY /* `data` has all bytes */
} range_state;

struct ebpo_cached_range {
    uint64_t begin, end; /* the bytes [begin, end) of the file */
    uint64_t wanted;     /* hinted bytes that are not read yet */
    uint64_t last_hint;  /* number of the last prefetch hint that included the range */
    uint64_t used;       /* time of the last read, by ebpo_range_cache.clock */
    bool fresh; /* true while add_wanted must add the bytes of the current prefetch hint to `wanted`
                 */
    range_state state;
    unsigned users; /* number of threads that need the range to stay in the list */
    bool demanded; /* true: a reader waits for the range, and returns the error if the request fails
                    */
    bool to_store; /* true: after the fetch, the range must be written to disk */
    /* the part of the range that is requested; the blocks before and after this part came from disk
     */
    uint64_t fetch_begin, fetch_end;
    ebpo_request request;
    uint8_t *data; /* [end - begin] */
};

/* --- the list; callers of the functions below hold the lock, except where noted --- */

/* Returns the index of the first range that ends after the offset `at`. */
static uint64_t find_range(const ebpo_range_cache *p, uint64_t at)
{
    uint64_t low = 0, high = p->count;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (p->range[middle]->end > at)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

static uint64_t bytes_of(const ebpo_cached_range *range) { return range->end - range->begin; }

static void drop_data(ebpo_range_cache *p, ebpo_cached_range *range)
{
    if (range->data)
        p->held -= bytes_of(range);
    free(range->data);
    range->data = NULL;
    range->state = RANGE_NOTED;
}

static void remove_at(ebpo_range_cache *p, uint64_t i)
{
    ebpo_cached_range *range = p->range[i];
    drop_data(p, range);
    free(range);
    memmove(p->range + i, p->range + i + 1, (p->count - i - 1) * sizeof *p->range);
    p->count--;
}

/* Inserts the range [begin, end) at index i. Returns false when memory is short. */
static bool insert_range(ebpo_range_cache *p, uint64_t i, uint64_t begin, uint64_t end)
{
    ebpo_cached_range *range = ebpo_alloc_zero(1, sizeof *range);
    if (!range || !ebpo_grow(&p->range, &p->capacity, p->count + 1, sizeof *p->range)) {
        free(range);
        return false;
    }
    range->begin = begin;
    range->end = end;
    range->last_hint = p->hint_count;
    range->fresh = p->hinting;
    memmove(p->range + i + 1, p->range + i, (p->count - i) * sizeof *p->range);
    p->range[i] = range;
    p->count++;
    return true;
}

/* Inserts ranges for the bytes [begin, end) into the list, from index i on. The ranges are about
 * equally large and have at most EBPO_RANGE_BYTES bytes. The boundaries between these ranges are
 * boundaries of blocks. Returns false when memory is short. */
static bool insert_ranges(ebpo_range_cache *p, uint64_t i, uint64_t begin, uint64_t end)
{
    uint64_t number = (end - begin + EBPO_RANGE_BYTES - 1) / EBPO_RANGE_BYTES;
    uint64_t each = ((end - begin + number - 1) / number + p->block - 1) / p->block * p->block;
    for (; begin < end; i++) {
        uint64_t stop = end - begin <= each ? end : (begin + each) / p->block * p->block;
        if (!insert_range(p, i, begin, stop))
            return false;
        begin = stop;
    }
    return true;
}

/* Inserts ranges for the parts of [begin, end) that no range contains yet. If there is a cache
 * folder, the ranges consist of whole blocks. Returns false when memory is short. */
static bool cover_range(ebpo_range_cache *p, uint64_t begin, uint64_t end)
{
    if (p->disk) {
        begin = begin / p->block * p->block;
        end = (end + p->block - 1) / p->block * p->block;
    }
    begin = begin < p->begin ? p->begin : begin;
    end = end > p->size ? p->size : end;
    while (begin < end) {
        uint64_t i = find_range(p, begin);
        uint64_t next = i < p->count && p->range[i]->begin < end ? p->range[i]->begin : end;
        if (begin < next && !insert_ranges(p, i, begin, next))
            return false;
        i = find_range(p, next);
        begin = next < end && i < p->count ? p->range[i]->end : end;
    }
    return true;
}

/* --- fetching --- */

/* Returns true if a whole block begins at `at` and is in a range that ends at `end`. The last block
 * of the file ends with the file. Only whole blocks are stored on disk. */
static bool has_block(const ebpo_range_cache *p, uint64_t at, uint64_t end)
{
    return at % p->block == 0 && (end - at >= p->block || end == p->size);
}

/* Reads blocks of a range from disk: from its begin forwards, and from its end backwards, up to the
 * first missing block. Releases the lock while it reads. Sets fetch_begin and fetch_end to the part
 * in between, which must be requested. */
static void load_from_disk(ebpo_range_cache *p, ebpo_cached_range *range)
{
    uint64_t begin = range->begin, end = range->end, loaded = 0;
    range->state = RANGE_LOADING;
    pthread_mutex_unlock(&p->lock);
    while (begin < end && has_block(p, begin, end)) {
        size_t size = (size_t)(end - begin < p->block ? end - begin : p->block);
        if (!get_block(p->disk, begin / p->block, range->data + (begin - range->begin), size))
            break;
        begin += size;
        loaded += size;
    }
    while (begin < end) {
        uint64_t block = (end - 1) / p->block, at = block * p->block;
        if (at <= begin || (end % p->block && end != p->size) ||
            !get_block(p->disk, block, range->data + (at - range->begin), (size_t)(end - at)))
            break;
        loaded += end - at;
        end = at;
    }
    pthread_mutex_lock(&p->lock);
    range->fetch_begin = begin;
    range->fetch_end = end;
    p->disk_bytes += loaded;
    p->disk_hits += begin == end;
}

/* Returns true if no thread needs the range, so that its data can be dropped. */
static bool is_idle(const ebpo_cached_range *range)
{
    return range->users == 0 && range->data &&
           (range->state == RANGE_IN_MEMORY ||
            (range->state == RANGE_COMING && range->request.done));
}

/* Drops one range. If some ranges have no hinted bytes left to read, drops the least recently read
 * of these ranges. Otherwise drops the range with the oldest hint, but only if more than
 * STALE_AFTER later hints were given. Returns false if no range can be dropped. */
static bool forget_one(ebpo_range_cache *p)
{
    uint64_t read = p->count, stale = p->count;
    for (uint64_t i = 0; i < p->count; i++) {
        const ebpo_cached_range *range = p->range[i];
        if (!is_idle(range))
            continue;
        if (range->wanted == 0 && (read == p->count || range->used < p->range[read]->used))
            read = i;
        if (range->wanted && range->last_hint + STALE_AFTER < p->hint_count &&
            (stale == p->count || range->last_hint < p->range[stale]->last_hint))
            stale = i;
    }
    uint64_t which = read < p->count ? read : stale;
    if (which == p->count)
        return false;
    remove_at(p, which);
    return true;
}

/* Drops ranges until `bytes` more bytes are within the limit, or no range can be dropped. */
static void reserve_space(ebpo_range_cache *p, uint64_t bytes)
{
    while (p->held + bytes > p->held_limit && forget_one(p))
        ;
}

/* Loads a range with the state RANGE_NOTED from disk, and requests the part that is not on disk.
 * Returns false when memory is short. */
static bool start_request(ebpo_range_cache *p, ebpo_cached_range *range, bool urgent)
{
    range->users++; /* so that reserve_space does not drop this range */
    reserve_space(p, bytes_of(range));
    range->users--;
    range->data = ebpo_alloc(bytes_of(range), 1);
    if (!range->data)
        return false;
    p->held += bytes_of(range);
    range->fetch_begin = range->begin;
    range->fetch_end = range->end;
    if (p->disk) {
        range->users++;
        load_from_disk(p, range);
        range->users--;
    }
    range->to_store = p->disk && range->fetch_begin < range->fetch_end;
    if (range->fetch_begin == range->fetch_end) {
        range->state = RANGE_IN_MEMORY;
        pthread_cond_broadcast(&p->done);
        return true;
    }
    range->state = RANGE_COMING;
    range->demanded = urgent;
    range->request = (ebpo_request){ .offset = range->fetch_begin,
                                     .size = range->fetch_end - range->fetch_begin,
                                     .data = range->data + (range->fetch_begin - range->begin) };
    ebpo_transfers_add(p->transfers, &range->request, urgent);
    return true;
}

/* Ends this thread's use of a range, after it has read `read` bytes of the range. The data stay
 * until the memory is needed. If the request has failed, drops the data at once. */
static void release_range(ebpo_range_cache *p, ebpo_cached_range *range, uint64_t read)
{
    range->users--;
    range->wanted -= read < range->wanted ? read : range->wanted;
    if (read)
        range->used = ++p->clock;
    bool failed =
        range->state == RANGE_COMING && range->request.done && range->request.status != EBPO_OK;
    if (range->users)
        return;
    if (failed)
        drop_data(p, range);
    if (range->wanted == 0 && range->state == RANGE_NOTED)
        remove_at(p, find_range(p, range->begin));
}

/* Requests the hinted ranges from an offset on, until the memory limit is reached. */
static void read_ahead(ebpo_range_cache *p, uint64_t from)
{
    for (uint64_t i = find_range(p, from); i < p->count; i = find_range(p, from)) {
        ebpo_cached_range *range = p->range[i];
        from = range->end;
        if (range->state != RANGE_NOTED || range->wanted == 0)
            continue;
        range->users++; /* so that reserve_space does not drop this range */
        reserve_space(p, bytes_of(range));
        bool fits = p->held + bytes_of(range) <= p->held_limit && start_request(p, range, false);
        release_range(p, range, 0);
        if (!fits)
            return;
    }
}

/* --- prefetch hints --- */

static int by_offset(const void *a, const void *b)
{
    const ebpo_range *x = a, *y = b;
    return x->offset < y->offset ? -1 : x->offset > y->offset;
}

/* Adds the bytes of a hinted range to `wanted` of the fresh cached ranges that contain these bytes.
 * Cached ranges that are not fresh have counted the bytes for an earlier hint. */
static void add_wanted(ebpo_range_cache *p, const ebpo_range *hinted)
{
    uint64_t begin = hinted->offset, end = begin + hinted->size;
    for (uint64_t i = find_range(p, begin); i < p->count && p->range[i]->begin < end; i++) {
        ebpo_cached_range *range = p->range[i];
        uint64_t from = range->begin > begin ? range->begin : begin,
                 to = range->end < end ? range->end : end;
        range->last_hint = p->hint_count;
        if (range->fresh)
            range->wanted += to - from;
    }
}

/* Makes cached ranges for the hinted ranges, which must be sorted by offset. Hinted ranges that are
 * close together become one cached range. */
static void record_ranges(ebpo_range_cache *p, const ebpo_range *sorted, size_t count)
{
    uint64_t before = p->count, gap = ebpo_transfers_joins(p->transfers) ? GAP_BYTES_JOINED
                                      : count > MANY                     ? GAP_BYTES_OF_MANY
                                                                         : GAP_BYTES;
    p->hinting = true;
    for (size_t i = 0; i < count;) {
        uint64_t begin = sorted[i].offset, end = begin + sorted[i].size;
        for (i++; i < count && (sorted[i].offset <= end || sorted[i].offset - end <= gap); i++)
            end = sorted[i].offset + sorted[i].size > end ? sorted[i].offset + sorted[i].size : end;
        if (begin < end && !cover_range(p, begin, end))
            break;
    }
    p->hinting = false;
    p->hint_count += p->count > before;
    uint64_t first = find_range(p, sorted[0].offset),
             end = sorted[count - 1].offset + sorted[count - 1].size;
    for (uint64_t i = first; i < p->count && p->range[i]->begin < end; i++)
        /* All hinted bytes of the range were read before. The new hint shows that they are needed
         * again. */
        p->range[i]->fresh |= p->range[i]->wanted == 0;
    for (size_t i = 0; i < count; i++)
        add_wanted(p, &sorted[i]);
    for (uint64_t i = first; i < p->count && p->range[i]->begin < end; i++)
        p->range[i]->fresh = false;
}

void ebpo_range_cache_hint(ebpo_range_cache *p, const ebpo_range *ranges, size_t count)
{
    ebpo_range *sorted = ebpo_alloc(count, sizeof *sorted);
    if (!sorted || count == 0) {
        free(sorted);
        return;
    }
    memcpy(sorted, ranges, count * sizeof *sorted);
    qsort(sorted, count, sizeof *sorted, by_offset);
    pthread_mutex_lock(&p->lock);
    record_ranges(p, sorted, count);
    read_ahead(p, sorted[0].offset);
    pthread_mutex_unlock(&p->lock);
    free(sorted);
}

/* --- reading --- */

/* Stores the fetched blocks of a range on disk. Releases the lock while it writes. */
static void store_blocks(ebpo_range_cache *p, ebpo_cached_range *range)
{
    range->to_store = false;
    pthread_mutex_unlock(&p->lock);
    for (uint64_t at = range->fetch_begin; at < range->fetch_end; at += p->block) {
        uint64_t remaining = range->fetch_end - at;
        if (has_block(p, at, range->fetch_end))
            put_block(p->disk, at / p->block, range->data + (at - range->begin),
                      (size_t)(remaining < p->block ? remaining : p->block));
    }
    pthread_mutex_lock(&p->lock);
}

/* Returns true if a range has been fetched and must be written to disk. */
static bool is_to_be_stored(const ebpo_cached_range *range)
{
    return range->to_store && (range->state == RANGE_IN_MEMORY ||
                               (range->state == RANGE_COMING && range->request.done &&
                                range->request.status == EBPO_OK));
}

/* Stores one fetched range on disk, also if it was not read yet, so that its bytes are not lost
 * when the process ends. Returns false if no range must be stored. Releases the lock while it
 * writes. */
static bool store_one(ebpo_range_cache *p)
{
    for (uint64_t i = 0; p->disk && i < p->count; i++) {
        ebpo_cached_range *range = p->range[i];
        if (!is_to_be_stored(range))
            continue;
        range->users++;
        store_blocks(p, range);
        range->users--;
        return true;
    }
    return false;
}

/* Waits until a range is in memory. The caller has counted itself in range->users. If the request
 * has failed while no reader waited, requests the range again. */
static ebpo_status await_range(ebpo_range_cache *p, ebpo_cached_range *range, ebpo_error *error)
{
    while (range->state != RANGE_IN_MEMORY) {
        if (range->state == RANGE_COMING && range->request.done) {
            if (range->request.status == EBPO_OK) {
                range->state = RANGE_IN_MEMORY;
                break;
            }
            if (range->demanded || range->request.status == EBPO_E_CANCELLED) {
                if (error)
                    *error = range->request.error;
                return range->request.status;
            }
            drop_data(p, range);
        }
        if (range->state == RANGE_NOTED) {
            if (!start_request(p, range, true))
                return ebpo_fail_memory(error, bytes_of(range));
            continue;
        }
        if (range->state == RANGE_COMING && !range->request.done) {
            range->demanded = true;
            ebpo_transfers_urge(p->transfers, &range->request);
        }
        if (!store_one(p))
            pthread_cond_wait(&p->done, &p->lock);
    }
    if (range->to_store)
        store_blocks(p, range);
    return EBPO_OK;
}

/* Reads bytes from *at up to `end`, but not beyond the end of the range that contains *at. Moves
 * *at past the bytes that were read. */
static ebpo_status read_range(ebpo_range_cache *p, uint64_t *at, uint64_t end, uint8_t *data,
                              ebpo_error *error)
{
    uint64_t i = find_range(p, *at);
    if (i == p->count ||
        p->range[i]->begin > *at) { /* the range was dropped since cover_range made it */
        if (!cover_range(p, *at, end))
            return ebpo_fail_memory(error, end - *at);
        i = find_range(p, *at);
    }
    ebpo_cached_range *range = p->range[i];
    uint64_t size = (range->end < end ? range->end : end) - *at, next = range->end;
    range->users++;
    ebpo_status status = await_range(p, range, error);
    if (status == EBPO_OK) {
        read_ahead(p, next);
        pthread_mutex_unlock(&p->lock);
        memcpy(data, range->data + (*at - range->begin), (size_t)size);
        pthread_mutex_lock(&p->lock);
    }
    release_range(p, range, status == EBPO_OK ? size : 0);
    *at += size;
    return status;
}

/* Requests all cached ranges of [begin, end) together, until the memory limit is reached. */
static void begin_read(ebpo_range_cache *p, uint64_t begin, uint64_t end)
{
    for (uint64_t i = find_range(p, begin); i < p->count && p->range[i]->begin < end;
         i = find_range(p, begin)) {
        ebpo_cached_range *range = p->range[i];
        begin = range->end;
        range->users++;
        reserve_space(p, bytes_of(range));
        if (range->state == RANGE_NOTED && p->held + bytes_of(range) <= p->held_limit)
            (void)!start_request(p, range, true);
        range->users--;
    }
}

ebpo_status ebpo_range_cache_read(ebpo_range_cache *p, uint64_t offset, uint64_t size,
                                  uint8_t *data, ebpo_error *error)
{
    uint64_t at = offset, end = offset + size;
    ebpo_status status = EBPO_OK;
    pthread_mutex_lock(&p->lock);
    double since = ebpo_seconds();
    if (!cover_range(p, offset, end))
        status = ebpo_fail_memory(error, size);
    if (status == EBPO_OK)
        begin_read(p, offset, end);
    while (at < end && status == EBPO_OK) {
        uint64_t before = at;
        status = read_range(p, &at, end, data + (before - offset), error);
    }
    for (uint64_t i = find_range(p, at);
         status != EBPO_OK && i < p->count && p->range[i]->begin < end; i++)
        /* after an error, this reader does not wait for these requests or return their errors */
        p->range[i]->demanded = p->range[i]->users > 0;
    p->wait_seconds += ebpo_seconds() - since;
    pthread_mutex_unlock(&p->lock);
    return status;
}

void ebpo_range_cache_clear(ebpo_range_cache *p)
{
    if (p->disk) {
        pthread_mutex_lock(&p->lock);
        while (store_one(p))
            continue;
        pthread_mutex_unlock(&p->lock);
    }
    for (uint64_t i = 0; i < p->count; i++) {
        free(p->range[i]->data);
        free(p->range[i]);
    }
    free(p->range);
    p->range = NULL;
    p->count = p->capacity = p->held = 0;
}
