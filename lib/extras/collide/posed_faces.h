/* A block's faces as the kernels of pairs take them. One thread. */
#ifndef EBPO_COLLIDE_POSED_FACES_H
#define EBPO_COLLIDE_POSED_FACES_H

#include "query/accel.h"
#include "extras/collide/posed_block.h"

/* Eight faces, seen from `base`. */
typedef struct ebpo_posed_faces {
    _Alignas(32) float x[9][8]; /* 3 corner + axis */
    double base[3];             /* posed coordinates of the block's first vertex */
    float error, reach;         /* as in ebpo_posed_block */
    uint32_t block;             /* EBPO_NO_CHILD: none is here */
    uint8_t lanes;
} ebpo_posed_faces;

/* Of each model so many are kept. */
enum { EBPO_POSED_FACES = 32 };

static inline void ebpo_posed_faces_forget(ebpo_posed_faces faces[2][EBPO_POSED_FACES])
{
    for (int i = 0; i < 2 * EBPO_POSED_FACES; i++)
        faces[i / EBPO_POSED_FACES][i % EBPO_POSED_FACES].block = EBPO_NO_CHILD;
}

#endif
