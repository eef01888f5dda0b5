#include "geom/strict_fp.h"

#include "query/ray_walk.h"

#include <math.h>

#include "base/error.h"
#include "query/pruned.h"
#include "query/query_node.h"

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

static void try_block(ebpo_casting *c, const ebpo_accel *s, uint32_t block)
{
    for (uint32_t lane = 0; lane < EBPO_BLOCK; lane++) {
        uint32_t slot = block * EBPO_BLOCK + lane, local = s->slot_face[slot];
        ebpo_met m;
        if (local == EBPO_NO_SLOT)
            return;
        ebpo_accel_triangle(s, slot, m.triangle);
        if (!ebpo_casting_meets(c, &m))
            continue;
        m.file_face = ebpo_accel_file_face(s, local);
        m.source_face = ebpo_accel_source_face(s, local);
        ebpo_casting_keep(c, &m);
        if (c->done)
            return;
    }
}

/* The ray in the subtree's frame, its direction scaled by a power of two to about 1. Widening
 * covers the rounding of all. */
typedef struct framed {
    double origin[3], direction[3], slack;
    /* t in the frame for t = 1; 0 or infinite where that leaves the doubles, and then limits prune
     * nothing */
    double limit_scale;
} framed;

static double frame_limit(const ebpo_casting *c, const framed *f)
{
    double limit = c->limit * f->limit_scale * (1 + 0x1p-40);
    return f->limit_scale > 0 && limit > 0x1p-500 ? limit
           : c->limit > 0 || c->count             ? INFINITY
                                                  : 0x1p-40;
}

typedef struct entered {
    double enter;
    uint32_t child;
} entered;

static void cast_bound(ebpo_casting *c, const ebpo_accel *s, const framed *f, uint32_t child)
{
    if (child & EBPO_IS_BLOCK) {
        try_block(c, s, child & ~EBPO_IS_BLOCK);
        return;
    }
    const ebpo_bound *b = &s->bound[child];
    entered order[8];
    int count = 0;
    for (int lane = 0; lane < 8; lane++) {
        if (b->child[lane] == EBPO_NO_CHILD)
            continue;
        double low[3] = { b->low[0][lane], b->low[1][lane], b->low[2][lane] },
               high[3] = { b->high[0][lane], b->high[1][lane], b->high[2][lane] };
        entered e = { 0, b->child[lane] };
        if (!meets_slabs(f->origin, f->direction, frame_limit(c, f), low, high, f->slack, &e.enter))
            continue;
        int at = count++;
        for (; at > 0 && order[at - 1].enter > e.enter; at--)
            order[at] = order[at - 1];
        order[at] = e;
    }
    for (int i = 0; i < count && !c->done; i++)
        if (order[i].enter <= frame_limit(c, f))
            cast_bound(c, s, f, order[i].child);
}

static void cast_subtree(ebpo_casting *c, const ebpo_accel *s)
{
    framed f;
    double most = 2, longest = 0;
    int exponent;
    if (s->bound_count == 0)
        return;
    for (int k = 0; k < 3; k++)
        longest = fmax(longest, fabs(c->ray.direction[k]));
    frexp(longest, &exponent);
    for (int k = 0; k < 3; k++) {
        f.origin[k] = (c->ray.origin[k] - s->centre[k]) * s->scale;
        f.direction[k] = ldexp(c->ray.direction[k], -exponent);
        most = fmax(most, fabs(f.origin[k]));
    }
    f.limit_scale = ldexp(s->scale, exponent);
    f.slack = most * 0x1p-48;
    cast_bound(c, s, &f, s->top);
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
    if (status == EBPO_OK && !c->done)
        status = ebpo_check_pruned(c->context, ray_matters, c, error);
    if (status == EBPO_OK && c->no_memory)
        status = ebpo_fail_memory(error, c->count * sizeof(ebpo_met));
    return status;
}
