/* What a cursor asks of that which holds nodes: levels in memory, a file, the tables of a decoded
 * tree, a model that loads subtrees as they are needed. */
#ifndef EBPO_GEOMETRY_NODE_SOURCE_H
#define EBPO_GEOMETRY_NODE_SOURCE_H

#include "geometry/node.h"

enum { EBPO_NODE_PLANES = 255 }; /* counts of planes are bytes */

typedef struct ebpo_node_source {
    /* The eight children of a gray node. Where there are none in this holder, the node is marked as
     * pruned instead. What the holder learns about the node is noted in it as well, so that it need
     * not be found a second time. */
    ebpo_status (*children)(void *holder, ebpo_node *gray, ebpo_node child[8], ebpo_error *error);
    /* Codes of the planes that a gray node adds to its parent's envelope; other nodes have none,
     * but leaves where levels store theirs. */
    ebpo_status (*planes)(void *holder, const ebpo_node *node, uint32_t codes[EBPO_NODE_PLANES],
                          unsigned *count, ebpo_error *error);
    /* Winding number in a white or black node of a solid. */
    ebpo_status (*winding)(void *holder, const ebpo_node *uniform, int32_t *winding,
                           ebpo_error *error);
} ebpo_node_source;

#endif
