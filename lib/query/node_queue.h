/* A context's queue of nodes to be come to: the nearest first, of equal ones that with the least
 * entry. */
#ifndef EBPO_QUERY_NODE_QUEUE_H
#define EBPO_QUERY_NODE_QUEUE_H

#include "query/query_node.h"

EBPO_MUST_USE ebpo_status ebpo_queue_push(ebpo_context *context, const ebpo_ranked *item,
                                          ebpo_error *error);
/* Of a queue that is not empty. */
ebpo_ranked ebpo_queue_pop(ebpo_context *context);

#endif
