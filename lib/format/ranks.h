/* Ranks: from the nearest row of an index, and counting from there. */
#ifndef EBPO_FORMAT_RANKS_H
#define EBPO_FORMAT_RANKS_H

#include "format/chunks.h"

/* Sum of rows of an unsigned array; EBPO_E_FORMAT when it is beyond 2^62. */
EBPO_MUST_USE ebpo_status ebpo_chunks_sum(ebpo_chunks *chunks, ebpo_array_id id, int level,
                                          uint64_t row, uint64_t rows, uint64_t *sum,
                                          ebpo_error *error);

/* ebpo_groups_count for groups [group, group + groups) of the file. */
EBPO_MUST_USE ebpo_status ebpo_ranks_count_file(ebpo_chunks *chunks, int level, uint64_t group,
                                                uint64_t groups, uint64_t counts[4],
                                                ebpo_error *error);
/* Nodes of each type of a level before a group. */
EBPO_MUST_USE ebpo_status ebpo_ranks_before(ebpo_chunks *chunks, int level, uint64_t group,
                                            uint64_t ranks[4], ebpo_error *error);
/* [rank, rank + count) lies within the level, for each type. */
EBPO_MUST_USE ebpo_status ebpo_ranks_check(const ebpo_chunks *chunks, int level,
                                           const uint64_t ranks[4], const uint64_t counts[4],
                                           ebpo_error *error);
/* Planes of the gray nodes before one. */
EBPO_MUST_USE ebpo_status ebpo_ranks_planes(ebpo_chunks *chunks, int level, uint64_t gray,
                                            uint64_t *planes, ebpo_error *error);
/* End of the new faces of the leaf before one, and references of the leaves before it. */
EBPO_MUST_USE ebpo_status ebpo_ranks_leaf(ebpo_chunks *chunks, int level, uint64_t leaf,
                                          uint64_t *end, uint64_t *refs, ebpo_error *error);

/* Leaf planes of the leaves before one. */
EBPO_MUST_USE ebpo_status ebpo_ranks_leaf_planes(ebpo_chunks *chunks, int level, uint64_t leaf,
                                                 uint64_t *planes, ebpo_error *error);

#endif
