/* The inner loops of questions, over blocks of faces and bounds of eight: filters, whose "certain"
 * holds in exact arithmetic. Compiled twice on x86-64, for any processor and for those with AVX2,
 * with the same results. Pure functions. */
#ifndef EBPO_QUERY_KERNELS_H
#define EBPO_QUERY_KERNELS_H

#include "accel/accel.h"
#include "query/ray_kernel.h"

/* A segment along an axis from `from` (on all three axes) up to coordinate `to`: predicates.h,
 * ebpo_axis_crossing. */
typedef struct ebpo_axis_segment {
    double from[3];
    double to;
    int axis;
    /* its box in the leaf's cell, in the unit of ebpo_listed_block, rounded down */
    uint8_t low[3], high[3];
} ebpo_axis_segment;

/* False when nothing that the block has in the cell can meet the segment. */
static inline bool ebpo_axis_segment_meets(const ebpo_axis_segment *g, const ebpo_listed_block *b)
{
    return (g->high[0] >= b->low[0]) & (g->low[0] <= b->high[0]) & (g->high[1] >= b->low[1]) &
           (g->low[1] <= b->high[1]) & (g->high[2] >= b->low[2]) & (g->low[2] <= b->high[2]);
}

/* A point as the distance kernels want it. */
typedef struct ebpo_probe {
    double p[3];
    float high[3], low[3]; /* p = high + low up to 2^-48 of |p| (blocks of floats) */
    float local[3];        /* in the subtree's frame */
    float scale;           /* of the frame */
    double scale64;
    /* bound on what rounding does to a distance between the point and a bound, in the frame */
    float error;
} ebpo_probe;

typedef struct ebpo_kernels {
    /* Sum of the certain crossings of the blocks' faces, in the part of them that is in the leaf's
     * cell (as ebpo_axis_crossing gives them) with the segment; lanes that are not certain are
     * appended to `open` as slots (room for count * 8), their number to *open_count. Every face on
     * which the segment's end at `to` or `from` lies is among them. */
    int32_t (*crossings)(const ebpo_accel *s, const ebpo_listed_block *blocks, uint32_t count,
                         const ebpo_axis_segment *segment, uint32_t *open, uint32_t *open_count);
    /* Squared lower bounds of the distance to the eight children, in the frame; the result has a
     * bit for each child whose bound is at most `limit2`. */
    unsigned (*bounds)(const ebpo_bound *bound, const ebpo_bound_slab *slab,
                       const ebpo_probe *probe, float limit2, float lower2[8]);
    /* Certain bounds of the distances to eight faces, in the frame; the result has a bit for each
     * face whose lower bound is at most `best`. Lanes without a face have none, or one with a lower
     * bound of infinity. */
    unsigned (*faces)(const ebpo_accel *s, uint32_t block, const ebpo_probe *probe, float best,
                      float low[8], float high[8]);
    /* Walks through search->s: candidates, and the limit. Not pure: it asks search->decide when
     * there are many. */
    void (*ray)(ebpo_ray_search *search);
} ebpo_kernels;

/* Those that suit this processor best. */
const ebpo_kernels *ebpo_kernels_best(void);
extern const ebpo_kernels ebpo_kernels_base, ebpo_kernels_avx2;

#endif
