/* Point in solid: pieces that the ways of asking share. */
#ifndef EBPO_QUERY_INSIDE_H
#define EBPO_QUERY_INSIDE_H

#include "query/query_model.h"

/* In a leaf of a subtree, whose cell holds p. */
EBPO_MUST_USE ebpo_status ebpo_inside_leaf(ebpo_context *context, const ebpo_accel *s,
                                           uint32_t number, ebpo_cell cell, const double p[3],
                                           ebpo_inside_result *out, ebpo_error *error);

/* Below a pruned node of the whole tree or of a subtree: an envelope decides, or EBPO_E_ABSENT. */
EBPO_MUST_USE ebpo_status ebpo_inside_pruned(ebpo_context *context, const double p[3],
                                             ebpo_inside_result *out, ebpo_error *error);

/* In a white or black node. */
void ebpo_inside_uniform(const ebpo_context *context, uint32_t entry, ebpo_inside_result *out);

/* In a subtree whose root holds p; `at` is p's cell at the file's deepest level. */
EBPO_MUST_USE ebpo_status ebpo_inside_subtree(ebpo_context *context, const ebpo_accel *s,
                                              const uint32_t at[3], const double p[3],
                                              ebpo_inside_result *out, ebpo_error *error);

/* With the whole tree in memory. */
EBPO_MUST_USE ebpo_status ebpo_inside_whole(ebpo_context *context, const double *points,
                                            uint64_t count, ebpo_inside_result *out,
                                            ebpo_error *error);

#endif
