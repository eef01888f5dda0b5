/* Faces that may be deep in a solid, found by the cells of their octree. One thread. */
#ifndef EBPO_COLLIDE_DEPTH_CELLS_H
#define EBPO_COLLIDE_DEPTH_CELLS_H

#include "extras/collide/depth_parts.h"

/* Offers all faces that may matter, which wait then. As ebpo_depth_search_run. */
EBPO_MUST_USE ebpo_status ebpo_depth_offer_cells(ebpo_depth_search *search, ebpo_error *error);

#endif
