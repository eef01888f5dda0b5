/* Envelopes chosen as in the theses, without the limits of files, for comparison (thesis_levels.c):
 * ebpo_build_as_theses. */
#ifndef EBPO_CONSTRUCT_THESIS_LEVELS_H
#define EBPO_CONSTRUCT_THESIS_LEVELS_H

#include "construct/builder.h"
#include "construct/large_polytope.h"
#include "construct/pieces.h"

/* A run of ebpo_build_as_theses: its criterion of leaves, and its results. */
typedef struct ebpo_thesis_run {
    ebpo_coalescing coalesce;
    ebpo_thesis_levels *out;
} ebpo_thesis_run;

/* Returns true when a gray node becomes a leaf by a criterion of the theses. `most` is the greatest
 * number of faces that such a leaf may have. */
bool ebpo_thesis_coalesces(const ebpo_builder *b, const ebpo_branch *s, uint32_t node,
                           uint64_t *most);

/* Chooses planes among all candidates of a node, cuts `own` by them, adds the result to `levels`
 * and makes the data for the parent. Returns false when out of memory. */
bool ebpo_thesis_choose(const ebpo_builder *b, ebpo_large_polytope *own, ebpo_thesis_level *levels,
                        ebpo_cell cell, uint64_t leaf_faces, ebpo_choice *choice,
                        const ebpo_handover *given, ebpo_handover *out);

/* Adds a node without faces. */
void ebpo_thesis_add_empty(const ebpo_builder *b, ebpo_thesis_level *levels, int level,
                           int32_t winding);

/* Adds the sums of a part of the tree to the result. */
void ebpo_thesis_add_up(ebpo_thesis_levels *out, const ebpo_thesis_level *levels);

#endif
