/* Point in solid: pieces that the ways of asking share. */
#ifndef EBPO_QUERY_INSIDE_H
#define EBPO_QUERY_INSIDE_H

#include "query/query_model.h"

/* In a leaf of a subtree and of this level, whose cell holds p, which is at `place`. */
EBPO_MUST_USE ebpo_status ebpo_inside_leaf(ebpo_context *context, const ebpo_accel *s,
                                           uint32_t number, int level, const ebpo_position *place,
                                           const double p[3], ebpo_inside_result *out,
                                           ebpo_error *error);

/* Below a pruned node of the whole tree or of a subtree: an envelope decides, or EBPO_E_ABSENT. */
EBPO_MUST_USE ebpo_status ebpo_inside_pruned(ebpo_context *context, const double p[3],
                                             ebpo_inside_result *out, ebpo_error *error);

/* In a white or black node. */
void ebpo_inside_uniform(const ebpo_context *context, uint32_t entry, ebpo_inside_result *out);

/* In a subtree whose root holds p, which is at `place`. */
EBPO_MUST_USE ebpo_status ebpo_inside_subtree(ebpo_context *context, const ebpo_accel *s,
                                              const ebpo_position *place, const double p[3],
                                              ebpo_inside_result *out, ebpo_error *error);

/* With the whole tree in memory. */
EBPO_MUST_USE ebpo_status ebpo_inside_whole(ebpo_context *context, const double *points,
                                            uint64_t count, ebpo_inside_result *out,
                                            ebpo_error *error);

#endif
