/* The nodes of levels in memory, from the root down to some level. */
#ifndef EBPO_GEOMETRY_LEVEL_NODES_H
#define EBPO_GEOMETRY_LEVEL_NODES_H

#include "geometry/level_ranks.h"
#include "geometry/node.h"
#include "geometry/node_source.h"

/* Lent; gray nodes without children in these levels are pruned ones, those of the last level all
 * are. */
typedef struct ebpo_level_nodes {
    const ebpo_level *level;       /* [level_count] */
    const ebpo_level_ranks *ranks; /* [level_count] */
    int level_count;
} ebpo_level_nodes;

ebpo_node ebpo_level_root(const ebpo_level_nodes *nodes);

/* Child of a gray node that is not pruned. Of white and black nodes the rank is known only where
 * their winding numbers are stored. */
ebpo_node ebpo_level_child(const ebpo_level_nodes *nodes, const ebpo_node *gray, unsigned octant);

/* Codes of the planes that a gray node adds, or that are stored for a leaf. */
const uint32_t *ebpo_level_planes(const ebpo_level_nodes *nodes, const ebpo_node *node,
                                  unsigned *count);

/* Winding number of a white or black node; of a leaf: that at its lowest corner. Solids only. */
int32_t ebpo_level_winding(const ebpo_level_nodes *nodes, const ebpo_node *node);

/* For cursors; the holder is an ebpo_level_nodes. */
extern const ebpo_node_source ebpo_level_source;

#endif
