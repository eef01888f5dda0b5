/* Answers from nodes alone, as far as level and deadline allow. */
#ifndef EBPO_QUERY_LIMITED_H
#define EBPO_QUERY_LIMITED_H

#include "query/query_model.h"

/* Point in solid from node to node: with envelopes, to a level, against the clock, or because not
 * everything is in memory. */
EBPO_MUST_USE ebpo_status ebpo_inside_walk(ebpo_context *context, const double p[3],
                                           const ebpo_inside_options *options,
                                           ebpo_inside_result *out, ebpo_error *error);

/* Interval of the distance from the nodes of levels 0 .. options->level. */
EBPO_MUST_USE ebpo_status ebpo_distance_interval(ebpo_context *context, const double p[3],
                                                 const ebpo_distance_options *options, double *lo,
                                                 double *hi, ebpo_error *error);

#endif
