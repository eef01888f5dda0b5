/* On which side of the surface a point lies. */
#ifndef EBPO_QUERY_SIGN_H
#define EBPO_QUERY_SIGN_H

#include "query/query_model.h"

/* Makes an answer's distance negative inside: solids, unless unsigned. */
EBPO_MUST_USE ebpo_status ebpo_give_sign(ebpo_context *context, const double p[3],
                                         const ebpo_distance_options *options,
                                         ebpo_distance_result *out, ebpo_error *error);

#endif
