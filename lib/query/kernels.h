/* The inner loops of questions, over blocks of faces and bounds of eight: filters, whose "certain"
 * holds in exact arithmetic. Compiled twice on x86-64, for any processor and for those with AVX2,
 * with the same results. Pure functions. */
#ifndef EBPO_QUERY_KERNELS_H
#define EBPO_QUERY_KERNELS_H

#include "core/cpu.h"
#include "query/accel.h"
#include "query/near_kernel.h"
#include "query/ray_kernel.h"

/* A segment along an axis from `from` (on all three axes) up to coordinate `to`: predicates.h,
 * ebpo_axis_crossing. */
typedef struct ebpo_axis_segment {
    double from[3];
    double to;
    int axis;
    /* As an ebpo_listed_block has boxes, but for each axis the upper side and 15 less the lower
     * one, rounded down; all ones: meets everything. */
    uint32_t reach;
} ebpo_axis_segment;
#define EBPO_REACH_ALL UINT32_C(0xffffff)

/* False when nothing that the block has in the cell can meet the segment: a side of the box, four
 * bits each, is above the segment's. */
static inline bool ebpo_axis_segment_meets(const ebpo_axis_segment *g, uint64_t listed)
{
    const uint32_t digits = 0x0f0f0f, carry = 0x101010;
    uint32_t box = (uint32_t)(listed >> EBPO_LISTED_BOX);
    uint32_t even = ((g->reach & digits) | carry) - (box & digits),
             odd = ((g->reach >> 4 & digits) | carry) - (box >> 4 & digits);
    return (even & odd & carry) == carry;
}

typedef struct ebpo_kernels {
    /* Sum of the certain crossings of a leaf's listed faces, in the part of them that is in the
     * leaf's cell (as ebpo_axis_crossing gives them) with the segment; lanes that are not certain
     * are appended to `open` as slots (room for 8 a block), their number to *open_count. Every face
     * on which the segment's end at `to` or `from` lies is among them. */
    int32_t (*crossings)(const ebpo_accel *s, const ebpo_listed_block *list,
                         const ebpo_axis_segment *segment, uint32_t *open, uint32_t *open_count);
    ebpo_walls_fn *walls;
    /* Not pure: they ask search->judge when many faces wait. They walk through search->s: what
     * then waits may be nearest, or met, and best, or the limit, has fallen. */
    void (*near)(ebpo_near_search *search);
    void (*ray)(ebpo_ray_search *search);
} ebpo_kernels;

EBPO_KERNELS(ebpo_kernels, ebpo_kernels)

#endif
