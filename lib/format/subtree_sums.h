/* For writing: where each subtree begins in every array, and which chunks from elsewhere it needs.
 * format-spec/README.md, section 9. */
#ifndef EBPO_FORMAT_SUBTREE_SUMS_H
#define EBPO_FORMAT_SUBTREE_SUMS_H

#include <ebpo/file.h>

#include "format/schema.h"

typedef struct ebpo_subtree_sums {
    uint64_t subtrees;
    uint32_t cols;
    uint64_t *before; /* [subtrees + 1][cols] sums of the columns of /subtrees/counts */
    uint32_t *counts; /* [subtrees][cols] */
    uint64_t *index;  /* [chunks of counts][cols] */
    uint32_t *outer;  /* [outer_count] */
    uint64_t outer_count, outer_capacity;
} ebpo_subtree_sums;

/* The level of the subtrees' roots, given how many faces a subtree should have; 0: none is needed.
 */
int ebpo_subtree_level_for(const ebpo_info *info, uint64_t subtree_faces);

/* `info` is what the file will state, its subtree_level not 0; the tree has been checked. */
EBPO_MUST_USE ebpo_status ebpo_subtree_sums_make(ebpo_subtree_sums *out, const ebpo_tree *tree,
                                                 const ebpo_info *info, ebpo_error *error);
void ebpo_subtree_sums_free(ebpo_subtree_sums *sums);

/* The subtree that a row of an array belongs to: arrays of levels below the roots, the mesh, the
 * maps. Rows before the first subtree belong to it. */
uint64_t ebpo_subtree_of_row(const ebpo_subtree_sums *sums, const ebpo_info *info, ebpo_array_id id,
                             int level, uint64_t row);

#endif
