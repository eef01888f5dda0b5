/* Provides sources of files whose bytes arrive asynchronously (ebpo/async.h). The bytes that the
 * caller supplies are stored in extents (ranges of the file), in order and without overlaps. A read
 * copies from extents. If bytes are missing, the read records its range as wanted and returns
 * EBPO_E_PENDING. A prefetch hint announces ranges that will be read soon. These ranges are also
 * recorded as wanted, so the caller can fetch all ranges that are needed next in one round.
 *
 * An operation is a call that the caller repeats until all bytes are available. A clock counts
 * reads, supplied ranges and operations; its count serves as the time. An extent is never removed
 * if it was used after the oldest running operation began. So, while an operation is repeated,
 * available bytes never become missing again, which limits the number of repetitions. */
#include <inttypes.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/async.h>

#include "core/alloc.h"
#include "core/error.h"

enum {
    HEAD_BYTES = 131072,   /* the head: the first bytes of the file, which opening reads */
    RANGE_BYTES = 4 << 20, /* maximum size of a needed range */
    /* If the gap between two needed ranges is at most this, the gap is also fetched, because this
     * is faster than another request. */
    GAP_BYTES = 16384,
    GAP_BYTES_OF_MANY = 32768, /* used instead of GAP_BYTES for more than MANY ranges */
    MANY = 256,
    COMPACT_COUNT =
        1 << 16 /* the wanted ranges are merged whenever their number is a multiple of this */
};

/* Supplied bytes [begin, end) of the file. */
typedef struct extent {
    uint64_t begin, end;
    uint64_t used; /* time of supply or of the last read */
    uint8_t *bytes;
} extent;

struct ebpo_async {
    pthread_mutex_t lock;
    char *name, *version; /* name for messages; version of the file, or "" if it is not known */
    uint64_t size;        /* bytes of the file */
    uint64_t memory;      /* limit of the bytes in extents */
    uint64_t held;        /* bytes in extents */
    bool changed;         /* true: the file has changed; every further call fails */
    uint64_t clock;       /* number of reads, supplied ranges and operations so far */
    extent *extents;      /* [extent_count] by offset */
    uint64_t extent_count, extent_capacity;
    ebpo_range *wanted; /* [wanted_count] ranges of pending reads and of hints, in any order */
    uint64_t wanted_count, wanted_capacity;
    ebpo_range *needed; /* the last result of ebpo_async_needed */
    uint64_t needed_capacity;
    uint64_t *running; /* [running_count] times at which running operations began, ascending */
    uint64_t running_count, running_capacity;
    uint64_t unlisted; /* number of running operations that are not in `running`, because memory was
                          short */
};

/* --- extents; callers of the functions below hold the lock --- */

/* Returns the index of the first extent that ends after the offset `at`. */
static uint64_t find_extent(const ebpo_async *a, uint64_t at)
{
    uint64_t low = 0, high = a->extent_count;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (a->extents[middle].end > at)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

/* Returns the first missing part of the bytes [begin, end). If no byte is missing, returns an empty
 * range at `end`. */
static ebpo_range first_missing(const ebpo_async *a, uint64_t begin, uint64_t end)
{
    uint64_t i = find_extent(a, begin);
    while (begin < end && i < a->extent_count && a->extents[i].begin <= begin)
        begin = a->extents[i++].end;
    if (begin >= end)
        return (ebpo_range){ end, 0 };
    uint64_t next = i < a->extent_count && a->extents[i].begin < end ? a->extents[i].begin : end;
    return (ebpo_range){ begin, next - begin };
}

/* Returns true if all bytes of [begin, end) are available. */
static bool is_available(const ebpo_async *a, uint64_t begin, uint64_t end)
{
    return first_missing(a, begin, end).size == 0;
}

/* Copies the bytes [begin, end) to `to`. All these bytes must be available. */
static void copy_bytes(ebpo_async *a, uint64_t begin, uint64_t end, uint8_t *to)
{
    for (uint64_t i = find_extent(a, begin); begin < end; i++) {
        extent *e = &a->extents[i];
        uint64_t stop = e->end < end ? e->end : end;
        memcpy(to, e->bytes + (begin - e->begin), (size_t)(stop - begin));
        e->used = ++a->clock;
        to += stop - begin;
        begin = stop;
    }
}

/* Inserts an extent for a missing range. Returns false if memory is short. */
static bool insert_extent(ebpo_async *a, uint64_t begin, uint64_t end, const uint8_t *bytes)
{
    if (!ebpo_grow(&a->extents, &a->extent_capacity, a->extent_count + 1, sizeof *a->extents))
        return false;
    uint8_t *copy = ebpo_alloc(end - begin, 1);
    if (!copy)
        return false;
    memcpy(copy, bytes, (size_t)(end - begin));
    uint64_t i = find_extent(a, begin);
    memmove(a->extents + i + 1, a->extents + i, (a->extent_count - i) * sizeof *a->extents);
    a->extents[i] = (extent){ begin, end, ++a->clock, copy };
    a->extent_count++;
    a->held += end - begin;
    return true;
}

/* Returns false if the bytes differ from bytes that were supplied earlier. */
static bool compare_bytes(const ebpo_async *a, uint64_t begin, uint64_t end, const uint8_t *bytes)
{
    for (uint64_t i = find_extent(a, begin); i < a->extent_count && a->extents[i].begin < end;
         i++) {
        const extent *e = &a->extents[i];
        uint64_t from = e->begin > begin ? e->begin : begin, to = e->end < end ? e->end : end;
        if (memcmp(e->bytes + (from - e->begin), bytes + (from - begin), (size_t)(to - from)) != 0)
            return false;
    }
    return true;
}

/* --- removing old bytes --- */

/* Returns true if the extent is not part of the head, and was not used since the oldest running
 * operation began. */
static bool is_removable(const ebpo_async *a, const extent *e)
{
    return e->begin >= HEAD_BYTES && (a->running_count == 0 || e->used < a->running[0]);
}

static int compare_use(const void *x, const void *y)
{
    uint64_t a = *(const uint64_t *)x, b = *(const uint64_t *)y;
    return (a > b) - (a < b);
}

/* Returns a time. To meet the memory limit, all removable extents whose last use is not after this
 * time must be removed. If this does not suffice, returns the latest time of a removable extent.
 * Returns 0 if no extent can be removed. */
static uint64_t find_removal_time(const ebpo_async *a)
{
    uint64_t count = 0, last = 0, excess = a->held - a->memory;
    uint64_t(*old)[2] = ebpo_alloc(a->extent_count, sizeof *old);
    for (uint64_t i = 0; old && i < a->extent_count; i++)
        if (is_removable(a, &a->extents[i])) {
            old[count][0] = a->extents[i].used;
            old[count++][1] = a->extents[i].end - a->extents[i].begin;
        }
    if (count)
        qsort(old, count, sizeof *old, compare_use);
    for (uint64_t i = 0, removed = 0; i < count && removed < excess; removed += old[i++][1])
        last = old[i][0];
    free(old);
    return last;
}

/* Removes the extents that were used least recently, until the memory limit is met. */
static void remove_old(ebpo_async *a)
{
    if (a->held <= a->memory || a->unlisted)
        return;
    uint64_t last = find_removal_time(a), kept = 0;
    for (uint64_t i = 0; i < a->extent_count; i++) {
        extent e = a->extents[i];
        if (is_removable(a, &e) && e.used <= last) {
            a->held -= e.end - e.begin;
            free(e.bytes);
        } else {
            a->extents[kept++] = e;
        }
    }
    a->extent_count = kept;
}

/* --- wanted ranges --- */

static int compare_offsets(const void *x, const void *y)
{
    uint64_t a = ((const ebpo_range *)x)->offset, b = ((const ebpo_range *)y)->offset;
    return (a > b) - (a < b);
}

/* Sorts the wanted ranges, and merges ranges with gaps of at most `gap` bytes between them. */
static void merge_wanted(ebpo_async *a, uint64_t gap)
{
    uint64_t kept = 0;
    if (a->wanted_count)
        qsort(a->wanted, a->wanted_count, sizeof *a->wanted, compare_offsets);
    for (uint64_t i = 0; i < a->wanted_count; i++) {
        ebpo_range next = a->wanted[i], *last = kept ? &a->wanted[kept - 1] : NULL;
        if (!last || next.offset > last->offset + last->size + gap)
            a->wanted[kept++] = next;
        else if (next.offset + next.size > last->offset + last->size)
            last->size = next.offset + next.size - last->offset;
    }
    a->wanted_count = kept;
}

/* Adds a range to the wanted ranges. Returns false when memory is short. */
static bool record_wanted(ebpo_async *a, ebpo_range range)
{
    if (a->wanted_count && a->wanted_count % COMPACT_COUNT == 0)
        merge_wanted(a, 0);
    if (!ebpo_grow(&a->wanted, &a->wanted_capacity, a->wanted_count + 1, sizeof *a->wanted))
        return false;
    a->wanted[a->wanted_count++] = range;
    return true;
}

/* Adds the missing parts of [begin, end) to the needed ranges. Divides a large part into ranges of
 * about equal size and at most RANGE_BYTES. Returns false when memory is short. */
static bool add_needed(ebpo_async *a, uint64_t begin, uint64_t end, uint64_t *count)
{
    for (ebpo_range m = first_missing(a, begin, end); m.size;
         m = first_missing(a, m.offset + m.size, end)) {
        uint64_t pieces = (m.size + RANGE_BYTES - 1) / RANGE_BYTES,
                 each = (m.size + pieces - 1) / pieces;
        for (uint64_t at = 0; at < m.size; at += each) {
            if (!ebpo_grow(&a->needed, &a->needed_capacity, *count + 1, sizeof *a->needed))
                return false;
            uint64_t size = m.size - at < each ? m.size - at : each;
            a->needed[(*count)++] = (ebpo_range){ m.offset + at, size };
        }
    }
    return true;
}

static ebpo_status fail_changed(const ebpo_async *a, ebpo_error *error)
{
    return ebpo_fail_file(error, EBPO_E_IO, a->name,
                          "the file has changed while it was read; open it again");
}

/* --- the source --- */

static ebpo_status async_read(void *user, uint64_t offset, uint64_t size, void *data,
                              ebpo_error *error)
{
    ebpo_async *a = user;
    ebpo_status status = EBPO_OK;
    pthread_mutex_lock(&a->lock);
    if (a->changed)
        status = fail_changed(a, error);
    else if (is_available(a, offset, offset + size))
        copy_bytes(a, offset, offset + size, data);
    else if (!record_wanted(a, (ebpo_range){ offset, size }))
        status = ebpo_fail_memory(error, sizeof *a->wanted);
    else
        status = ebpo_fail_at(error, EBPO_E_PENDING, a->name, "", (int64_t)offset,
                              "bytes %" PRIu64 " to %" PRIu64
                              " are not available yet; supply them and repeat the call",
                              offset, offset + size - 1);
    pthread_mutex_unlock(&a->lock);
    return status;
}

static void async_prefetch(void *user, const ebpo_range *ranges, size_t count)
{
    ebpo_async *a = user;
    pthread_mutex_lock(&a->lock);
    for (size_t i = 0; i < count; i++)
        if (!is_available(a, ranges[i].offset, ranges[i].offset + ranges[i].size) &&
            !record_wanted(a, ranges[i]))
            break; /* memory is short: the remaining hints are dropped */
    pthread_mutex_unlock(&a->lock);
}

/* --- the object --- */

ebpo_status ebpo_async_new(uint64_t size, const char *name, const char *version, uint64_t memory,
                           ebpo_async **out, ebpo_error *error)
{
    if (!out)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "ebpo_async_new: out is NULL");
    *out = NULL;
    if (!name || !version || size > INT64_MAX)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "ebpo_async_new: name or version is NULL, or the size is above 2^63 - 1");
    ebpo_async *a = ebpo_alloc_zero(1, sizeof *a);
    if (!a)
        return ebpo_fail_memory(error, sizeof *a);
    a->size = size;
    a->memory = memory;
    a->name = strdup(name);
    a->version = strdup(version);
    if (!a->name || !a->version || pthread_mutex_init(&a->lock, NULL) != 0) {
        free(a->name);
        free(a->version);
        free(a);
        return ebpo_fail_memory(error, strlen(name) + strlen(version));
    }
    *out = a;
    return EBPO_OK;
}

void ebpo_async_free(ebpo_async *a)
{
    if (!a)
        return;
    for (uint64_t i = 0; i < a->extent_count; i++)
        free(a->extents[i].bytes);
    free(a->extents);
    free(a->wanted);
    free(a->needed);
    free(a->running);
    free(a->name);
    free(a->version);
    pthread_mutex_destroy(&a->lock);
    free(a);
}

ebpo_status ebpo_async_source(ebpo_async *a, ebpo_source *out, ebpo_error *error)
{
    ebpo_source made = EBPO_SOURCE_INIT;
    if (!a || !out)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "ebpo_async_source: an argument is NULL");
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_source, out, error);
    if (status != EBPO_OK)
        return status;
    made.user = a;
    made.size = a->size;
    made.read = async_read;
    made.prefetch = async_prefetch;
    made.prefetched = a->size < HEAD_BYTES ? a->size : HEAD_BYTES;
    return EBPO_GIVE(ebpo_source, out, &made);
}

uint64_t ebpo_async_begin(ebpo_async *a)
{
    uint64_t operation = 0;
    pthread_mutex_lock(&a->lock);
    if (ebpo_grow(&a->running, &a->running_capacity, a->running_count + 1, sizeof *a->running))
        operation = a->running[a->running_count++] = ++a->clock;
    else
        a->unlisted++;
    pthread_mutex_unlock(&a->lock);
    return operation;
}

void ebpo_async_end(ebpo_async *a, uint64_t operation)
{
    uint64_t kept = 0;
    pthread_mutex_lock(&a->lock);
    a->unlisted -= operation == 0 && a->unlisted;
    for (uint64_t i = 0; i < a->running_count; i++)
        if (a->running[i] != operation)
            a->running[kept++] = a->running[i];
    a->running_count = kept;
    remove_old(a);
    if (kept == 0 && a->unlisted == 0)
        a->wanted_count = 0;
    pthread_mutex_unlock(&a->lock);
}

ebpo_status ebpo_async_needed(ebpo_async *a, const ebpo_range **ranges, size_t *count,
                              ebpo_error *error)
{
    uint64_t needed_count = 0;
    bool added = true;
    pthread_mutex_lock(&a->lock);
    ebpo_status status = a->changed ? fail_changed(a, error) : EBPO_OK;
    merge_wanted(a, a->wanted_count > MANY ? GAP_BYTES_OF_MANY : GAP_BYTES);
    for (uint64_t i = 0; i < a->wanted_count && added; i++)
        added = add_needed(a, a->wanted[i].offset, a->wanted[i].offset + a->wanted[i].size,
                           &needed_count);
    if (!added && status == EBPO_OK)
        status = ebpo_fail_memory(error, (needed_count + 1) * sizeof *a->needed);
    a->wanted_count = 0;
    pthread_mutex_unlock(&a->lock);
    *ranges = a->needed;
    *count = status == EBPO_OK ? (size_t)needed_count : 0;
    return status;
}

/* Returns true if `version` is NULL or the version of the file. The first version that is not ""
 * becomes the version of the file. */
static bool check_version(ebpo_async *a, const char *version)
{
    if (!version || strcmp(version, a->version) == 0)
        return true;
    if (*a->version)
        return false;
    char *copy = strdup(version);
    if (copy) {
        free(a->version);
        a->version = copy;
    }
    return true; /* if memory is short, the version stays unknown */
}

/* Stores the missing bytes of [begin, end). */
static ebpo_status store_supplied(ebpo_async *a, uint64_t begin, uint64_t end, const uint8_t *bytes,
                                  ebpo_error *error)
{
    for (ebpo_range m = first_missing(a, begin, end); m.size;
         m = first_missing(a, m.offset + m.size, end)) {
        if (m.offset < HEAD_BYTES && m.offset + m.size > HEAD_BYTES)
            /* no extent crosses the end of the head, because bytes of the head are never removed */
            m.size = HEAD_BYTES - m.offset;
        if (!insert_extent(a, m.offset, m.offset + m.size, bytes + (m.offset - begin)))
            return ebpo_fail_memory(error, m.size);
    }
    return EBPO_OK;
}

ebpo_status ebpo_async_supply(ebpo_async *a, uint64_t offset, uint64_t size, const void *bytes,
                              const char *version, ebpo_error *error)
{
    if (!a || (!bytes && size))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "ebpo_async_supply: an argument is NULL");
    if (offset > a->size || size > a->size - offset)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, a->name,
                              "%" PRIu64 " bytes from offset %" PRIu64
                              " were supplied, but the file ends at %" PRIu64,
                              size, offset, a->size);
    pthread_mutex_lock(&a->lock);
    a->changed |= !check_version(a, version) || !compare_bytes(a, offset, offset + size, bytes);
    ebpo_status status = a->changed ? fail_changed(a, error)
                                    : store_supplied(a, offset, offset + size, bytes, error);
    pthread_mutex_unlock(&a->lock);
    return status;
}

uint64_t ebpo_async_bytes(const ebpo_async *a)
{
    /* the cast removes const only for locking */
    ebpo_async *locked = (ebpo_async *)(uintptr_t)a;
    pthread_mutex_lock(&locked->lock);
    uint64_t bytes = a->held;
    pthread_mutex_unlock(&locked->lock);
    return bytes;
}
