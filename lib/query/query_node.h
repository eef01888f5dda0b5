/* Going down from node to node, in the top of a tree and in subtrees alike, with what envelopes
 * tell on the way. */
#ifndef EBPO_QUERY_WALK_H
#define EBPO_QUERY_WALK_H

#include "query/query_model.h"

/* A node. `subtree` is NULL in the top. */
typedef struct ebpo_spot {
    const ebpo_subtree *subtree;
    uint32_t entry;
    int level;
    uint32_t at[3];
} ebpo_spot;

ebpo_spot ebpo_spot_root(const ebpo_model *model);

/* True for gray nodes, also those whose subtree is not in memory. */
bool ebpo_spot_is_gray(const ebpo_model *model, const ebpo_spot *spot);
static inline bool ebpo_spot_is_uniform(const ebpo_spot *spot)
{
    return ebpo_entry_kind_of(spot->entry) == EBPO_ENTRY_UNIFORM;
}
/* Also true for pruned nodes, wherever they are: those cannot be entered. */
static inline bool ebpo_spot_is_below(const ebpo_spot *spot)
{
    return ebpo_entry_kind_of(spot->entry) == EBPO_ENTRY_BELOW;
}

static inline bool ebpo_spot_is_pruned(const ebpo_model *model, const ebpo_spot *spot)
{
    return ebpo_spot_is_below(spot) &&
           (spot->subtree || model->top->below[ebpo_entry_value(spot->entry)].pruned);
}

/* EBPO_E_ABSENT for a pruned node. For a spot BELOW: the same node as the root of its subtree,
 * loaded if need be; it stays until the context enters another one. */
EBPO_MUST_USE ebpo_status ebpo_spot_enter(ebpo_context *context, ebpo_spot *spot,
                                          ebpo_error *error);

/* Child of a gray node that is not BELOW. */
ebpo_spot ebpo_spot_child(const ebpo_model *model, const ebpo_spot *gray, unsigned octant);

/* Plane codes that the node itself has. */
const uint32_t *ebpo_spot_planes(const ebpo_model *model, const ebpo_spot *spot, uint32_t *count);

/* Length of the diagonal of the spot's cell, rounded up so that it bounds the distance of any point
 * of the cell to a face that the node lists. */
double ebpo_spot_diagonal(const ebpo_model *model, const ebpo_spot *spot);

/* --- envelopes, in codes and cells: any node --- */

/* True when p is certainly outside one of the half-spaces of a cell. */
bool ebpo_outside_planes(const ebpo_box *box, int level, const uint32_t at[3],
                         const uint32_t *codes, uint32_t count, const double p[3]);

/* Certain lower bound of the distance of p to the cell cut by the half-spaces, and upper bound of
 * the distance to the farthest point of the cell. */
double ebpo_envelope_distance(const ebpo_box *box, int level, const uint32_t at[3],
                              const uint32_t *codes, uint32_t count, const double p[3]);
double ebpo_cell_far(const ebpo_box *box, int level, const uint32_t at[3], const double p[3]);

/* The same for a node and the envelopes of its ancestors: `parent` is its parent's bound, 0 for the
 * root. */
double ebpo_spot_distance(const ebpo_model *model, const ebpo_box *box, const ebpo_spot *spot,
                          double parent, const double p[3]);

/* Children of a gray node that are neither white nor black, nearest first; returns how many. */
struct ebpo_ranked {
    ebpo_spot spot;
    double lower;
};

int ebpo_rank_children(const ebpo_model *model, const ebpo_box *box, const ebpo_spot *gray,
                       double parent, const double p[3], ebpo_ranked out[8]);

#endif
