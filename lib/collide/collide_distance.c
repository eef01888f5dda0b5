/* The distance of two models at poses. */
#include "geom/strict_fp.h"

#include <math.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/fp_env.h"
#include "base/sized.h"
#include "collide/collider.h"
#include "collide/nearest_pair.h"
#include "pair/contact.h"
#include "pair/triangle_pair.h"

static ebpo_status check_options(const ebpo_clearance_options *o, ebpo_error *error)
{
    if (!(o->tolerance >= 0 && o->tolerance < INFINITY) || isnan(o->at_least))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the distance's tolerance has to be 0 or more and finite, and the "
                         "distance asked for a number");
    return EBPO_OK;
}

/* Of the collider; it stays, as what it holds is the start of the next. */
static ebpo_status begin_search(ebpo_collision *q, ebpo_error *error)
{
    ebpo_collider *c = q->collider;
    const ebpo_accel *accel[2] = { q->model[0]->whole, q->model[1]->whole };
    ebpo_posing posing[2] = { q->posing[0].posing, q->posing[1].posing };
    if (!c->gap)
        c->gap = ebpo_gap_new();
    if (!c->gap)
        return ebpo_fail_memory(error, sizeof *c->gap);
    ebpo_gap_begin(c->gap, accel, posing, q->reach);
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
    const ebpo_accel *first = q->model[0]->whole, *second = q->model[1]->whole;
    ebpo_met_pair met = { ebpo_accel_slot_face(first, f->slot[0]),
                          ebpo_accel_slot_face(second, f->slot[1]), EBPO_PAIR_APART };
    double point[2][3];
    for (int i = 0; i < 6; i++)
        point[i / 3][i % 3] = f->bounds.point[i / 3][i % 3];
    if (n->meets) {
        met.kind = (int32_t)ebpo_triangle_pair((const double(*)[3])f->corner[0],
                                               (const double(*)[3])f->corner[1]);
        meeting_point(f, (ebpo_pair_kind)met.kind, point);
    }
    out->pair = ebpo_collision_pair(q, first, second, &met);
    for (int k = 0; k < 3; k++) {
        out->point_a[k] = point[q->turned][k];
        out->point_b[k] = point[!q->turned][k];
    }
}

static ebpo_status search(ebpo_collision *q, const ebpo_clearance_options *o, ebpo_clearance *out,
                          ebpo_error *error)
{
    ebpo_collider *c = q->collider;
    int32_t meet = 0;
    ebpo_status status = begin_search(q, error);
    if (status == EBPO_OK) /* of models that meet bounds say little: that walk is better at it */
        status = ebpo_collision_first(q, "distance", &meet, error);
    if (status != EBPO_OK)
        return status;
    ebpo_nearest_pair n = { .tolerance = o->tolerance,
                            .at_least = o->at_least < 0 ? NAN : o->at_least,
                            .late = q->late,
                            .progress = &q->options.progress,
                            .meets = meet == 1,
                            .warm = o->warm && c->has_nearest };
    for (int s = 0; s < 2; s++)
        n.best.slot[s] = n.meets ? c->walk.met_slot[s] : c->nearest[s != q->turned];
    status = ebpo_nearest_pair_find(c->gap, &n, error);
    if (status != EBPO_OK)
        return status;
    c->node_pairs += c->gap->node_pairs;
    c->block_pairs += c->gap->block_pairs;
    out->distance = ebpo_certain_of(n.lo, n.hi);
    out->at_least = n.is_at_least;
    if (!n.found)
        return EBPO_OK;
    tell_pair(q, &n, out);
    c->has_nearest = true;
    for (int s = 0; s < 2; s++)
        c->nearest[s != q->turned] = n.best.slot[s];
    return EBPO_OK;
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
        status = ebpo_collision_begin_whole(&q, c, options, error);
    if (status != EBPO_OK)
        return status;
    if (q.model[0]->whole->bound_count == 0 || q.model[1]->whole->bound_count == 0) {
        out->distance = ebpo_certain_of(INFINITY, INFINITY);
        out->at_least = wanted.at_least < 0 ? -1 : 1;
        return EBPO_OK;
    }
    return search(&q, &wanted, out, error);
}
