/* Declares the parts of a model that are not subtrees: the top of its tree, skeletons, and its
 * share of budgets. A model that is not completely in memory keeps the top of its tree in memory
 * and loads the subtrees below the top on demand. */
#ifndef EBPO_QUERY_MODEL_PARTS_H
#define EBPO_QUERY_MODEL_PARTS_H

#include <ebpo/query.h>

#include "core/cache.h"
#include "format/slice.h"
#include "query/accel.h"
#include "query/point_bounds.h"

/* --- the top: levels 0 to the cut level, without faces. The top does not change after it is made;
 * any thread may use it --- */

/* A range of ebpo_top.planes. */
typedef struct ebpo_top_planes {
    uint32_t first;
    uint32_t count;
} ebpo_top_planes;

typedef struct ebpo_top {
    int cut_level;
    /* The kinds of entries are UNIFORM (white and black nodes), GRAY (gray nodes above the cut
     * level) and SUBTREE_ROOT. The roots of subtrees (SUBTREE_ROOT) are gray nodes of the cut
     * level, leaves down to the cut level, and pruned nodes, whose children are not in the file.
     * The value of an entry SUBTREE_ROOT is an index in `below`. */
    ebpo_node_table nodes;
    uint32_t *planes;      /* codes of all planes */
    ebpo_top_planes *gray; /* [group] planes of the gray node whose children are this group */

    uint64_t below_count;
    /* [below_count] the roots of the subtrees; NULL after ebpo_top_read_envelopes. A subtree is
     * identified by its index in this array, in variables called `below` */
    ebpo_node *below;
    ebpo_top_planes *below_planes; /* [below_count] planes of these nodes; leaves have none */
    uint64_t bytes;                /* of memory that the top takes */
} ebpo_top;

/* Reads the top of a file. */
EBPO_MUST_USE ebpo_status ebpo_top_read(ebpo_top **out, const ebpo_file *file, int cut_level,
                                        unsigned threads, ebpo_error *error);
/* Reads only the table of nodes and the planes, without `below`. */
EBPO_MUST_USE ebpo_status ebpo_top_read_envelopes(ebpo_top **out, const ebpo_file *file,
                                                  int cut_level, unsigned threads,
                                                  ebpo_error *error);
/* Number of levels of deep bounds (nearest.h). Each level takes four times the memory of the level
 * above it, and a third level would save only a tenth of the remaining loads
 * (docs/develop/design.md). */
enum { EBPO_DEEP_LEVELS = 2 };
/* Reads the envelopes of the first EBPO_DEEP_LEVELS levels below a gray node of a file that is no
 * subset. Level 0 of the result is this node. */
EBPO_MUST_USE ebpo_status ebpo_top_read_subtree(ebpo_top **out, ebpo_chunks *chunks,
                                                const ebpo_node *root, ebpo_error *error);
/* The data that ebpo_top_read_subtree needs. */
enum { EBPO_TOP_ENVELOPES = EBPO_NEEDS_ALWAYS | EBPO_NEEDS_PLANES };
void ebpo_top_free(ebpo_top *top);

/* ebpo_top_estimate and ebpo_top_envelopes_estimate return upper bounds of the bytes that
 * ebpo_top_read and ebpo_top_read_envelopes will take. The bounds follow from the counts in the
 * file header. */
uint64_t ebpo_top_estimate(const ebpo_info *info, int cut_level);
uint64_t ebpo_top_envelopes_estimate(const ebpo_info *info, int cut_level);

/* For a remote file with a table of subtrees: sends prefetch hints for `count` subtrees, by their
 * indices in top->below. A leaf that is in no subtree of the file is loaded like a subtree; its
 * list of faces is read here, because only this list names the faces that it shares with other
 * leaves. `needs`: EBPO_NEEDS_... (schema.h); without EBPO_NEEDS_MESH, all are subtrees of the
 * file, and only nodes down to `last_level` are hinted. */
void ebpo_top_hint(const ebpo_top *top, ebpo_chunks *chunks, const uint32_t *below, uint64_t count,
                   uint32_t needs, int last_level);

/* --- skeletons ---
 *
 * A skeleton has the upper nodes of a subtree's hierarchy over faces (query/accel.h): eight nodes
 * at first, which take 2 KB, whereas the subtree takes hundreds of KB. A skeleton gives a much
 * better lower bound of the distance to a subtree's faces than the subtree's cell and envelope. So
 * searches rarely reload a subtree without a near face. A skeleton is made when the subtree is
 * loaded, without reading more of the file, and is kept when the cache drops the subtree. If a
 * search loads a subtree and finds no near face in it, nodes near the query point are added to the
 * subtree's skeleton. So skeletons grow at the places for which bounds are not good enough.
 *
 * Skeletons give lower bounds only. Upper bounds would not help, because every subtree whose lower
 * bound is at most the result must be searched. Subtrees are searched in the order of lower bounds
 * until the next bound is beyond the found distance (nearest_subtrees.c). */

/* Any thread may read a skeleton, also while one other thread changes it. */
typedef struct ebpo_skeleton ebpo_skeleton;

/* Guaranteed lower bounds of the distance, in the model's unit, to the faces that the subtree owns,
 * and to its shared faces, which it lists but other subtrees own. INFINITY: there are no such
 * faces.
 */
typedef struct ebpo_skeleton_bounds {
    double owned, shared;
} ebpo_skeleton_bounds;

/* Makes a skeleton with at most `nodes` nodes, 1 to 8. Returns NULL if the subtree has no faces, if
 * squares of its size overflow or underflow, or when out of memory. */
ebpo_skeleton *ebpo_skeleton_make(const ebpo_accel *subtree, unsigned nodes);
void ebpo_skeleton_free(ebpo_skeleton *skeleton);
/* Returns the maximum bytes of a skeleton with this number of nodes. */
uint64_t ebpo_skeleton_bytes(unsigned nodes);

/* Returns lower bounds. A bound beyond `limit` may be replaced by INFINITY. */
ebpo_skeleton_bounds ebpo_skeleton_lower_bounds(const ebpo_skeleton *skeleton, const double p[3],
                                                double limit);
/* Returns lower bounds of keys, which replace distances for a far point (point_bounds.h). */
ebpo_skeleton_bounds ebpo_skeleton_far_bounds(const ebpo_skeleton *skeleton, const ebpo_far *far,
                                              double limit);

/* Maximum number of nodes after growing. */
enum { EBPO_SKELETON_NODES = 64 };
/* Adds at most eight nodes of the subtree's hierarchy to its skeleton: those within `limit` of p
 * that have the least lower bounds. `take` reserves bytes of a quota, and returns false if the
 * quota is too small. */
void ebpo_skeleton_grow(ebpo_skeleton *skeleton, const ebpo_accel *subtree, const double p[3],
                        double limit, bool (*take)(void *user, uint64_t bytes), void *user);

/* A box around some faces, in the model's unit. */
typedef struct ebpo_faces_box {
    double low[3], high[3];
} ebpo_faces_box;
/* Maximum number of boxes of a skeleton. */
enum { EBPO_SHARED_BOXES = 64 };
/* Writes boxes that contain all shared faces that may be within `limit` of p; returns the number of
 * boxes. */
unsigned ebpo_skeleton_shared_boxes(const ebpo_skeleton *skeleton, const double p[3], double limit,
                                    ebpo_faces_box out[EBPO_SHARED_BOXES]);

/* The nodes of a skeleton as an accel without faces. A child whose node the skeleton does not have
 * is block 0. Set are only the members that walks over pairs of nodes read: the frame, the boxes
 * and cylinders, and the hierarchy. */
typedef struct ebpo_skeleton_accel {
    ebpo_accel accel;
    ebpo_bound bound[EBPO_SKELETON_NODES];
    ebpo_bound_cylinder cylinder[EBPO_SKELETON_NODES];
} ebpo_skeleton_accel;
void ebpo_skeleton_copy(const ebpo_skeleton *skeleton, ebpo_skeleton_accel *out);

/* The skeletons of a model's subtrees. `number`: index of a subtree in top->below. Any thread may
 * use the skeletons. */
typedef struct ebpo_skeletons ebpo_skeletons;

/* Makes an empty table for `count` subtrees. `space`: quota in bytes for all skeletons
 * (ebpo_skeletons_capacity). When bytes are needed, they are taken from the budget of `cache`,
 * unless `cache` is NULL. Returns NULL when out of memory. */
ebpo_skeletons *ebpo_skeletons_make(uint64_t count, uint64_t space, ebpo_cache *cache);
/* Frees the table after all other threads have finished; NULL is allowed. */
void ebpo_skeletons_free(ebpo_skeletons *all);
/* Returns how many bytes of `space` the skeletons of `count` subtrees can use at most. */
uint64_t ebpo_skeletons_capacity(uint64_t count, uint64_t space);
/* ebpo_skeletons_take reserves bytes of the quota for other data about subtrees (deep bounds,
 * nearest.h), and returns false if the quota is too small. ebpo_skeletons_give_back gives such
 * bytes back. Any thread may call these functions. */
bool ebpo_skeletons_take(ebpo_skeletons *all, uint64_t bytes);
void ebpo_skeletons_give_back(ebpo_skeletons *all, uint64_t bytes);
/* Returns the bytes of memory that are used now. */
uint64_t ebpo_skeletons_bytes(const ebpo_skeletons *all);

/* Makes and keeps the skeleton of a subtree, unless it is already kept or the quota is used up. */
void ebpo_skeletons_keep(ebpo_skeletons *all, uint64_t number, const ebpo_accel *subtree);
/* Adds nodes to the kept skeleton, as ebpo_skeleton_grow does. */
void ebpo_skeletons_grow(ebpo_skeletons *all, uint64_t number, const ebpo_accel *subtree,
                         const double p[3], double limit);
/* Returns the skeleton of a subtree, or NULL if none is kept. */
const ebpo_skeleton *ebpo_skeletons_find(const ebpo_skeletons *all, uint64_t number);

/* --- shares of a budget --- */

/* The least bytes for subtrees, so that at least one can be loaded. */
enum { EBPO_SUBTREES_LEAST = 1 << 20 };

/* The least bytes for decoded chunks. */
enum { EBPO_CHUNKS_LEAST = 2 << 20 };

/* The next three functions return the bytes of a budget for decoded chunks, for skeletons, and for
 * both together. The remaining bytes are for the top and subtrees. */
uint64_t ebpo_chunk_budget(uint64_t budget);
uint64_t ebpo_skeleton_budget(const ebpo_model_options *options, uint64_t budget);
uint64_t ebpo_bytes_besides_subtrees(const ebpo_model_options *options, uint64_t budget);

/* --- the plan for a model's budget, from the counts in the file header --- */

/* Sets options->memory in two cases. For a shared budget: to the bytes that no model has taken
 * permanently. For a remote file without any budget: to a default, unless a cut level is given.
 * Returns true for a remote file without any budget. */
bool ebpo_default_memory(const ebpo_file *file, ebpo_model_options *options);

/* Decides if the whole model is loaded, and otherwise chooses the cut level. Errors: as for
 * ebpo_model_memory. */
EBPO_MUST_USE ebpo_status ebpo_plan_model(const ebpo_file *file, const ebpo_model_options *options,
                                          bool default_memory, ebpo_model_plan *out,
                                          ebpo_error *error);
/* Chooses the cut level for a budget that is too small for the whole model. Sets only
 * out->cut_level and out->least. */
EBPO_MUST_USE ebpo_status ebpo_plan_parts(const ebpo_file *file, const ebpo_model_options *options,
                                          ebpo_model_plan *out, ebpo_error *error);

/* --- shared budgets ---
 *
 * Several models may share a budget. The budget counts the bytes that each model takes permanently,
 * and the bytes for the caches of all models. Any thread may use a shared budget. */

/* ebpo_budget_subtrees and ebpo_budget_chunks return the pools of the caches of subtrees and of
 * chunks. The pools are separate, because loading a subtree needs memory for chunks. */
ebpo_cache_pool *ebpo_budget_subtrees(const ebpo_budget *budget);
ebpo_cache_pool *ebpo_budget_chunks(const ebpo_budget *budget);

uint64_t ebpo_budget_bytes(const ebpo_budget *budget);

/* ebpo_budget_take_whole reserves bytes for a model that is held completely in memory.
 * ebpo_budget_take_whole returns false if the bytes exceed the quota of whole models or the free
 * part of the budget. ebpo_budget_give_back_whole gives bytes back: unused bytes, or, when the
 * model is closed, all bytes. */
bool ebpo_budget_take_whole(ebpo_budget *budget, uint64_t bytes);
void ebpo_budget_give_back_whole(ebpo_budget *budget, uint64_t bytes);

/* ebpo_budget_take_skeletons reserves at most `wanted` bytes of the quota of skeletons, and returns
 * the number of reserved bytes. ebpo_budget_give_back_skeletons gives bytes back. */
uint64_t ebpo_budget_take_skeletons(ebpo_budget *budget, uint64_t wanted);
void ebpo_budget_give_back_skeletons(ebpo_budget *budget, uint64_t bytes);

#endif
