/* Reads ranges of arrays through a cache of decoded chunks. A chunk is the unit of compression in
 * HDF5. Values that are read are checked: wrong values in a file give EBPO_E_FORMAT, never an index
 * out of range. Any thread may call these functions. */
#ifndef EBPO_FORMAT_CHUNKS_H
#define EBPO_FORMAT_CHUNKS_H

#include <pthread.h>

#include "core/cache.h"
#include "format/reader.h"

/* Cache of decoded chunks under a budget (0: no limit; the smallest usable budget is a few MiB). */
typedef struct ebpo_chunks ebpo_chunks;
EBPO_MUST_USE ebpo_status ebpo_chunks_make(ebpo_chunks **out, const ebpo_file *file,
                                           uint64_t budget, ebpo_error *error);
/* Creates a cache that shares the budget of `pool` with other caches. */
EBPO_MUST_USE ebpo_status ebpo_chunks_make_in(ebpo_chunks **out, const ebpo_file *file,
                                              ebpo_cache_pool *pool, ebpo_error *error);
/* Creates a counted cache, for one thread at a time. A counted cache counts the bytes that it reads
 * from the file, and reads and prefetches only requested data. ebpo_chunks_limit sets the maximum
 * of these bytes; a new cache has no limit. A read beyond the limit returns EBPO_E_LIMIT, and
 * ebpo_chunks_refused then returns true. */
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
    pthread_mutex_t lock;        /* protects `rows` */
    struct ebpo_kept_rows *rows; /* recently used rows of the table of subtrees, or NULL */
    /* state of a counted cache (ebpo_chunks_make_counted), which one thread uses at a time */
    bool counted;
    bool refused;    /* a load was refused because of the limit */
    uint64_t limit;  /* maximum number of bytes read from the file, including prefetched bytes */
    uint64_t *ahead; /* [ahead_count] keys of chunks that are prefetched and not yet read */
    uint64_t ahead_count, ahead_capacity;
    uint64_t ahead_bytes;               /* stored bytes of the chunks in `ahead` */
    struct ebpo_chunk_keys *collecting; /* set by ebpo_chunks_collect; NULL: chunks are read */
};

/* A position in an array, for one thread. At most one chunk is pinned: it stays in the cache while
 * its rows are needed. Initialise with { .array = ... }, end with ebpo_held_chunk_release. */
typedef struct ebpo_held_chunk {
    const ebpo_array_in *array;
    uint64_t key;        /* key of the pinned chunk in the cache */
    uint64_t begin, end; /* row range of the pinned chunk */
    /* rows of the pinned chunk; NULL: no chunk is pinned. Faces: three uint32_t corners. Vertices:
     * three floats or doubles. Source indices: uint32_t. Other arrays: integers as in the file */
    const uint8_t *rows;
} ebpo_held_chunk;

/* Pins the chunk of a row. Use ebpo_held_chunk_move, which calls this function only if the row is
 * not in the pinned chunk. */
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

/* Adds to `hints` the chunks that are not in memory and contain existing rows of
 * [row, row + rows). Returns true if chunks were added. Adds nothing to `hints` for a counted
 * cache, whose callers prefetch with ebpo_chunks_missing and ebpo_chunks_fetch. If chunks are being
 * collected (ebpo_chunks_collect), adds these chunks to the collected keys. */
bool ebpo_chunks_hint(ebpo_chunks *chunks, ebpo_hints *hints, ebpo_array_id id, int level,
                      uint64_t row, uint64_t rows);

/* Set of chunk keys. A key identifies a chunk in the cache. Keys beyond EBPO_CHUNK_KEYS are
 * omitted, and their chunks are later read without a prefetch hint. Initialise a set with
 * ebpo_chunk_keys_begin, which clears only the members that are used first (the struct is large).
 */
enum { EBPO_CHUNK_KEYS = 8192 };
typedef struct ebpo_chunk_keys {
    unsigned count, mask; /* mask + 1 slots */
    uint64_t bytes;       /* bytes of the file to read for these chunks */
    uint64_t key[EBPO_CHUNK_KEYS];
    uint16_t slot[2 * EBPO_CHUNK_KEYS]; /* index in `key` + 1; 0: free */
} ebpo_chunk_keys;
void ebpo_chunk_keys_begin(ebpo_chunk_keys *keys);

/* Adds to `keys` the chunks that are not in memory and contain existing rows of [row, row + rows).
 * Returns true if there are such chunks. */
bool ebpo_chunks_missing(ebpo_chunks *chunks, ebpo_array_id id, int level, uint64_t row,
                         uint64_t rows, ebpo_chunk_keys *keys);

/* Returns the number of bytes that a counted cache may prefetch now for later use. */
uint64_t ebpo_chunks_capacity(const ebpo_chunks *chunks);

/* Returns true if all chunks of `keys` in this counted cache are prefetched and not yet read. */
bool ebpo_chunks_hinted(const ebpo_chunks *chunks, const ebpo_chunk_keys *keys);
/* Collects in `keys` the chunks that an operation on a counted cache needs, until this function is
 * called with NULL. Meanwhile the cache reads nothing: a read of a chunk that is not in memory adds
 * the chunk to `keys` and returns EBPO_E_LIMIT. */
void ebpo_chunks_collect(ebpo_chunks *chunks, ebpo_chunk_keys *keys);
/* Sends prefetch hints for the chunks of `keys` of a counted cache, and reads the first `now` of
 * these chunks. */
EBPO_MUST_USE ebpo_status ebpo_chunks_fetch(ebpo_chunks *chunks, const ebpo_chunk_keys *keys,
                                            unsigned now, ebpo_error *error);

/* Reports a wrong array, as ebpo_check_fail does. */
static inline ebpo_status ebpo_chunks_fail(const ebpo_chunks *chunks, int level, ebpo_array_id id,
                                           const char *what, ebpo_error *error)
{
    ebpo_check check = ebpo_reader_check(chunks->file, NULL);
    return ebpo_check_fail(&check, level, ebpo_schema[id].name, what, error);
}

#endif
