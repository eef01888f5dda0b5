/* Point in solid, exact. */
#include "geom/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "base/alloc.h"
#include "base/error.h"
#include "geom/predicates.h"
#include "query/inside.h"

/* Adds the crossings that the filter left open; true when the point lies on one of these faces. */
static bool decide_open(const ebpo_accel *s, const uint32_t *open, uint32_t count,
                        const ebpo_axis_segment *g, const double *point, int32_t *sum)
{
    for (uint32_t i = 0; i < count; i++) {
        double t[3][3];
        ebpo_accel_triangle(s, open[i], t);
        if (point && ebpo_point_on_triangle(point, t[0], t[1], t[2]))
            return true;
        *sum += ebpo_axis_crossing(g->from, g->to, g->axis, t[0], t[1], t[2]);
    }
    return false;
}

/* Crossings along a segment; `point` (its end) is looked for on the faces, NULL: is not. False when
 * it lies on one. */
static bool cross(const ebpo_kernels *kernels, const ebpo_accel *s, const ebpo_accel_leaf *leaf,
                  const ebpo_axis_segment *g, const double *point, uint32_t *open, int32_t *sum)
{
    uint32_t count = 0;
    *sum = kernels->crossings(s, s->list + leaf->list, leaf->blocks, g, open, &count);
    return count == 0 || !decide_open(s, open, count, g, point, sum);
}

/* A point in a leaf's cell. */
typedef struct in_leaf {
    double low[3], high[3]; /* the cell */
    double xi[3];           /* the point in it, 0 .. 1, rounded */
    uint8_t cell[3];        /* and in the unit of ebpo_listed_block */
} in_leaf;

static uint8_t listed_cell(double xi)
{
    double cells = xi * EBPO_LISTED_CELLS;
    /* no number, as cells of no size give: 255, which meets the boxes of such cells */
    return cells < 0 ? 0 : cells < 255 ? (uint8_t)cells : 255;
}

static void find_in_leaf(const ebpo_accel *s, ebpo_cell cell, const double p[3], in_leaf *out)
{
    ebpo_cell_bounds(&s->box, cell, out->low, out->high);
    for (int k = 0; k < 3; k++) {
        out->xi[k] = (p[k] - out->low[k]) * (1 / (out->high[k] - out->low[k]));
        out->cell[k] = listed_cell(out->xi[k]);
    }
}

/* From the leaf's free wall to the point. */
static ebpo_axis_segment wall_segment(const ebpo_accel_leaf *leaf, const in_leaf *i,
                                      const double p[3])
{
    int axis = leaf->wall / 2;
    ebpo_axis_segment g = { { p[0], p[1], p[2] },
                            p[axis],
                            axis,
                            { i->cell[0], i->cell[1], i->cell[2] },
                            { i->cell[0], i->cell[1], i->cell[2] } };
    if (leaf->wall % 2) {
        g.to = i->high[axis];
        g.high[axis] = 255;
    } else {
        g.from[axis] = i->low[axis];
        g.low[axis] = 0;
    }
    return g;
}

/* One segment from a wall that no face meets. */
static bool from_wall(const ebpo_kernels *kernels, const ebpo_accel *s, const ebpo_accel_leaf *leaf,
                      const in_leaf *i, const double p[3], uint32_t *open, int32_t *winding)
{
    ebpo_axis_segment g = wall_segment(leaf, i, p);
    int32_t sum;
    if (!cross(kernels, s, leaf, &g, p, open, &sum))
        return false;
    *winding = leaf->wall % 2 ? leaf->winding - sum : leaf->winding + sum;
    return true;
}

/* Three segments from the lowest corner: format-spec, section 5. Faces that the point lies on come
 * up in the last one. */
static bool from_corner(const ebpo_kernels *kernels, const ebpo_accel *s,
                        const ebpo_accel_leaf *leaf, const in_leaf *i, const double p[3],
                        uint32_t *open, int32_t *winding)
{
    ebpo_axis_segment g = { { i->low[0], i->low[1], i->low[2] }, 0, 0, { 0, 0, 0 }, { 0, 0, 0 } };
    *winding = leaf->winding;
    for (int axis = 0; axis < 3; axis++) {
        int32_t sum;
        g.axis = axis;
        g.to = p[axis];
        g.high[axis] = i->cell[axis];
        if (!cross(kernels, s, leaf, &g, axis == 2 ? p : NULL, open, &sum))
            return false;
        *winding += sum;
        g.from[axis] = p[axis];
        g.low[axis] = i->cell[axis];
    }
    return true;
}

/* Signs of the planes alone; false when one is too close to tell. */
static bool from_planes(const ebpo_accel *s, const ebpo_accel_leaf *leaf, const in_leaf *in,
                        int32_t *winding)
{
    float xi[3] = { (float)in->xi[0], (float)in->xi[1], (float)in->xi[2] }, most = -INFINITY;
    const ebpo_four_planes *first = EBPO_KIND_PLANE(s->kinds, leaf->first_plane);
    for (int i = 0; i < leaf->planes; i += 4) {
        const ebpo_four_planes *q = first + i / 4;
        for (int j = 0; j < 4; j++) {
            float value = q->n[0][j] * xi[0] + q->n[1][j] * xi[1] + q->n[2][j] * xi[2] - q->d[j];
            most = value > most ? value : most;
        }
    }
    if (most > EBPO_PLANE_ERROR) {
        *winding = leaf->outer;
        return true;
    }
    *winding = leaf->inner;
    return most < -EBPO_PLANE_ERROR;
}

/* What a leaf is like is found out when the first question comes to it. */
static ebpo_leaf_kind kind_of(const ebpo_context *context, const ebpo_accel *s,
                              ebpo_accel_leaf *leaf, const in_leaf *i)
{
    ebpo_leaf_kind kind = ebpo_leaf_kind_of(leaf);
    if (kind < EBPO_LEAF_UNKNOWN)
        return kind;
    if (ebpo_leaf_know(s, leaf, i->low, i->high))
        ebpo_model_count_kind(context->model, leaf);
    return ebpo_leaf_kind_of(leaf);
}

static ebpo_status answer_in_leaf(ebpo_context *context, const ebpo_accel *s, ebpo_accel_leaf *leaf,
                                  const in_leaf *i, const double p[3], ebpo_inside_result *out,
                                  ebpo_error *error)
{
    const ebpo_model *m = context->model;
    if (!ebpo_grow(&context->open, &context->open_capacity, (uint64_t)leaf->blocks * EBPO_BLOCK,
                   sizeof *context->open))
        return ebpo_fail_memory(error, (uint64_t)leaf->blocks * EBPO_BLOCK * sizeof *context->open);
    int32_t winding;
    bool off =
        kind_of(context, s, leaf, i) != EBPO_LEAF_GENERAL && from_planes(s, leaf, i, &winding);
    if (!off)
        off = leaf->wall != EBPO_NO_WALL
                  ? from_wall(m->kernels, s, leaf, i, p, context->open, &winding)
                  : from_corner(m->kernels, s, leaf, i, p, context->open, &winding);
    if (!off) {
        *out = (ebpo_inside_result){ EBPO_ON, 0, 0 };
        return EBPO_OK;
    }
    *out = (ebpo_inside_result){ ebpo_rule_inside(m->info->rule, winding) ? EBPO_IN : EBPO_OUT,
                                 winding, 0 };
    return EBPO_OK;
}

ebpo_status ebpo_inside_leaf(ebpo_context *context, const ebpo_accel *s, uint32_t number,
                             ebpo_cell cell, const double p[3], ebpo_inside_result *out,
                             ebpo_error *error)
{
    in_leaf i;
    find_in_leaf(s, cell, p, &i);
    return answer_in_leaf(context, s, &s->leaf[number], &i, p, out, error);
}

void ebpo_inside_uniform(const ebpo_context *context, uint32_t entry, ebpo_inside_result *out)
{
    int32_t winding = ebpo_entry_winding(entry);
    *out = (ebpo_inside_result){ ebpo_rule_inside(context->model->info->rule, winding) ? EBPO_IN
                                                                                       : EBPO_OUT,
                                 winding, 0 };
}

ebpo_status ebpo_inside_subtree(ebpo_context *context, const ebpo_accel *s, const uint32_t at[3],
                                const double p[3], ebpo_inside_result *out, ebpo_error *error)
{
    int fine = context->model->info->level_count - 1;
    ebpo_descent d = ebpo_descend(&s->nodes, fine, at);
    if (ebpo_entry_kind_of(d.entry) == EBPO_ENTRY_UNIFORM) {
        ebpo_inside_uniform(context, d.entry, out);
        return EBPO_OK;
    }
    if (ebpo_entry_kind_of(d.entry) == EBPO_ENTRY_BELOW)
        return ebpo_inside_pruned(context, p, out, error);
    return ebpo_inside_leaf(context, s, ebpo_entry_value(d.entry), ebpo_descent_cell(&d, fine, at),
                            p, out, error);
}

/* Several points at a time, stage by stage, so that the memory that one stage needs is on its way
 * while others are dealt with. */
enum { TOGETHER = 16 };

typedef struct lane {
    uint32_t at[3];
    bool within;
    ebpo_descent d;
} lane;

/* A point that ended in a leaf. */
typedef struct waiting {
    ebpo_accel_leaf *leaf;
    unsigned point;
    in_leaf in;
} waiting;

static void start_lanes(const ebpo_accel *s, int fine, const double *points, unsigned count,
                        lane *l)
{
    for (unsigned i = 0; i < count; i++) {
        l[i].within = ebpo_locate(&s->box, fine, points + 3 * i, l[i].at);
        if (l[i].within && s->nodes.grid) {
            uint64_t cell = ebpo_grid_cell(&s->nodes, fine, l[i].at);
            __builtin_prefetch(&s->nodes.grid[cell]);
            __builtin_prefetch(&s->nodes.grid_depth[cell]);
        }
    }
    for (unsigned i = 0; i < count; i++)
        if (l[i].within) {
            l[i].d = ebpo_descent_begin(&s->nodes, fine, l[i].at);
            ebpo_descent_prefetch(&l[i].d, &s->nodes);
        }
}

static void descend_together(const ebpo_accel *s, int fine, unsigned count, lane *l)
{
    for (bool more = true; more;) {
        more = false;
        for (unsigned i = 0; i < count; i++)
            if (l[i].within && ebpo_descent_step(&l[i].d, &s->nodes, fine, l[i].at))
                more |= ebpo_descent_prefetch(&l[i].d, &s->nodes);
    }
}

/* The cache lines of the blocks that the point's segment may meet. */
static void prefetch_blocks(const ebpo_accel *s, const waiting *w, const double p[3])
{
    const ebpo_accel_leaf *leaf = w->leaf;
    ebpo_axis_segment g = { .high = { 255, 255, 255 } };
    if (ebpo_leaf_kind_of(leaf) != EBPO_LEAF_GENERAL)
        return;
    if (leaf->wall != EBPO_NO_WALL)
        g = wall_segment(leaf, &w->in, p);
    for (uint32_t b = 0; b < leaf->blocks && b < 8; b++)
        if (ebpo_axis_segment_meets(&g, &s->list[leaf->list + b]))
            for (int line = 0; line < (s->wide ? 4 : 2); line++)
                __builtin_prefetch(
                    (const char *)ebpo_accel_meshlet(s, s->list[leaf->list + b].block) + 64 * line);
}

static ebpo_status answer_waiting(ebpo_context *context, const ebpo_accel *s, const waiting *w,
                                  unsigned count, const double *points, ebpo_inside_result *out,
                                  ebpo_error *error)
{
    for (unsigned i = 0; i < count; i++) {
        __builtin_prefetch(s->list + w[i].leaf->list);
        if (kind_of(context, s, w[i].leaf, &w[i].in) != EBPO_LEAF_GENERAL)
            __builtin_prefetch(EBPO_KIND_PLANE(s->kinds, w[i].leaf->first_plane));
    }
    for (unsigned i = 0; i < count; i++)
        prefetch_blocks(s, &w[i], points + 3 * w[i].point);
    ebpo_status status = EBPO_OK;
    for (unsigned i = 0; i < count && status == EBPO_OK; i++)
        status = answer_in_leaf(context, s, w[i].leaf, &w[i].in, points + 3 * w[i].point,
                                &out[w[i].point], error);
    return status;
}

static ebpo_status inside_together(ebpo_context *context, const ebpo_accel *s, const double *points,
                                   unsigned count, ebpo_inside_result *out, ebpo_error *error)
{
    lane l[TOGETHER];
    waiting w[TOGETHER];
    unsigned leaves = 0;
    int fine = context->model->info->level_count - 1;
    start_lanes(s, fine, points, count, l);
    descend_together(s, fine, count, l);
    for (unsigned i = 0; i < count; i++) {
        if (!l[i].within) {
            out[i] = (ebpo_inside_result){ EBPO_OUT, 0, 0 };
        } else if (ebpo_entry_kind_of(l[i].d.entry) == EBPO_ENTRY_UNIFORM) {
            ebpo_inside_uniform(context, l[i].d.entry, &out[i]);
        } else if (ebpo_entry_kind_of(l[i].d.entry) == EBPO_ENTRY_BELOW) {
            ebpo_status status = ebpo_inside_pruned(context, points + 3 * i, &out[i], error);
            if (status != EBPO_OK)
                return status;
        } else {
            w[leaves].leaf = &s->leaf[ebpo_entry_value(l[i].d.entry)];
            w[leaves].point = i;
            __builtin_prefetch(w[leaves].leaf);
            find_in_leaf(s, ebpo_descent_cell(&l[i].d, fine, l[i].at), points + 3 * i,
                         &w[leaves].in);
            leaves++;
        }
    }
    return answer_waiting(context, s, w, leaves, points, out, error);
}

ebpo_status ebpo_inside_whole(ebpo_context *context, const double *points, uint64_t count,
                              ebpo_inside_result *out, ebpo_error *error)
{
    const ebpo_accel *s = context->model->whole;
    ebpo_status status = EBPO_OK;
    if (count == 1) {
        uint32_t at[3];
        if (ebpo_locate(&s->box, context->model->info->level_count - 1, points, at))
            return ebpo_inside_subtree(context, s, at, points, out, error);
        *out = (ebpo_inside_result){ EBPO_OUT, 0, 0 };
        return EBPO_OK;
    }
    for (uint64_t i = 0; i < count && status == EBPO_OK; i += TOGETHER)
        status = inside_together(context, s, points + 3 * i,
                                 count - i < TOGETHER ? (unsigned)(count - i) : TOGETHER, out + i,
                                 error);
    return status;
}
