#include "core/strict_fp.h"

#include "extras/collide/subtree_distance.h"

#include <math.h>

#include "core/error.h"
#include "core/parallel.h"
#include "extras/collide/subtree_search.h"

static const char stage[] = "distance";

typedef struct searching {
    ebpo_subtree_search subtrees;
    ebpo_nearest_pair *n;
    double hi; /* cells tell that the distance is not greater */
} searching;

/* --- two accels --- */

ebpo_status ebpo_distance_of_accels(const ebpo_collision *q, const ebpo_accel *const accel[2],
                                    bool may_meet, ebpo_nearest_pair *n, ebpo_error *error)
{
    ebpo_collider *c = q->collider;
    ebpo_posing posing[2] = { q->posing[0].posing, q->posing[1].posing };
    int32_t meet = 0;
    if (accel[0]->bound_count == 0 || accel[1]->bound_count == 0)
        return EBPO_OK;
    ebpo_gap_begin(c->gap, accel, posing, q->reach);
    ebpo_status status = may_meet ? ebpo_collision_first(q, accel, stage, &meet, error) : EBPO_OK;
    if (status != EBPO_OK)
        return status;
    if (meet == 1) {
        ebpo_nearest_pair_met(n, c->gap, c->walk.met_slot);
        return EBPO_OK;
    }
    status = ebpo_nearest_pair_search(n, c->gap, error);
    c->node_pairs += c->gap->node_pairs;
    c->block_pairs += c->gap->block_pairs;
    return status;
}

/* --- pairs of nodes --- */

static ebpo_status look_at(searching *s, const ebpo_node_gap *pair, ebpo_error *error)
{
    const ebpo_accel *accel[2];
    bool there;
    ebpo_status status = ebpo_subtree_search_load(&s->subtrees, pair->node, accel, &there, error);
    return status == EBPO_OK && there
               ? ebpo_distance_of_accels(s->subtrees.question, accel, pair->gap == 0, s->n, error)
               : status;
}

static ebpo_status add(searching *s, const ebpo_posed_node node[2], double gap, ebpo_error *error)
{
    ebpo_node_gaps *nodes = &s->subtrees.nodes;
    ebpo_model *const *model = s->subtrees.question->model;
    ebpo_node_gap pair = { { node[0], node[1] }, 0 };
    for (int i = 0; i < 2; i++)
        if (ebpo_entry_kind_of(node[i].entry) == EBPO_ENTRY_UNIFORM)
            return EBPO_OK;
    ebpo_status status = ebpo_node_gap_of(nodes, node, &pair.gap, error);
    pair.gap = fmax(pair.gap, gap); /* the nodes are in those above them */
    if (status != EBPO_OK || pair.gap > fmin(s->hi, ebpo_nearest_pair_limit(s->n)))
        return status;
    if (!model[0]->info->pruned && !model[1]->info->pruned)
        s->hi = fmin(s->hi, ebpo_node_far_bound(nodes, node));
    return ebpo_node_gaps_push(nodes, &pair, error);
}

static ebpo_status divide(searching *s, const ebpo_node_gap *pair, int side, ebpo_error *error)
{
    ebpo_posed_node part[2] = { pair->node[0], pair->node[1] };
    ebpo_status status = EBPO_OK;
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        part[side] = ebpo_posed_child(&s->subtrees.nodes.side[side], &pair->node[side], octant);
        status = add(s, part, pair->gap, error);
    }
    return status;
}

/* Pairs come by their gaps: behind the first that is too far away there is nothing. */
static ebpo_status search(searching *s, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    ebpo_node_gaps *nodes = &s->subtrees.nodes;
    const ebpo_collision *q = s->subtrees.question;
    while (nodes->count > 0 && status == EBPO_OK && !ebpo_nearest_pair_is_done(s->n)) {
        ebpo_node_gap pair = ebpo_node_gaps_pop(nodes);
        int side = ebpo_subtree_search_side(&s->subtrees, pair.node);
        if (pair.gap > ebpo_nearest_pair_limit(s->n))
            return EBPO_OK;
        if (ebpo_collision_is_late(q))
            ebpo_nearest_pair_leave(s->n, pair.gap);
        else
            status = side < 0 ? look_at(s, &pair, error) : divide(s, &pair, side, error);
        if (ebpo_nearest_pair_is_done(s->n)) /* nobody looks at the others */
            ebpo_nearest_pair_leave(s->n, pair.gap);
        if (!ebpo_progress_step(&q->options.progress, stage, 0, 0, error))
            return EBPO_E_CANCELLED;
    }
    return status;
}

ebpo_status ebpo_distance_of_parts(const ebpo_collision *q, ebpo_nearest_pair *n, ebpo_error *error)
{
    searching s = { .n = n, .hi = INFINITY };
    ebpo_status status = ebpo_subtree_search_begin(&s.subtrees, q, error);
    if (status == EBPO_OK) {
        ebpo_posed_node root[2] = { ebpo_posed_root(&s.subtrees.nodes.side[0]),
                                    ebpo_posed_root(&s.subtrees.nodes.side[1]) };
        status = add(&s, root, 0, error);
    }
    if (status == EBPO_OK)
        status = search(&s, error);
    ebpo_subtree_search_end(&s.subtrees);
    return status;
}
