/* Files that are subsets: what was left out must not change an answer. */
#ifndef EBPO_QUERY_PRUNED_H
#define EBPO_QUERY_PRUNED_H

#include "query/absent.h"
#include "query/query_node.h"

/* Whether something in the node's cell matters to the question. */
typedef bool (*ebpo_matters_fn)(void *user, const ebpo_box *box, const ebpo_node *node);

/* EBPO_OK when no pruned node matters. `matters` holds for a node when it does for one below it. */
EBPO_MUST_USE ebpo_status ebpo_check_pruned(ebpo_context *context, ebpo_matters_fn matters,
                                            void *user, ebpo_error *error);

#endif
