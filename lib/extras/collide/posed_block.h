/* Blocks of faces at a pose, as the floats that the filter of pairs takes, with proved errors
 * (docs/develop/collision.md, "From blocks to the filter"). Pure functions, any thread. */
#ifndef EBPO_COLLIDE_POSED_BLOCK_H
#define EBPO_COLLIDE_POSED_BLOCK_H

#include <stdbool.h>

#include "geometry/pose.h"
#include "query/accel.h"

/* A pose made ready for blocks. */
typedef struct ebpo_block_posing {
    ebpo_posing posing;
    double unit;        /* a power of two: floats are world coordinates times it */
    float matrix[3][3]; /* the posing's times unit */
    float size;         /* no row of the matrix is longer */
    float doubt;        /* what posed coordinates are off from exact motions, times unit */
    bool fits;          /* in floats; else only blocks of doubles are */
} ebpo_block_posing;

/* The unit for two models whose posed coordinates are at most `reach` in size: it brings them below
 * 2^30. reach <= 2^1000. */
double ebpo_block_unit(double reach);

/* reach: as for ebpo_block_unit, the same for both models of a pair. */
void ebpo_block_posing_make(ebpo_block_posing *out, const ebpo_posing *posing, double reach);

/* At most: eight faces without a vertex in common. */
enum { EBPO_POSED_VERTICES = 24 };

/* A block's vertices, turned, beside the posed coordinates of its first one. */
typedef struct ebpo_posed_block {
    _Alignas(32) float x[3][EBPO_POSED_VERTICES]; /* 0 from `vertices` on */
    double base[3];                               /* posed coordinates, as defined */
    unsigned vertices;
    float error; /* x + base * unit less the exact one times unit, at most */
    float reach; /* no |x| is greater */
} ebpo_posed_block;

/* Of vertices whose 1-norms, seen from the first one, are at most `most`. */
static inline float ebpo_posed_block_reach(const ebpo_block_posing *p, float most)
{
    return p->size * most * (1 + 0x1p-20f);
}
static inline float ebpo_posed_block_error(const ebpo_block_posing *p, float reach)
{
    return 6 * 0x1p-24f * reach + p->doubt;
}

/* vertex: [3][vertices], all x, all y, all z, as blocks have them; 1 to 24 of them. The first:
 * p->fits. */
void ebpo_posed_block_make(ebpo_posed_block *out, const ebpo_block_posing *p, const float *vertex,
                           unsigned vertices);
void ebpo_posed_block_make_wide(ebpo_posed_block *out, const ebpo_block_posing *p,
                                const double *vertex, unsigned vertices);

/* The vertices as seen from `origin` in the world, from which a block's corners pick the faces that
 * ebpo_pair_kernels take; returns their error. */
float ebpo_posed_block_place(const ebpo_posed_block *b, double unit, const double origin[3],
                             float out[3][EBPO_POSED_VERTICES]);

/* How two models' frames lie to each other at their poses: what boxes and slabs of one are seen as
 * from the other, in floats. Pure functions, any thread. */

/* y = x * unit, x in the accel's frame; the other model's y is turn y + shift. */
typedef struct ebpo_turned_frame {
    float unit, turn[3][3], turn_size[3][3], shift[3];
    float in_world[3][3]; /* a direction of the world is in_world^T of it in the frame */
} ebpo_turned_frame;

/* Lengths are those of the world times ebpo_block_posing's unit, the same for both. */
typedef struct ebpo_two_frames {
    ebpo_turned_frame frame[2];
    /* On each axis of either frame, gaps of boxes may be so much less than they are computed: what
     * floats lose (docs/develop/collision.md, "Bounds of pairs of nodes"), what poses are off from
     * motions, and posed coordinates from exact ones. */
    float slack;
} ebpo_two_frames;

/* The posings have been made with one reach. */
void ebpo_two_frames_make(ebpo_two_frames *out, const ebpo_accel *const accel[2],
                          const ebpo_block_posing posing[2]);

#endif
