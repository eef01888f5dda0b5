/* How deep the surface of one model is in a solid: branch and bound over its octree, then its faces
 * and parts of these. Bounds: docs/develop/collision.md, "Depth". One thread. */
#ifndef EBPO_COLLIDE_DEPTH_SEARCH_H
#define EBPO_COLLIDE_DEPTH_SEARCH_H

#include "extras/collide/depth_parts.h"

/* EBPO_E_MEMORY, EBPO_E_CANCELLED, and those of ebpo_distance. */
EBPO_MUST_USE ebpo_status ebpo_depth_search_run(ebpo_depth_search *search, ebpo_error *error);

#endif
