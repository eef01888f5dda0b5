/* Declares the stages in which an accel (acceleration structure of a subtree, accel.h) is made, and
 * the data that the stages exchange. */
#ifndef EBPO_QUERY_ACCEL_PARTS_H
#define EBPO_QUERY_ACCEL_PARTS_H

#include "core/cpu.h"
#include "query/accel.h"

/* Extent of vertices in the subtree's frame, and the sum of the normals of their faces. */
typedef struct ebpo_extent {
    double low[3], high[3], normal[3];
} ebpo_extent;

/* A node of the hierarchy. The blocks below a node are contiguous in ebpo_layout.ordered_number. */
typedef struct ebpo_layout_node {
    /* as in ebpo_bound, but a block is given by its index in the layout */
    uint32_t child[8];
    uint32_t begin, end; /* the blocks below the node */
} ebpo_layout_node;

/* The layout assigns faces to blocks (at most eight faces each), and blocks to a hierarchy. */
typedef struct ebpo_layout {
    /* [block_count + 1] first face of each block, as local index (accel.h), and the number of
     * faces; the blocks together contain all faces, in order */
    uint32_t *block_begin;
    uint64_t block_count;
    uint64_t shared_blocks; /* the blocks of shared faces, which are the first blocks */
    /* [block_count] number of each block in the accel: the position of its record, in units
     * (EBPO_MESHLET_UNIT); set by ebpo_accel_number_blocks */
    uint32_t *block_number;
    struct ebpo_block_corners *corners; /* [block_count] valid until the blocks are filled */
    uint32_t *ordered_number;           /* [block_count] block_number in the order of the nodes */
    ebpo_layout_node *node;             /* [node_count] children come before their parent */
    uint64_t node_count, node_capacity;
    uint32_t top; /* index in `node` of the hierarchy's root */
} ebpo_layout;

/* Returns the greatest number of nodes of a hierarchy over so many blocks. A cut (block_tree.c)
 * leaves at least four blocks on each side, so there are at most blocks / 4 nodes above blocks
 * only, and a seventh of this number above nodes. */
static inline uint64_t ebpo_layout_nodes_max(uint64_t blocks) { return blocks * 2 / 7 + 4; }

/* Assigns the faces of a slice to blocks, without coordinates. Returns EBPO_E_LIMIT for more than
 * `blocks_max` blocks, which is EBPO_BLOCKS_MAX except in tests. */
EBPO_MUST_USE ebpo_status ebpo_layout_make(ebpo_layout *out, const ebpo_slice *slice,
                                           uint64_t blocks_max, ebpo_error *error);
/* Makes the hierarchy over the blocks. extent[i]: of block i. */
EBPO_MUST_USE ebpo_status ebpo_layout_join(ebpo_layout *layout, const ebpo_extent *extent,
                                           ebpo_error *error);
void ebpo_layout_free(ebpo_layout *layout);

/* The inputs from which an accel is made. */
typedef struct ebpo_accel_plan {
    const ebpo_info *info;
    const ebpo_slice *slice;
    ebpo_accel_content content;
    ebpo_layout *layout; /* NULL: not made yet */
} ebpo_accel_plan;

/* ebpo_accel_number_blocks computes the sizes of blocks, and sets their numbers (positions in
 * units) and s->units. ebpo_accel_fill_blocks then fills the blocks. */
EBPO_MUST_USE ebpo_status ebpo_accel_number_blocks(ebpo_accel *s, const ebpo_accel_plan *plan,
                                                   unsigned threads, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_accel_fill_blocks(ebpo_accel *s, const ebpo_accel_plan *plan,
                                                 unsigned threads, ebpo_error *error);
/* Makes the hierarchy over the filled blocks, with its boxes and bounding cylinders. */
EBPO_MUST_USE ebpo_status ebpo_accel_fill_bounds(ebpo_accel *s, ebpo_layout *layout,
                                                 unsigned threads, ebpo_error *error);
/* Makes an empty store of at most `rows_max` rows of leaf planes (ebpo_kind_row). Returns NULL when
 * out of memory. */
ebpo_leaf_kinds *ebpo_leaf_kinds_make(uint64_t rows_max);
void ebpo_leaf_kinds_free(ebpo_leaf_kinds *kinds);

/* --- kernels (block_measure_kernels.c) ---
 *
 * These kernels measure blocks of floats, eight vertices at a time. The kernels are compiled for
 * any processor and for processors with AVX2, with the same operations in the same order. Error
 * bounds: docs/develop/bounds.md, "How bounding cylinders are measured". */

typedef struct ebpo_block_extent {
    float low[3], high[3]; /* extent of the block's vertices, in the model's unit */
    /* The sum of the faces' normals, each as long as twice the face's area. The direction of a
     * cylinder's axis affects only the tightness of the bounds, so rounding does not matter. */
    float normal[3];
} ebpo_block_extent;

/* Coordinates in which a bounding cylinder is measured. */
typedef struct ebpo_cylinder_view {
    float origin_high[3], origin_low[3]; /* their sum is the origin, in the model's unit */
    float scale;                         /* scale of the subtree's frame (ebpo_accel) */
    float axis[3], length2_defect;       /* axis, and 1 minus its squared length */
} ebpo_cylinder_view;

/* The measured cylinder. */
typedef struct ebpo_cylinder_extent {
    float from, to; /* extent along the axis, in the subtree's frame */
    float aside2;   /* square of the greatest distance from the axis */
} ebpo_cylinder_extent;

typedef struct ebpo_block_measures {
    /* Measures one block. */
    void (*extent)(const ebpo_accel *s, uint32_t block, ebpo_block_extent *out);
    /* Measures all vertices of `count` blocks, given by their numbers. */
    void (*cylinder)(const ebpo_accel *s, const uint32_t *block, uint32_t count,
                     const ebpo_cylinder_view *view, ebpo_cylinder_extent *out);
} ebpo_block_measures;

EBPO_KERNELS(ebpo_block_measures, ebpo_block_measures)

#endif
