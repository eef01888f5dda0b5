/* Declares the parts of a model other than subtrees: the top of its tree, skeletons, and its share
 * of budgets. */
#ifndef EBPO_QUERY_MODEL_PARTS_H
#define EBPO_QUERY_MODEL_PARTS_H

#include <ebpo/query.h>

#include "core/cache.h"
#include "format/slice.h"
#include "query/accel.h"
#include "query/point_bounds.h"

/* --- the top: levels 0 .. cut level, without faces. Immutable; any thread may use it --- */

/* A range of ebpo_top.planes. */
typedef struct ebpo_top_planes {
    uint32_t first;
    uint32_t count;
} ebpo_top_planes;

typedef struct ebpo_top {
    int cut_level;
    /* The kinds of entries are UNIFORM, GRAY (gray nodes above the cut level) and SUBTREE_ROOT:
     * gray nodes of the cut level, leaves down to the cut level, and pruned nodes (whose children
     * are not in the file). The value of an entry SUBTREE_ROOT is an index in `below`. */
    ebpo_node_table nodes;
    uint32_t *planes;      /* codes of all planes */
    ebpo_top_planes *gray; /* [group] planes of the gray node whose children are this group */

    uint64_t below_count;
    /* [below_count] nodes of the kind SUBTREE_ROOT; NULL after ebpo_top_read_envelopes */
    ebpo_node *below;
    ebpo_top_planes *below_planes; /* [below_count] planes of these nodes; leaves have none */
    uint64_t bytes;
} ebpo_top;

/* Reads the top. */
EBPO_MUST_USE ebpo_status ebpo_top_read(ebpo_top **out, const ebpo_file *file, int cut_level,
                                        unsigned threads, ebpo_error *error);
/* Reads only the table of nodes and the planes; `below` is NULL. */
EBPO_MUST_USE ebpo_status ebpo_top_read_envelopes(ebpo_top **out, const ebpo_file *file,
                                                  int cut_level, unsigned threads,
                                                  ebpo_error *error);
void ebpo_top_free(ebpo_top *top);

/* Return upper bounds, from the counts in the file header, of the bytes that ebpo_top_read and
 * ebpo_top_read_envelopes will take. */
uint64_t ebpo_top_estimate(const ebpo_info *info, int cut_level);
uint64_t ebpo_top_envelopes_estimate(const ebpo_info *info, int cut_level);

/* --- skeletons ---
 *
 * A skeleton has the upper nodes of a subtree's hierarchy over faces (query/accel.h): eight nodes
 * at first, which take 2 KB, whereas the subtree takes hundreds. Skeletons bound the distance to a
 * subtree's faces much better than the subtree's cell and envelope do, so searches load the subtree
 * again only if it may matter. A skeleton is made when the subtree is loaded, without reading more
 * of the file, and is kept when the cache drops the subtree. When a search loads a subtree without
 * need, nodes near the query point are added to its skeleton: so memory is used where bounds are
 * too loose.
 *
 * Skeletons give lower bounds only. Upper bounds would not help: subtrees are searched in the order
 * of lower bounds until the next bound is beyond the found distance (nearest_subtrees.c), and every
 * subtree whose lower bound is at most the result must be searched. */

/* Any thread may read a skeleton, also while one other thread changes it. */
typedef struct ebpo_skeleton ebpo_skeleton;

/* Guaranteed lower bounds of the distance, in the model's unit, to the faces that the subtree owns,
 * and to its shared faces, which other subtrees own. INFINITY: there are no such faces. */
typedef struct ebpo_skeleton_bounds {
    double owned, shared;
} ebpo_skeleton_bounds;

/* Makes a skeleton with at most `nodes` nodes, 1 to 8. Returns NULL if the subtree has no faces, if
 * squares of its size overflow or underflow, or without memory. */
ebpo_skeleton *ebpo_skeleton_make(const ebpo_accel *subtree, unsigned nodes);
void ebpo_skeleton_free(ebpo_skeleton *skeleton);
/* Returns the maximum bytes of a skeleton with this number of nodes. */
uint64_t ebpo_skeleton_bytes(unsigned nodes);

/* Returns lower bounds; those beyond `limit` may be INFINITY. */
ebpo_skeleton_bounds ebpo_skeleton_lower_bounds(const ebpo_skeleton *skeleton, const double p[3],
                                                double limit);
/* Returns lower bounds of keys instead of distances, for a far point (point_bounds.h). */
ebpo_skeleton_bounds ebpo_skeleton_far_bounds(const ebpo_skeleton *skeleton, const ebpo_far *far,
                                              double limit);

/* Maximum number of nodes after growing. */
enum { EBPO_SKELETON_NODES = 64 };
/* Adds up to eight nodes of the same subtree: the nodes within `limit` of p that have the least
 * lower bounds. `take` reserves bytes of a quota, and returns false if that is not possible. */
void ebpo_skeleton_grow(ebpo_skeleton *skeleton, const ebpo_accel *subtree, const double p[3],
                        double limit, bool (*take)(void *user, uint64_t bytes), void *user);

/* A box around some shared faces, in the model's unit. */
typedef struct ebpo_shared_box {
    double low[3], high[3];
} ebpo_shared_box;
/* Maximum number of boxes of a skeleton. */
enum { EBPO_SHARED_BOXES = 64 };
/* Writes boxes around the shared faces that may be within `limit` of p, and returns their number.
 */
unsigned ebpo_skeleton_shared_boxes(const ebpo_skeleton *skeleton, const double p[3], double limit,
                                    ebpo_shared_box out[EBPO_SHARED_BOXES]);

/* The skeletons of a model's subtrees. `number`: index of a subtree in top->below. Any thread. */
typedef struct ebpo_skeletons ebpo_skeletons;

/* Makes an empty table for `count` subtrees. `space`: quota in bytes for all skeletons
 * (ebpo_skeletons_capacity). When bytes are needed, they are taken from the budget of `cache`,
 * unless it is NULL. Returns NULL without memory. */
ebpo_skeletons *ebpo_skeletons_make(uint64_t count, uint64_t space, ebpo_cache *cache);
/* Frees the table after all other threads have finished; NULL is allowed. */
void ebpo_skeletons_free(ebpo_skeletons *all);
/* Returns the part of `space` that `count` skeletons can use. */
uint64_t ebpo_skeletons_capacity(uint64_t count, uint64_t space);
/* Reserve bytes of the quota for other data about subtrees (deep bounds, nearest.h), and give them
 * back. The first function returns false if the quota is too small. Any thread. */
bool ebpo_skeletons_take(ebpo_skeletons *all, uint64_t bytes);
void ebpo_skeletons_give_back(ebpo_skeletons *all, uint64_t bytes);
/* Returns the bytes of memory that are used now. */
uint64_t ebpo_skeletons_bytes(const ebpo_skeletons *all);

/* Keeps the skeleton of a subtree, unless it exists or the quota is used up. */
void ebpo_skeletons_keep(ebpo_skeletons *all, uint64_t number, const ebpo_accel *subtree);
/* Adds nodes to the kept skeleton, as ebpo_skeleton_grow does. */
void ebpo_skeletons_grow(ebpo_skeletons *all, uint64_t number, const ebpo_accel *subtree,
                         const double p[3], double limit);
/* Returns NULL if no skeleton is kept. */
const ebpo_skeleton *ebpo_skeletons_find(const ebpo_skeletons *all, uint64_t number);

/* --- shares of a budget --- */

/* Bytes for loading at least one subtree. */
enum { EBPO_SUBTREES_LEAST = 1 << 20 };

/* Bytes for decoded chunks. */
enum { EBPO_CHUNKS_LEAST = 2 << 20 };

/* Return the bytes of a budget for decoded chunks, for skeletons, and for both together. The
 * remaining bytes are for the top and subtrees. */
uint64_t ebpo_chunk_budget(uint64_t budget);
uint64_t ebpo_skeleton_budget(const ebpo_model_options *options, uint64_t budget);
uint64_t ebpo_bytes_besides_subtrees(const ebpo_model_options *options, uint64_t budget);

/* --- the plan for a model's budget, from the counts in the file header --- */

/* Sets options->memory: for a shared budget, the bytes that are not taken permanently; for a remote
 * file without any budget, a default unless a cut level is given. Returns true for a remote file
 * without any budget. */
bool ebpo_default_memory(const ebpo_file *file, ebpo_model_options *options);

/* Decides if the whole model is loaded, or chooses the cut level. Returns the errors of
 * ebpo_model_memory. */
EBPO_MUST_USE ebpo_status ebpo_plan_model(const ebpo_file *file, const ebpo_model_options *options,
                                          bool default_memory, ebpo_model_plan *out,
                                          ebpo_error *error);
/* Chooses the cut level for a budget that the whole model exceeds. Sets only the cut level and
 * `least`. */
EBPO_MUST_USE ebpo_status ebpo_plan_parts(const ebpo_file *file, const ebpo_model_options *options,
                                          ebpo_model_plan *out, ebpo_error *error);

/* --- shared budgets ---
 *
 * A budget that several models share. It counts the bytes that each model takes permanently, and
 * the bytes for the caches of all models. Any thread. */

/* Return the pools of the caches of subtrees and of chunks. They are separate, because loading a
 * subtree needs memory for chunks. */
ebpo_cache_pool *ebpo_budget_subtrees(const ebpo_budget *budget);
ebpo_cache_pool *ebpo_budget_chunks(const ebpo_budget *budget);

uint64_t ebpo_budget_bytes(const ebpo_budget *budget);

/* Reserve bytes for a whole model, and give back unused bytes or, at the end of the model, all
 * bytes. The first function returns false if the bytes exceed the quota of whole models or the free
 * part of the budget. */
bool ebpo_budget_take_whole(ebpo_budget *budget, uint64_t bytes);
void ebpo_budget_give_back_whole(ebpo_budget *budget, uint64_t bytes);

/* Reserve at most `wanted` bytes of the quota of skeletons (returns their number), and give them
 * back. */
uint64_t ebpo_budget_take_skeletons(ebpo_budget *budget, uint64_t wanted);
void ebpo_budget_give_back_skeletons(ebpo_budget *budget, uint64_t bytes);

#endif
