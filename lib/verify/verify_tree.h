/* Finds the nodes of a tree in memory, and checks nesting and structure. This implementation is
 * separate from the library's other code for trees, because the verifier checks the results of that
 * code. */
#ifndef EBPO_VERIFY_VERIFY_TREE_H
#define EBPO_VERIFY_VERIFY_TREE_H

#include <ebpo/file.h>

#include "geometry/cells.h"
#include "verify/tally.h"

/* --- finding nodes --- */

/* The numbers of items of a level that precede a group of siblings. */
typedef struct ebpo_reference_group {
    uint64_t of_type[4]; /* nodes of each ebpo_node_type */
    uint64_t planes, refs, leaf_planes;
} ebpo_reference_group;

/* A view of a tree: the tree, and data to find nodes by rank (the number of a node among the nodes
 * of its level and type). */
typedef struct ebpo_reference_tree {
    const ebpo_tree *tree; /* borrowed from the caller */
    ebpo_box box;
    bool has_mesh, has_planes, has_leaf_planes;
    ebpo_reference_group *groups[EBPO_LEVELS_MAX]; /* [group_count] for each level */
    ebpo_workspace *workspace;                     /* `groups` is allocated here; or NULL */
} ebpo_reference_tree;

/* A node. */
typedef struct ebpo_reference_node {
    ebpo_octcode code;
    ebpo_cell cell;
    uint64_t group;  /* index, in its level, of its group of siblings */
    unsigned octant; /* position in this group */
    ebpo_node_type type;
    uint64_t rank;
} ebpo_reference_node;

/* Creates a view of a tree. The tree must have passed ebpo_check_shape, and must outlive the view.
 * Memory is allocated from `workspace`, or from the heap if `workspace` is NULL. On failure, the
 * view is set to zeros. */
EBPO_MUST_USE ebpo_status ebpo_reference_make(ebpo_reference_tree *out, const ebpo_tree *tree,
                                              ebpo_workspace *workspace, ebpo_error *error);
void ebpo_reference_free(ebpo_reference_tree *view);

static inline ebpo_node_type ebpo_reference_type(const ebpo_level *level, uint64_t group,
                                                 unsigned octant)
{
    return (ebpo_node_type)(level->types[group] >> 2 * octant & 3);
}

ebpo_reference_node ebpo_reference_root(const ebpo_reference_tree *view);
/* Returns true for a gray node whose children are not in the file. Only subsets have such nodes. */
bool ebpo_reference_is_pruned(const ebpo_reference_tree *view, const ebpo_reference_node *node);
/* Returns a child of a gray node that is not pruned. */
ebpo_reference_node ebpo_reference_child(const ebpo_reference_tree *view,
                                         const ebpo_reference_node *node, unsigned octant);

/* Returns the codes of the planes stored for a node: the planes that a gray node adds to its
 * parent's envelope, or the leaf planes of a leaf. If there are none, returns NULL and sets *count
 * to 0. */
const uint32_t *ebpo_reference_planes(const ebpo_reference_tree *view,
                                      const ebpo_reference_node *node, uint32_t *count);
/* Returns the references of a leaf (the faces in its list that an earlier leaf also lists), and
 * sets *count to their number. */
const uint32_t *ebpo_reference_refs(const ebpo_reference_tree *view,
                                    const ebpo_reference_node *leaf, uint32_t *count);
/* Returns the winding number that is stored for a leaf (at its lowest corner) or a white or black
 * node (in the whole cell). */
int64_t ebpo_reference_winding(const ebpo_reference_tree *view, const ebpo_reference_node *node);

/* Returns true if points with this winding number are inside by the file's rule. */
static inline bool ebpo_reference_inside(const ebpo_reference_tree *view, int64_t winding)
{
    switch (view->tree->info.rule) {
    case EBPO_RULE_EVENODD: return winding & 1;
    case EBPO_RULE_POSITIVE: return winding > 0;
    default: return winding != 0;
    }
}

/* --- nesting --- */

/* Checks that plane codes are valid, and that a plane is the same in the coordinates of its cell
 * and in the coordinates of sampled cells below. */
void ebpo_check_nesting(ebpo_tally *tally, const ebpo_reference_tree *view);

/* --- structure: the arrays are consistent, and the format allows the tree --- */

/* Checks that the arrays are consistent, so that other checks do not read beyond their ends.
 * Returns false after a violation; the caller must then run no other checks. */
bool ebpo_check_shape(ebpo_tally *tally, const ebpo_tree *tree);

/* Checks the level summaries, the sizes of leaves and the order of faces. Checks that the root box
 * contains the vertices, and that the faces of a solid use each edge equally often in both
 * directions. */
void ebpo_check_structure(ebpo_tally *tally, const ebpo_reference_tree *view);

#endif
