#include "core/strict_fp.h"

#include "query/ray_walk.h"

#include <math.h>

#include "core/error.h"
#include "query/query_node.h"
#include "query/ray_search.h"

/* Interval of t in which the ray is within [low, high] widened by `slack`, cut to 0 .. limit; false
 * when it is empty. */
static bool meets_slabs(const double origin[3], const double direction[3], double limit,
                        const double low[3], const double high[3], double slack, double *enter)
{
    double from = 0, to = limit;
    for (int k = 0; k < 3; k++) {
        double a = low[k] - slack - origin[k], b = high[k] + slack - origin[k];
        if (direction[k] == 0) {
            if (a > 0 || b < 0)
                return false;
            continue;
        }
        double t0 = a / direction[k], t1 = b / direction[k];
        from = fmax(from, fmin(t0, t1) - fabs(fmin(t0, t1)) * 0x1p-50);
        to = fmin(to, fmax(t0, t1) + fabs(fmax(t0, t1)) * 0x1p-50);
    }
    *enter = from;
    return from <= to;
}

static void decide(ebpo_ray_search *r, uint32_t slot, int facing)
{
    ebpo_casting *c = r->user;
    ebpo_met m;
    uint32_t local = ebpo_accel_slot_face(r->s, slot);
    ebpo_accel_fetch_face(r->s, local);
    ebpo_accel_triangle(r->s, slot, m.triangle);
    if (!ebpo_casting_meets(c, facing, &m))
        return;
    m.file_face = ebpo_accel_file_face(r->s, local);
    m.source_face = ebpo_accel_source_face(r->s, local);
    ebpo_casting_keep(c, &m);
    r->done = c->done;
    r->limit = c->limit;
}

static void cast_subtree(ebpo_casting *c, const ebpo_accel *s)
{
    ebpo_ray_search r;
    r.ray = &c->ray;
    r.wants = c->wants;
    r.facing = c->sides == EBPO_RAY_BOTH ? 0 : c->sides == EBPO_RAY_FRONT ? 1 : -1;
    r.limit = c->limit;
    r.decide = decide;
    r.user = c;
    ebpo_ray_search_accel(&r, c->context->model->kernels, s);
    if (r.met) { /* only where any hit was wanted */
        c->count = 1;
        c->done = true;
    }
}

/* Whether the ray comes to the node's cell before its limit; rather yes than no. */
static bool meets_cell(const ebpo_casting *c, const ebpo_box *box, const ebpo_node *node)
{
    double low[3], high[3], slack = 0, enter;
    ebpo_cell_bounds(box, node->cell, low, high);
    for (int k = 0; k < 3; k++)
        slack = fmax(slack, (fabs(low[k]) + fabs(high[k]) + fabs(c->ray.origin[k])) * 0x1p-48);
    return meets_slabs(c->ray.origin, c->ray.direction, c->limit, low, high, slack, &enter);
}

static bool ray_matters(void *user, const ebpo_box *box, const ebpo_node *node)
{
    return meets_cell(user, box, node);
}

static ebpo_status cast_node(ebpo_casting *c, const ebpo_box *box, ebpo_node node,
                             ebpo_error *error)
{
    const ebpo_model *m = c->context->model;
    if (c->done || ebpo_node_is_uniform(&node) || !meets_cell(c, box, &node) ||
        node.pruned) /* pruned: see ebpo_ray_walk */
        return EBPO_OK;
    if (ebpo_node_is_below(&node)) {
        ebpo_status status = ebpo_model_enter(c->context, &node, error);
        if (status == EBPO_OK)
            cast_subtree(c, node.subtree);
        return status;
    }
    /* Children in the order in which the ray meets their cells. */
    unsigned turn = 0;
    for (int k = 0; k < 3; k++)
        turn |= (unsigned)(c->ray.direction[k] < 0) << k;
    ebpo_status status = EBPO_OK;
    for (unsigned i = 0; i < 8 && status == EBPO_OK; i++)
        status = cast_node(c, box, ebpo_model_child(m, &node, i ^ turn), error);
    return status;
}

ebpo_status ebpo_ray_walk(ebpo_casting *c, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    if (c->context->model->whole) {
        cast_subtree(c, c->context->model->whole);
    } else {
        ebpo_box box = ebpo_model_box(c->context->model);
        status = cast_node(c, &box, ebpo_model_root(c->context->model), error);
    }
    if (status == EBPO_OK && !c->done && c->context->model->info->pruned)
        status = ebpo_check_pruned(c->context, ray_matters, c, error);
    if (status == EBPO_OK && c->no_memory)
        status = ebpo_fail_memory(error, c->count * sizeof(ebpo_met));
    return status;
}
