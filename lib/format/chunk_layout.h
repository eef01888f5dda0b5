/* Computes the layout of a file to write: the list of arrays, the number of rows in their chunks,
 * the order of the chunks, and the counts of subtrees. format-spec/subtrees.md. */
#ifndef EBPO_FORMAT_CHUNK_LAYOUT_H
#define EBPO_FORMAT_CHUNK_LAYOUT_H

#include <ebpo/file.h>

#include "format/schema.h"
#include "hdf5_read/chunk.h"
#include "hdf5_write/h5.h"
#include "mesh/attributes.h"

/* Counts of the items of each subtree, and prefix sums of these counts. The columns are those of
 * /subtrees/counts: EBPO_S_... and ebpo_subtree_column (schema.h). */
typedef struct ebpo_subtree_sums {
    uint64_t subtrees; /* number of subtrees */
    uint32_t cols;     /* number of columns */
    uint64_t *before;  /* [subtrees + 1][cols] sums of the columns before each subtree */
    uint32_t *counts;  /* [subtrees][cols] rows of /subtrees/counts */
    uint64_t *index;   /* [chunks][cols] sums before each chunk of /subtrees/counts */
    uint32_t *shared;  /* [shared_count] rows of /subtrees/shared_chunks */
    uint64_t shared_count, shared_capacity;
} ebpo_subtree_sums;

/* Returns the level of the subtrees' roots for a requested number of faces in a subtree. Returns 0
 * if the file is to be written without subtrees. `subtree_faces`: as in ebpo_write_options. */
int ebpo_subtree_level_for(const ebpo_info *info, uint64_t subtree_faces);

/* Computes the counts of the subtrees and the sums of these counts. `info`: as in the file to
 * write; its subtree_level is not 0. The caller has checked the tree. */
EBPO_MUST_USE ebpo_status ebpo_subtree_sums_make(ebpo_subtree_sums *out, const ebpo_tree *tree,
                                                 const ebpo_info *info, ebpo_error *error);
void ebpo_subtree_sums_free(ebpo_subtree_sums *sums);

/* --- arrays to write --- */

typedef struct ebpo_array_out {
    ebpo_array_id id;
    int level;
    char path[EBPO_PATH_BYTES];
    ebpo_shape shape; /* shape of the values; ebpo_stored_shape returns the shape in the file */
    /* true: the array has faces that are stored as gates (EBPO_GATES_CODING of schema.h) */
    bool gates;
    /* native integers, row by row; NULL for arrays with a special coding */
    const void *values;
    uint8_t value_size;
    ebpo_h5_id handle; /* HDF5 handle of the array, while the file is written */
    bool columns;      /* for attributes: true if written column after column */
    /* for attributes of vertices or faces: array of the mesh with the same number of rows
     * (EBPO_A_VERTICES or EBPO_A_FACES); EBPO_A_ATTRIBUTE for other attributes */
    ebpo_array_id rows_of;
} ebpo_array_out;

/* Properties of an attribute array that its HDF5 attributes state. */
typedef struct ebpo_attribute_plan {
    bool columns;       /* the values are written column after column */
    bool items_columns; /* the items of the lists are written column after column */
    bool has_range;
    double range[2]; /* least and greatest value */
} ebpo_attribute_plan;

/* A file to write (write_plan.h). */
typedef struct ebpo_plan {
    const ebpo_tree *tree;
    ebpo_info info;        /* the values that the file states */
    ebpo_array_out *array; /* [count] the arrays of the file */
    unsigned count;
    uint64_t *index[EBPO_LEVELS_MAX][EBPO_INDEXES]; /* the index arrays of each level */
    uint64_t *faces_index;             /* number of vertices that the faces before each chunk use */
    ebpo_subtree_sums subtrees;        /* empty if info.subtree_level is 0 */
    const ebpo_attributes *attributes; /* NULL: no attributes */
    ebpo_attribute_plan *attribute;    /* [attributes->count] plan of each attribute array */
    uint8_t attributes_sha256[32];
} ebpo_plan;

/* --- rows of chunks --- */

/* Returns the number of rows in each chunk of an array: `rows` (a single chunk), or a power of two.
 * `rows`: number of rows of the array. */
uint32_t ebpo_rows_of_chunk(const ebpo_info *info, ebpo_array_id id, int level, uint64_t rows,
                            uint32_t cols, uint32_t element_size);

/* Returns the number of rows that each chunk of an array had before another program rewrote the
 * file with other chunks (callback ebpo_h5_chunk_rows_fn of hdf5_write/h5.h). Codes restart at each
 * chunk, so the values can only be decoded with the original number of rows. `subtrees`: true if
 * the file has a table of subtrees. `kept`: if true, an array keeps its current chunk size if the
 * format allows several chunk sizes, including this size. */
uint32_t ebpo_rows_of_foreign_chunk(const char *path, const ebpo_shape *stored, bool subtrees,
                                    bool kept);

/* --- the order of chunks --- */

typedef struct ebpo_ordered_chunk {
    uint32_t array; /* index in the plan */
    uint32_t chunk;
    uint64_t subtree; /* subtree of the chunk's first row, if chunks are sorted by subtree */
} ebpo_ordered_chunk;

typedef struct ebpo_chunk_order {
    /* [count] all chunks except the two lists of all chunks (chunk_directory.h) */
    ebpo_ordered_chunk *chunk;
    uint64_t count;
    uint64_t top; /* the first `top` chunks are needed to locate a subtree */
} ebpo_chunk_order;

/* Computes the order in which the chunks are written. */
EBPO_MUST_USE ebpo_status ebpo_chunk_order_make(ebpo_chunk_order *out, const ebpo_plan *plan,
                                                ebpo_error *error);
void ebpo_chunk_order_free(ebpo_chunk_order *order);

#endif
