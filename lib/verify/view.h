/* Finding one's way in a tree held in memory: children by rank, and the counts that ranks rest on.
 */
#ifndef EBPO_VERIFY_VIEW_H
#define EBPO_VERIFY_VIEW_H

#include <ebpo/file.h>

#include "geom/cell.h"
#include "morton/octcode.h"

/* How many of each thing come before a group of siblings in its level. */
typedef struct ebpo_view_group {
    uint64_t of_type[4]; /* nodes of each type, by ebpo_node_type */
    uint64_t planes, refs, leaf_planes;
} ebpo_view_group;

typedef struct ebpo_tree_view {
    const ebpo_tree *tree; /* borrowed */
    ebpo_box box;
    bool has_mesh, has_planes, has_leaf_planes;
    ebpo_view_group *groups[EBPO_LEVELS_MAX]; /* [group_count] for each level */
} ebpo_tree_view;

/* A node. `rank` counts the nodes of its own type that come before it in its level. */
typedef struct ebpo_tree_view_node {
    ebpo_octcode code;
    ebpo_cell cell;
    uint64_t group;
    unsigned octant;
    ebpo_node_type type;
    uint64_t rank;
} ebpo_tree_view_node;

/* The tree must have passed ebpo_check_shape as far as level arrays go. `workspace`: what it keeps
 * to, or NULL. Cleared on failure. */
EBPO_MUST_USE ebpo_status ebpo_view_make(ebpo_tree_view *out, const ebpo_tree *tree,
                                         ebpo_workspace *workspace, ebpo_error *error);
void ebpo_view_free(ebpo_tree_view *view);

static inline ebpo_node_type ebpo_view_type(const ebpo_level *level, uint64_t group,
                                            unsigned octant)
{
    return (ebpo_node_type)(level->types[group] >> 2 * octant & 3);
}

ebpo_tree_view_node ebpo_view_root(const ebpo_tree_view *view);
/* True for a gray node whose children are not in the file: subsets only. */
bool ebpo_view_is_pruned(const ebpo_tree_view *view, const ebpo_tree_view_node *node);
/* Child of a gray node that is not pruned. */
ebpo_tree_view_node ebpo_view_child(const ebpo_tree_view *view, const ebpo_tree_view_node *node,
                                    unsigned octant);
/* The node at a place of a level; climbs to the root to find its cell. */
ebpo_tree_view_node ebpo_view_at(const ebpo_tree_view *view, int level, uint64_t group,
                                 unsigned octant);

/* Codes of the node's own planes (gray: the level's planes; leaf: stored leaf planes); NULL and 0
 * when there are none. */
const uint32_t *ebpo_view_planes(const ebpo_tree_view *view, const ebpo_tree_view_node *node,
                                 uint32_t *count);
/* Back-references of a leaf. */
const uint32_t *ebpo_view_refs(const ebpo_tree_view *view, const ebpo_tree_view_node *leaf,
                               uint32_t *count);
/* Winding number that the file gives for the lowest corner of a leaf, or for all of a white or
 * black cell. */
int64_t ebpo_view_winding(const ebpo_tree_view *view, const ebpo_tree_view_node *node);

static inline bool ebpo_view_inside(const ebpo_tree_view *view, int64_t winding)
{
    switch (view->tree->info.rule) {
    case EBPO_RULE_EVENODD: return winding & 1;
    case EBPO_RULE_POSITIVE: return winding > 0;
    default: return winding != 0;
    }
}

#endif
