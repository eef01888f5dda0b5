/* Ranks in one level of a tree in memory: where a group's nodes, a node's planes and a leaf's
 * references begin. Prefix sums, so that nodes can be gone to in any order. */
#ifndef EBPO_GEOMETRY_LEVEL_RANKS_H
#define EBPO_GEOMETRY_LEVEL_RANKS_H

#include "geometry/node_types.h"

typedef struct ebpo_level_ranks {
    /* [group_count] by type: such nodes in the groups before; of white and of black nodes only
     * where the level has their winding numbers, else NULL */
    uint64_t *before[4];
    uint64_t *plane_first;      /* [gray_count] */
    uint64_t *leaf_plane_first; /* [leaf_count], NULL without stored leaf planes */
    uint64_t *ref_first;        /* [leaf_count], NULL without face lists */
} ebpo_level_ranks;

/* EBPO_E_FORMAT when the level's counts contradict each other. On failure nothing is left to free.
 * `number` is for messages. */
EBPO_MUST_USE ebpo_status ebpo_level_ranks_make(ebpo_level_ranks *out, const ebpo_level *level,
                                                int number, ebpo_error *error);
void ebpo_level_ranks_free(ebpo_level_ranks *ranks);

#endif
