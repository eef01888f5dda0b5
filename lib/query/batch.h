/* Many points: asked about along the curve, so that subtrees are loaded few times; and of a file
 * far away, what they will need is announced before. One thread. */
#ifndef EBPO_QUERY_BATCH_H
#define EBPO_QUERY_BATCH_H

#include "query/query_model.h"

typedef struct ebpo_batch {
    ebpo_context *context;
    const double *points; /* [count][3], finite; the caller's */
    uint64_t count;
    uint64_t *order; /* [count] which is asked about first, second, ...; NULL: as they come */
    bool far, reach;
    uint64_t told;     /* points whose subtrees have been announced */
    uint64_t searched; /* points around which it has been looked for further ones */
    uint32_t *below;   /* [capacity] subtrees that are being collected, in the top's numbers */
    uint64_t below_count, capacity;
} ebpo_batch;

/* `reach`: questions look around (distances). Where room for an order is short, points are asked
 * about as they come. */
void ebpo_batch_begin(ebpo_batch *batch, ebpo_context *context, const double *points,
                      uint64_t count, bool reach);
void ebpo_batch_end(ebpo_batch *batch);

/* The points' numbers [count] along the curve, of the nearest cell for points outside the box; the
 * caller frees it. NULL: no memory. */
uint64_t *ebpo_curve_order(const ebpo_box *box, const double *points, uint64_t count);

/* The i-th point to be asked about; i goes from 0 on. */
uint64_t ebpo_batch_next(ebpo_batch *batch, uint64_t i);

#endif
