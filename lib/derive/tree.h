/* The trees behind the bounds: that whose envelopes are asked about, and the whole model's, which
 * tells what is solid. */
#ifndef EBPO_DERIVE_TREE_H
#define EBPO_DERIVE_TREE_H

#include <ebpo/query.h>

#include "levels/lod_model.h"
#include "geometry/cursor.h"

/* Reads the whole model of a file that has a mesh and is no subset, else EBPO_E_ABSENT. Freed by
 * ebpo_lod_model_free. */
EBPO_MUST_USE ebpo_status ebpo_tree_read_whole(ebpo_lod_model *out, const ebpo_file *file,
                                               unsigned threads, ebpo_error *error);

/* The node of `cell`; false: there is no such node. */
bool ebpo_tree_find(const ebpo_lod_model *tree, ebpo_cell cell, ebpo_node *out);

/* The same, with the half-spaces of its ancestors in the cell's
 * coordinates, and with `own` those that the file stores for the node. */
bool ebpo_tree_bounds(const ebpo_lod_model *tree, ebpo_cell cell, bool own, ebpo_node *out,
                      ebpo_half_spaces *halves);

/* Adds the half-spaces that ebpo_lod_level derives for a leaf of a file without stored ones. */
EBPO_MUST_USE ebpo_status ebpo_tree_derive(const ebpo_lod_model *tree, const ebpo_node *leaf,
                                           ebpo_leaf_scratch *scratch, ebpo_half_spaces *halves,
                                           ebpo_error *error);

#endif
