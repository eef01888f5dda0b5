/* The nearest face of a model: all of it, or subtree by subtree, the nearest first. */
#ifndef EBPO_QUERY_NEAREST_FIRST_H
#define EBPO_QUERY_NEAREST_FIRST_H

#include "query/nearest.h"

/* Nodes of the top and subtrees are come to in the order of certain lower bounds of their distance,
 * until the next is beyond what has been found: a subtree is searched, and loaded if need be, only
 * if its bound is at most the answer, whatever else is in memory. Under a deadline, the first bound
 * that was not come to is what was passed over. */
EBPO_MUST_USE ebpo_status ebpo_nearest_first(ebpo_context *context, ebpo_nearest *search,
                                             ebpo_error *error);

#endif
