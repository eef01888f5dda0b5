/* For writing: the list of arrays, the rows and the order of their chunks, and the counts of
 * subtrees. format-spec/README.md, section 9. */
#ifndef EBPO_FORMAT_CHUNK_LAYOUT_H
#define EBPO_FORMAT_CHUNK_LAYOUT_H

#include <ebpo/file.h>

#include "format/schema.h"
#include "hdf5_read/chunk.h"
#include "hdf5_write/h5.h"
#include "mesh/attributes.h"

typedef struct ebpo_subtree_sums {
    uint64_t subtrees;
    uint32_t cols;
    uint64_t *before; /* [subtrees + 1][cols] sums of the columns of /subtrees/counts */
    uint32_t *counts; /* [subtrees][cols] */
    uint64_t *index;  /* [chunks of counts][cols] */
    uint32_t *outer;  /* [outer_count] */
    uint64_t outer_count, outer_capacity;
} ebpo_subtree_sums;

/* The level of the subtrees' roots, given how many faces a subtree should have; 0: none is needed.
 */
int ebpo_subtree_level_for(const ebpo_info *info, uint64_t subtree_faces);

/* `info` is what the file will state, its subtree_level not 0; the tree has been checked. */
EBPO_MUST_USE ebpo_status ebpo_subtree_sums_make(ebpo_subtree_sums *out, const ebpo_tree *tree,
                                                 const ebpo_info *info, ebpo_error *error);
void ebpo_subtree_sums_free(ebpo_subtree_sums *sums);

/* --- the arrays to be written --- */

typedef struct ebpo_array_out {
    ebpo_array_id id;
    int level;
    char path[EBPO_PATH_BYTES];
    ebpo_shape shape; /* before ebpo_stored_shape */
    bool gates;       /* faces, stored across edges */
    /* native integers, row after row; NULL for arrays with a coding of their own */
    const void *values;
    uint8_t value_size;
    ebpo_h5_id handle;
    /* of attributes: whether they are written as columns, and whose rows they have: vertices',
     * faces', or else EBPO_A_ATTRIBUTE */
    bool columns;
    ebpo_array_id rows_of;
} ebpo_array_out;

/* What stands in the head of an array of attributes. */
typedef struct ebpo_attribute_plan {
    bool columns, items_columns, has_range;
    double range[2];
} ebpo_attribute_plan;

typedef struct ebpo_plan {
    const ebpo_tree *tree;
    ebpo_info info; /* as it will be in the file */
    ebpo_array_out *array;
    unsigned count;
    uint64_t *index[EBPO_LEVELS_MAX][EBPO_INDEXES];
    uint64_t *faces_index;             /* vertices seen before each chunk of faces */
    ebpo_subtree_sums subtrees;        /* nothing, if info.subtree_level is 0 */
    const ebpo_attributes *attributes; /* NULL: none are written */
    ebpo_attribute_plan *attribute;    /* [attributes->count] */
    uint8_t attributes_sha256[32];
} ebpo_plan;

/* --- rows of chunks --- */

/* Rows of an array's chunks, all or a power of two; `rows` are those of the array. */
uint32_t ebpo_rows_of_chunk(const ebpo_info *info, ebpo_array_id id, int level, uint64_t rows,
                            uint32_t cols, uint32_t element_size);

/* The same of a file that another program has rewritten: as ebpo_h5_chunk_rows_fn says. The numbers
 * of arrays start anew at chunks, so the right ones have to be found where that program changed
 * them; arrays whose chunks nothing fixes keep theirs if the format takes them. */
uint32_t ebpo_rows_of_foreign_chunk(const char *path, const ebpo_shape *stored, bool subtrees,
                                    bool kept);

/* --- the order of chunks --- */

typedef struct ebpo_ordered_chunk {
    uint32_t array; /* of the plan */
    uint32_t chunk;
    uint64_t subtree; /* of its first row, where chunks are sorted by it */
} ebpo_ordered_chunk;

typedef struct ebpo_chunk_order {
    ebpo_ordered_chunk *chunk; /* [count]; all but /subtrees/places */
    uint64_t count;
    uint64_t top; /* so many are of what looking up a subtree takes */
} ebpo_chunk_order;

EBPO_MUST_USE ebpo_status ebpo_chunk_order_make(ebpo_chunk_order *out, const ebpo_plan *plan,
                                                ebpo_error *error);
void ebpo_chunk_order_free(ebpo_chunk_order *order);

#endif
