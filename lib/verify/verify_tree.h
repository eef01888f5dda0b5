/* A tree in memory as the verifier sees it (verify_tree.c): children by rank, and the checks of
 * nesting and structure. */
#ifndef EBPO_VERIFY_VERIFY_TREE_H
#define EBPO_VERIFY_VERIFY_TREE_H

#include <ebpo/file.h>

#include "geometry/cells.h"
#include "verify/tally.h"

/* --- finding nodes --- */

/* Counts before a group of siblings in its level. */
typedef struct ebpo_reference_group {
    uint64_t of_type[4]; /* nodes of each type, by ebpo_node_type */
    uint64_t planes, refs, leaf_planes;
} ebpo_reference_group;

typedef struct ebpo_reference_tree {
    const ebpo_tree *tree; /* borrowed */
    ebpo_box box;
    bool has_mesh, has_planes, has_leaf_planes;
    ebpo_reference_group *groups[EBPO_LEVELS_MAX]; /* [group_count] for each level */
    ebpo_workspace *workspace;                     /* quota of the groups */
} ebpo_reference_tree;

/* A node. `rank` counts the nodes of its type before it in its level. */
typedef struct ebpo_reference_node {
    ebpo_octcode code;
    ebpo_cell cell;
    uint64_t group;
    unsigned octant;
    ebpo_node_type type;
    uint64_t rank;
} ebpo_reference_node;

/* Makes the view. The level arrays of the tree must have passed ebpo_check_shape. `workspace` is
 * the quota of the view, or NULL. The view is cleared on failure. */
EBPO_MUST_USE ebpo_status ebpo_reference_make(ebpo_reference_tree *out, const ebpo_tree *tree,
                                              ebpo_workspace *workspace, ebpo_error *error);
void ebpo_reference_free(ebpo_reference_tree *view);

static inline ebpo_node_type ebpo_reference_type(const ebpo_level *level, uint64_t group,
                                                 unsigned octant)
{
    return (ebpo_node_type)(level->types[group] >> 2 * octant & 3);
}

ebpo_reference_node ebpo_reference_root(const ebpo_reference_tree *view);
/* Returns true for a gray node whose children are not in the file: subsets only. */
bool ebpo_reference_is_pruned(const ebpo_reference_tree *view, const ebpo_reference_node *node);
/* Returns a child of a gray node that is not pruned. */
ebpo_reference_node ebpo_reference_child(const ebpo_reference_tree *view,
                                         const ebpo_reference_node *node, unsigned octant);

/* Returns codes of the node's own planes (gray: the level's planes; leaf: stored leaf planes); NULL
 * and 0 when there are none. */
const uint32_t *ebpo_reference_planes(const ebpo_reference_tree *view,
                                      const ebpo_reference_node *node, uint32_t *count);
/* Returns the back-references of a leaf. */
const uint32_t *ebpo_reference_refs(const ebpo_reference_tree *view,
                                    const ebpo_reference_node *leaf, uint32_t *count);
/* Returns the stored winding number of the lowest corner of a leaf, or of all of a white or black
 * cell. */
int64_t ebpo_reference_winding(const ebpo_reference_tree *view, const ebpo_reference_node *node);

static inline bool ebpo_reference_inside(const ebpo_reference_tree *view, int64_t winding)
{
    switch (view->tree->info.rule) {
    case EBPO_RULE_EVENODD: return winding & 1;
    case EBPO_RULE_POSITIVE: return winding > 0;
    default: return winding != 0;
    }
}

/* --- nesting: plane codes decode, and coordinates agree from level to level --- */

/* Checks nesting: a plane must mean the same in every cell's coordinates (verify_tree.c). */
void ebpo_check_nesting(ebpo_tally *tally, const ebpo_reference_tree *view);

/* --- structure: the arrays fit together, and the format allows the tree --- */

/* Checks everything that the other checks need to stay within arrays. Returns false after a
 * violation: then nothing else can be checked. */
bool ebpo_check_shape(ebpo_tally *tally, const ebpo_tree *tree);

/* Checks the rest: summaries, leaf sizes, order of faces, root box around the vertices, balanced
 * edges of a solid. */
void ebpo_check_structure(ebpo_tally *tally, const ebpo_reference_tree *view);

#endif
