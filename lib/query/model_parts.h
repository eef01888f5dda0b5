/* Parts of a model beside subtrees: the top of its tree, skeletons, and its share of budgets. */
#ifndef EBPO_QUERY_MODEL_PARTS_H
#define EBPO_QUERY_MODEL_PARTS_H

#include <ebpo/query.h>

#include "core/cache.h"
#include "format/slice.h"
#include "query/accel.h"
#include "query/point_bounds.h"

/* --- the top: levels 0 .. cut level, without faces. Immutable; any thread --- */

typedef struct ebpo_top_planes {
    uint32_t first;
    uint32_t count;
} ebpo_top_planes;

typedef struct ebpo_top {
    int cut_level;
    /* Entries are UNIFORM, GRAY (gray nodes above the cut level), or SUBTREE_ROOT: gray nodes of
     * the cut level, leaves down to this level, and pruned nodes (whose children are not in the
     * file). */
    ebpo_node_table nodes;
    uint32_t *planes;      /* codes of all planes */
    ebpo_top_planes *gray; /* planes of the gray node whose children are group g */

    uint64_t below_count;
    /* [below_count] nodes of the kind SUBTREE_ROOT; NULL in a table of envelopes alone */
    ebpo_node *below;
    ebpo_top_planes *below_planes; /* [below_count] planes of these nodes; leaves have none */
    uint64_t bytes;
} ebpo_top;

EBPO_MUST_USE ebpo_status ebpo_top_read(ebpo_top **out, const ebpo_file *file, int cut_level,
                                        unsigned threads, ebpo_error *error);
/* Reads only envelopes, and allocates memory for nothing else; `below` is NULL. */
EBPO_MUST_USE ebpo_status ebpo_top_read_envelopes(ebpo_top **out, const ebpo_file *file,
                                                  int cut_level, unsigned threads,
                                                  ebpo_error *error);
void ebpo_top_free(ebpo_top *top);

/* Returns the bytes that the top will take, from the file header alone. */
uint64_t ebpo_top_estimate(const ebpo_info *info, int cut_level);
uint64_t ebpo_top_envelopes_estimate(const ebpo_info *info, int cut_level);

/* --- skeletons ---
 *
 * A skeleton has the upper nodes of a subtree's hierarchy over faces (query/accel.h). It is kept in
 * memory for each subtree that has been loaded: eight nodes at first, 2 KB where the subtree takes
 * hundreds. Skeletons bound the distance to a subtree's faces much better than its cell and its
 * envelope do, so searches load the subtree again only if it may matter. A skeleton is made when
 * the subtree is loaded and kept when the cache drops the subtree: this works for every file, and
 * needs no further reading. When a search loads a subtree without need, nodes are added near the
 * query point: memory is used where bounds are too loose.
 *
 * Skeletons give lower bounds only. Subtrees are searched in the order of guaranteed lower bounds
 * until the next bound is beyond the found distance (nearest_subtrees.c): the searched subtrees are
 * those whose bound is at most the result. No upper bound could avoid searching one of these. */

/* Any thread may use const skeletons; one thread at a time may change one. */
typedef struct ebpo_skeleton ebpo_skeleton;

/* Guaranteed lower bounds of the distance to a subtree's faces, in the model's unit: to its owned
 * faces, which no other subtree owns, and to its shared faces. INFINITY: there are no such faces.
 */
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
/* As ebpo_skeleton_lower_bounds, with keys instead of distances, for a far point (point_bounds.h).
 */
ebpo_skeleton_bounds ebpo_skeleton_far_bounds(const ebpo_skeleton *skeleton, const ebpo_far *far,
                                              double limit);

/* Maximum number of nodes after growing. */
enum { EBPO_SKELETON_NODES = 64 };
/* Adds up to eight nodes of the same subtree: those nearest to p, as far as is known, and within
 * `limit`. `take` returns true if the quota allows more. */
void ebpo_skeleton_grow(ebpo_skeleton *skeleton, const ebpo_accel *subtree, const double p[3],
                        double limit, bool (*take)(void *user, uint64_t bytes), void *user);

/* Writes boxes, in the model's unit, around the shared faces that may be within `limit` of p;
 * returns the number of boxes. Each shared face is owned by another subtree, whose cell it
 * intersects. */
typedef struct ebpo_shared_box {
    double low[3], high[3];
} ebpo_shared_box;
enum { EBPO_SHARED_BOXES = 64 };
unsigned ebpo_skeleton_shared_boxes(const ebpo_skeleton *skeleton, const double p[3], double limit,
                                    ebpo_shared_box out[EBPO_SHARED_BOXES]);

/* The skeletons of a model's subtrees, by the subtrees' numbers. Any thread. */
typedef struct ebpo_skeletons ebpo_skeletons;

/* Makes the table. `space`: quota in bytes for all skeletons, see ebpo_skeletons_capacity. The
 * bytes are taken when needed from the budget of `cache`, unless it is NULL. Returns NULL without
 * memory. */
ebpo_skeletons *ebpo_skeletons_make(uint64_t count, uint64_t space, ebpo_cache *cache);
/* Frees the table after all other threads have finished; NULL is allowed. */
void ebpo_skeletons_free(ebpo_skeletons *all);
/* Returns the part of `space` that `count` skeletons can use. */
uint64_t ebpo_skeletons_capacity(uint64_t count, uint64_t space);
/* Reserves bytes of the quota of skeletons for other data about subtrees; returns false if not
 * enough is left. The other function returns such bytes to the quota. Any thread. */
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

/* Return the bytes for decoded chunks, for skeletons, and for both together; the rest is for the
 * top and subtrees. */
uint64_t ebpo_chunk_budget(uint64_t budget);
uint64_t ebpo_skeleton_budget(const ebpo_model_options *options, uint64_t budget);
uint64_t ebpo_bytes_besides_subtrees(const ebpo_model_options *options, uint64_t budget);

/* --- the plan for a model's budget, from the counts in the file header --- */

/* Sets options->memory: the remainder of a shared budget, or a default for a remote file if no
 * budget was given. Returns true in the last case. */
bool ebpo_default_memory(const ebpo_file *file, ebpo_model_options *options);

/* Plans to load everything at once, or chooses the cut level. Fails with the errors of
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

/* Return the pools of the caches of subtrees and of chunks. When one pool loads data, it needs
 * memory in the other. */
ebpo_cache_pool *ebpo_budget_subtrees(const ebpo_budget *budget);
ebpo_cache_pool *ebpo_budget_chunks(const ebpo_budget *budget);

uint64_t ebpo_budget_bytes(const ebpo_budget *budget);

/* Reserves bytes for a model that is all in memory, for the lifetime of the model. Returns false if
 * they exceed the limit or the free part. The other function returns unused bytes, or all bytes, to
 * the budget. */
bool ebpo_budget_take_whole(ebpo_budget *budget, uint64_t bytes);
void ebpo_budget_give_back_whole(ebpo_budget *budget, uint64_t bytes);

/* Reserves at most `wanted` bytes of the quota for skeletons; the other function returns them to
 * the quota. */
uint64_t ebpo_budget_take_skeletons(ebpo_budget *budget, uint64_t wanted);
void ebpo_budget_give_back_skeletons(ebpo_budget *budget, uint64_t bytes);

#endif
