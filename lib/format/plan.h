/* What is about to be written: the list of arrays, and how each one's rows become bytes. */
#ifndef EBPO_FORMAT_PLAN_H
#define EBPO_FORMAT_PLAN_H

#include "format/planned.h"

/* Checks the tree (EBPO_E_ARGUMENT) and lists its arrays. The tree stays the caller's and must
 * outlive the plan. */
EBPO_MUST_USE ebpo_status ebpo_plan_make(ebpo_plan *plan, const ebpo_tree *tree,
                                         const ebpo_write_options *options, const char *shown,
                                         ebpo_error *error);
void ebpo_plan_free(ebpo_plan *plan);

/* Rows [row, row + rows) of an array, as stored before compression; row is a multiple of the
 * chunk's rows, rows at most that many. */
void ebpo_plan_encode(const ebpo_plan *plan, const ebpo_array_out *array, uint64_t row,
                      uint64_t rows, uint8_t *file);

#endif
