#include "query/model_parts.h"

/* Decoded chunks: an eighth of the budget, within these. */
enum { CHUNKS_MOST = 128 << 20 };

uint64_t ebpo_chunk_budget(uint64_t budget)
{
    return budget / 8 < EBPO_CHUNKS_LEAST ? EBPO_CHUNKS_LEAST
           : budget / 8 > CHUNKS_MOST     ? CHUNKS_MOST
                                          : budget / 8;
}

/* Skeletons of subtrees, at most: searches that go everywhere gain more by them than by a few more
 * subtrees. Of what is beyond the least, so that small budgets do for what they would do for
 * without them. */
uint64_t ebpo_skeleton_budget(const ebpo_model_options *o, uint64_t budget)
{
    const uint64_t least = EBPO_CHUNKS_LEAST + EBPO_SUBTREES_LEAST;
    return o->loading == EBPO_LOAD_CACHE && budget > least ? (budget - least) / 4 : 0;
}

uint64_t ebpo_beside_subtrees(const ebpo_model_options *o, uint64_t budget)
{
    return ebpo_chunk_budget(budget) + ebpo_skeleton_budget(o, budget);
}
