/* Nodes of a model: going down from one to the next, in the top of its tree and in subtrees alike,
 * with what envelopes tell on the way. Nodes of a subtree last until the context enters another. */
#ifndef EBPO_QUERY_QUERY_NODE_H
#define EBPO_QUERY_QUERY_NODE_H

#include "query/point_bounds.h"
#include "query/query_model.h"

ebpo_node ebpo_model_root(const ebpo_model *model);

/* A node on whose far side another table begins: a subtree that is loaded on demand, or nothing,
 * for pruned nodes, which cannot be entered. */
static inline bool ebpo_node_is_below(const ebpo_node *node)
{
    return ebpo_entry_kind_of(node->entry) == EBPO_ENTRY_BELOW;
}

/* EBPO_E_ABSENT for a pruned node. For a node BELOW: the same as the root of its subtree, loaded if
 * need be; it stays until the context enters another one. */
EBPO_MUST_USE ebpo_status ebpo_model_enter(ebpo_context *context, ebpo_node *node,
                                           ebpo_error *error);

/* Child of a gray node that is not BELOW. */
ebpo_node ebpo_model_child(const ebpo_model *model, const ebpo_node *gray, unsigned octant);

/* For cursors (geometry/cursor.h); the holder is an ebpo_context, which loads subtrees as the
 * cursor comes to them: one cursor at a time, and no other question while its nodes are used. */
extern const ebpo_node_source ebpo_context_source;

/* Plane codes that the node itself has. */
const uint32_t *ebpo_model_planes(const ebpo_model *model, const ebpo_node *node, uint32_t *count);

/* A point that nodes are ranked for. */
typedef struct ebpo_ranking {
    const ebpo_model *model;
    ebpo_box box; /* the model's */
    const double *p;
    const ebpo_far *far; /* bounds and limits are its keys; NULL: they are distances */
} ebpo_ranking;
static inline ebpo_ranking ebpo_ranking_of(const ebpo_model *model, const double p[3],
                                           const ebpo_far *far)
{
    return (ebpo_ranking){ model, ebpo_model_box(model), p, far && far->far ? far : NULL };
}

/* Lower bound for what is in the node, by its envelope and those of its ancestors: `parent` is its
 * parent's bound; and of the root. */
double ebpo_rank_node(const ebpo_ranking *ranking, const ebpo_node *node, double parent);
double ebpo_rank_root(const ebpo_ranking *ranking);
/* The same for cells of which only the planes are known: some bound is enough that is beyond
 * `enough`. And an upper bound for the farthest point of a cell. */
double ebpo_rank_cell(const ebpo_ranking *ranking, ebpo_cell cell, const uint32_t *codes,
                      uint32_t count, double enough);
double ebpo_rank_cell_end(const ebpo_ranking *ranking, ebpo_cell cell);

/* Children of a gray node that are neither white nor black nor beyond `limit`, nearest first;
 * returns how many. */
struct ebpo_ranked {
    ebpo_node node;
    double lower;
    uint8_t what; /* of a subtree: nearest_subtrees.c */
};

int ebpo_rank_children(const ebpo_ranking *ranking, const ebpo_node *gray, double parent,
                       double limit, ebpo_ranked out[8]);

/* --- subsets: what was left out must not change a result --- */

/* EBPO_E_ABSENT: the question needs what was left out below this node. Says which file, where, and
 * what it was cut to. */
ebpo_status ebpo_fail_pruned(const ebpo_model *model, ebpo_cell cell, ebpo_error *error);

/* Whether something in the node's cell matters to the question. */
typedef bool (*ebpo_matters_fn)(void *user, const ebpo_box *box, const ebpo_node *node);

/* EBPO_OK when no pruned node matters. `matters` holds for a node when it does for one below it. */
EBPO_MUST_USE ebpo_status ebpo_check_pruned(ebpo_context *context, ebpo_matters_fn matters,
                                            void *user, ebpo_error *error);

#endif
