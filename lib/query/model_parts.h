/* What a model has beside subtrees: the top of its tree, skeletons, and its share of budgets. */
#ifndef EBPO_QUERY_MODEL_PARTS_H
#define EBPO_QUERY_MODEL_PARTS_H

#include <ebpo/query.h>

#include "core/cache.h"
#include "format/slice.h"
#include "query/accel.h"
#include "query/point_bounds.h"

/* --- the top: levels 0 .. cut level without faces, and which nodes lie below. Immutable; any
 * thread
 * --- */

typedef struct ebpo_top_planes {
    uint32_t first;
    uint32_t count;
} ebpo_top_planes;

typedef struct ebpo_top {
    int cut_level;
    /* entries UNIFORM, GRAY (levels above the cut), BELOW (gray nodes of the cut level, leaves down
     * to it, pruned nodes) */
    ebpo_node_table nodes;
    uint32_t *planes;      /* codes */
    ebpo_top_planes *gray; /* which of them are the gray node's whose children are group g */

    uint64_t below_count;
    ebpo_node *below;              /* NULL of envelopes alone */
    ebpo_top_planes *below_planes; /* [below_count]; leaves have none */
    uint64_t bytes;
} ebpo_top;

EBPO_MUST_USE ebpo_status ebpo_top_read(ebpo_top **out, const ebpo_file *file, int cut_level,
                                        unsigned threads, ebpo_error *error);
/* Only envelopes, with room for nothing else: without `below`. */
EBPO_MUST_USE ebpo_status ebpo_top_read_envelopes(ebpo_top **out, const ebpo_file *file,
                                                  int cut_level, unsigned threads,
                                                  ebpo_error *error);
void ebpo_top_free(ebpo_top *top);

/* Bytes that the top will take: from the head alone. */
uint64_t ebpo_top_estimate(const ebpo_info *info, int cut_level);
uint64_t ebpo_top_envelopes_estimate(const ebpo_info *info, int cut_level);

/* --- skeletons ---
 *
 * What is kept in memory of each subtree that has ever been loaded: the upper nodes of its
 * hierarchy over faces (query/accel.h), eight at first, 2 KB where the subtree takes hundreds. They
 * bound the distance to its faces much better than its cell and its envelope do, so that searches
 * load it again only if it may matter. Made when it is loaded, kept when the cache drops it: works
 * for every file, and costs no reading. Whenever a search has loaded it for nothing, nodes are
 * added where it was looked for: memory goes where bounds are too loose.
 *
 * Lower bounds only. Subtrees are searched in the order of certain lower bounds until the next is
 * beyond what has been found (nearest_subtrees.c): those searched are the ones whose bound is at
 * most the answer. No upper bound could save one of them. */

/* Any thread; one at a time where it is not const. */
typedef struct ebpo_skeleton ebpo_skeleton;

/* Certain lower bounds of the distance to a subtree's faces, in the model's unit: to its own, which
 * no other subtree has as its own, and to its outer ones. INFINITY: it has none. */
typedef struct ebpo_skeleton_bounds {
    double own, outer;
} ebpo_skeleton_bounds;

/* With at most `nodes` nodes, 1 to 8. NULL: the subtree has no faces, or is of a size that doubles
 * do not square; no memory. */
ebpo_skeleton *ebpo_skeleton_make(const ebpo_accel *subtree, unsigned nodes);
void ebpo_skeleton_free(ebpo_skeleton *skeleton);
/* At most, of memory. */
uint64_t ebpo_skeleton_bytes(unsigned nodes);

/* What is beyond `limit` may be INFINITY, too. */
ebpo_skeleton_bounds ebpo_skeleton_lower_bounds(const ebpo_skeleton *skeleton, const double p[3],
                                                double limit);
/* The same of keys, for a far point. */
ebpo_skeleton_bounds ebpo_skeleton_far_bounds(const ebpo_skeleton *skeleton, const ebpo_far *far,
                                              double limit);

/* As many as there may be after growing. */
enum { EBPO_SKELETON_NODES = 64 };
/* Adds up to eight nodes of the same subtree, those that are nearest to p as far as is known, while
 * that is within `limit`. `take` says whether there is room for more. */
void ebpo_skeleton_grow(ebpo_skeleton *skeleton, const ebpo_accel *subtree, const double p[3],
                        double limit, bool (*take)(void *user, uint64_t bytes), void *user);

/* Boxes, in the model's unit, around the outer faces that may be within `limit` of p; returns how
 * many. Each outer face is another subtree's own, whose cell it meets. */
typedef struct ebpo_outer_box {
    double low[3], high[3];
} ebpo_outer_box;
enum { EBPO_OUTER_BOXES = 64 };
unsigned ebpo_skeleton_outer_boxes(const ebpo_skeleton *skeleton, const double p[3], double limit,
                                   ebpo_outer_box out[EBPO_OUTER_BOXES]);

/* Those of a model's subtrees, by their numbers. Any thread. */
typedef struct ebpo_skeletons ebpo_skeletons;

/* `room`: bytes that they may take at most, all in all, see ebpo_skeletons_room. Of a cache's
 * budget, as they come to be needed, or NULL. NULL without memory. */
ebpo_skeletons *ebpo_skeletons_make(uint64_t count, uint64_t room, ebpo_cache *cache);
/* After all others have done with it; NULL is fine. */
void ebpo_skeletons_free(ebpo_skeletons *all);
/* The part of `room` that `count` skeletons can make use of. */
uint64_t ebpo_skeletons_room(uint64_t count, uint64_t room);
/* Of their room, for what tells of subtrees beside them; false: there is not enough left. And back,
 * what has been taken so. Any thread. */
bool ebpo_skeletons_take(ebpo_skeletons *all, uint64_t bytes);
void ebpo_skeletons_give_back(ebpo_skeletons *all, uint64_t bytes);
/* Of memory, now. */
uint64_t ebpo_skeletons_bytes(const ebpo_skeletons *all);

/* Keeps that of a subtree, unless it is there or there is no room. */
void ebpo_skeletons_keep(ebpo_skeletons *all, uint64_t number, const ebpo_accel *subtree);
/* Adds to what is kept of it, as ebpo_skeleton_grow does. */
void ebpo_skeletons_grow(ebpo_skeletons *all, uint64_t number, const ebpo_accel *subtree,
                         const double p[3], double limit);
/* NULL where nothing is known. */
const ebpo_skeleton *ebpo_skeletons_find(const ebpo_skeletons *all, uint64_t number);

/* --- shares of a budget --- */

/* For loading one at least. */
enum { EBPO_SUBTREES_LEAST = 1 << 20 };

/* For decoded chunks. */
enum { EBPO_CHUNKS_LEAST = 2 << 20 };

/* Bytes for decoded chunks, for skeletons, and for both: what is not for the top and subtrees. */
uint64_t ebpo_chunk_budget(uint64_t budget);
uint64_t ebpo_skeleton_budget(const ebpo_model_options *options, uint64_t budget);
uint64_t ebpo_beside_subtrees(const ebpo_model_options *options, uint64_t budget);

/* --- the plan for a model's budget, from the counts in the file's head --- */

/* Sets the budget: what is left of one that is shared, or that of a file far away where nobody
 * asked for one; true then. */
bool ebpo_usual_memory(const ebpo_file *file, ebpo_model_options *options);

/* Everything at once, or the cut level. Errors are those of ebpo_model_memory. */
EBPO_MUST_USE ebpo_status ebpo_plan_model(const ebpo_file *file, const ebpo_model_options *options,
                                          bool default_memory, ebpo_model_plan *out,
                                          ebpo_error *error);
/* The cut level for a budget that everything was found to exceed. Only that and `least` are set. */
EBPO_MUST_USE ebpo_status ebpo_plan_parts(const ebpo_file *file, const ebpo_model_options *options,
                                          ebpo_model_plan *out, ebpo_error *error);

/* --- shared budgets ---
 *
 * A budget that models share: what of it each of them takes for good, and what is for the caches of
 * all. Any thread. */

/* Of the caches of subtrees, and of those of chunks: what one loads needs room in the other. */
ebpo_cache_pool *ebpo_budget_subtrees(const ebpo_budget *budget);
ebpo_cache_pool *ebpo_budget_chunks(const ebpo_budget *budget);

uint64_t ebpo_budget_bytes(const ebpo_budget *budget);

/* Takes bytes for a model that is all in memory, for as long as it lives. False: these take too
 * much, or there is no room. And what turned out not to be needed, or all of it, back. */
bool ebpo_budget_take_whole(ebpo_budget *budget, uint64_t bytes);
void ebpo_budget_give_back_whole(ebpo_budget *budget, uint64_t bytes);

/* Of the room for skeletons, at most `wanted`; and back. */
uint64_t ebpo_budget_take_skeletons(ebpo_budget *budget, uint64_t wanted);
void ebpo_budget_give_back_skeletons(ebpo_budget *budget, uint64_t bytes);

#endif
