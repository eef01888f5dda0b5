#include "geom/strict_fp.h"

#include "collide/subtree_distance.h"

#include <math.h>
#include <stdlib.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/parallel.h"
#include "collide/node_gaps.h"

static const char stage[] = "distance";

typedef struct searching {
    const ebpo_collision *question;
    ebpo_nearest_pair *n;
    ebpo_node_gaps nodes;
    ebpo_context *context[2]; /* of models that are in parts */
    bool *seen[2];            /* subtrees that have been looked at */
    double hi;                /* cells tell that the distance is not greater */
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

/* --- two subtrees --- */

static uint32_t subtree_of(const searching *s, int side, const ebpo_posed_node *node)
{
    return s->question->model[side]->whole ? 0 : ebpo_entry_value(node->entry);
}

static bool is_pruned(const searching *s, int side, uint32_t number)
{
    const ebpo_model *m = s->question->model[side];
    return !m->whole && m->top->below[number].pruned;
}

/* Of a whole model and one in parts several pairs of nodes call for the same subtree: once. */
static bool was_seen(const searching *s, const uint32_t number[2])
{
    for (int i = 0; i < 2; i++)
        if (s->question->model[!i]->whole && s->seen[i][number[i]])
            return true;
    return false;
}

static ebpo_status load(searching *s, const uint32_t number[2], const ebpo_accel *accel[2],
                        ebpo_error *error)
{
    ebpo_collider *c = s->question->collider;
    c->subtree_pairs++;
    for (int i = 0; i < 2; i++) {
        ebpo_accel *loaded = s->question->model[i]->whole;
        ebpo_status status =
            loaded ? EBPO_OK : ebpo_context_subtree(s->context[i], number[i], &loaded, error);
        if (status != EBPO_OK)
            return status;
        c->subtrees += !s->seen[i][number[i]];
        s->seen[i][number[i]] = true;
        accel[i] = loaded;
    }
    return EBPO_OK;
}

static ebpo_status look_at(searching *s, const ebpo_node_gap *pair, ebpo_error *error)
{
    const ebpo_accel *accel[2];
    uint32_t number[2];
    for (int i = 0; i < 2; i++) {
        number[i] = subtree_of(s, i, &pair->node[i]);
        if (is_pruned(s, i, number[i]))
            return EBPO_OK; /* what it had is not in this file */
    }
    if (was_seen(s, number))
        return EBPO_OK;
    ebpo_status status = load(s, number, accel, error);
    return status == EBPO_OK
               ? ebpo_distance_of_accels(s->question, accel, pair->gap == 0, s->n, error)
               : status;
}

/* --- pairs of nodes --- */

static bool is_gray(const ebpo_posed_node *node)
{
    return ebpo_entry_kind_of(node->entry) == EBPO_ENTRY_GRAY;
}

/* -1: neither; then they are looked at. Nodes of a whole model are divided for their gaps only: not
 * below the size of the other one's subtree. */
static int side_to_divide(const searching *s, const ebpo_posed_node node[2])
{
    int larger = ebpo_node_larger(&s->nodes, node);
    if (is_gray(&node[larger]))
        return larger;
    return is_gray(&node[!larger]) && !s->question->model[!larger]->whole ? !larger : -1;
}

static ebpo_status add(searching *s, const ebpo_posed_node node[2], double gap, ebpo_error *error)
{
    ebpo_node_gap pair = { { node[0], node[1] }, 0 };
    for (int i = 0; i < 2; i++)
        if (ebpo_entry_kind_of(node[i].entry) == EBPO_ENTRY_UNIFORM)
            return EBPO_OK;
    ebpo_status status = ebpo_node_gap_of(&s->nodes, node, &pair.gap, error);
    pair.gap = fmax(pair.gap, gap); /* the nodes are in those above them */
    if (status != EBPO_OK || pair.gap > fmin(s->hi, ebpo_nearest_pair_limit(s->n)))
        return status;
    if (!s->question->model[0]->info->pruned && !s->question->model[1]->info->pruned)
        s->hi = fmin(s->hi, ebpo_node_far_bound(&s->nodes, node));
    return ebpo_node_gaps_push(&s->nodes, &pair, error);
}

static ebpo_status divide(searching *s, const ebpo_node_gap *pair, int side, ebpo_error *error)
{
    ebpo_posed_node part[2] = { pair->node[0], pair->node[1] };
    ebpo_status status = EBPO_OK;
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        part[side] = ebpo_posed_child(&s->nodes.side[side], &pair->node[side], octant);
        status = add(s, part, pair->gap, error);
    }
    return status;
}

/* Pairs come by their gaps: behind the first that is too far away there is nothing. */
static ebpo_status search(searching *s, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    while (s->nodes.count > 0 && status == EBPO_OK && !ebpo_nearest_pair_is_done(s->n)) {
        ebpo_node_gap pair = ebpo_node_gaps_pop(&s->nodes);
        int side = side_to_divide(s, pair.node);
        if (pair.gap > ebpo_nearest_pair_limit(s->n))
            return EBPO_OK;
        if (ebpo_collision_is_late(s->question))
            ebpo_nearest_pair_leave(s->n, pair.gap);
        else
            status = side < 0 ? look_at(s, &pair, error) : divide(s, &pair, side, error);
        if (ebpo_nearest_pair_is_done(s->n)) /* nobody looks at the others */
            ebpo_nearest_pair_leave(s->n, pair.gap);
        if (!ebpo_progress_step(&s->question->options.progress, stage, 0, 0, error))
            return EBPO_E_CANCELLED;
    }
    return status;
}

static ebpo_status begin(searching *s, ebpo_error *error)
{
    const ebpo_collision *q = s->question;
    ebpo_status status = ebpo_node_gaps_begin(&s->nodes, q, error);
    for (int i = 0; i < 2 && status == EBPO_OK; i++) {
        s->seen[i] = ebpo_alloc_zero(s->nodes.side[i].count + 1, sizeof *s->seen[i]);
        if (!s->seen[i])
            return ebpo_fail_memory(error, s->nodes.side[i].count);
        if (!q->model[i]->whole)
            status = ebpo_context_new(q->model[i], &s->context[i], error);
    }
    if (status != EBPO_OK)
        return status;
    ebpo_posed_node root[2] = { ebpo_posed_root(&s->nodes.side[0]),
                                ebpo_posed_root(&s->nodes.side[1]) };
    return add(s, root, 0, error);
}

static void end(searching *s, uint64_t read_before)
{
    ebpo_collider *c = s->question->collider;
    c->bytes_read += ebpo_collision_bytes_read(s->question) - read_before;
    for (int i = 0; i < 2; i++) {
        c->loads += s->context[i] ? s->context[i]->loaded : 0;
        ebpo_context_free(s->context[i]);
        free(s->seen[i]);
    }
    ebpo_node_gaps_free(&s->nodes);
}

ebpo_status ebpo_distance_of_parts(const ebpo_collision *q, ebpo_nearest_pair *n, ebpo_error *error)
{
    searching s = { .question = q, .n = n, .hi = INFINITY };
    uint64_t before = ebpo_collision_bytes_read(q);
    ebpo_status status = begin(&s, error);
    if (status == EBPO_OK)
        status = search(&s, error);
    end(&s, before);
    return status;
}
