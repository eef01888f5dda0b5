/* Loads subtrees before queries need them, sends prefetch hints (which bytes will be read soon) to
 * remote sources, and orders batches of points. A subtree that is loaded on demand is given by its
 * index in top->below (ebpo_top). */
#ifndef EBPO_QUERY_LOAD_AHEAD_H
#define EBPO_QUERY_LOAD_AHEAD_H

#include "query/query_model.h"

/* Let s be the longest side of a cell of the cut level, at which the roots of subtrees are.
 * Requests the subtrees whose envelopes are within |search_distance| + 2.25 s of p, the nearest
 * first. Does nothing if, since the last prefetch, p has moved by less than s / 4 and
 * |search_distance| has grown by at most s / 4. `search_distance`: the distance that the query at p
 * returned, or its limit if no face was found; 0 after ebpo_inside. Only for models that load
 * subtrees into a cache. */
void ebpo_context_prefetch(ebpo_context *context, const double p[3], double search_distance);

/* Lists the subtrees whose envelopes may be within `limit` of p, the nearest first, but at most
 * EBPO_CACHE_AHEAD subtrees. Returns their number. */
unsigned ebpo_subtrees_near(const ebpo_model *model, const double p[3], double limit,
                            uint64_t below[EBPO_CACHE_AHEAD]);

/* Maximum number of subtrees in one hint, except for hints of batches. */
enum { EBPO_HINTED_MAX = 64 };

/* Sends one prefetch hint for `count` subtrees that queries will visit soon, except subtrees that
 * are in memory. Does nothing if the file is not remote or has no table of subtrees. */
void ebpo_context_hint(const ebpo_context *context, const uint32_t *below, uint64_t count);

/* Returns true if ebpo_context_read_envelopes may be used: the file is remote, is no subset, and
 * its table locates the model's subtrees; the model has skeletons. */
static inline bool ebpo_model_has_envelopes(const ebpo_model *m)
{
    return ebpo_input_prefetches(&m->file->in) && !m->info->pruned && m->skeletons &&
           m->top->cut_level == m->info->subtree_level;
}

/* Reads the envelopes of the first levels below the roots of `count` gray subtrees, after one
 * prefetch hint. Reads fewer if the quota of skeletons, or memory for chunks, is used up. After an
 * error, some may have been read. */
EBPO_MUST_USE ebpo_status ebpo_context_read_envelopes(ebpo_context *context, const uint32_t *below,
                                                      uint64_t count, ebpo_error *error);

/* Returns the envelopes of a subtree that were read, as a top whose level 0 is the subtree's root,
 * or NULL. */
static inline const ebpo_top *ebpo_context_envelopes(const ebpo_context *context, uint32_t below)
{
    return context->envelope_count ? context->envelopes_of[below] : NULL;
}

/* Frees all envelopes that were read. */
void ebpo_context_drop_envelopes(ebpo_context *context);

/* Returns true if the options enable prefetching and the model loads subtrees into a cache. */
static inline bool ebpo_model_prefetches(const ebpo_model *m)
{
    return m->options.prefetch && !m->whole && m->options.loading == EBPO_LOAD_CACHE;
}

/* A batch of points. The points are evaluated along the Morton curve, so that each subtree is
 * loaded few times. For a remote file, prefetch hints are sent in advance. A batch belongs to one
 * thread. The *turn* of a point is its position in the order of evaluation. The *home* of a point
 * is the subtree whose cell contains it, or the nearest subtree (home_of). */

typedef struct ebpo_batch {
    ebpo_context *context;
    const double *points; /* finite; owned by the caller */
    uint64_t count;
    uint64_t *order;      /* [count] indices of points in the order of evaluation; NULL: as given */
    bool *done;           /* [points] flags of completed points, or NULL */
    bool as_given;        /* evaluate in the given order, without hints */
    bool sends_hints;     /* the file is remote, and prefetch hints are possible */
    bool searches_around; /* queries search around the point (distances) */
    uint64_t hinted;      /* hints were sent for the homes of this number of points */
    uint64_t searched;    /* hints were sent for all subtrees that this number of points may need */
    uint32_t *below;      /* [capacity] subtrees of the next hint */
    uint64_t below_count, capacity;
    bool pending;             /* there are pending points: their bytes are not available yet */
    uint64_t first_pending;   /* turn of the first pending point */
    uint64_t pending_home;    /* home of the last pending point */
    ebpo_error pending_error; /* error of the first pending point */
} ebpo_batch;

/* Begins a batch. Before the call, the caller sets context, points, count, done, as_given and
 * searches_around; all other members are 0. If the batch sorts the points, it omits completed
 * points, so `count` may decrease. If there is no memory to sort, points are evaluated in the given
 * order. */
void ebpo_batch_begin(ebpo_batch *batch);
/* Ends a batch. Returns EBPO_E_PENDING if `status` is EBPO_OK and bytes for some points are not
 * available yet, otherwise `status`. */
EBPO_MUST_USE ebpo_status ebpo_batch_end(ebpo_batch *batch, ebpo_status status, ebpo_error *error);

/* Returns the indices of the points, [count], in the order of the Morton curve. (A point outside
 * the box is sorted as the nearest cell.) The caller frees the array. Returns NULL when out of
 * memory.
 */
uint64_t *ebpo_curve_order(const ebpo_box *box, const double *points, uint64_t count);

/* Returns the index of the i-th point to evaluate. Call this function with i = 0, 1, 2, ... */
uint64_t ebpo_batch_next(ebpo_batch *batch, uint64_t i);

/* Records the status of the point with turn i and index `point`. Returns EBPO_OK if the caller must
 * go on with the next point, otherwise the status with which the batch ends. After EBPO_E_PENDING,
 * the caller must go on with all points for whose subtrees hints were sent, so that one round trip
 * fetches the bytes of all these subtrees. */
EBPO_MUST_USE ebpo_status ebpo_batch_note(ebpo_batch *batch, uint64_t i, uint64_t point,
                                          ebpo_status status, const ebpo_error *error);

#endif
