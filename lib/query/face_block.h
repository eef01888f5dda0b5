/* Reads a block (at most eight faces, accel.h) for kernels: one face in each of eight lanes, for
 * one axis of coordinates at a time. Lanes without a face repeat the block's first face. So a
 * kernel that computes bounds needs no mask; a kernel that counts faces uses ebpo_face_block_lanes.
 * This header is included by files that are compiled for several processors. */
#ifndef EBPO_QUERY_FACE_BLOCK_H
#define EBPO_QUERY_FACE_BLOCK_H

#include "query/accel.h"
#include "core/simd.h"

typedef struct ebpo_face_block {
    const ebpo_meshlet *m; /* the block's record */
    n8 corner[3];          /* [corner] each lane's vertex; not used if the record has 24 vertices */
} ebpo_face_block;

EBPO_EIGHT ebpo_face_block ebpo_face_block_open(const ebpo_accel *s, uint32_t block)
{
    ebpo_face_block b = { .m = ebpo_accel_meshlet(s, block) };
    for (int i = 0; i < 3; i++)
        b.corner[i] = n8_from_bits(b.m->corner[i]);
    return b;
}

/* Returns a bit for each lane that holds a face. */
EBPO_EIGHT unsigned ebpo_face_block_lanes(const ebpo_face_block *b)
{
    return (1u << b->m->faces) - 1;
}

/* Reads one coordinate (`axis`) of the three corners of all lanes, in the model's unit. The accel
 * (acceleration structure of a subtree) must store floats (`wide` is false). */
EBPO_EIGHT void ebpo_face_block_floats(const ebpo_face_block *b, int axis, f8 corner[3])
{
    const float *x = ebpo_meshlet_floats(b->m) + (unsigned)axis * b->m->vertices;
    if (__builtin_expect(b->m->vertices > EBPO_MESHLET_SHARED, 0)) {
        for (int i = 0; i < 3; i++)
            corner[i] = f8_load(x + i * EBPO_BLOCK);
        return;
    }
    f8_table table =
        f8_table_load(x); /* loads 16 floats; the floats after the block's vertices are not used */
    for (int i = 0; i < 3; i++)
        corner[i] = f8_look_up(table, b->corner[i]);
}

/* As ebpo_face_block_floats, for an accel that stores doubles (`wide`). */
EBPO_EIGHT void ebpo_face_block_doubles(const ebpo_face_block *b, int axis,
                                        double corner[3][EBPO_BLOCK])
{
    const double *x = ebpo_meshlet_doubles(b->m) + (unsigned)axis * b->m->vertices;
    for (unsigned i = 0; i < 3; i++)
        for (unsigned lane = 0; lane < EBPO_BLOCK; lane++)
            corner[i][lane] = x[ebpo_meshlet_vertex(b->m, lane, i)];
}

#endif
