/* Point in solid, exact. */
#include "geom/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "base/alloc.h"
#include "base/error.h"
#include "geom/predicates.h"
#include "query/inside.h"
#include "query/locate.h"

/* Adds the crossings that the filter left open; true when the point lies on one of these faces. */
static bool settle_open(const ebpo_subtree *s, const uint32_t *open, uint32_t count, const ebpo_axis_segment *g, const double *point,
                        int32_t *sum)
{
    for (uint32_t i = 0; i < count; i++) {
        double t[3][3];
        ebpo_subtree_triangle(s, open[i], t);
        if (point && ebpo_point_on_triangle(point, t[0], t[1], t[2]))
            return true;
        *sum += ebpo_axis_crossing(g->from, g->to, g->axis, t[0], t[1], t[2]);
    }
    return false;
}

/* Crossings along a segment; `point` (its end) is looked for on the faces, NULL: is not. False when it lies on one. */
static bool cross(const ebpo_kernels *kernels, const ebpo_subtree *s, const ebpo_subtree_leaf *leaf, const ebpo_axis_segment *g,
                  const double *point, uint32_t *open, int32_t *sum)
{
    uint32_t count = 0;
    *sum = kernels->crossings(s, s->list + leaf->list, leaf->blocks, g, open, &count);
    return count == 0 || !settle_open(s, open, count, g, point, sum);
}

/* One segment from a wall that no face meets. */
static bool from_wall(const ebpo_kernels *kernels, const ebpo_subtree *s, const ebpo_subtree_leaf *leaf, const double low[3], const double high[3],
                      const double p[3], uint32_t *open, int32_t *winding)
{
    int axis = leaf->wall / 2;
    ebpo_axis_segment g = { { p[0], p[1], p[2] }, p[axis], axis };
    int32_t sum;
    bool upper = leaf->wall % 2;
    if (upper)
        g.to = high[axis];
    else
        g.from[axis] = low[axis];
    if (!cross(kernels, s, leaf, &g, p, open, &sum))
        return false;
    *winding = upper ? leaf->winding - sum : leaf->winding + sum;
    return true;
}

/* Three segments from the lowest corner: format-spec, section 5. Faces that the point lies on come up in the last one. */
static bool from_corner(const ebpo_kernels *kernels, const ebpo_subtree *s, const ebpo_subtree_leaf *leaf, const double low[3], const double p[3],
                        uint32_t *open, int32_t *winding)
{
    ebpo_axis_segment g = { { low[0], low[1], low[2] }, 0, 0 };
    *winding = leaf->winding;
    for (int axis = 0; axis < 3; axis++) {
        int32_t sum;
        g.axis = axis;
        g.to = p[axis];
        if (!cross(kernels, s, leaf, &g, axis == 2 ? p : NULL, open, &sum))
            return false;
        *winding += sum;
        g.from[axis] = p[axis];
    }
    return true;
}

/* Signs of the planes alone; false when one is too close to tell. */
static bool from_planes(const ebpo_subtree *s, const ebpo_subtree_leaf *leaf, const double low[3], const double high[3], const double p[3],
                        int32_t *winding)
{
    float xi[3];
    for (int k = 0; k < 3; k++)
        xi[k] = (float)((p[k] - low[k]) / (high[k] - low[k]));
    float most = -INFINITY;
    for (int i = 0; i < leaf->planes; i += 4) {
        const ebpo_four_planes *q = &s->planes[leaf->first_plane + (uint32_t)i / 4];
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

ebpo_status ebpo_inside_leaf(ebpo_context *context, const ebpo_subtree *s, uint32_t number, int level, const uint32_t at[3], const double p[3],
                             ebpo_inside_result *out, ebpo_error *error)
{
    const ebpo_subtree_leaf *leaf = &s->leaf[number];
    const ebpo_model *m = context->model;
    double low[3], high[3];
    for (int k = 0; k < 3; k++) {
        low[k] = ebpo_wall(&s->box, k, level, at[k]);
        high[k] = ebpo_wall(&s->box, k, level, at[k] + 1);
    }
    if (!ebpo_grow(&context->open, &context->open_room, (uint64_t)leaf->blocks * EBPO_BLOCK, sizeof *context->open))
        return ebpo_fail_memory(error, (uint64_t)leaf->blocks * EBPO_BLOCK * sizeof *context->open);
    int32_t winding;
    bool off = leaf->kind != EBPO_LEAF_GENERAL && from_planes(s, leaf, low, high, p, &winding);
    if (!off)
        off = leaf->wall != EBPO_NO_WALL ? from_wall(m->kernels, s, leaf, low, high, p, context->open, &winding)
                                         : from_corner(m->kernels, s, leaf, low, p, context->open, &winding);
    if (!off) {
        *out = (ebpo_inside_result){ EBPO_ON, 0, 0 };
        return EBPO_OK;
    }
    *out = (ebpo_inside_result){ ebpo_rule_inside(m->info->rule, winding) ? EBPO_IN : EBPO_OUT, winding, 0 };
    return EBPO_OK;
}

void ebpo_inside_settled(const ebpo_context *context, uint32_t entry, ebpo_inside_result *out)
{
    int32_t winding = ebpo_entry_winding(entry);
    *out = (ebpo_inside_result){ ebpo_rule_inside(context->model->info->rule, winding) ? EBPO_IN : EBPO_OUT, winding, 0 };
}

static ebpo_status answer_entry(ebpo_context *context, const ebpo_subtree *s, uint32_t entry, int level, const uint32_t at[3], const double p[3],
                                ebpo_inside_result *out, ebpo_error *error)
{
    if (ebpo_entry_kind_of(entry) == EBPO_ENTRY_SETTLED) {
        ebpo_inside_settled(context, entry, out);
        return EBPO_OK;
    }
    int shift = context->model->info->level_count - 1 - level;
    uint32_t cell[3] = { at[0] >> shift, at[1] >> shift, at[2] >> shift };
    return ebpo_inside_leaf(context, s, ebpo_entry_value(entry), level, cell, p, out, error);
}

ebpo_status ebpo_inside_subtree(ebpo_context *context, const ebpo_subtree *s, const uint32_t at[3], const double p[3], ebpo_inside_result *out,
                                ebpo_error *error)
{
    int level;
    uint32_t entry = ebpo_descend(&s->nodes, context->model->info->level_count - 1, at, &level);
    return answer_entry(context, s, entry, level, at, p, out, error);
}

/* Several points at a time, stage by stage, so that the memory that one stage needs is on its way while others are dealt with. */
enum { TOGETHER = 16 };

typedef struct lane {
    uint32_t at[3], entry;
    int level;
    bool within;
} lane;

static void prefetch_leaf(const ebpo_subtree *s, const lane *l, int stage)
{
    if (!l->within || ebpo_entry_kind_of(l->entry) != EBPO_ENTRY_LEAF)
        return;
    const ebpo_subtree_leaf *leaf = &s->leaf[ebpo_entry_value(l->entry)];
    if (stage == 0) {
        __builtin_prefetch(leaf);
    } else if (stage == 1) {
        __builtin_prefetch(s->list + leaf->list);
        if (leaf->kind != EBPO_LEAF_GENERAL)
            __builtin_prefetch(s->planes + leaf->first_plane);
    } else if (leaf->kind == EBPO_LEAF_GENERAL) {
        for (uint32_t b = 0; b < leaf->blocks && b < 8; b++) {
            const char *block = s->wide ? (const char *)(s->block64 + (uint64_t)s->list[leaf->list + b] * EBPO_BLOCK_NUMBERS)
                                        : (const char *)(s->block32 + (uint64_t)s->list[leaf->list + b] * EBPO_BLOCK_NUMBERS);
            for (size_t line = 0; line < (s->wide ? 576u : 288u); line += 64)
                __builtin_prefetch(block + line);
        }
    }
}

static ebpo_status inside_together(ebpo_context *context, const ebpo_subtree *s, const double *points, unsigned count, ebpo_inside_result *out,
                                   ebpo_error *error)
{
    lane l[TOGETHER];
    int fine = context->model->info->level_count - 1;
    for (unsigned i = 0; i < count; i++) {
        l[i].within = ebpo_locate(&s->box, fine, points + 3 * i, l[i].at);
        if (l[i].within && s->nodes.grid) {
            uint64_t cell = ebpo_grid_cell(&s->nodes, fine, l[i].at);
            __builtin_prefetch(&s->nodes.grid[cell]);
            __builtin_prefetch(&s->nodes.grid_depth[cell]);
        }
    }
    bool more = s->nodes.grid != NULL;
    for (unsigned i = 0; i < count && more; i++)
        if (l[i].within) {
            uint64_t cell = ebpo_grid_cell(&s->nodes, fine, l[i].at);
            l[i].entry = s->nodes.grid[cell];
            l[i].level = s->nodes.root_level + s->nodes.grid_depth[cell];
            if (ebpo_entry_kind_of(l[i].entry) == EBPO_ENTRY_GRAY)
                __builtin_prefetch(s->nodes.group[ebpo_entry_value(l[i].entry)]);
        }
    while (more) {
        more = false;
        for (unsigned i = 0; i < count; i++)
            if (l[i].within && ebpo_entry_kind_of(l[i].entry) == EBPO_ENTRY_GRAY) {
                l[i].level++;
                l[i].entry = s->nodes.group[ebpo_entry_value(l[i].entry)][ebpo_octant_at(l[i].at, fine - l[i].level)];
                if (ebpo_entry_kind_of(l[i].entry) == EBPO_ENTRY_GRAY) {
                    __builtin_prefetch(s->nodes.group[ebpo_entry_value(l[i].entry)]);
                    more = true;
                }
            }
    }
    for (unsigned i = 0; i < count && !s->nodes.grid; i++)
        if (l[i].within)
            l[i].entry = ebpo_descend(&s->nodes, fine, l[i].at, &l[i].level);
    for (int stage = 0; stage < 3; stage++)
        for (unsigned i = 0; i < count; i++)
            prefetch_leaf(s, &l[i], stage);
    ebpo_status status = EBPO_OK;
    for (unsigned i = 0; i < count && status == EBPO_OK; i++) {
        if (l[i].within)
            status = answer_entry(context, s, l[i].entry, l[i].level, l[i].at, points + 3 * i, &out[i], error);
        else
            out[i] = (ebpo_inside_result){ EBPO_OUT, 0, 0 };
    }
    return status;
}

ebpo_status ebpo_inside_whole(ebpo_context *context, const double *points, uint64_t count, ebpo_inside_result *out, ebpo_error *error)
{
    const ebpo_subtree *s = context->model->whole;
    ebpo_status status = EBPO_OK;
    if (count == 1) {
        uint32_t at[3];
        if (ebpo_locate(&s->box, context->model->info->level_count - 1, points, at))
            return ebpo_inside_subtree(context, s, at, points, out, error);
        *out = (ebpo_inside_result){ EBPO_OUT, 0, 0 };
        return EBPO_OK;
    }
    for (uint64_t i = 0; i < count && status == EBPO_OK; i += TOGETHER)
        status = inside_together(context, s, points + 3 * i, count - i < TOGETHER ? (unsigned)(count - i) : TOGETHER, out + i, error);
    return status;
}
