/* Rays through a model: conservative on the way down, exact at the faces. */
#ifndef EBPO_QUERY_RAY_WALK_H
#define EBPO_QUERY_RAY_WALK_H

#include "query/ray_hits.h"

/* Shows the casting every face that may matter to it. The ray is one that makes sense. */
EBPO_MUST_USE ebpo_status ebpo_ray_walk(ebpo_casting *casting, ebpo_error *error);

#endif
