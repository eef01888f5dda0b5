/* Goes from a node of a model to its children, in the top of the tree (levels 0 to the cut level)
 * and in subtrees, and computes bounds of distances from envelopes. Nodes of a subtree are valid
 * until the context enters another subtree. */
#ifndef EBPO_QUERY_QUERY_NODE_H
#define EBPO_QUERY_QUERY_NODE_H

#include "query/point_bounds.h"
#include "query/query_model.h"

ebpo_node ebpo_model_root(const ebpo_model *model);

/* Returns true for a node of the kind SUBTREE_ROOT: the root of a subtree that is loaded on demand.
 * Also true for a pruned node, whose subtree is not in the file and cannot be entered. */
static inline bool ebpo_node_is_subtree_root(const ebpo_node *node)
{
    return ebpo_entry_kind_of(node->entry) == EBPO_ENTRY_SUBTREE_ROOT;
}

/* Enters a subtree. On entry, `node` is of the kind SUBTREE_ROOT; on return, `node` is the root
 * node in the subtree's table. The subtree is loaded if needed, and stays in memory until the
 * context enters another subtree. Returns EBPO_E_ABSENT for a pruned node. */
EBPO_MUST_USE ebpo_status ebpo_model_enter(ebpo_context *context, ebpo_node *node,
                                           ebpo_error *error);

/* Returns a child of a gray node. The gray node must not be of the kind SUBTREE_ROOT. */
ebpo_node ebpo_model_child(const ebpo_model *model, const ebpo_node *gray, unsigned octant);

/* Source of nodes for cursors (geometry/cursor.h). The cursor's holder is an ebpo_context, which
 * loads subtrees as the cursor enters them. Only one cursor at a time may use a context. While
 * nodes of the cursor are used, the context may not be used for queries. */
extern const ebpo_node_source ebpo_context_source;

/* Returns the plane codes of the node itself, without the codes of the node's ancestors. */
const uint32_t *ebpo_model_planes(const ebpo_model *model, const ebpo_node *node, uint32_t *count);

/* A point p. Nodes are ranked by lower bounds of the distance of p to the faces in them. */
typedef struct ebpo_ranking {
    const ebpo_model *model;
    ebpo_box box; /* box of the model */
    const double *p;
    /* If not NULL, p is far, and bounds and limits are keys (point_bounds.h) instead of distances.
     */
    const ebpo_far *far;
} ebpo_ranking;
static inline ebpo_ranking ebpo_ranking_of(const ebpo_model *model, const double p[3],
                                           const ebpo_far *far)
{
    return (ebpo_ranking){ model, ebpo_model_box(model), p, far && far->far ? far : NULL };
}

/* Returns the lower bound of a node: the greater of `parent` (the bound of the node's parent) and
 * the bound from the node's cell and planes. */
double ebpo_rank_node(const ebpo_ranking *ranking, const ebpo_node *node, double parent);
/* Returns the lower bound of the root. */
double ebpo_rank_root(const ebpo_ranking *ranking);
/* Returns the lower bound of a cell with these planes. Once a bound is beyond `enough`, no better
 * bound is searched for. */
double ebpo_rank_cell(const ebpo_ranking *ranking, ebpo_cell cell, const uint32_t *codes,
                      uint32_t count, double enough);
/* Returns an upper bound of the distance (ebpo_cell_far) or key of a cell's farthest point. */
double ebpo_rank_cell_end(const ebpo_ranking *ranking, ebpo_cell cell);

/* A node and its lower bound. */
struct ebpo_ranked {
    ebpo_node node;
    double lower;
    uint8_t what; /* which faces of a subtree (nearest_subtrees.c); otherwise 0 */
};

/* Lists the children of a gray node that are gray nodes or leaves and have a lower bound of at most
 * `limit`, the nearest first. `parent`: bound of the gray node. Returns their number. */
int ebpo_rank_children(const ebpo_ranking *ranking, const ebpo_node *gray, double parent,
                       double limit, ebpo_ranked out[8]);

/* --- subsets: omitted parts must not change a result --- */

/* Returns EBPO_E_ABSENT, because the query needs a part of the tree that the file omits below the
 * node of this cell. The message gives the file, the position and how the file was cut. */
ebpo_status ebpo_fail_pruned(const ebpo_model *model, ebpo_cell cell, ebpo_error *error);

/* Returns true if the query's result may depend on what is in the node's cell. */
typedef bool (*ebpo_matters_fn)(void *user, const ebpo_box *box, const ebpo_node *node);

/* Returns EBPO_E_ABSENT if `matters` is true for a pruned node. If `matters` is true for a node, it
 * must be true for the node's parent. */
EBPO_MUST_USE ebpo_status ebpo_check_pruned(ebpo_context *context, ebpo_matters_fn matters,
                                            void *user, ebpo_error *error);

#endif
