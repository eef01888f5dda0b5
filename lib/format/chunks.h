/* Ranges of arrays, through a cache of decoded chunks. What comes out has been checked: a hostile
 * file gives EBPO_E_FORMAT, never an index out of range. Any thread. */
#ifndef EBPO_FORMAT_CHUNKS_H
#define EBPO_FORMAT_CHUNKS_H

#include <pthread.h>

#include "core/cache.h"
#include "format/reader.h"

/* Decoded chunks under a budget (0: no limit; the smallest that works is a few MiB). */
typedef struct ebpo_chunks ebpo_chunks;
EBPO_MUST_USE ebpo_status ebpo_chunks_make(ebpo_chunks **out, const ebpo_file *file,
                                           uint64_t budget, ebpo_error *error);
/* The same under a budget that others share. */
EBPO_MUST_USE ebpo_status ebpo_chunks_make_in(ebpo_chunks **out, const ebpo_file *file,
                                              ebpo_cache_pool *pool, ebpo_error *error);
/* The same for one thread at a time, and counted: nothing is read or announced but what was asked
 * for, and nothing after which the file would have read more than the
 * limit (ebpo_chunks_limit; none at first). Then EBPO_E_LIMIT, and ebpo_chunks_refused is true. */
EBPO_MUST_USE ebpo_status ebpo_chunks_make_counted(ebpo_chunks **out, const ebpo_file *file,
                                                   uint64_t budget, ebpo_error *error);
void ebpo_chunks_limit(ebpo_chunks *chunks, uint64_t bytes);
bool ebpo_chunks_refused(const ebpo_chunks *chunks);
void ebpo_chunks_free(ebpo_chunks *chunks);
void ebpo_chunks_get_stats(ebpo_chunks *chunks, ebpo_cache_stats *out);

/* Rows [row, row + rows) of a plain integer array that is present, each value widened to `size`
 * bytes. Beyond the array's end: EBPO_E_ARGUMENT. */
EBPO_MUST_USE ebpo_status ebpo_chunks_integers(ebpo_chunks *chunks, ebpo_array_id id, int level,
                                               uint64_t row, uint64_t rows, void *values,
                                               size_t size, ebpo_error *error);

/* --- inside lib/format --- */

struct ebpo_chunks {
    const ebpo_file *file;
    ebpo_cache *cache;
    /* [chunks of /mesh/faces] vertices seen before each; NULL: a single chunk, or no mesh */
    uint64_t *seen;
    pthread_mutex_t lock;        /* of `rows` */
    struct ebpo_kept_rows *rows; /* of the table of subtrees, those last asked for; or NULL */
    /* Of chunks made by ebpo_chunks_make_counted, which one thread uses at a time. */
    bool counted;
    bool refused;    /* a load has been refused because of the limit */
    uint64_t limit;  /* of the bytes that the file has read, announced ones included */
    uint64_t *ahead; /* [ahead_count] keys that have been announced and not been read yet */
    uint64_t ahead_count, ahead_capacity, ahead_bytes;
    struct ebpo_chunk_keys *collecting; /* ebpo_chunks_collect */
};

/* A place in an array: at most one chunk, pinned while rows in it are wanted. Begin with { .array =
 * ... }, end with ebpo_held_chunk_release. One thread. */
typedef struct ebpo_held_chunk {
    const ebpo_array_in *array;
    uint64_t key;
    uint64_t begin, end; /* rows of the pinned chunk */
    /* NULL: none is pinned. Integers as in the file; faces as u32 corners, vertices as floats or
     * doubles, maps as u32 */
    const uint8_t *rows;
} ebpo_held_chunk;

EBPO_MUST_USE ebpo_status ebpo_held_chunk_load(ebpo_chunks *chunks, ebpo_held_chunk *view,
                                               uint64_t row, ebpo_error *error);
void ebpo_held_chunk_release(ebpo_chunks *chunks, ebpo_held_chunk *view);

/* Pins the chunk that holds `row`, which the array has. Cheap while rows stay in one chunk. */
EBPO_MUST_USE static inline ebpo_status ebpo_held_chunk_move(ebpo_chunks *chunks,
                                                             ebpo_held_chunk *view, uint64_t row,
                                                             ebpo_error *error)
{
    return row >= view->begin && row < view->end ? EBPO_OK
                                                 : ebpo_held_chunk_load(chunks, view, row, error);
}

/* The same as ebpo_chunks_integers, in new memory; NULL for no rows. */
EBPO_MUST_USE ebpo_status ebpo_chunks_take(ebpo_chunks *chunks, ebpo_array_id id, int level,
                                           uint64_t row, uint64_t rows, size_t size,
                                           void *values_out, ebpo_error *error);

/* Collects the chunks of rows [row, row + rows), as far as the array has them, that are not in
 * memory. Counted chunks are announced otherwise (below): nothing, but while they are collected. */
void ebpo_chunks_expect(ebpo_chunks *chunks, ebpo_expected *expected, ebpo_array_id id, int level,
                        uint64_t row, uint64_t rows);

/* Chunks, each once. What does not fit is left out: then it is read without having been announced.
 * Begin with ebpo_chunk_keys_begin: what is not in use is never cleared. */
enum { EBPO_CHUNK_KEYS = 8192 };
typedef struct ebpo_chunk_keys {
    unsigned count, mask; /* mask + 1 slots */
    uint64_t bytes;       /* that reading them takes of the file */
    uint64_t key[EBPO_CHUNK_KEYS];
    uint16_t slot[2 * EBPO_CHUNK_KEYS]; /* number in `key` + 1; 0: free */
} ebpo_chunk_keys;
void ebpo_chunk_keys_begin(ebpo_chunk_keys *keys);

/* Adds the chunks of rows [row, row + rows), as far as the array has them, that are not in memory;
 * true if there are any. */
bool ebpo_chunks_missing(ebpo_chunks *chunks, ebpo_array_id id, int level, uint64_t row,
                         uint64_t rows, ebpo_chunk_keys *keys);

/* How many bytes may be announced now for later. */
uint64_t ebpo_chunks_room(const ebpo_chunks *chunks);

/* Of counted arrays: whether all of these have been announced, and not been read yet. */
bool ebpo_chunks_announced(const ebpo_chunks *chunks, const ebpo_chunk_keys *keys);
/* Trying out what a reading of counted chunks takes: until this is called with NULL, nothing is
 * read. What is not in memory is added to `keys`, and reading it fails with EBPO_E_LIMIT. */
void ebpo_chunks_collect(ebpo_chunks *chunks, ebpo_chunk_keys *keys);
/* Announces counted chunks, as ebpo_chunks_announce, and reads the first `now`. */
EBPO_MUST_USE ebpo_status ebpo_chunks_fetch(ebpo_chunks *chunks, const ebpo_chunk_keys *keys,
                                            unsigned now, ebpo_error *error);

static inline ebpo_status ebpo_chunks_fail(const ebpo_chunks *chunks, int level, ebpo_array_id id,
                                           const char *what, ebpo_error *error)
{
    ebpo_check check = ebpo_reader_check(chunks->file, NULL);
    return ebpo_check_fail(&check, level, ebpo_schema[id].name, what, error);
}

#endif
