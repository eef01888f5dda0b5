/* How kernels read a block's faces: eight lanes at a time, one axis after the other. Lanes from
 * `count` on repeat one of its faces: bounds need no mask, counting does. Included by what is
 * compiled for several processors. */
#ifndef EBPO_ACCEL_FACE_BLOCK_H
#define EBPO_ACCEL_FACE_BLOCK_H

#include "accel/accel.h"
#include "base/eight.h"

typedef struct ebpo_face_block {
    const ebpo_accel *s;
    uint64_t at;
    unsigned count; /* faces: 1 to 8 */
} ebpo_face_block;

EBPO_EIGHT ebpo_face_block ebpo_face_block_open(const ebpo_accel *s, uint32_t block)
{
    return (ebpo_face_block){ s, (uint64_t)block * EBPO_BLOCK_NUMBERS,
                              s->block_face[block + 1] - s->block_face[block] };
}

/* A bit for each lane that holds a face. */
EBPO_EIGHT unsigned ebpo_face_block_lanes(const ebpo_face_block *b) { return (1u << b->count) - 1; }

/* The three corners' coordinates on an axis, in the model's unit; of an accel of floats. */
EBPO_EIGHT void ebpo_face_block_floats(const ebpo_face_block *b, int axis, f8 corner[3])
{
    for (int i = 0; i < 3; i++)
        corner[i] = f8_load(b->s->block32 + b->at + (unsigned)(3 * i + axis) * EBPO_BLOCK);
}

/* The same of an accel of doubles. */
EBPO_EIGHT void ebpo_face_block_doubles(const ebpo_face_block *b, int axis,
                                        double corner[3][EBPO_BLOCK])
{
    for (int i = 0; i < 3; i++)
        memcpy(corner[i], b->s->block64 + b->at + (unsigned)(3 * i + axis) * EBPO_BLOCK,
               sizeof corner[i]);
}

#endif
