#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/collide/collider.h"
#include "extras/collide/contact.h"
#include "extras/collide/nearest_pair.h"
#include "extras/collide/posed_subtrees.h"
#include "geometry/triangle_pair.h"

/* The nearest faces of two models, of which subtrees are loaded as they may matter. One thread. */

static const char stage[] = "distance";

typedef struct searching {
    ebpo_subtree_search subtrees;
    ebpo_nearest_pair *n;
    double hi; /* cells tell that the distance is not greater */
} searching;

/* --- two accels --- */

/* Goes on with `n` in two more accels of the question's models. `may_meet`: the walk for the first
 * contact comes first, as bounds say little where faces meet. */
static ebpo_status ebpo_distance_of_accels(const ebpo_collision *q,
                                           const ebpo_accel *const accel[2], bool may_meet,
                                           ebpo_nearest_pair *n, ebpo_error *error)
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

static ebpo_status distance_add(searching *s, const ebpo_posed_node node[2], double gap,
                                ebpo_error *error)
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

static ebpo_status distance_divide(searching *s, const ebpo_node_gap *pair, int side,
                                   ebpo_error *error)
{
    ebpo_posed_node part[2] = { pair->node[0], pair->node[1] };
    ebpo_status status = EBPO_OK;
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        part[side] = ebpo_posed_child(&s->subtrees.nodes.side[side], &pair->node[side], octant);
        status = distance_add(s, part, pair->gap, error);
    }
    return status;
}

/* Pairs come by their gaps: behind the first that is too far away there is nothing. */
static ebpo_status search_nearest_parts(searching *s, ebpo_error *error)
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
            status = side < 0 ? look_at(s, &pair, error) : distance_divide(s, &pair, side, error);
        if (ebpo_nearest_pair_is_done(s->n)) /* nobody looks at the others */
            ebpo_nearest_pair_leave(s->n, pair.gap);
        if (!ebpo_progress_step(&q->options.progress, stage, 0, 0, error))
            return EBPO_E_CANCELLED;
    }
    return status;
}

/* Goes on with `n` in all pairs of subtrees whose envelopes are not farther apart than what has
 * been found, the nearest first: the same as of whole models. */
static ebpo_status ebpo_distance_of_parts(const ebpo_collision *q, ebpo_nearest_pair *n,
                                          ebpo_error *error)
{
    searching s = { .n = n, .hi = INFINITY };
    ebpo_status status = ebpo_subtree_search_begin(&s.subtrees, q, error);
    if (status == EBPO_OK) {
        ebpo_posed_node root[2] = { ebpo_posed_root(&s.subtrees.nodes.side[0]),
                                    ebpo_posed_root(&s.subtrees.nodes.side[1]) };
        status = distance_add(&s, root, 0, error);
    }
    if (status == EBPO_OK)
        status = search_nearest_parts(&s, error);
    ebpo_subtree_search_end(&s.subtrees);
    return status;
}

/* The distance of two models at poses. */

static ebpo_status check_options(const ebpo_clearance_options *o, ebpo_error *error)
{
    if (!(o->tolerance >= 0 && o->tolerance < INFINITY) || isnan(o->at_least))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the distance's tolerance has to be 0 or more and finite, and the "
                         "distance asked for a number");
    return EBPO_OK;
}

/* A point that both have: an end of the common segment, or what the nearest features have. */
static void meeting_point(const ebpo_face_two *f, ebpo_pair_kind kind, double point[2][3])
{
    ebpo_contact_end end[2];
    if (kind != EBPO_PAIR_CROSSING)
        return;
    ebpo_triangle_contact((const double(*)[3])f->corner[0], (const double(*)[3])f->corner[1], end);
    for (int k = 0; k < 3; k++)
        point[0][k] = point[1][k] = end[0].point[k];
}

static void tell_pair(const ebpo_collision *q, const ebpo_nearest_pair *n, ebpo_clearance *out)
{
    const ebpo_face_two *f = &n->best;
    int a = q->turned, b = !q->turned;
    ebpo_pair_kind kind = EBPO_PAIR_APART;
    double point[2][3];
    for (int i = 0; i < 6; i++)
        point[i / 3][i % 3] = f->bounds.point[i / 3][i % 3];
    if (n->meets) {
        kind =
            ebpo_triangle_pair((const double(*)[3])f->corner[0], (const double(*)[3])f->corner[1]);
        meeting_point(f, kind, point);
    }
    out->pair =
        (ebpo_face_pair){ f->source[a], f->source[b], f->file[a], f->file[b], (int32_t)kind, 0 };
    for (int k = 0; k < 3; k++) {
        out->point_a[k] = point[a][k];
        out->point_b[k] = point[b][k];
    }
}

/* --- from one question to the next --- */

static ebpo_face_two in_order(const ebpo_collision *q, const ebpo_face_two *f)
{
    ebpo_face_two out = *f;
    for (int i = 0; i < 2 && q->turned; i++) {
        out.file[i] = f->file[!i];
        out.source[i] = f->source[!i];
        memcpy(out.own[i], f->own[!i], sizeof out.own[i]);
    }
    return out;
}

static ebpo_status distance_keep(const ebpo_collision *q, const ebpo_nearest_pair *n,
                                 ebpo_error *error)
{
    ebpo_collider *c = q->collider;
    if (!c->nearest)
        c->nearest = ebpo_alloc_zero(1, sizeof *c->nearest);
    if (!c->nearest)
        return ebpo_fail_memory(error, sizeof *c->nearest);
    *c->nearest = in_order(q, &n->best);
    return EBPO_OK;
}

static void distance_start(const ebpo_collision *q, ebpo_nearest_pair *n)
{
    const ebpo_posing posing[2] = { q->posing[0].posing, q->posing[1].posing };
    ebpo_face_two known = in_order(q, q->collider->nearest);
    ebpo_nearest_pair_start(n, posing, &known);
    if (ebpo_nearest_pair_is_done(n))
        ebpo_nearest_pair_leave(n, 0);
}

/* --- the search --- */

static bool has_faces(const ebpo_model *m)
{
    return m->whole ? m->whole->bound_count > 0 : m->info->face_count > 0;
}

static ebpo_status search_nearest_faces(const ebpo_collision *q, bool warm, ebpo_nearest_pair *n,
                                        ebpo_error *error)
{
    ebpo_collider *c = q->collider;
    const ebpo_accel *accel[2] = { q->model[0]->whole, q->model[1]->whole };
    if (!c->gap)
        c->gap = ebpo_gap_new();
    if (!c->gap)
        return ebpo_fail_memory(error, sizeof *c->gap);
    if (warm && c->nearest)
        distance_start(q, n);
    if (ebpo_nearest_pair_is_done(n))
        return EBPO_OK;
    return ebpo_collision_is_in_parts(q) ? ebpo_distance_of_parts(q, n, error)
                                         : ebpo_distance_of_accels(q, accel, true, n, error);
}

ebpo_status ebpo_collide_distance(ebpo_collider *c, const ebpo_collide_options *options,
                                  const ebpo_clearance_options *clearance, ebpo_clearance *out,
                                  ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_collision q;
    ebpo_clearance_options wanted = EBPO_CLEARANCE_OPTIONS_INIT;
    *out = (ebpo_clearance){ .at_least = -1,
                             .pair = { EBPO_NO_FACE, EBPO_NO_FACE, EBPO_NO_FACE, EBPO_NO_FACE,
                                       EBPO_PAIR_APART, 0 } };
    ebpo_status status = EBPO_TAKE(ebpo_clearance_options, &wanted, clearance, error);
    if (status == EBPO_OK)
        status = check_options(&wanted, error);
    if (status == EBPO_OK)
        status = ebpo_collision_begin(&q, c, options, error);
    if (status != EBPO_OK)
        return status;
    if (!has_faces(q.model[0]) || !has_faces(q.model[1])) {
        out->distance = ebpo_certain_of(INFINITY, INFINITY);
        out->at_least = wanted.at_least < 0 ? -1 : 1;
        return EBPO_OK;
    }
    ebpo_nearest_pair n = { .tolerance = wanted.tolerance,
                            .at_least = wanted.at_least < 0 ? NAN : wanted.at_least,
                            .late = q.late,
                            .progress = &q.options.progress };
    ebpo_nearest_pair_begin(&n);
    status = search_nearest_faces(&q, wanted.warm, &n, error);
    if (status != EBPO_OK)
        return status;
    ebpo_nearest_pair_end(&n);
    out->distance = ebpo_certain_of(n.lo, n.hi);
    out->at_least = n.is_at_least;
    if (!n.found)
        return EBPO_OK;
    tell_pair(&q, &n, out);
    return distance_keep(&q, &n, error);
}
