/* One ray through one accel: a filter in single precision, certain in what it says, and exact
 * decisions about the few faces that it leaves. Bounds: docs/develop/bounds.md. */
#ifndef EBPO_QUERY_RAY_SEARCH_H
#define EBPO_QUERY_RAY_SEARCH_H

#include "query/query_kernels.h"

/* Shows `decide` every face that may matter, the most promising first. */
void ebpo_ray_search_accel(ebpo_ray_search *search, const ebpo_kernels *kernels,
                           const ebpo_accel *s);

#endif
