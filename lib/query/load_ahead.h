/* Loads subtrees before queries need them, sends prefetch hints (which bytes will be read soon) to
 * remote sources, and orders batches of points. Subtrees are given by their index in top->below
 * (ebpo_top): the subtrees that are loaded on demand. */
#ifndef EBPO_QUERY_LOAD_AHEAD_H
#define EBPO_QUERY_LOAD_AHEAD_H

#include "query/query_model.h"

/* Requests the subtrees whose envelopes are within |search_distance| + 2.25 s of p, the nearest
 * first, where s is the longest side of a cell of the cut level. Does nothing if, since the last
 * prefetch, p has moved by less than s / 4 and |search_distance| has grown by at most s / 4.
 * `search_distance`: the distance that the query at p returned, or its limit if no face was found;
 * 0 for point in solid. Only for models that load subtrees into a cache. */
void ebpo_context_prefetch(ebpo_context *context, const double p[3], double search_distance);

/* Lists the subtrees whose envelopes may be within `limit` of p, at most EBPO_CACHE_AHEAD, the
 * nearest first. Returns their number. */
unsigned ebpo_subtrees_near(const ebpo_model *model, const double p[3], double limit,
                            uint64_t below[EBPO_CACHE_AHEAD]);

/* Maximum number of subtrees in one hint, except for hints of batches. */
enum { EBPO_HINTED_MAX = 64 };

/* Sends one prefetch hint for `count` subtrees that queries will visit soon; omits those in memory.
 * Does nothing if the file is not remote or has no table of subtrees. */
void ebpo_context_hint(const ebpo_context *context, const uint32_t *below, uint64_t count);

/* Returns true if the options enable prefetching and the model loads subtrees into a cache. */
static inline bool ebpo_model_prefetches(const ebpo_model *m)
{
    return m->options.prefetch && !m->whole && m->options.loading == EBPO_LOAD_CACHE;
}

/* A batch of many points. The points are evaluated along the Morton curve, so that subtrees are
 * loaded few times. For a remote file, prefetch hints are sent in advance. A batch belongs to one
 * thread. The *turn* of a point is its position in the order of evaluation. */

typedef struct ebpo_batch {
    ebpo_context *context;
    const double *points; /* finite; owned by the caller */
    uint64_t count;
    uint64_t *order; /* [count] order of evaluation; NULL: in the given order */
    bool *done;      /* flags of completed points, or NULL */
    bool as_given;   /* evaluate in the given order, without hints */
    bool sends_hints;
    bool searches_around; /* queries search around the point (distances) */
    uint64_t hinted;      /* hints have been sent for the home (home_of) of this number of points */
    uint64_t searched;    /* hints have been sent for all subtrees of this number of points */
    uint32_t *below;      /* [capacity] subtrees of the next hint */
    uint64_t below_count, capacity;
    bool pending;           /* bytes for some points are not available yet */
    uint64_t first_pending; /* turn of the first such point */
    uint64_t pending_home;  /* the last subtree that was not available */
    ebpo_error why_pending;
} ebpo_batch;

/* Begins a batch. Before the call, the caller sets context, points, count, done, as_given and
 * searches_around; all other members are 0. If the points get an order, completed points are
 * removed from it and from `count`. Without memory for an order, points are evaluated in the given
 * order. */
void ebpo_batch_begin(ebpo_batch *batch);
/* Ends a batch, and returns its status: `status`, or EBPO_E_PENDING if there was no other error but
 * bytes for some points are not available. */
EBPO_MUST_USE ebpo_status ebpo_batch_end(ebpo_batch *batch, ebpo_status status, ebpo_error *error);

/* Returns the indices of the points [count] in the order of the Morton curve; a point outside the
 * box has the position of the nearest cell. The caller frees the array. Returns NULL without
 * memory. */
uint64_t *ebpo_curve_order(const ebpo_box *box, const double *points, uint64_t count);

/* Returns the index of the i-th point to evaluate. Call it with i = 0, 1, 2, ... */
uint64_t ebpo_batch_next(ebpo_batch *batch, uint64_t i);

/* Records the status of the point with turn i and index `point`. Returns EBPO_OK if the caller must
 * go on with the next point. After EBPO_E_PENDING, the caller also goes on, until all points are
 * done for whose subtrees hints were sent; so one round trip fetches the bytes of all these
 * subtrees. */
EBPO_MUST_USE ebpo_status ebpo_batch_note(ebpo_batch *batch, uint64_t i, uint64_t point,
                                          ebpo_status status, const ebpo_error *error);

#endif
