/* Ranks of one level: where a group's nodes, a node's planes and a leaf's references start. Prefix
 * sums, so that subtrees can be walked independently of each other. */
#ifndef EBPO_LOD_INDEX_H
#define EBPO_LOD_INDEX_H

#include <ebpo/file.h>

typedef struct ebpo_lod_index {
    uint64_t *gray_before, *leaf_before; /* [group_count] nodes of that type in the groups before */
    uint64_t *plane_first;               /* [gray_count] */
    uint64_t *leaf_plane_first;          /* [leaf_count], NULL without stored leaf planes */
    uint64_t *ref_first;                 /* [leaf_count], NULL without face lists */
} ebpo_lod_index;

/* EBPO_E_FORMAT when the level's counts contradict each other. On failure nothing is left to free.
 * `number` is for messages. */
EBPO_MUST_USE ebpo_status ebpo_lod_index_make(ebpo_lod_index *out, const ebpo_level *level,
                                              int number, ebpo_error *error);
void ebpo_lod_index_free(ebpo_lod_index *index);

#endif
