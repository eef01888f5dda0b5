/* A tree in memory as the verifier sees it (verify_tree.c): children by rank, and the checks of
 * nesting and structure. */
#ifndef EBPO_VERIFY_VERIFY_TREE_H
#define EBPO_VERIFY_VERIFY_TREE_H

#include <ebpo/file.h>

#include "geometry/cells.h"
#include "verify/tally.h"

/* --- finding nodes --- */

/* How many of each thing come before a group of siblings in its level. */
typedef struct ebpo_twin_group {
    uint64_t of_type[4]; /* nodes of each type, by ebpo_node_type */
    uint64_t planes, refs, leaf_planes;
} ebpo_twin_group;

typedef struct ebpo_twin_tree {
    const ebpo_tree *tree; /* borrowed */
    ebpo_box box;
    bool has_mesh, has_planes, has_leaf_planes;
    ebpo_twin_group *groups[EBPO_LEVELS_MAX]; /* [group_count] for each level */
    ebpo_workspace *workspace;                /* owns the groups */
} ebpo_twin_tree;

/* A node. `rank` counts the nodes of its own type that come before it in its level. */
typedef struct ebpo_twin_node {
    ebpo_octcode code;
    ebpo_cell cell;
    uint64_t group;
    unsigned octant;
    ebpo_node_type type;
    uint64_t rank;
} ebpo_twin_node;

/* The tree must have passed ebpo_check_shape as far as level arrays go. `workspace`: what it keeps
 * to, or NULL. Cleared on failure. */
EBPO_MUST_USE ebpo_status ebpo_twin_make(ebpo_twin_tree *out, const ebpo_tree *tree,
                                         ebpo_workspace *workspace, ebpo_error *error);
void ebpo_twin_free(ebpo_twin_tree *view);

static inline ebpo_node_type ebpo_twin_type(const ebpo_level *level, uint64_t group,
                                            unsigned octant)
{
    return (ebpo_node_type)(level->types[group] >> 2 * octant & 3);
}

ebpo_twin_node ebpo_twin_root(const ebpo_twin_tree *view);
/* True for a gray node whose children are not in the file: subsets only. */
bool ebpo_twin_is_pruned(const ebpo_twin_tree *view, const ebpo_twin_node *node);
/* Child of a gray node that is not pruned. */
ebpo_twin_node ebpo_twin_child(const ebpo_twin_tree *view, const ebpo_twin_node *node,
                               unsigned octant);

/* Codes of the node's own planes (gray: the level's planes; leaf: stored leaf planes); NULL and 0
 * when there are none. */
const uint32_t *ebpo_twin_planes(const ebpo_twin_tree *view, const ebpo_twin_node *node,
                                 uint32_t *count);
/* Back-references of a leaf. */
const uint32_t *ebpo_twin_refs(const ebpo_twin_tree *view, const ebpo_twin_node *leaf,
                               uint32_t *count);
/* Winding number that the file gives for the lowest corner of a leaf, or for all of a white or
 * black cell. */
int64_t ebpo_twin_winding(const ebpo_twin_tree *view, const ebpo_twin_node *node);

static inline bool ebpo_twin_inside(const ebpo_twin_tree *view, int64_t winding)
{
    switch (view->tree->info.rule) {
    case EBPO_RULE_EVENODD: return winding & 1;
    case EBPO_RULE_POSITIVE: return winding > 0;
    default: return winding != 0;
    }
}

/* --- nesting: plane codes decode, and coordinates agree from level to level --- */

/* A node's envelope is its own planes and all its ancestors', so it lies in its parent's by
 * definition, as long as a plane means the same in every cell's coordinates: checked in integers on
 * points of sampled cells, with each plane taken down to the cell and the point taken up to the
 * plane. */
void ebpo_check_nesting(ebpo_tally *tally, const ebpo_twin_tree *view);

/* --- structure: the arrays fit together, and the format allows the tree --- */

/* Everything that the other checks rely on to stay within arrays. False when something is wrong:
 * then nothing else can be checked. */
bool ebpo_check_shape(ebpo_tally *tally, const ebpo_tree *tree);

/* The rest: summaries, leaf sizes, order of faces, root box around the vertices, balanced edges of
 * a solid. */
void ebpo_check_structure(ebpo_tally *tally, const ebpo_twin_tree *view);

#endif
