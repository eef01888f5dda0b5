/* Nodes of the levels right below the cut, with their envelopes and nothing of their faces: a few
 * bytes for each. They tell of subtrees that have never been loaded what their own envelopes do
 * not, as skeletons (query/skeleton.h) tell of those that have. Read at once, when questions have
 * loaded about as much for nothing as reading them takes, so that neither opening nor paths wait
 * for them; of local files only: of others a request more would cost what it saves. Counted with
 * skeletons, and of their room. */
#ifndef EBPO_QUERY_DEEP_BOUNDS_H
#define EBPO_QUERY_DEEP_BOUNDS_H

#include "query/query_node.h"

/* Reads them, unless there is no room, or nothing below the cut. Once; what cannot be read will
 * be told by the questions that come to it. */
void ebpo_deep_bounds_make(ebpo_model *model);

/* A question has loaded so many subtrees of which nothing was known. Makes them when it is time.
 * Any thread. */
void ebpo_deep_bounds_tell(ebpo_model *model, unsigned loaded);

/* A certain lower bound, not less than `lower`, for what is of the solid's surface in the cell of a
 * node of the cut level; what is beyond `limit` is not told apart. Any thread. */
double ebpo_deep_bound(const ebpo_ranking *ranking, const ebpo_node *node, double lower,
                       double limit);

#endif
