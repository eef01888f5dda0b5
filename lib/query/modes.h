/* The distances of EBP 2017, section 4.4, which are not always the minimum. */
#ifndef EBPO_QUERY_MODES_H
#define EBPO_QUERY_MODES_H

#include "query/query_model.h"

/* Of the leaf around p; where there is none: nothing (LEAVES), or of all leaves below the deepest
 * gray node around p (RECURSIVE). */
EBPO_MUST_USE ebpo_status ebpo_distance_around(ebpo_context *context, const double p[3],
                                               const ebpo_distance_options *options,
                                               ebpo_distance_result *out, ebpo_error *error);
/* To the polygons of the envelope of the deepest gray node around p, at most at options->level. */
EBPO_MUST_USE ebpo_status ebpo_distance_to_envelope(ebpo_context *context, const double p[3],
                                                    const ebpo_distance_options *options,
                                                    ebpo_distance_result *out, ebpo_error *error);

#endif
