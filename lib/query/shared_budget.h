/* A budget that models share: what of it each of them takes for good, and what is for the caches of
 * all. Any thread. */
#ifndef EBPO_QUERY_SHARED_BUDGET_H
#define EBPO_QUERY_SHARED_BUDGET_H

#include <ebpo/query.h>

#include "core/cache.h"

/* Of the caches of subtrees, and of those of chunks: what one loads needs room in the other. */
ebpo_cache_pool *ebpo_budget_subtrees(const ebpo_budget *budget);
ebpo_cache_pool *ebpo_budget_chunks(const ebpo_budget *budget);

uint64_t ebpo_budget_bytes(const ebpo_budget *budget);
/* What is not taken for good. */
uint64_t ebpo_budget_left(const ebpo_budget *budget);

/* Takes bytes for a model that is all in memory, for as long as it lives. False: these take too
 * much, or there is no room. And what turned out not to be needed, or all of it, back. */
bool ebpo_budget_take_whole(ebpo_budget *budget, uint64_t bytes);
void ebpo_budget_give_back_whole(ebpo_budget *budget, uint64_t bytes);

/* Of the room for skeletons, at most `wanted`; and back. */
uint64_t ebpo_budget_take_skeletons(ebpo_budget *budget, uint64_t wanted);
void ebpo_budget_give_back_skeletons(ebpo_budget *budget, uint64_t bytes);

#endif
