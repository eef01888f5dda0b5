/* Fetched parts of a file on a server. In memory there are pieces, in order and without overlaps.
 * Each is fetched by one request and kept while memory allows. Pieces with prefetch hints that are
 * not read yet are kept longest, then those read last. The cache folder, if there is one, holds
 * blocks as files, named by a digest of address and version, each with a SHA-256. Blocks are
 * written under temporary names, so any number of processes may share the folder. When its limit is
 * reached, the oldest blocks are removed. Nothing depends on the folder: missing or damaged blocks
 * are fetched. */
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

/* A block's file consists of a magic number, the block's number, its size, the SHA-256 of these
 * three and the bytes, and the bytes. */
enum { MAGIC_BYTES = 8, DIGEST_AT = 24, HEAD_BYTES = 56, NAME_BYTES = 128 };
static const char MAGIC[MAGIC_BYTES + 1] = "EBPOBLK2", SUFFIX[] = ".ebpo-block",
                                      TEMPORARY[] = ".ebpo-part-";
/* the writer of a temporary file older than this has ended */
static const double STALE_SECONDS = 3600;

struct ebpo_disk {
    int folder;
    uint64_t limit;
    char key[65];
    pthread_mutex_t lock;
    uint64_t written; /* bytes since the folder was last scanned */
    uint64_t number;  /* for temporary names */
    uint64_t held, others;
};

static void digest_block(const uint8_t head[DIGEST_AT], const void *data, size_t size,
                         uint8_t out[32])
{
    ebpo_sha256 sha;
    ebpo_sha256_begin(&sha);
    ebpo_sha256_add(&sha, head, DIGEST_AT);
    ebpo_sha256_add(&sha, data, size);
    ebpo_sha256_end(&sha, out);
}

/* Makes the key; blocks of the default size keep their original names. */
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

typedef struct entry {
    struct timespec used;
    uint64_t bytes;
    char name[NAME_BYTES];
} entry;

static bool ends_with(const char *name, const char *end)
{
    size_t n = strlen(name), e = strlen(end);
    return n >= e && strcmp(name + n - e, end) == 0;
}

static int is_older(const void *a, const void *b)
{
    const struct timespec *x = &((const entry *)a)->used, *y = &((const entry *)b)->used;
    if (x->tv_sec != y->tv_sec)
        return x->tv_sec < y->tv_sec ? -1 : 1;
    return x->tv_nsec < y->tv_nsec ? -1 : x->tv_nsec > y->tv_nsec;
}

/* Lists the files of this library in the folder, and no others. */
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

static void count_held(ebpo_disk *d)
{
    uint64_t count, bytes;
    entry *entries = list_entries(d, &count, &bytes);
    for (uint64_t i = 0; i < count; i++) {
        uint64_t own = entries[i].bytes > HEAD_BYTES ? entries[i].bytes - HEAD_BYTES : 0;
        *(strncmp(entries[i].name, d->key, sizeof d->key - 1) == 0 ? &d->held : &d->others) += own;
    }
    free(entries);
}

void ebpo_disk_held(const ebpo_disk *d, uint64_t *held, uint64_t *others)
{
    *held = d->held;
    *others = d->others;
}

/* Removes the oldest blocks; called after each eighth of the limit is written, so one process alone
 * stays below the limit. */
static void trim_folder(ebpo_disk *d)
{
    uint64_t count, bytes;
    entry *entries = list_entries(d, &count, &bytes);
    if (bytes > d->limit / 8 * 7) {
        qsort(entries, count, sizeof *entries, is_older);
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
        (void)mkdir(path, 0777); /* if this fails, the next call reports it */
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
        /* with too many open files or without memory, another folder does not help */
        bool folders = errno != EMFILE && errno != ENFILE && errno != ENOMEM;
        ebpo_status status = ebpo_fail_file(error, folders ? EBPO_E_ARGUMENT : EBPO_E_IO, folder,
                                            "cannot be used as a cache folder: %s%s",
                                            strerror(errno), folders ? "; give another one" : "");
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
        ssize_t got = read(fd, to, size);
        if (got <= 0 && !(got < 0 && errno == EINTR))
            return false;
        if (got > 0) {
            to += got;
            size -= (size_t)got;
        }
    }
    return true;
}

static bool write_fully(int fd, const void *data, size_t size)
{
    const uint8_t *from = data;
    while (size) {
        ssize_t put = write(fd, from, size);
        if (put < 0 && errno != EINTR)
            return false;
        if (put > 0) {
            from += put;
            size -= (size_t)put;
        }
    }
    return true;
}

/* Reads a block of `size` bytes (the last block of the file has fewer). Returns false if it is
 * missing. */
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
        (void)!futimens(fd, NULL); /* marks it as used now; may fail in a read-only folder */
    close(fd);
    if (!good)
        unlinkat(d->folder, name, 0);
    return good;
}

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

enum {
    /* smaller gaps between prefetched ranges are fetched too, because that takes less time than
     * another request */
    GAP_BYTES = 16384,
    GAP_BYTES_OF_MANY = 32768,
    MANY = 256,
    STALE_AFTER = 64 /* after so many later hints, a hinted piece will probably not be read */
};

typedef enum piece_state {
    PIECE_NOTED,   /* nothing fetched */
    PIECE_LOADING, /* a thread reads it from disk */
    PIECE_COMING,  /* requested */
    PIECE_THERE
} piece_state;

struct ebpo_cached_range {
    uint64_t begin, end;
    uint64_t wanted; /* hinted bytes that are not read yet */
    uint64_t plan;   /* number of the last prefetch hint that included it */
    uint64_t used;   /* time of the last read, by p->clock */
    bool fresh;      /* made for the current prefetch hint */
    piece_state state;
    unsigned users; /* threads that need it to stay in the list */
    bool demanded;  /* a reader waits for it, and receives its failure */
    bool to_store;  /* fetched, not on disk yet */
    /* the requested part: blocks at the ends of the piece may have come from disk */
    uint64_t fetch_begin, fetch_end;
    ebpo_request request;
    uint8_t *data; /* [end - begin] */
};

/* --- the list; lock held in the functions below, except where noted --- */

/* Returns the first piece that ends behind `at`. */
static uint64_t find_piece(const ebpo_range_cache *p, uint64_t at)
{
    uint64_t low = 0, high = p->count;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (p->piece[middle]->end > at)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

static uint64_t bytes_of(const ebpo_cached_range *piece) { return piece->end - piece->begin; }

static void drop_data(ebpo_range_cache *p, ebpo_cached_range *piece)
{
    if (piece->data)
        p->held -= bytes_of(piece);
    free(piece->data);
    piece->data = NULL;
    piece->state = PIECE_NOTED;
}

static void remove_at(ebpo_range_cache *p, uint64_t i)
{
    ebpo_cached_range *piece = p->piece[i];
    drop_data(p, piece);
    free(piece);
    memmove(p->piece + i, p->piece + i + 1, (p->count - i - 1) * sizeof *p->piece);
    p->count--;
}

static bool insert_piece(ebpo_range_cache *p, uint64_t i, uint64_t begin, uint64_t end)
{
    ebpo_cached_range *piece = ebpo_alloc_zero(1, sizeof *piece);
    if (!piece || !ebpo_grow(&p->piece, &p->capacity, p->count + 1, sizeof *p->piece)) {
        free(piece);
        return false;
    }
    piece->begin = begin;
    piece->end = end;
    piece->plan = p->plan;
    piece->fresh = p->hinting;
    memmove(p->piece + i + 1, p->piece + i, (p->count - i) * sizeof *p->piece);
    p->piece[i] = piece;
    p->count++;
    return true;
}

/* Inserts [begin, end) in pieces of about equal size, at most EBPO_RANGE_BYTES, on the grid of the
 * blocks. */
static bool insert_pieces(ebpo_range_cache *p, uint64_t i, uint64_t begin, uint64_t end)
{
    uint64_t number = (end - begin + EBPO_RANGE_BYTES - 1) / EBPO_RANGE_BYTES;
    uint64_t each = ((end - begin + number - 1) / number + p->block - 1) / p->block * p->block;
    for (; begin < end; i++) {
        uint64_t stop = end - begin <= each ? end : (begin + each) / p->block * p->block;
        if (!insert_piece(p, i, begin, stop))
            return false;
        begin = stop;
    }
    return true;
}

/* Makes pieces for uncovered parts of [begin, end). With a folder, whole blocks. */
static bool cover_range(ebpo_range_cache *p, uint64_t begin, uint64_t end)
{
    if (p->disk) {
        begin = begin / p->block * p->block;
        end = (end + p->block - 1) / p->block * p->block;
    }
    begin = begin < p->begin ? p->begin : begin;
    end = end > p->size ? p->size : end;
    while (begin < end) {
        uint64_t i = find_piece(p, begin);
        uint64_t next = i < p->count && p->piece[i]->begin < end ? p->piece[i]->begin : end;
        if (begin < next && !insert_pieces(p, i, begin, next))
            return false;
        i = find_piece(p, next);
        begin = next < end && i < p->count ? p->piece[i]->end : end;
    }
    return true;
}

/* --- fetching --- */

/* Returns true if a piece holds the whole block at an offset, or as much of it as the file has.
 * Only such blocks are stored on disk. */
static bool has_block(const ebpo_range_cache *p, uint64_t at, uint64_t end)
{
    return at % p->block == 0 && (end - at >= p->block || end == p->size);
}

/* Reads blocks from disk, from both ends inwards; the lock is released meanwhile. The rest must be
 * requested. */
static void load_from_disk(ebpo_range_cache *p, ebpo_cached_range *piece)
{
    uint64_t begin = piece->begin, end = piece->end, got = 0;
    piece->state = PIECE_LOADING;
    pthread_mutex_unlock(&p->lock);
    while (begin < end && has_block(p, begin, end)) {
        size_t size = (size_t)(end - begin < p->block ? end - begin : p->block);
        if (!get_block(p->disk, begin / p->block, piece->data + (begin - piece->begin), size))
            break;
        begin += size;
        got += size;
    }
    while (begin < end) {
        uint64_t block = (end - 1) / p->block, at = block * p->block;
        if (at <= begin || (end % p->block && end != p->size) ||
            !get_block(p->disk, block, piece->data + (at - piece->begin), (size_t)(end - at)))
            break;
        got += end - at;
        end = at;
    }
    pthread_mutex_lock(&p->lock);
    piece->fetch_begin = begin;
    piece->fetch_end = end;
    p->disk_bytes += got;
    p->disk_hits += begin == end;
}

/* Returns true if no thread needs the piece to stay. */
static bool is_idle(const ebpo_cached_range *piece)
{
    return piece->users == 0 && piece->data &&
           (piece->state == PIECE_THERE || (piece->state == PIECE_COMING && piece->request.done));
}

/* Drops the piece that was read least recently; if none was read, one whose prefetch hint is old.
 */
static bool forget_one(ebpo_range_cache *p)
{
    uint64_t read = p->count, stale = p->count;
    for (uint64_t i = 0; i < p->count; i++) {
        const ebpo_cached_range *piece = p->piece[i];
        if (!is_idle(piece))
            continue;
        if (piece->wanted == 0 && (read == p->count || piece->used < p->piece[read]->used))
            read = i;
        if (piece->wanted && piece->plan + STALE_AFTER < p->plan &&
            (stale == p->count || piece->plan < p->piece[stale]->plan))
            stale = i;
    }
    uint64_t which = read < p->count ? read : stale;
    if (which == p->count)
        return false;
    remove_at(p, which);
    return true;
}

static void reserve_space(ebpo_range_cache *p, uint64_t bytes)
{
    while (p->held + bytes > p->held_limit && forget_one(p))
        ;
}

/* Requests a piece that is only noted (PIECE_NOTED). Returns false when memory is short. */
static bool start_request(ebpo_range_cache *p, ebpo_cached_range *piece, bool urgent)
{
    piece->users++; /* must not be dropped here */
    reserve_space(p, bytes_of(piece));
    piece->users--;
    piece->data = ebpo_alloc(bytes_of(piece), 1);
    if (!piece->data)
        return false;
    p->held += bytes_of(piece);
    piece->fetch_begin = piece->begin;
    piece->fetch_end = piece->end;
    if (p->disk) {
        piece->users++;
        load_from_disk(p, piece);
        piece->users--;
    }
    piece->to_store = p->disk && piece->fetch_begin < piece->fetch_end;
    if (piece->fetch_begin == piece->fetch_end) {
        piece->state = PIECE_THERE;
        pthread_cond_broadcast(&p->done);
        return true;
    }
    piece->state = PIECE_COMING;
    piece->demanded = urgent;
    piece->request = (ebpo_request){ .offset = piece->fetch_begin,
                                     .size = piece->fetch_end - piece->fetch_begin,
                                     .data = piece->data + (piece->fetch_begin - piece->begin) };
    ebpo_transfers_add(p->transfers, &piece->request, urgent);
    return true;
}

/* Ends this thread's use of a piece, after reading `read` bytes of it. Its data stays until the
 * memory is needed. */
static void release_piece(ebpo_range_cache *p, ebpo_cached_range *piece, uint64_t read)
{
    piece->users--;
    piece->wanted -= read < piece->wanted ? read : piece->wanted;
    if (read)
        piece->used = ++p->clock;
    bool failed =
        piece->state == PIECE_COMING && piece->request.done && piece->request.status != EBPO_OK;
    if (piece->users)
        return;
    if (failed)
        drop_data(p, piece);
    if (piece->wanted == 0 && piece->state == PIECE_NOTED)
        remove_at(p, find_piece(p, piece->begin));
}

/* Reads ahead from an offset in the file, as far as the limit allows. */
static void read_ahead(ebpo_range_cache *p, uint64_t from)
{
    for (uint64_t i = find_piece(p, from); i < p->count; i = find_piece(p, from)) {
        ebpo_cached_range *piece = p->piece[i];
        from = piece->end;
        if (piece->state != PIECE_NOTED || piece->wanted == 0)
            continue;
        piece->users++; /* must not be dropped here */
        reserve_space(p, bytes_of(piece));
        bool fits = p->held + bytes_of(piece) <= p->held_limit && start_request(p, piece, false);
        release_piece(p, piece, 0);
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

/* Adds hinted bytes; pieces in memory have been counted. */
static void add_wanted(ebpo_range_cache *p, const ebpo_range *range)
{
    uint64_t begin = range->offset, end = begin + range->size;
    for (uint64_t i = find_piece(p, begin); i < p->count && p->piece[i]->begin < end; i++) {
        ebpo_cached_range *piece = p->piece[i];
        uint64_t from = piece->begin > begin ? piece->begin : begin,
                 to = piece->end < end ? piece->end : end;
        piece->plan = p->plan;
        if (piece->fresh)
            piece->wanted += to - from;
    }
}

/* Makes pieces for the ranges (sorted), one for ranges that are close together. */
static void note_ranges(ebpo_range_cache *p, const ebpo_range *sorted, size_t count)
{
    uint64_t before = p->count, gap = count > MANY ? GAP_BYTES_OF_MANY : GAP_BYTES;
    p->hinting = true;
    for (size_t i = 0; i < count;) {
        uint64_t begin = sorted[i].offset, end = begin + sorted[i].size;
        for (i++; i < count && (sorted[i].offset <= end || sorted[i].offset - end <= gap); i++)
            end = sorted[i].offset + sorted[i].size > end ? sorted[i].offset + sorted[i].size : end;
        if (begin < end && !cover_range(p, begin, end))
            break;
    }
    p->hinting = false;
    p->plan += p->count > before;
    uint64_t first = find_piece(p, sorted[0].offset),
             end = sorted[count - 1].offset + sorted[count - 1].size;
    for (uint64_t i = first; i < p->count && p->piece[i]->begin < end; i++)
        p->piece[i]->fresh |= p->piece[i]->wanted == 0; /* was read before, and is needed again */
    for (size_t i = 0; i < count; i++)
        add_wanted(p, &sorted[i]);
    for (uint64_t i = first; i < p->count && p->piece[i]->begin < end; i++)
        p->piece[i]->fresh = false;
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
    note_ranges(p, sorted, count);
    read_ahead(p, sorted[0].offset);
    pthread_mutex_unlock(&p->lock);
    free(sorted);
}

/* --- reading --- */

/* Stores a block; the lock is released meanwhile. */
static void store_block(ebpo_range_cache *p, ebpo_cached_range *piece)
{
    piece->to_store = false;
    pthread_mutex_unlock(&p->lock);
    for (uint64_t at = piece->fetch_begin; at < piece->fetch_end; at += p->block) {
        uint64_t left = piece->fetch_end - at;
        if (has_block(p, at, piece->fetch_end))
            put_block(p->disk, at / p->block, piece->data + (at - piece->begin),
                      (size_t)(left < p->block ? left : p->block));
    }
    pthread_mutex_lock(&p->lock);
}

static bool has_come(const ebpo_cached_range *piece)
{
    return piece->to_store &&
           (piece->state == PIECE_THERE || (piece->state == PIECE_COMING && piece->request.done &&
                                            piece->request.status == EBPO_OK));
}

/* Stores one piece that has arrived but has not been read, so that it is not lost when the process
 * ends; returns false when there is none. The lock is released meanwhile. */
static bool store_one(ebpo_range_cache *p)
{
    for (uint64_t i = 0; p->disk && i < p->count; i++) {
        ebpo_cached_range *piece = p->piece[i];
        if (!has_come(piece))
            continue;
        piece->users++;
        store_block(p, piece);
        piece->users--;
        return true;
    }
    return false;
}

/* Waits for a piece that this thread uses. A piece that failed while no thread waited is requested
 * again. */
static ebpo_status await_piece(ebpo_range_cache *p, ebpo_cached_range *piece, ebpo_error *error)
{
    while (piece->state != PIECE_THERE) {
        if (piece->state == PIECE_COMING && piece->request.done) {
            if (piece->request.status == EBPO_OK) {
                piece->state = PIECE_THERE;
                break;
            }
            if (piece->demanded || piece->request.status == EBPO_E_CANCELLED) {
                if (error)
                    *error = piece->request.error;
                return piece->request.status;
            }
            drop_data(p, piece);
        }
        if (piece->state == PIECE_NOTED) {
            if (!start_request(p, piece, true))
                return ebpo_fail_memory(error, bytes_of(piece));
            continue;
        }
        if (piece->state == PIECE_COMING && !piece->request.done) {
            piece->demanded = true;
            ebpo_transfers_urge(p->transfers, &piece->request);
        }
        if (!store_one(p))
            pthread_cond_wait(&p->done, &p->lock);
    }
    if (piece->to_store)
        store_block(p, piece);
    return EBPO_OK;
}

/* Reads bytes [at, end) as far as one piece has them; advances *at. */
static ebpo_status read_piece(ebpo_range_cache *p, uint64_t *at, uint64_t end, uint8_t *data,
                              ebpo_error *error)
{
    uint64_t i = find_piece(p, *at);
    if (i == p->count || p->piece[i]->begin > *at) { /* the piece was dropped in the meantime */
        if (!cover_range(p, *at, end))
            return ebpo_fail_memory(error, end - *at);
        i = find_piece(p, *at);
    }
    ebpo_cached_range *piece = p->piece[i];
    uint64_t size = (piece->end < end ? piece->end : end) - *at, next = piece->end;
    piece->users++;
    ebpo_status status = await_piece(p, piece, error);
    if (status == EBPO_OK) {
        read_ahead(p, next);
        pthread_mutex_unlock(&p->lock);
        memcpy(data, piece->data + (*at - piece->begin), (size_t)size);
        pthread_mutex_lock(&p->lock);
    }
    release_piece(p, piece, status == EBPO_OK ? size : 0);
    *at += size;
    return status;
}

/* Requests all pieces of a long range at the same time. */
static void begin_read(ebpo_range_cache *p, uint64_t begin, uint64_t end)
{
    for (uint64_t i = find_piece(p, begin); i < p->count && p->piece[i]->begin < end;
         i = find_piece(p, begin)) {
        ebpo_cached_range *piece = p->piece[i];
        begin = piece->end;
        piece->users++;
        reserve_space(p, bytes_of(piece));
        if (piece->state == PIECE_NOTED && p->held + bytes_of(piece) <= p->held_limit)
            (void)!start_request(p, piece, true);
        piece->users--;
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
        status = read_piece(p, &at, end, data + (before - offset), error);
    }
    for (uint64_t i = find_piece(p, at);
         status != EBPO_OK && i < p->count && p->piece[i]->begin < end; i++)
        /* this reader does not receive failures of these requests any more */
        p->piece[i]->demanded = p->piece[i]->users > 0;
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
        free(p->piece[i]->data);
        free(p->piece[i]);
    }
    free(p->piece);
    p->piece = NULL;
    p->count = p->capacity = p->held = 0;
}
