/* Until when two models have common points, of which subtrees are loaded as they may matter. One
 * thread. */
#ifndef EBPO_COLLIDE_SUBTREE_WAY_H
#define EBPO_COLLIDE_SUBTREE_WAY_H

#include "extras/collide/way_search.h"

/* Goes on with the search in all pairs of subtrees whose envelopes may part as late as what has
 * been found, the latest first: the same as of whole models. */
EBPO_MUST_USE ebpo_status ebpo_way_of_parts(ebpo_way_search *search, ebpo_error *error);

#endif
