/* Blocks of faces at a pose, as the floats that the filter of pairs takes, with proved errors
 * (docs/develop/collision.md, "From blocks to the filter"). Pure functions, any thread. */
#ifndef EBPO_PAIR_POSED_BLOCK_H
#define EBPO_PAIR_POSED_BLOCK_H

#include <stdbool.h>

#include "pair/pose.h"

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

/* A block, turned, beside the posed coordinates of its first face's first corner. */
typedef struct ebpo_posed_block {
    _Alignas(32) float x[72]; /* as in blocks; lanes without a face are at 0 */
    double base[3];           /* posed coordinates, as defined */
    float error;              /* x + base * unit less the exact one times unit, at most */
    float reach;              /* no |x| is greater */
} ebpo_posed_block;

/* block: [9][8] as in accel.h; lane 0 has a face, lanes without one hold FLT_MAX (or DBL_MAX). The
 * first: p->fits. */
void ebpo_posed_block_make(ebpo_posed_block *out, const ebpo_block_posing *p, const float *block);
void ebpo_posed_block_make_wide(ebpo_posed_block *out, const ebpo_block_posing *p,
                                const double *block);

/* The block as seen from `origin` in the world, for ebpo_pair_kernels; returns its error. */
float ebpo_posed_block_place(const ebpo_posed_block *b, double unit, const double origin[3],
                             float out[72]);

#endif
