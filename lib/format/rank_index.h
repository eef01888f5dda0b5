/* Prefix sums that let a reader start in the middle of a level. */
#ifndef EBPO_FORMAT_RANK_INDEX_H
#define EBPO_FORMAT_RANK_INDEX_H

#include <ebpo/file.h>

/* Index arrays (also what readers compare against), one row for each EBPO_INDEX_ROWS items, at
 * least one; NULL when memory is short. */
uint64_t *ebpo_index_types(const ebpo_level *level, bool root);
uint64_t *ebpo_index_gray(const ebpo_level *level);
uint64_t *ebpo_index_leaves(const ebpo_level *level);

#endif
