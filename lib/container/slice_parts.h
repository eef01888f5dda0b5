/* What the files of slice.h share: pinned chunks, ranks, and the numbering of what a slice picks
 * out of the file. */
#ifndef EBPO_CONTAINER_SLICE_PARTS_H
#define EBPO_CONTAINER_SLICE_PARTS_H

#include <pthread.h>

#include "container/reader.h"
#include "container/slice.h"

/* --- chunks.c --- */

typedef struct ebpo_chunk_scratch ebpo_chunk_scratch; /* what one loading thread needs */

struct ebpo_chunks {
    const ebpo_file *file;
    ebpo_cache *cache;
    /* [chunks of /mesh/faces] vertices seen before each; NULL: a single chunk, or no mesh */
    uint64_t *seen;
    pthread_mutex_t lock; /* of the scratch that is not in use */
    ebpo_chunk_scratch *idle;
    unsigned idle_count;
    /* Of chunks made by ebpo_chunks_make_counted, which one thread uses at a time. */
    bool counted;
    bool refused;    /* a load has been refused because of the limit */
    uint64_t limit;  /* of the bytes that the file has read, announced ones included */
    uint64_t *ahead; /* [ahead_count] keys that have been announced and not been read yet */
    uint64_t ahead_count, ahead_capacity, ahead_bytes;
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
 * memory. */
void ebpo_chunks_expect(ebpo_chunks *chunks, ebpo_expected *expected, ebpo_array_id id, int level,
                        uint64_t row, uint64_t rows);

/* Chunks, each once. What does not fit is left out: then it is read without having been announced.
 */
enum { EBPO_CHUNK_KEYS = 512 };
typedef struct ebpo_chunk_keys {
    unsigned count;
    uint64_t key[EBPO_CHUNK_KEYS];
} ebpo_chunk_keys;

/* Adds the chunks of rows [row, row + rows), as far as the array has them, that are not in memory;
 * true if there are any. */
bool ebpo_chunks_missing(ebpo_chunks *chunks, ebpo_array_id id, int level, uint64_t row,
                         uint64_t rows, ebpo_chunk_keys *keys);
/* Announces chunks of counted arrays to the source, as far as the limit allows: from then on they
 * count as read. The first `now` are needed at once; the others only as far as what has been
 * announced and not been read stays small, also beside what the limit leaves. */
void ebpo_chunks_announce(ebpo_chunks *chunks, const uint64_t *keys, unsigned now, unsigned count);

/* Sum of rows of an unsigned array; EBPO_E_FORMAT when it is beyond 2^62. */
EBPO_MUST_USE ebpo_status ebpo_chunks_sum(ebpo_chunks *chunks, ebpo_array_id id, int level,
                                          uint64_t row, uint64_t rows, uint64_t *sum,
                                          ebpo_error *error);

static inline ebpo_status ebpo_chunks_fail(const ebpo_chunks *chunks, int level, ebpo_array_id id,
                                           const char *what, ebpo_error *error)
{
    ebpo_check check = ebpo_reader_check(chunks->file, NULL);
    return ebpo_check_fail(&check, level, ebpo_schema[id].name, what, error);
}

/* --- ranks.c: from the nearest row of an index, and counting from there --- */

/* ebpo_groups_count for groups [group, group + groups) of the file. */
EBPO_MUST_USE ebpo_status ebpo_ranks_count_file(ebpo_chunks *chunks, int level, uint64_t group,
                                                uint64_t groups, uint64_t counts[4],
                                                ebpo_error *error);
/* Nodes of each type of a level before a group. */
EBPO_MUST_USE ebpo_status ebpo_ranks_before(ebpo_chunks *chunks, int level, uint64_t group,
                                            uint64_t ranks[4], ebpo_error *error);
/* [rank, rank + count) lies within the level, for each type. */
EBPO_MUST_USE ebpo_status ebpo_ranks_check(const ebpo_chunks *chunks, int level,
                                           const uint64_t ranks[4], const uint64_t counts[4],
                                           ebpo_error *error);
/* Planes of the gray nodes before one. */
EBPO_MUST_USE ebpo_status ebpo_ranks_planes(ebpo_chunks *chunks, int level, uint64_t gray,
                                            uint64_t *planes, ebpo_error *error);
/* End of the new faces of the leaf before one, and references of the leaves before it. */
EBPO_MUST_USE ebpo_status ebpo_ranks_leaf(ebpo_chunks *chunks, int level, uint64_t leaf,
                                          uint64_t *end, uint64_t *refs, ebpo_error *error);

/* Leaf planes of the leaves before one. */
EBPO_MUST_USE ebpo_status ebpo_ranks_leaf_planes(ebpo_chunks *chunks, int level, uint64_t leaf,
                                                 uint64_t *planes, ebpo_error *error);

/* A node that the file has, as far as the head tells; else EBPO_E_ARGUMENT. */
EBPO_MUST_USE ebpo_status ebpo_chunks_check_node(const ebpo_chunks *chunks, const ebpo_node *node,
                                                 ebpo_error *error);

/* --- compact.c: different numbers, sorted, and the place of each --- */

typedef struct ebpo_compact {
    /* open addressing, at most half full; number UINT32_MAX: free */
    struct {
        uint32_t number, place;
    } * slot;
    uint64_t mask;
    uint32_t *sorted; /* [count] */
    uint64_t count;
} ebpo_compact;

/* For at most `room` calls of add. Numbers are below 2^32 - 1. */
EBPO_MUST_USE ebpo_status ebpo_compact_make(ebpo_compact *out, uint64_t room, ebpo_error *error);
void ebpo_compact_free(ebpo_compact *compact);
void ebpo_compact_add(ebpo_compact *compact, uint32_t number);
/* After the last add: sorts. */
EBPO_MUST_USE ebpo_status ebpo_compact_sort(ebpo_compact *compact, ebpo_error *error);
/* Place of a number that was added. */
uint32_t ebpo_compact_find(const ebpo_compact *compact, uint32_t number);

/* --- slice_faces.c --- */

/* From levels with numbers of the file, and first_face and face_count: everything else, and local
 * numbers in the levels. */
EBPO_MUST_USE ebpo_status ebpo_slice_take_faces(ebpo_slice *slice, ebpo_chunks *chunks,
                                                ebpo_error *error);

#endif
