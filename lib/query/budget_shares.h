/* Who gets which share of a budget. */
#ifndef EBPO_QUERY_BUDGET_SHARES_H
#define EBPO_QUERY_BUDGET_SHARES_H

#include <ebpo/query.h>

/* For loading one at least. */
enum { EBPO_SUBTREES_LEAST = 1 << 20 };

/* For decoded chunks. */
enum { EBPO_CHUNKS_LEAST = 2 << 20 };

/* Bytes for decoded chunks, for skeletons, and for both: what is not for the top and subtrees. */
uint64_t ebpo_chunk_budget(uint64_t budget);
uint64_t ebpo_skeleton_budget(const ebpo_model_options *options, uint64_t budget);
uint64_t ebpo_beside_subtrees(const ebpo_model_options *options, uint64_t budget);

#endif
