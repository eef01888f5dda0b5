/* Two accels at their poses, each in its own frame, made ready for going down both hierarchies
 * together. Immutable; any thread.
 *
 * Frames are measured in one unit: the first's, or the second's if that is the larger one. What is
 * known of each is linear in the frame of the other, whatever the poses' matrices are like; only
 * slabs rest upon lengths (docs/develop/collision.md, "Going down two hierarchies"). */
#ifndef EBPO_COLLIDE_ACCEL_PAIR_H
#define EBPO_COLLIDE_ACCEL_PAIR_H

#include "query/accel.h"
#include "extras/collide/posed_block.h"

typedef struct ebpo_accel_pair {
    const ebpo_accel *accel[2];
    const ebpo_block_posing *posing[2];
    float unit[2];     /* what a length of a frame is multiplied by */
    double turn[3][3]; /* a vector of the second's frame to the first's */
    double place[3];   /* the second's origin in the first's frame */
    /* The same in floats: a vector of the other's frame to frame i; and the sizes of the entries,
     * rounded up. */
    float into[2][3][3], size[2][3][3];
    float doubt;      /* what posing and these numbers are off, in the unit */
    float slab_share; /* of the sizes of nodes, for what slabs lose */
    float sine_room;  /* added to the squared sine of two slabs' axes */
    bool slabs;       /* they may be asked */
    bool apart;       /* the boxes around all faces have no common point */
} ebpo_accel_pair;

/* reach: at least every posed coordinate of both models. The posings must live as long. */
void ebpo_accel_pair_make(ebpo_accel_pair *out, const ebpo_accel *const accel[2],
                          const ebpo_block_posing *const posing[2], double reach);

#endif
