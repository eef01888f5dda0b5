/* The inner loops of questions, over blocks of faces and bounds of eight: filters, whose "certain"
 * holds in exact arithmetic. Compiled twice on x86-64, for any processor and for those with AVX2,
 * with the same results. Pure functions. */
#ifndef EBPO_QUERY_KERNELS_H
#define EBPO_QUERY_KERNELS_H

#include "accel/accel.h"
#include "query/near_kernel.h"
#include "query/ray_kernel.h"

/* A segment along an axis from `from` (on all three axes) up to coordinate `to`: predicates.h,
 * ebpo_axis_crossing. */
typedef struct ebpo_axis_segment {
    double from[3];
    double to;
    int axis;
    /* its box in the leaf's cell, in the unit of ebpo_listed_block, rounded down */
    uint8_t low[3], high[3];
    bool everywhere; /* the boxes of the list are not known */
} ebpo_axis_segment;

/* False when nothing that the block has in the cell can meet the segment. */
static inline bool ebpo_axis_segment_meets(const ebpo_axis_segment *g, const ebpo_listed_block *b)
{
    return g->everywhere ||
           ((g->high[0] >= b->low[0]) & (g->low[0] <= b->high[0]) & (g->high[1] >= b->low[1]) &
            (g->low[1] <= b->high[1]) & (g->high[2] >= b->low[2]) & (g->low[2] <= b->high[2]));
}

typedef struct ebpo_kernels {
    /* Sum of the certain crossings of the blocks' faces, in the part of them that is in the leaf's
     * cell (as ebpo_axis_crossing gives them) with the segment; lanes that are not certain are
     * appended to `open` as slots (room for count * 8), their number to *open_count. Every face on
     * which the segment's end at `to` or `from` lies is among them. */
    int32_t (*crossings)(const ebpo_accel *s, const ebpo_listed_block *blocks, uint32_t count,
                         const ebpo_axis_segment *segment, uint32_t *open, uint32_t *open_count);
    /* Not pure: they ask search->judge when many faces wait. They walk through search->s: what
     * then waits may be nearest, or met, and best, or the limit, has fallen. */
    void (*near)(ebpo_near_search *search);
    void (*ray)(ebpo_ray_search *search);
} ebpo_kernels;

/* Those that suit this processor best. */
const ebpo_kernels *ebpo_kernels_best(void);
extern const ebpo_kernels ebpo_kernels_base, ebpo_kernels_avx2;

#endif
