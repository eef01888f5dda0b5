/* Stages of making an acceleration structure. */
#ifndef EBPO_QUERY_ACCEL_PARTS_H
#define EBPO_QUERY_ACCEL_PARTS_H

#include "core/cpu.h"
#include "query/accel.h"

/* Layout: assigns faces to blocks and blocks to a hierarchy in one walk through the tree; it uses
 * no coordinates. */
typedef struct ebpo_layout {
    /* [block_count] first local face of each block, and one past the last; blocks contain all
     * faces, in order */
    uint32_t *block_begin;
    uint32_t *block_end;
    uint64_t block_count, block_capacity;
    /* [block_count] number of each block in the accel (ebpo_meshlet); set with the blocks */
    uint32_t *block_number;
    struct ebpo_block_corners *corners; /* [block_count] valid until the blocks are filled */
    uint32_t (*child)[8];               /* [bound_count] as in ebpo_bound */
    /* [bound_count] blocks below a node are contiguous: first, and one past the last */
    uint32_t *first_block;
    uint32_t *last_block;
    uint64_t bound_count, bound_capacity, bound_capacity2, bound_capacity3, block_capacity2;
    uint32_t top;
} ebpo_layout;

/* Returns EBPO_E_LIMIT for more than `most` blocks; `most` is EBPO_BLOCKS_MAX except in tests. */
EBPO_MUST_USE ebpo_status ebpo_layout_make(ebpo_layout *out, const ebpo_slice *slice, uint64_t most,
                                           ebpo_error *error);
void ebpo_layout_free(ebpo_layout *layout);

/* Input of the making of an accel. */
typedef struct ebpo_accel_plan {
    const ebpo_info *info;
    const ebpo_slice *slice;
    bool with_planes;
    ebpo_layout *layout; /* NULL: not known yet */
} ebpo_accel_plan;

/* The first function computes the sizes of blocks, numbers them and sets s->units; the second fills
 * them. Both are parallel. */
EBPO_MUST_USE ebpo_status ebpo_accel_number_blocks(ebpo_accel *s, const ebpo_accel_plan *plan,
                                                   unsigned threads, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_accel_fill_blocks(ebpo_accel *s, const ebpo_accel_plan *plan,
                                                 unsigned threads, ebpo_error *error);
/* Computes the bounds of the hierarchy from the blocks (parallel). */
EBPO_MUST_USE ebpo_status ebpo_accel_fill_bounds(ebpo_accel *s, const ebpo_layout *layout,
                                                 unsigned threads, ebpo_error *error);
/* Allocates storage for at most `rows_max` rows. Returns NULL without memory. */
ebpo_leaf_kinds *ebpo_leaf_kinds_make(uint64_t rows_max);
void ebpo_leaf_kinds_free(ebpo_leaf_kinds *kinds);

/* --- kernels (block_measure_kernels.c) ---
 *
 * They measure blocks of floats, eight vertices at a time. They are compiled for any processor and
 * for those with AVX2, with the same operations in the same order. Error bounds:
 * docs/develop/bounds.md, "How bounding cylinders are measured". */

typedef struct ebpo_block_extent {
    float low[3], high[3]; /* extent of the block's vertices, in the model's unit */
    /* The sum of the faces' normals, each as long as twice the face's area. The direction of a
     * cylinder's axis affects only the tightness of the bounds, so rounding does not matter. */
    float normal[3];
} ebpo_block_extent;

/* Frame of a bounding cylinder: an origin in two parts, in the model's unit; the scale of the
 * subtree's frame; the axis, and 1 less its squared length. */
typedef struct ebpo_cylinder_view {
    float high[3], low[3], scale, axis[3], rest;
} ebpo_cylinder_view;

typedef struct ebpo_cylinder_extent {
    float from, to, aside2; /* extent along the axis, in the subtree's frame; square of the greatest
                             * distance from the axis */
} ebpo_cylinder_extent;

typedef struct ebpo_block_measures {
    void (*extent)(const ebpo_accel *s, uint32_t block, ebpo_block_extent *out);
    /* Measures all vertices of `count` blocks, given by their numbers. */
    void (*cylinder)(const ebpo_accel *s, const uint32_t *block, uint32_t count,
                     const ebpo_cylinder_view *view, ebpo_cylinder_extent *out);
} ebpo_block_measures;

EBPO_KERNELS(ebpo_block_measures, ebpo_block_measures)

#endif
