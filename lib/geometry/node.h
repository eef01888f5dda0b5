/* A node of an octree, by where it stands: what every holder of nodes (levels in memory, a file,
 * the tables of a decoded tree) gives and takes. A value: copy it, keep it, put it in a queue. */
#ifndef EBPO_GEOMETRY_NODE_H
#define EBPO_GEOMETRY_NODE_H

#include <ebpo/file.h>

#include "geometry/cells.h"
#include "geometry/node_types.h"

typedef struct ebpo_node {
    ebpo_cell cell;
    ebpo_node_type type;
    bool pruned; /* gray, and known to have no children in what holds it */
    /* How its holder finds it. */
    union {
        uint64_t rank;  /* in levels and files: among the nodes of its type in its level */
        uint32_t entry; /* in tables: see node_table.h */
    };
    /* in a model whose subtrees are loaded on demand: that in which the node stands; else NULL */
    const struct ebpo_accel *subtree;
} ebpo_node;

/* White or black: no face touches it, and all of it is on one side. */
static inline bool ebpo_node_is_uniform(const ebpo_node *node)
{
    return node->type == EBPO_WHITE || node->type == EBPO_BLACK;
}

/* A gray node's child: its types as the group of its children gives them, and the rank of the
 * group's first node of each type in the next level. */
static inline ebpo_node ebpo_node_child(const ebpo_node *gray, unsigned octant, uint16_t types,
                                        const uint64_t ranks[4])
{
    ebpo_node_type type = ebpo_group_type(types, octant);
    return (ebpo_node){ .cell = ebpo_cell_child(gray->cell, octant),
                        .type = type,
                        .rank = ranks[type] + ebpo_group_count(types, type, octant) };
}

#endif
