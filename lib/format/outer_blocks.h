/* For writing: the chunks of faces and vertices that a subtree shares with those before it. One
 * subtree after the other. */
#ifndef EBPO_FORMAT_OUTER_BLOCKS_H
#define EBPO_FORMAT_OUTER_BLOCKS_H

#include <ebpo/file.h>

/* A subtree's own: faces [face, face_end), vertices from `vertex` on. */
typedef struct ebpo_outer_range {
    uint64_t face, face_end, vertex;
} ebpo_outer_range;

typedef struct ebpo_outer_blocks {
    /* [blocks of the mesh] the round in which a block was last listed */
    uint32_t *face_round, *vertex_round;
    uint32_t round;
    uint32_t *face_block, *vertex_block; /* [blocks of the mesh] those listed */
    uint64_t face_blocks, vertex_blocks;
} ebpo_outer_blocks;

EBPO_MUST_USE ebpo_status ebpo_outer_blocks_make(ebpo_outer_blocks *out, const ebpo_info *info,
                                                 ebpo_error *error);
void ebpo_outer_blocks_free(ebpo_outer_blocks *blocks);

/* Faces that its leaves refer to, own ones among them; and all its own faces. */
void ebpo_outer_blocks_refer(ebpo_outer_blocks *blocks, const ebpo_mesh *mesh,
                             const ebpo_outer_range *own, const uint32_t *refs, uint64_t count);
void ebpo_outer_blocks_use(ebpo_outer_blocks *blocks, const ebpo_mesh *mesh,
                           const ebpo_outer_range *own);

/* Distances into `out`, faces first; adds how many there are to the sums before the subtree. Then
 * the lists are empty. */
void ebpo_outer_blocks_take(ebpo_outer_blocks *blocks, const ebpo_outer_range *own, uint32_t *out,
                            const uint64_t *before, uint64_t *after);

#endif
