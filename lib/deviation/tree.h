/* The trees behind the bounds: that whose envelopes are asked about, and the whole model's, which
 * tells what is solid. */
#ifndef EBPO_DEVIATION_TREE_H
#define EBPO_DEVIATION_TREE_H

#include <ebpo/query.h>

#include "lod/lod_model.h"

/* A node's place in its level. */
typedef struct ebpo_tree_node {
    ebpo_cell cell;
    ebpo_node_type type;
    uint64_t rank; /* among the level's nodes of its type */
} ebpo_tree_node;

/* A half-space in the coordinates of a cell: 4096 (n . xi) <= d, exactly. */
typedef struct ebpo_half {
    int32_t n[3];
    int64_t d;
} ebpo_half;

enum { EBPO_HALVES_MAX = EBPO_LEVELS_MAX * 256 }; /* plane counts are bytes */

/* What bounds a node's envelope beside its cell; half-spaces that keep the whole cell are left out.
 */
typedef struct ebpo_halves {
    int count;
    ebpo_half half[EBPO_HALVES_MAX];
} ebpo_halves;

/* Reads the whole model of a file that has a mesh and is no subset, else EBPO_E_ABSENT. Freed by
 * ebpo_lod_model_free. */
EBPO_MUST_USE ebpo_status ebpo_tree_read_whole(ebpo_lod_model *out, ebpo_file *file,
                                               unsigned threads, ebpo_error *error);

/* Goes down to the node of `cell`, which is there, and sets out->type and rank. `halves` (may be
 * NULL) receives the half-spaces of its ancestors in the cell's coordinates, and with `own` those
 * that the file stores for the node. `planes` false: as if there were none in the file. False:
 * there is no such node. */
bool ebpo_tree_find(const ebpo_lod_model *tree, ebpo_cell cell, bool planes, bool own,
                    ebpo_tree_node *out, ebpo_halves *halves);

/* Child of a gray node that has a next level. */
ebpo_tree_node ebpo_tree_child(const ebpo_lod_model *tree, const ebpo_tree_node *gray,
                               unsigned octant);

/* True when the gray node has no children in its file. */
bool ebpo_tree_is_pruned(const ebpo_lod_model *tree, const ebpo_tree_node *gray);

/* Adds the half-spaces that ebpo_lod_level derives for a leaf of a file without stored ones. */
EBPO_MUST_USE ebpo_status ebpo_tree_derive(const ebpo_lod_model *tree, const ebpo_tree_node *leaf,
                                           ebpo_leaf_scratch *scratch, ebpo_halves *halves,
                                           ebpo_error *error);

/* The cell cut by the half-spaces, each moved outwards by `slack` (in the units of n / 511, about
 * cells). */
void ebpo_halves_cut(const ebpo_halves *halves, double slack, ebpo_polytope *out);

#endif
