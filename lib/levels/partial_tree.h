/* The part of a tree that has been delivered: groups of siblings, each linked to its parent once it
 * is complete. */
#ifndef EBPO_LEVELS_PARTIAL_TREE_H
#define EBPO_LEVELS_PARTIAL_TREE_H

#include "format/file_nodes.h"
#include "geometry/node_types.h"
#include "levels/stream_node.h"
#include "levels/level_walk.h"

typedef struct ebpo_partial_group {
    uint64_t parent;     /* octcode; 0: the root's group */
    uint64_t first_gray; /* rank in its level of the group's first gray node */
    uint64_t first_code; /* into codes */
    uint32_t child[8];   /* number of the children's group; 0: not there */
    uint16_t types;
    uint8_t plane_count[8];
} ebpo_partial_group;

typedef struct ebpo_partial {
    ebpo_partial_group *group; /* group 0 is the root's */
    uint32_t *codes;
    int32_t (*winding)[8]; /* NULL: not wanted */
    uint64_t group_count, group_capacity, winding_capacity, code_count, code_capacity;
    bool windings;
    /* gray nodes seen of each level; more than the head tells: the file is damaged */
    uint64_t grays[EBPO_LEVELS_MAX];
} ebpo_partial;

void ebpo_partial_free(ebpo_partial *partial);

/* A node by its group and octant. */
typedef struct ebpo_partial_node {
    uint32_t group;
    uint8_t octant;
} ebpo_partial_node;

static inline ebpo_node_type ebpo_partial_type(const ebpo_partial *g, ebpo_partial_node node)
{
    return ebpo_group_type(g->group[node.group].types, node.octant);
}

static inline uint64_t ebpo_partial_octcode(const ebpo_partial *g, ebpo_partial_node node)
{
    uint64_t parent = g->group[node.group].parent;
    return parent ? ebpo_octcode_child(parent, node.octant) : 1;
}

/* The group in which a gray node's children stand, in the next level of the file. */
static inline uint64_t ebpo_partial_children(const ebpo_partial *g, ebpo_partial_node gray)
{
    return g->group[gray.group].first_gray +
           ebpo_group_count(g->group[gray.group].types, EBPO_GRAY, gray.octant);
}

/* Adds a group behind the last one; not linked yet. */
EBPO_MUST_USE ebpo_status ebpo_partial_add(ebpo_partial *partial, const ebpo_info *info,
                                           uint64_t parent, const ebpo_group *read,
                                           ebpo_error *error);

/* A node's own plane codes. */
const uint32_t *ebpo_partial_codes(const ebpo_partial *partial, ebpo_partial_node node,
                                   unsigned *count);

/* Its envelope in coordinates of its cell; the nodes above it are linked. Lent until the next call
 * with these envelopes. */
const ebpo_polytope *ebpo_partial_envelope(const ebpo_partial *partial, ebpo_partial_node node,
                                           ebpo_envelope_stack *envelopes);

#endif
