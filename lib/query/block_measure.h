/* What is measured of blocks of floats, eight vertices at a time: compiled for any processor and
 * for those with AVX2, the same operations in the same order. How far off it may be:
 * docs/develop/bounds.md, "How slabs are measured". */
#ifndef EBPO_QUERY_BLOCK_MEASURE_H
#define EBPO_QUERY_BLOCK_MEASURE_H

#include "core/cpu.h"
#include "query/accel.h"

typedef struct ebpo_block_extent {
    float low[3], high[3]; /* of its vertices, in the model's unit */
    /* The sum of its faces' normals, as long as twice their areas. Where the axis of a slab points
     * is only a matter of how tight it is. */
    float normal[3];
} ebpo_block_extent;

/* Where slabs are seen from: a place, in two parts, in the model's unit; the frame's scale; the
 * axis, and 1 less its square. */
typedef struct ebpo_slab_view {
    float high[3], low[3], scale, axis[3], rest;
} ebpo_slab_view;

typedef struct ebpo_slab_extent {
    float from, to, aside2; /* in the frame; the square of the greatest distance from the axis */
} ebpo_slab_extent;

typedef struct ebpo_block_measures {
    void (*extent)(const ebpo_accel *s, uint32_t block, ebpo_block_extent *out);
    /* Of all vertices of `count` blocks, of these numbers. */
    void (*slab)(const ebpo_accel *s, const uint32_t *block, uint32_t count,
                 const ebpo_slab_view *view, ebpo_slab_extent *out);
} ebpo_block_measures;

EBPO_KERNELS(ebpo_block_measures, ebpo_block_measures)

#endif
