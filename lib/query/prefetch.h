/* Loading ahead. */
#ifndef EBPO_QUERY_PREFETCH_H
#define EBPO_QUERY_PREFETCH_H

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

#endif
