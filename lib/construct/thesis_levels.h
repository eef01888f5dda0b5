/* Computes envelopes as in the theses (EBP 2017, BP 2008), without the limits of files. Only
 * ebpo_build_as_theses uses this code, for comparisons. */
#ifndef EBPO_CONSTRUCT_THESIS_LEVELS_H
#define EBPO_CONSTRUCT_THESIS_LEVELS_H

#include "construct/builder.h"
#include "construct/large_polytope.h"
#include "construct/pieces.h"

/* A call of ebpo_build_as_theses: the criterion that decides which nodes become leaves, and the
 * results. */
typedef struct ebpo_thesis_run {
    ebpo_coalescing coalesce;
    ebpo_thesis_levels *out;
} ebpo_thesis_run;

/* Returns true if a gray node becomes a leaf by the criterion b->thesis->coalesce. Then sets
 * *faces_max to the greatest number of faces that this leaf may have. */
bool ebpo_thesis_coalesces(const ebpo_builder *b, const ebpo_branch *s, uint32_t node,
                           uint64_t *faces_max);

/* Chooses planes among all candidates of a node, cuts the cell by these planes, adds the counts and
 * the volume to `levels`, and adds the data for the parent to `out`. `given`: the offers from which
 * the candidates were made. `envelope`: work space. `leaf_faces`: number of faces of a leaf; 0 for
 * a gray node. Returns false when out of memory. */
bool ebpo_thesis_choose(const ebpo_builder *b, ebpo_large_polytope *envelope,
                        ebpo_thesis_level *levels, ebpo_cell cell, uint64_t leaf_faces,
                        ebpo_choice *choice, const ebpo_handover *given, ebpo_handover *out);

/* Adds a node without faces to the sums of its level if the node is black. `winding`: winding
 * number at its lowest corner. */
void ebpo_thesis_add_empty(const ebpo_builder *b, ebpo_thesis_level *levels, int level,
                           int32_t winding);

/* Adds `levels`, the sums of a part of the tree, to `out`, the sums of the whole tree. */
void ebpo_thesis_add_up(ebpo_thesis_levels *out, const ebpo_thesis_level *levels);

#endif
