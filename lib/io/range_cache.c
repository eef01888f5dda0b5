#include "io/range_cache.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/clock.h"
#include "core/error.h"

enum {
    /* between announced ranges: fetching them costs less than another request; of many, requests
     * are what takes time */
    GAP_BYTES = 16384,
    GAP_BYTES_OF_MANY = 32768,
    MANY = 256,
    STALE_AFTER = 64 /* announcements: what has not been read by then will hardly be */
};

typedef enum piece_state {
    PIECE_NOTED,   /* nothing fetched */
    PIECE_LOADING, /* a thread looks for it on disk */
    PIECE_COMING,  /* requested */
    PIECE_THERE
} piece_state;

struct ebpo_cached_range {
    uint64_t begin, end;
    uint64_t wanted; /* bytes announced and not read yet */
    uint64_t plan;   /* last announcement that named it */
    uint64_t used;   /* when it was last read, by p->clock */
    bool fresh;      /* made for the announcement under way */
    piece_state state;
    unsigned users;                  /* threads that need it in its place */
    bool demanded;                   /* a reader is waiting for it and gets its failure */
    bool to_store;                   /* fetched, not on disk yet */
    uint64_t fetch_begin, fetch_end; /* blocks at its ends may have come from disk */
    ebpo_request request;
    uint8_t *data; /* [end - begin] */
};

/* --- the list; lock held in all that follows but where it says otherwise --- */

/* First piece that ends behind `at`. */
static uint64_t find(const ebpo_range_cache *p, uint64_t at)
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

static bool insert(ebpo_range_cache *p, uint64_t i, uint64_t begin, uint64_t end)
{
    ebpo_cached_range *piece = ebpo_alloc_zero(1, sizeof *piece);
    if (!piece || !ebpo_grow(&p->piece, &p->capacity, p->count + 1, sizeof *p->piece)) {
        free(piece);
        return false;
    }
    piece->begin = begin;
    piece->end = end;
    piece->plan = p->plan;
    piece->fresh = p->announcing;
    memmove(p->piece + i + 1, p->piece + i, (p->count - i) * sizeof *p->piece);
    p->piece[i] = piece;
    p->count++;
    return true;
}

/* [begin, end) in pieces of about equal size, at most EBPO_RANGE_BYTES, on the grid of the blocks.
 */
static bool insert_pieces(ebpo_range_cache *p, uint64_t i, uint64_t begin, uint64_t end)
{
    uint64_t number = (end - begin + EBPO_RANGE_BYTES - 1) / EBPO_RANGE_BYTES;
    uint64_t each = ((end - begin + number - 1) / number + p->block - 1) / p->block * p->block;
    for (; begin < end; i++) {
        uint64_t stop = end - begin <= each ? end : (begin + each) / p->block * p->block;
        if (!insert(p, i, begin, stop))
            return false;
        begin = stop;
    }
    return true;
}

/* Pieces for what of [begin, end) has none. With a folder, whole blocks. */
static bool cover(ebpo_range_cache *p, uint64_t begin, uint64_t end)
{
    if (p->disk) {
        begin = begin / p->block * p->block;
        end = (end + p->block - 1) / p->block * p->block;
    }
    begin = begin < p->begin ? p->begin : begin;
    end = end > p->size ? p->size : end;
    while (begin < end) {
        uint64_t i = find(p, begin);
        uint64_t next = i < p->count && p->piece[i]->begin < end ? p->piece[i]->begin : end;
        if (begin < next && !insert_pieces(p, i, begin, next))
            return false;
        i = find(p, next);
        begin = next < end && i < p->count ? p->piece[i]->end : end;
    }
    return true;
}

/* --- fetching --- */

/* Whether a piece holds the whole block at an offset, or as much of it as the file has. Only such
 * blocks are stored on disk. */
static bool has_block(const ebpo_range_cache *p, uint64_t at, uint64_t end)
{
    return at % p->block == 0 && (end - at >= p->block || end == p->size);
}

/* Blocks from disk, from both ends inwards; the lock is released meanwhile. What is left is to be
 * requested. */
static void load_from_disk(ebpo_range_cache *p, ebpo_cached_range *piece)
{
    uint64_t begin = piece->begin, end = piece->end, got = 0;
    piece->state = PIECE_LOADING;
    pthread_mutex_unlock(&p->lock);
    while (begin < end && has_block(p, begin, end)) {
        size_t size = (size_t)(end - begin < p->block ? end - begin : p->block);
        if (!ebpo_disk_get(p->disk, begin / p->block, piece->data + (begin - piece->begin), size))
            break;
        begin += size;
        got += size;
    }
    while (begin < end) {
        uint64_t block = (end - 1) / p->block, at = block * p->block;
        if (at <= begin || (end % p->block && end != p->size) ||
            !ebpo_disk_get(p->disk, block, piece->data + (at - piece->begin), (size_t)(end - at)))
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

/* Nobody needs it in its place. */
static bool is_idle(const ebpo_cached_range *piece)
{
    return piece->users == 0 && piece->data &&
           (piece->state == PIECE_THERE || (piece->state == PIECE_COMING && piece->request.done));
}

/* The least recently read of the pieces that were; else what was announced long ago and not wanted
 * after all. */
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

static void make_room(ebpo_range_cache *p, uint64_t bytes)
{
    while (p->held + bytes > p->held_limit && forget_one(p))
        ;
}

/* A piece that is only noted. False when memory is short. */
static bool start(ebpo_range_cache *p, ebpo_cached_range *piece, bool urgent)
{
    piece->users++; /* it must not be forgotten here */
    make_room(p, bytes_of(piece));
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

/* This thread is done with a piece, having read that much of it. What was fetched stays until the
 * memory is needed. */
static void release(ebpo_range_cache *p, ebpo_cached_range *piece, uint64_t read)
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
        remove_at(p, find(p, piece->begin));
}

/* Reads ahead from an offset in the file, as far as the limit allows. */
static void read_ahead(ebpo_range_cache *p, uint64_t from)
{
    for (uint64_t i = find(p, from); i < p->count; i = find(p, from)) {
        ebpo_cached_range *piece = p->piece[i];
        from = piece->end;
        if (piece->state != PIECE_NOTED || piece->wanted == 0)
            continue;
        piece->users++; /* it must not be forgotten here */
        make_room(p, bytes_of(piece));
        bool fits = p->held + bytes_of(piece) <= p->held_limit && start(p, piece, false);
        release(p, piece, 0);
        if (!fits)
            return;
    }
}

/* --- announcements --- */

static int by_offset(const void *a, const void *b)
{
    const ebpo_range *x = a, *y = b;
    return x->offset < y->offset ? -1 : x->offset > y->offset;
}

/* Announced bytes; those of pieces that were there have been counted. */
static void add_wanted(ebpo_range_cache *p, const ebpo_range *range)
{
    uint64_t begin = range->offset, end = begin + range->size;
    for (uint64_t i = find(p, begin); i < p->count && p->piece[i]->begin < end; i++) {
        ebpo_cached_range *piece = p->piece[i];
        uint64_t from = piece->begin > begin ? piece->begin : begin,
                 to = piece->end < end ? piece->end : end;
        piece->plan = p->plan;
        if (piece->fresh)
            piece->wanted += to - from;
    }
}

/* Pieces for the ranges (sorted), one for those that lie close together. */
static void note(ebpo_range_cache *p, const ebpo_range *sorted, size_t count)
{
    uint64_t before = p->count, gap = count > MANY ? GAP_BYTES_OF_MANY : GAP_BYTES;
    p->announcing = true;
    for (size_t i = 0; i < count;) {
        uint64_t begin = sorted[i].offset, end = begin + sorted[i].size;
        for (i++; i < count && (sorted[i].offset <= end || sorted[i].offset - end <= gap); i++)
            end = sorted[i].offset + sorted[i].size > end ? sorted[i].offset + sorted[i].size : end;
        if (begin < end && !cover(p, begin, end))
            break;
    }
    p->announcing = false;
    p->plan += p->count > before;
    uint64_t first = find(p, sorted[0].offset),
             end = sorted[count - 1].offset + sorted[count - 1].size;
    for (uint64_t i = first; i < p->count && p->piece[i]->begin < end; i++)
        p->piece[i]->fresh |= p->piece[i]->wanted == 0; /* read before, and now again */
    for (size_t i = 0; i < count; i++)
        add_wanted(p, &sorted[i]);
    for (uint64_t i = first; i < p->count && p->piece[i]->begin < end; i++)
        p->piece[i]->fresh = false;
}

void ebpo_range_cache_expect(ebpo_range_cache *p, const ebpo_range *ranges, size_t count)
{
    ebpo_range *sorted = ebpo_alloc(count, sizeof *sorted);
    if (!sorted || count == 0) {
        free(sorted);
        return;
    }
    memcpy(sorted, ranges, count * sizeof *sorted);
    qsort(sorted, count, sizeof *sorted, by_offset);
    pthread_mutex_lock(&p->lock);
    note(p, sorted, count);
    read_ahead(p, sorted[0].offset);
    pthread_mutex_unlock(&p->lock);
    free(sorted);
}

/* --- reading --- */

/* The lock is released meanwhile. */
static void store(ebpo_range_cache *p, ebpo_cached_range *piece)
{
    piece->to_store = false;
    pthread_mutex_unlock(&p->lock);
    for (uint64_t at = piece->fetch_begin; at < piece->fetch_end; at += p->block) {
        uint64_t left = piece->fetch_end - at;
        if (has_block(p, at, piece->fetch_end))
            ebpo_disk_put(p->disk, at / p->block, piece->data + (at - piece->begin),
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
 * ends; false when there is none. The lock is released meanwhile. */
static bool store_one(ebpo_range_cache *p)
{
    for (uint64_t i = 0; p->disk && i < p->count; i++) {
        ebpo_cached_range *piece = p->piece[i];
        if (!has_come(piece))
            continue;
        piece->users++;
        store(p, piece);
        piece->users--;
        return true;
    }
    return false;
}

/* Waits for a piece that this thread uses. One that failed while nobody wanted it is requested
 * again. */
static ebpo_status await(ebpo_range_cache *p, ebpo_cached_range *piece, ebpo_error *error)
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
            if (!start(p, piece, true))
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
        store(p, piece);
    return EBPO_OK;
}

/* Bytes [at, end) as far as one piece has them; *at moves on. */
static ebpo_status read_piece(ebpo_range_cache *p, uint64_t *at, uint64_t end, uint8_t *data,
                              ebpo_error *error)
{
    uint64_t i = find(p, *at);
    if (i == p->count || p->piece[i]->begin > *at) { /* gone since it was covered */
        if (!cover(p, *at, end))
            return ebpo_fail_memory(error, end - *at);
        i = find(p, *at);
    }
    ebpo_cached_range *piece = p->piece[i];
    uint64_t size = (piece->end < end ? piece->end : end) - *at, next = piece->end;
    piece->users++;
    ebpo_status status = await(p, piece, error);
    if (status == EBPO_OK) {
        read_ahead(p, next);
        pthread_mutex_unlock(&p->lock);
        memcpy(data, piece->data + (*at - piece->begin), (size_t)size);
        pthread_mutex_lock(&p->lock);
    }
    release(p, piece, status == EBPO_OK ? size : 0);
    *at += size;
    return status;
}

/* All pieces of a long range come at the same time. */
static void begin_read(ebpo_range_cache *p, uint64_t begin, uint64_t end)
{
    for (uint64_t i = find(p, begin); i < p->count && p->piece[i]->begin < end;
         i = find(p, begin)) {
        ebpo_cached_range *piece = p->piece[i];
        begin = piece->end;
        piece->users++;
        make_room(p, bytes_of(piece));
        if (piece->state == PIECE_NOTED && p->held + bytes_of(piece) <= p->held_limit)
            (void)!start(p, piece, true);
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
    if (!cover(p, offset, end))
        status = ebpo_fail_memory(error, size);
    if (status == EBPO_OK)
        begin_read(p, offset, end);
    while (at < end && status == EBPO_OK) {
        uint64_t before = at;
        status = read_piece(p, &at, end, data + (before - offset), error);
    }
    for (uint64_t i = find(p, at); status != EBPO_OK && i < p->count && p->piece[i]->begin < end;
         i++)
        /* what comes of these requests is not this reader's any more */
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
