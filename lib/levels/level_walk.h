/* Walking the nodes of one level in octcode order, down from the root through the levels kept.
 * Within a level, depth-first order visits groups, nodes of each type, and planes in the order in
 * which they are stored: so running counts do, and no table of sums is needed. */
#ifndef EBPO_LEVELS_LEVEL_WALK_H
#define EBPO_LEVELS_LEVEL_WALK_H

#include <ebpo/file.h>

#include "geometry/envelope_stack.h"

typedef struct ebpo_level_walk_node {
    ebpo_octcode octcode;
    ebpo_node_type type;
    uint64_t rank;         /* among the nodes of its type in the level */
    const uint32_t *codes; /* its own planes */
    unsigned code_count;
} ebpo_level_walk_node;

typedef struct ebpo_level_walk {
    /* [target + 1] lent; of those above the target only types, plane counts and planes are used */
    const ebpo_level *level;
    int target, depth;
    bool pruned; /* the file is a subset: empty groups hold no nodes */
    struct {
        uint64_t group, rank[4], plane, leaf_plane; /* so many were passed in this level */
        unsigned octant;                            /* next one of the group */
        /* the node last passed: in levels above `depth` the ancestor */
        ebpo_level_walk_node node;
    } at[EBPO_LEVELS_MAX];
} ebpo_level_walk;

void ebpo_level_walk_begin(ebpo_level_walk *walk, const ebpo_level *level, int target, bool pruned);
/* The next node of the target level; false after the last. */
bool ebpo_level_walk_next(ebpo_level_walk *walk, ebpo_level_walk_node *out);

/* Envelope of the node that ebpo_level_walk_next gave last, in coordinates of its cell; gray nodes
 * and leaves: from the cube down, cut by the planes of all ancestors and its own. Black nodes: the
 * cube. Lent until the next call with these envelopes. */
const ebpo_polytope *ebpo_level_walk_envelope(const ebpo_level_walk *walk,
                                              const ebpo_level_walk_node *node,
                                              ebpo_envelope_stack *envelopes);

#endif
