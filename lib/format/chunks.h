/* Reads ranges of arrays through a cache of decoded chunks. Results are checked: untrusted input
 * gives EBPO_E_FORMAT, never an index out of range. Any thread may call these functions. */
#ifndef EBPO_FORMAT_CHUNKS_H
#define EBPO_FORMAT_CHUNKS_H

#include <pthread.h>

#include "core/cache.h"
#include "format/reader.h"

/* Cache of decoded chunks under a budget (0: no limit; the smallest usable budget is a few MiB). */
typedef struct ebpo_chunks ebpo_chunks;
EBPO_MUST_USE ebpo_status ebpo_chunks_make(ebpo_chunks **out, const ebpo_file *file,
                                           uint64_t budget, ebpo_error *error);
/* Creates a cache under a shared budget. */
EBPO_MUST_USE ebpo_status ebpo_chunks_make_in(ebpo_chunks **out, const ebpo_file *file,
                                              ebpo_cache_pool *pool, ebpo_error *error);
/* Creates a counted cache for one thread at a time. The cache reads and prefetches only requested
 * data. ebpo_chunks_limit sets the maximum number of bytes read from the file; a new cache has no
 * limit. A read beyond the limit returns EBPO_E_LIMIT, and ebpo_chunks_refused then returns true.
 */
EBPO_MUST_USE ebpo_status ebpo_chunks_make_counted(ebpo_chunks **out, const ebpo_file *file,
                                                   uint64_t budget, ebpo_error *error);
void ebpo_chunks_limit(ebpo_chunks *chunks, uint64_t bytes);
bool ebpo_chunks_refused(const ebpo_chunks *chunks);
void ebpo_chunks_free(ebpo_chunks *chunks);
void ebpo_chunks_get_stats(ebpo_chunks *chunks, ebpo_cache_stats *out);

/* Reads rows [row, row + rows) of a plain integer array that is present, each value widened to
 * `size` bytes. Returns EBPO_E_ARGUMENT for rows beyond the array's end. */
EBPO_MUST_USE ebpo_status ebpo_chunks_integers(ebpo_chunks *chunks, ebpo_array_id id, int level,
                                               uint64_t row, uint64_t rows, void *values,
                                               size_t size, ebpo_error *error);

/* --- inside lib/format --- */

struct ebpo_chunks {
    const ebpo_file *file;
    ebpo_cache *cache;
    /* [chunks of /mesh/faces] number of vertices that the faces before each chunk use;
     * NULL: a single chunk, or no mesh */
    uint64_t *vertices_before;
    pthread_mutex_t lock;        /* guards `rows` */
    struct ebpo_kept_rows *rows; /* recently used rows of the table of subtrees, or NULL */
    /* State of counted chunks (ebpo_chunks_make_counted), which one thread uses at a time. */
    bool counted;
    bool refused;    /* a load was refused because of the limit */
    uint64_t limit;  /* maximum number of bytes read from the file, including prefetched bytes */
    uint64_t *ahead; /* [ahead_count] keys that are prefetched and not yet read */
    uint64_t ahead_count, ahead_capacity;
    uint64_t ahead_bytes;               /* stored bytes of these chunks */
    struct ebpo_chunk_keys *collecting; /* set by ebpo_chunks_collect; NULL: chunks are read */
};

/* A position in an array, with at most one chunk pinned while its rows are needed. Initialise with
 * { .array = ... }, end with ebpo_held_chunk_release. One thread. */
typedef struct ebpo_held_chunk {
    const ebpo_array_in *array;
    uint64_t key;
    uint64_t begin, end; /* row range of the pinned chunk */
    /* NULL: no chunk is pinned. Integers as in the file; faces as u32 corners, vertices as floats
     * or doubles, source indices as u32 */
    const uint8_t *rows;
} ebpo_held_chunk;

/* Pins the chunk of a row, as ebpo_held_chunk_move does when the row is in another chunk. */
EBPO_MUST_USE ebpo_status ebpo_held_chunk_load(ebpo_chunks *chunks, ebpo_held_chunk *view,
                                               uint64_t row, ebpo_error *error);
void ebpo_held_chunk_release(ebpo_chunks *chunks, ebpo_held_chunk *view);

/* Pins the chunk that contains row `row`, which must exist. A call is cheap while the rows stay in
 * one chunk. */
EBPO_MUST_USE static inline ebpo_status ebpo_held_chunk_move(ebpo_chunks *chunks,
                                                             ebpo_held_chunk *view, uint64_t row,
                                                             ebpo_error *error)
{
    return row >= view->begin && row < view->end ? EBPO_OK
                                                 : ebpo_held_chunk_load(chunks, view, row, error);
}

/* Same as ebpo_chunks_integers, but allocates the memory, which the caller frees. `values_out` is
 * the address of the pointer; the pointer is NULL for 0 rows. */
EBPO_MUST_USE ebpo_status ebpo_chunks_take(ebpo_chunks *chunks, ebpo_array_id id, int level,
                                           uint64_t row, uint64_t rows, size_t size,
                                           void *values_out, ebpo_error *error);

/* Adds the chunks of existing rows in [row, row + rows) that are not in memory to `hints`. In a
 * counted cache, adds the chunks only to the keys of ebpo_chunks_collect, if any, and not to
 * `hints`; callers of a counted cache use the functions below. */
void ebpo_chunks_hint(ebpo_chunks *chunks, ebpo_hints *hints, ebpo_array_id id, int level,
                      uint64_t row, uint64_t rows);

/* Set of chunk keys. Chunks that do not fit are omitted, and later read without a prefetch hint.
 * Initialise a set with ebpo_chunk_keys_begin, which clears only the parts that it uses. */
enum { EBPO_CHUNK_KEYS = 8192 };
typedef struct ebpo_chunk_keys {
    unsigned count, mask; /* mask + 1 slots */
    uint64_t bytes;       /* bytes of the file to read for these chunks */
    uint64_t key[EBPO_CHUNK_KEYS];
    uint16_t slot[2 * EBPO_CHUNK_KEYS]; /* index in `key` + 1; 0: free */
} ebpo_chunk_keys;
void ebpo_chunk_keys_begin(ebpo_chunk_keys *keys);

/* Adds the chunks of existing rows in [row, row + rows) that are not in memory to `keys`. Returns
 * true if there are such chunks. */
bool ebpo_chunks_missing(ebpo_chunks *chunks, ebpo_array_id id, int level, uint64_t row,
                         uint64_t rows, ebpo_chunk_keys *keys);

/* Returns the number of bytes that a counted cache may prefetch now for later use. */
uint64_t ebpo_chunks_capacity(const ebpo_chunks *chunks);

/* Returns true if all of these counted chunks are prefetched and not yet read. */
bool ebpo_chunks_hinted(const ebpo_chunks *chunks, const ebpo_chunk_keys *keys);
/* Starts collecting the counted chunks that an operation needs. Until the call with NULL, nothing
 * is read: a chunk that is not in memory is added to `keys`, and its read returns EBPO_E_LIMIT. */
void ebpo_chunks_collect(ebpo_chunks *chunks, ebpo_chunk_keys *keys);
/* Sends prefetch hints for counted chunks and reads the first `now` chunks of `keys`. */
EBPO_MUST_USE ebpo_status ebpo_chunks_fetch(ebpo_chunks *chunks, const ebpo_chunk_keys *keys,
                                            unsigned now, ebpo_error *error);

static inline ebpo_status ebpo_chunks_fail(const ebpo_chunks *chunks, int level, ebpo_array_id id,
                                           const char *what, ebpo_error *error)
{
    ebpo_check check = ebpo_reader_check(chunks->file, NULL);
    return ebpo_check_fail(&check, level, ebpo_schema[id].name, what, error);
}

#endif
