/* Loading ahead: prefetching, announcing, and batches of points. */
#ifndef EBPO_QUERY_LOAD_AHEAD_H
#define EBPO_QUERY_LOAD_AHEAD_H

#include "query/query_model.h"

/* Asks for the subtrees whose envelopes are within `reach` (of either sign) and 2.25 sides of a
 * cell of the cut level of p, the nearest first, when p has moved on by a quarter of such a side.
 * `reach`: how far the query about p looked, 0 for point in solid. Models with a cache only. */
void ebpo_context_prefetch(ebpo_context *context, const double p[3], double reach);

/* The subtrees whose envelopes may be within `limit` of p, the nearest first; returns how many. */
unsigned ebpo_subtrees_near(const ebpo_model *model, const double p[3], double limit,
                            uint64_t keys[EBPO_CACHE_AHEAD]);

/* Announces subtrees that will be entered soon, by their numbers in the top, together: of files far
 * away that have a table of subtrees. Those in memory are left out. */
enum { EBPO_ANNOUNCED_MOST = 64 };
void ebpo_context_announce(const ebpo_context *context, const uint32_t *below, uint64_t count);

/* True when the model's options ask for it. */
static inline bool ebpo_model_prefetches(const ebpo_model *m)
{
    return m->options.prefetch && !m->whole && m->options.loading == EBPO_LOAD_CACHE;
}

/* Many points: asked about along the curve, so that subtrees are loaded few times; and of a file
 * far away, what they will need is announced before. One thread. */

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
