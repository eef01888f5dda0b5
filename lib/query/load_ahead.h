/* Loading ahead: prefetching, prefetch hints, and batches of points. */
#ifndef EBPO_QUERY_LOAD_AHEAD_H
#define EBPO_QUERY_LOAD_AHEAD_H

#include "query/query_model.h"

/* Requests the subtrees whose envelopes are within |search_distance| plus 2.25 sides of p, the
 * nearest first. A side is that of a cell of the cut level. Does nothing if, since the last
 * prefetch, p has moved by less than a quarter side and the search distance has grown by at most as
 * much. `search_distance`: that of the query at p; 0 for point in solid. Only for models with a
 * cache. */
void ebpo_context_prefetch(ebpo_context *context, const double p[3], double search_distance);

/* Lists the subtrees whose envelopes may be within `limit` of p, the nearest first, as indices of
 * top->below. Returns the number of subtrees. */
unsigned ebpo_subtrees_near(const ebpo_model *model, const double p[3], double limit,
                            uint64_t numbers[EBPO_CACHE_AHEAD]);

/* Maximum number of subtrees in one hint, except for hints of batches. */
enum { EBPO_HINTED_MAX = 64 };

/* Sends one prefetch hint for subtrees that queries will visit soon. `below` has their indices of
 * top->below. For remote files that have a table of subtrees. Skips subtrees in memory. */
void ebpo_context_hint(const ebpo_context *context, const uint32_t *below, uint64_t count);

/* Returns true when the model's options enable prefetching. */
static inline bool ebpo_model_prefetches(const ebpo_model *m)
{
    return m->options.prefetch && !m->whole && m->options.loading == EBPO_LOAD_CACHE;
}

/* A batch of many points. The points are evaluated along the Morton curve, so that subtrees are
 * loaded few times. For a remote file, prefetch hints are sent in advance. One thread. */

typedef struct ebpo_batch {
    ebpo_context *context;
    const double *points; /* finite; owned by the caller */
    uint64_t count;
    uint64_t *order; /* [count] order of evaluation; NULL: in the given order */
    bool *done;      /* flags of completed points, or NULL */
    bool as_given;   /* in the given order, without hints */
    bool sends_hints;
    bool searches_around; /* queries search around the point (distances) */
    uint64_t hinted;      /* number of points for whose subtrees hints have been sent */
    uint64_t searched;    /* number of points around which further subtrees have been searched */
    uint32_t *below;      /* [capacity] subtrees of the next hint, as indices of top->below */
    uint64_t below_count, capacity;
    bool pending;           /* bytes for some points are not available yet */
    uint64_t first_pending; /* turn of the first such point */
    uint64_t pending_home;  /* the last subtree that was not available */
    ebpo_error why_pending;
} ebpo_batch;

/* Begins a batch, whose context, points, count, done, as_given and searches_around the caller has
 * set; all other members are 0. Removes completed points from the order and from `count`. Without
 * memory for an order, points are evaluated in the given order. */
void ebpo_batch_begin(ebpo_batch *batch);
/* Ends a batch. Returns its status, which is EBPO_E_PENDING if bytes for some points are not
 * available. */
EBPO_MUST_USE ebpo_status ebpo_batch_end(ebpo_batch *batch, ebpo_status status, ebpo_error *error);

/* Returns the indices of the points [count] in the order of the Morton curve; a point outside the
 * box has the position of the nearest cell. The caller frees the array. NULL: no memory. */
uint64_t *ebpo_curve_order(const ebpo_box *box, const double *points, uint64_t count);

/* Returns the index of the i-th point to evaluate. Call it with i = 0, 1, 2, ... */
uint64_t ebpo_batch_next(ebpo_batch *batch, uint64_t i);

/* Records the status of the i-th point, which has the index `point`. Returns EBPO_OK if the batch
 * goes on with the next point: also after EBPO_E_PENDING, so that one round trip fetches the bytes
 * for all points whose subtrees have been hinted. */
EBPO_MUST_USE ebpo_status ebpo_batch_note(ebpo_batch *batch, uint64_t i, uint64_t point,
                                          ebpo_status status, const ebpo_error *error);

#endif
