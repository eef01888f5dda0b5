/* The distance of two models at poses. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "extras/collide/collider.h"
#include "extras/collide/nearest_pair.h"
#include "extras/collide/subtree_distance.h"
#include "extras/collide/contact.h"
#include "geometry/triangle_pair.h"

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

static ebpo_status keep(const ebpo_collision *q, const ebpo_nearest_pair *n, ebpo_error *error)
{
    ebpo_collider *c = q->collider;
    if (!c->nearest)
        c->nearest = ebpo_alloc_zero(1, sizeof *c->nearest);
    if (!c->nearest)
        return ebpo_fail_memory(error, sizeof *c->nearest);
    *c->nearest = in_order(q, &n->best);
    return EBPO_OK;
}

static void start(const ebpo_collision *q, ebpo_nearest_pair *n)
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

static ebpo_status search(const ebpo_collision *q, bool warm, ebpo_nearest_pair *n,
                          ebpo_error *error)
{
    ebpo_collider *c = q->collider;
    const ebpo_accel *accel[2] = { q->model[0]->whole, q->model[1]->whole };
    if (!c->gap)
        c->gap = ebpo_gap_new();
    if (!c->gap)
        return ebpo_fail_memory(error, sizeof *c->gap);
    if (warm && c->nearest)
        start(q, n);
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
    status = search(&q, wanted.warm, &n, error);
    if (status != EBPO_OK)
        return status;
    ebpo_nearest_pair_end(&n);
    out->distance = ebpo_certain_of(n.lo, n.hi);
    out->at_least = n.is_at_least;
    if (!n.found)
        return EBPO_OK;
    tell_pair(&q, &n, out);
    return keep(&q, &n, error);
}
