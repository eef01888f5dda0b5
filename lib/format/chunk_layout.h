/* Layout of a file to write: the list of arrays, the rows and order of their chunks, and the counts
 * of subtrees. format-spec/subtrees.md. */
#ifndef EBPO_FORMAT_CHUNK_LAYOUT_H
#define EBPO_FORMAT_CHUNK_LAYOUT_H

#include <ebpo/file.h>

#include "format/schema.h"
#include "hdf5_read/chunk.h"
#include "hdf5_write/h5.h"
#include "mesh/attributes.h"

typedef struct ebpo_subtree_checksums {
    uint64_t subtrees;
    uint32_t cols;
    uint64_t *before; /* [subtrees + 1][cols] sums of the columns of /subtrees/counts */
    uint32_t *counts; /* [subtrees][cols] */
    uint64_t *index;  /* [chunks of counts][cols] */
    uint32_t *outer;  /* [shared_count] */
    uint64_t shared_count, shared_capacity;
} ebpo_subtree_checksums;

/* Returns the level of the subtrees' roots for a desired number of faces in a subtree; 0 if no
 * subtrees are needed. */
int ebpo_subtree_level_for(const ebpo_info *info, uint64_t subtree_faces);

/* Computes the counts of the subtrees and their sums. `info` is the information that the file will
 * state; its subtree_level is not 0. The caller has checked the tree. */
EBPO_MUST_USE ebpo_status ebpo_subtree_checksums_make(ebpo_subtree_checksums *out,
                                                      const ebpo_tree *tree, const ebpo_info *info,
                                                      ebpo_error *error);
void ebpo_subtree_checksums_free(ebpo_subtree_checksums *checksums);

/* --- arrays to write --- */

typedef struct ebpo_array_out {
    ebpo_array_id id;
    int level;
    char path[EBPO_PATH_BYTES];
    ebpo_shape shape; /* before ebpo_stored_shape */
    bool gates;       /* faces, stored as gates across edges */
    /* native integers, row by row; NULL for arrays with a special coding */
    const void *values;
    uint8_t value_size;
    ebpo_h5_id handle;
    bool columns; /* for attributes: true if written as columns */
    /* for attributes: the array that has the same rows (vertices or faces), or EBPO_A_ATTRIBUTE */
    ebpo_array_id rows_of;
} ebpo_array_out;

/* Head of an attribute array. */
typedef struct ebpo_attribute_plan {
    bool columns, items_columns, has_range;
    double range[2];
} ebpo_attribute_plan;

typedef struct ebpo_plan {
    const ebpo_tree *tree;
    ebpo_info info; /* as stated in the file */
    ebpo_array_out *array;
    unsigned count;
    uint64_t *index[EBPO_LEVELS_MAX][EBPO_INDEXES];
    uint64_t *faces_index;             /* vertices seen before each chunk of faces */
    ebpo_subtree_checksums subtrees;   /* empty if info.subtree_level is 0 */
    const ebpo_attributes *attributes; /* NULL: no attributes */
    ebpo_attribute_plan *attribute;    /* [attributes->count] */
    uint8_t attributes_sha256[32];
} ebpo_plan;

/* --- rows of chunks --- */

/* Returns the number of rows in each chunk of an array: all rows, or a power of two. `rows` is the
 * number of rows of the array. */
uint32_t ebpo_rows_of_chunk(const ebpo_info *info, ebpo_array_id id, int level, uint64_t rows,
                            uint32_t cols, uint32_t element_size);

/* Returns the number of rows in each chunk for a file that another program has rewritten, as
 * described at ebpo_h5_chunk_rows_fn. Codes restart at chunks, so the original number must be found
 * if that program changed it. Arrays whose chunk size is not fixed keep their chunk size if the
 * format allows it. */
uint32_t ebpo_rows_of_foreign_chunk(const char *path, const ebpo_shape *stored, bool subtrees,
                                    bool kept);

/* --- the order of chunks --- */

typedef struct ebpo_ordered_chunk {
    uint32_t array; /* index in the plan */
    uint32_t chunk;
    uint64_t subtree; /* subtree of the chunk's first row, if chunks are sorted by subtree */
} ebpo_ordered_chunk;

typedef struct ebpo_chunk_order {
    ebpo_ordered_chunk *chunk; /* [count]; all except /subtrees/chunk_directory */
    uint64_t count;
    uint64_t top; /* number of chunks needed to look up a subtree */
} ebpo_chunk_order;

EBPO_MUST_USE ebpo_status ebpo_chunk_order_make(ebpo_chunk_order *out, const ebpo_plan *plan,
                                                ebpo_error *error);
void ebpo_chunk_order_free(ebpo_chunk_order *order);

#endif
