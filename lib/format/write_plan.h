/* Plans a file to write: lists the file's arrays with their shapes, and encodes the rows of these
 * arrays. */
#ifndef EBPO_FORMAT_WRITE_PLAN_H
#define EBPO_FORMAT_WRITE_PLAN_H

#include <ebpo/file.h>

#include "format/chunk_layout.h"

/* Checks the tree (EBPO_E_ARGUMENT) and lists its arrays. The caller keeps the tree, which must
 * outlive the plan. */
EBPO_MUST_USE ebpo_status ebpo_plan_make(ebpo_plan *plan, const ebpo_tree *tree,
                                         const ebpo_write_options *options, const char *shown,
                                         ebpo_error *error);
void ebpo_plan_free(ebpo_plan *plan);

/* Encodes rows [row, row + rows) of an array, as stored before compression. `row` is a multiple of
 * the array's chunk_rows; `rows` is at most chunk_rows. */
void ebpo_plan_encode(const ebpo_plan *plan, const ebpo_array_out *array, uint64_t row,
                      uint64_t rows, uint8_t *encoded);

/* Return the rows of an index array: sums of counts before each EBPO_INDEX_ROWS-th item. With these
 * sums, a reader can start in the middle of a level. A reader of a whole level also computes these
 * sums and compares them with the sums in the file. The result has at least one row, and the caller
 * frees it. Return NULL when out of memory. */
uint64_t *ebpo_index_types(const ebpo_level *level, bool root);
uint64_t *ebpo_index_gray(const ebpo_level *level);
uint64_t *ebpo_index_leaves(const ebpo_level *level);

/* Write the HDF5 attributes of the group /attributes, and of the arrays in this group except
 * `about`. */
EBPO_MUST_USE ebpo_status ebpo_attributes_put_group(ebpo_h5_out *out, const ebpo_plan *plan,
                                                    ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_attributes_put_array(ebpo_h5_out *out, const ebpo_plan *plan,
                                                    const ebpo_array_out *array, ebpo_error *error);

#endif
