/* How two models' frames lie to each other at their poses: what boxes and slabs of one are seen as
 * from the other, in floats. Pure functions, any thread. */
#ifndef EBPO_COLLIDE_TWO_FRAMES_H
#define EBPO_COLLIDE_TWO_FRAMES_H

#include "query/accel.h"
#include "extras/collide/posed_block.h"

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
