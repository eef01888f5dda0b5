/* Point in solid, exact. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "geometry/predicates.h"
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
    *sum = kernels->crossings(s, s->list + leaf->list, g, open, &count);
    return count == 0 || !decide_open(s, open, count, g, point, sum);
}

/* A point in a leaf's cell. */
typedef struct in_leaf {
    ebpo_cell leaf;
    double xi[3];       /* the point in it, 0 .. 1, right to 2^-30 */
    uint32_t sixteenth; /* and in the unit of ebpo_listed_block, eight bits an axis */
} in_leaf;

static inline void find_in_leaf(int fine, int level, const ebpo_position *place, in_leaf *out)
{
    int up = fine - level;
    double size = ebpo_half_power(up);
    out->leaf.level = level;
    out->sixteenth = 0;
    for (int k = 0; k < 3; k++) {
        out->leaf.at[k] = place->at[k] >> up;
        out->xi[k] = (place->cells[k] - (double)(out->leaf.at[k] << up)) * size;
        int at = (int)(out->xi[k] * EBPO_LISTED_CELLS); /* rounding may say 16 */
        out->sixteenth |= (uint32_t)(at < 15 ? at : 15) << 8 * k;
    }
}

/* ebpo_axis_segment.reach of the point alone, and of what goes on from it to a wall. */
static inline uint32_t reach_of(const in_leaf *i)
{
    return i->sixteenth | (UINT32_C(0x0f0f0f) - i->sixteenth) << 4;
}

/* From the leaf's free wall to the point. */
static ebpo_axis_segment wall_segment(const ebpo_box *box, uint8_t wall, const in_leaf *i,
                                      const double p[3])
{
    int axis = wall / 2;
    ebpo_axis_segment g = { { p[0], p[1], p[2] },
                            p[axis],
                            axis,
                            /* the wall: 15 above, or 15 less 0 */
                            reach_of(i) | (wall % 2 ? 0x0fu : 0xf0u) << 8 * axis };
    double end = ebpo_wall(box, axis, i->leaf.level, i->leaf.at[axis] + wall % 2);
    if (wall % 2)
        g.to = end;
    else
        g.from[axis] = end;
    return g;
}

/* One segment from a wall that no face meets. */
static bool from_wall(const ebpo_kernels *kernels, const ebpo_accel *s, const ebpo_accel_leaf *leaf,
                      const in_leaf *i, const double p[3], uint32_t *open, int32_t *winding)
{
    ebpo_axis_segment g = wall_segment(&s->box, leaf->wall, i, p);
    int32_t sum;
    if (!cross(kernels, s, leaf, &g, p, open, &sum))
        return false;
    *winding = leaf->winding + leaf->wall_step + (leaf->wall % 2 ? -sum : sum);
    return true;
}

/* Three segments from the lowest corner: format-spec, section 5. Faces that the point lies on come
 * up in the last one. `boxed`: the boxes of the leaf's list are known. */
static bool from_corner(const ebpo_kernels *kernels, const ebpo_accel *s,
                        const ebpo_accel_leaf *leaf, bool boxed, const in_leaf *i,
                        const double p[3], uint32_t *open, int32_t *winding)
{
    double low[3], high[3];
    ebpo_cell_bounds(&s->box, i->leaf, low, high);
    ebpo_axis_segment g = { { low[0], low[1], low[2] }, 0, 0, EBPO_REACH_ALL };
    uint32_t reach = 0xf0f0f0; /* at the corner on all axes */
    *winding = leaf->winding;
    for (int axis = 0; axis < 3; axis++) {
        int32_t sum;
        uint32_t byte = UINT32_C(0xff) << 8 * axis;
        g.axis = axis;
        g.to = p[axis];
        reach |= i->sixteenth & byte;
        if (boxed)
            g.reach = reach;
        if (!cross(kernels, s, leaf, &g, axis == 2 ? p : NULL, open, &sum))
            return false;
        *winding += sum;
        g.from[axis] = p[axis];
        reach = (reach & ~byte) | (reach_of(i) & byte);
    }
    return true;
}

typedef float four_floats __attribute__((vector_size(16)));
typedef int32_t four_signs __attribute__((vector_size(16)));

static inline bool any(four_signs mask)
{
    uint64_t half[2];
    memcpy(half, &mask, sizeof half);
    return half[0] | half[1];
}

/* Signs of the planes alone; false when one is too close to tell. */
static bool from_planes(const ebpo_accel *s, const ebpo_accel_leaf *leaf, const in_leaf *in,
                        int32_t *winding)
{
    float x = (float)in->xi[0], y = (float)in->xi[1], z = (float)in->xi[2];
    const ebpo_kind_row *row = EBPO_KIND_ROW(s->kinds, leaf->rows);
    const ebpo_kind_row *says = row++;
    four_signs above = { 0 }, near = { 0 };
    for (uint32_t left = says->says.fours; left > 0; left--, row += 4) {
        four_floats q[4];
        memcpy(q, row, sizeof q);
        four_floats value = q[0] * x + q[1] * y + q[2] * z - q[3];
        above |= value > EBPO_PLANE_ERROR;
        near |= value >= -EBPO_PLANE_ERROR;
    }
    if (any(above)) {
        *winding = says->says.outer;
        return true;
    }
    *winding = says->says.inner;
    return !any(near);
}

/* What a leaf is like is found out when questions come to it. */
static __attribute__((noinline)) ebpo_leaf_kind ask_kind(const ebpo_context *context,
                                                         const ebpo_accel *s, ebpo_accel_leaf *leaf,
                                                         const in_leaf *i)
{
    if (ebpo_leaf_ask(s, leaf, i->leaf, context->model->kernels->walls))
        ebpo_model_count_kind(context->model, leaf);
    return ebpo_leaf_kind_of(leaf);
}

static inline ebpo_leaf_kind kind_of(const ebpo_context *context, const ebpo_accel *s,
                                     ebpo_accel_leaf *leaf, const in_leaf *i)
{
    ebpo_leaf_kind kind = ebpo_leaf_kind_of(leaf);
    return kind <= EBPO_LEAF_CONCAVE ? kind : ask_kind(context, s, leaf, i);
}

static inline void give(const ebpo_context *context, int32_t winding, ebpo_inside_result *out)
{
    *out = (ebpo_inside_result){ ebpo_rule_inside(context->model->info->rule, winding) ? EBPO_IN
                                                                                       : EBPO_OUT,
                                 winding, 0 };
}

/* By crossing faces. */
static ebpo_status answer_by_faces(ebpo_context *context, const ebpo_accel *s,
                                   const ebpo_accel_leaf *leaf, bool walled, const in_leaf *i,
                                   const double p[3], ebpo_inside_result *out, ebpo_error *error)
{
    const ebpo_kernels *kernels = context->model->kernels;
    uint64_t most = (uint64_t)s->list_longest * EBPO_BLOCK;
    int32_t winding;
    if (most > context->open_capacity &&
        !ebpo_grow(&context->open, &context->open_capacity, most, sizeof *context->open))
        return ebpo_fail_memory(error, most * sizeof *context->open);
    bool off = walled && leaf->wall != EBPO_NO_WALL
                   ? from_wall(kernels, s, leaf, i, p, context->open, &winding)
                   : from_corner(kernels, s, leaf, walled, i, p, context->open, &winding);
    if (off)
        give(context, winding, out);
    else
        *out = (ebpo_inside_result){ EBPO_ON, 0, 0 };
    return EBPO_OK;
}

static ebpo_status answer_in_leaf(ebpo_context *context, const ebpo_accel *s, ebpo_accel_leaf *leaf,
                                  const in_leaf *i, const double p[3], ebpo_inside_result *out,
                                  ebpo_error *error)
{
    int32_t winding;
    ebpo_leaf_kind kind = kind_of(context, s, leaf, i);
    if (!ebpo_leaf_has_planes(kind) || !from_planes(s, leaf, i, &winding))
        return answer_by_faces(context, s, leaf, ebpo_leaf_is_walled(kind), i, p, out, error);
    give(context, winding, out);
    return EBPO_OK;
}

ebpo_status ebpo_inside_leaf(ebpo_context *context, const ebpo_accel *s, uint32_t number, int level,
                             const ebpo_position *place, const double p[3], ebpo_inside_result *out,
                             ebpo_error *error)
{
    in_leaf i;
    find_in_leaf(context->model->locator.level, level, place, &i);
    return answer_in_leaf(context, s, &s->leaf[number], &i, p, out, error);
}

void ebpo_inside_uniform(const ebpo_context *context, uint32_t entry, ebpo_inside_result *out)
{
    give(context, ebpo_entry_winding(entry), out);
}

ebpo_status ebpo_inside_subtree(ebpo_context *context, const ebpo_accel *s,
                                const ebpo_position *place, const double p[3],
                                ebpo_inside_result *out, ebpo_error *error)
{
    ebpo_descent d = ebpo_descend(&s->nodes, context->model->locator.level, place->at);
    if (ebpo_entry_kind_of(d.entry) == EBPO_ENTRY_UNIFORM) {
        ebpo_inside_uniform(context, d.entry, out);
        return EBPO_OK;
    }
    if (ebpo_entry_kind_of(d.entry) == EBPO_ENTRY_BELOW)
        return ebpo_inside_pruned(context, p, out, error);
    return ebpo_inside_leaf(context, s, ebpo_entry_value(d.entry), d.level, place, p, out, error);
}

/* Several points at a time, stage by stage, so that the memory that one stage needs is on its way
 * while others are dealt with. */
enum { TOGETHER = 16 };

typedef struct lane {
    ebpo_position place;
    bool within;
    ebpo_descent d;
} lane;

/* A point that ended in a leaf. */
typedef struct waiting {
    ebpo_accel_leaf *leaf;
    unsigned point;
    in_leaf in;
} waiting;

static void start_lanes(const ebpo_accel *s, const ebpo_locator *locator, const double *points,
                        unsigned count, lane *l)
{
    int fine = locator->level;
    for (unsigned i = 0; i < count; i++) {
        l[i].within = ebpo_locator_find(locator, points + 3 * i, &l[i].place);
        if (l[i].within && s->nodes.grid) {
            uint64_t cell = ebpo_grid_cell(&s->nodes, fine, l[i].place.at);
            __builtin_prefetch(&s->nodes.grid[cell]);
        }
    }
    for (unsigned i = 0; i < count; i++)
        if (l[i].within) {
            l[i].d = ebpo_descent_begin(&s->nodes, fine, l[i].place.at);
            ebpo_descent_prefetch(&l[i].d, &s->nodes);
        }
}

static void descend_together(const ebpo_accel *s, int fine, unsigned count, lane *l)
{
    for (bool more = true; more;) {
        more = false;
        for (unsigned i = 0; i < count; i++)
            if (l[i].within && ebpo_descent_step(&l[i].d, &s->nodes, fine, l[i].place.at))
                more |= ebpo_descent_prefetch(&l[i].d, &s->nodes);
    }
}

/* The cache lines of the blocks that the point's segment may meet. */
static void prefetch_blocks(const ebpo_accel *s, const waiting *w, const double p[3])
{
    const ebpo_accel_leaf *leaf = w->leaf;
    ebpo_leaf_kind kind = ebpo_leaf_kind_of(leaf);
    ebpo_axis_segment g = { .reach = EBPO_REACH_ALL };
    if (ebpo_leaf_has_planes(kind))
        return;
    if (ebpo_leaf_is_walled(kind) && leaf->wall != EBPO_NO_WALL)
        g = wall_segment(&s->box, leaf->wall, &w->in, p);
    const ebpo_listed_block *list = s->list + leaf->list;
    for (int b = 0; b < 8; b++) {
        uint64_t listed = ebpo_listed(list + b);
        if (ebpo_axis_segment_meets(&g, listed))
            for (int line = 0; line < (s->wide ? 4 : 2); line++)
                __builtin_prefetch((const char *)ebpo_accel_meshlet(s, ebpo_listed_number(listed)) +
                                   64 * line);
        if (listed & EBPO_LISTED_LAST)
            return;
    }
}

static ebpo_status answer_waiting(ebpo_context *context, const ebpo_accel *s, const waiting *w,
                                  unsigned count, const double *points, ebpo_inside_result *out,
                                  ebpo_error *error)
{
    for (unsigned i = 0; i < count; i++) {
        __builtin_prefetch(s->list + w[i].leaf->list);
        if (ebpo_leaf_has_planes(ebpo_leaf_kind_of(w[i].leaf)))
            __builtin_prefetch(EBPO_KIND_ROW(s->kinds, w[i].leaf->rows));
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
    int fine = context->model->locator.level;
    start_lanes(s, &context->model->locator, points, count, l);
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
            find_in_leaf(fine, l[i].d.level, &l[i].place, &w[leaves].in);
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
        ebpo_position place;
        if (ebpo_locator_find(&context->model->locator, points, &place))
            return ebpo_inside_subtree(context, s, &place, points, out, error);
        *out = (ebpo_inside_result){ EBPO_OUT, 0, 0 };
        return EBPO_OK;
    }
    for (uint64_t i = 0; i < count && status == EBPO_OK; i += TOGETHER)
        status = inside_together(context, s, points + 3 * i,
                                 count - i < TOGETHER ? (unsigned)(count - i) : TOGETHER, out + i,
                                 error);
    return status;
}
