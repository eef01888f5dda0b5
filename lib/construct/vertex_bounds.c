/* Support of runs of vertices by boxes of boxes. Rounding is monotone, so a box's bound computed in
 * the same order of operations is never below that of a point in it: skipping a box never loses the
 * greatest point. */
#include "core/strict_fp.h"

#include "construct/vertex_bounds.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "geometry/octcode.h"

static void join(double (*box)[3], const double low[3], const double high[3])
{
    for (int k = 0; k < 3; k++) {
        box[0][k] = low[k] < box[0][k] ? low[k] : box[0][k];
        box[1][k] = high[k] > box[1][k] ? high[k] : box[1][k];
    }
}

ebpo_status ebpo_bounds_make(ebpo_builder *b, ebpo_error *error)
{
    ebpo_bounds *bounds = &b->bounds;
    uint64_t below = b->vertex_count;
    for (int level = 0; level < EBPO_BOUNDS_LEVELS && below > 1; level++) {
        uint64_t n = (below + EBPO_BOUNDS_FAN - 1) / EBPO_BOUNDS_FAN;
        double(*box)[2][3] = ebpo_array_alloc(b->workspace, n, sizeof *box);
        if (!box)
            return ebpo_workspace_fail(b->workspace, n * sizeof *box, error);
        bounds->box[level] = box;
        bounds->count[level] = n;
        bounds->levels = level + 1;
        EBPO_FOR_ITEMS(b->workspace, i, 0, below) {
            double p[3], *low = level ? bounds->box[level - 1][i][0] : p,
                         *high = level ? bounds->box[level - 1][i][1] : p;
            if (level == 0)
                ebpo_mesh_position(b->mesh, i, p);
            if (i % EBPO_BOUNDS_FAN == 0) {
                memcpy(box[i / EBPO_BOUNDS_FAN][0], low, sizeof p);
                memcpy(box[i / EBPO_BOUNDS_FAN][1], high, sizeof p);
            } else
                join(box[i / EBPO_BOUNDS_FAN], low, high);
        }
        below = n;
    }
    return EBPO_OK;
}

void ebpo_bounds_free(ebpo_bounds *bounds)
{
    for (int i = 0; i < bounds->levels; i++)
        ebpo_array_free(bounds->workspace, bounds->box[i]);
    bounds->levels = 0;
}

typedef struct query {
    const ebpo_builder *b;
    double corner[3], size[3], n[3];
    uint64_t begin, end, at;
    double best;
} query;

static double value(const query *q, const double low[3], const double high[3])
{
    double x = (q->n[0] < 0 ? low[0] : high[0]), y = (q->n[1] < 0 ? low[1] : high[1]),
           z = (q->n[2] < 0 ? low[2] : high[2]);
    return q->n[0] * ((x - q->corner[0]) / q->size[0]) +
           q->n[1] * ((y - q->corner[1]) / q->size[1]) +
           q->n[2] * ((z - q->corner[2]) / q->size[2]);
}

static void visit(query *q, int level, uint64_t block)
{
    /* `level` 0 is the vertices themselves. */
    uint64_t width = 1;
    for (int i = 0; i < level; i++)
        width *= EBPO_BOUNDS_FAN;
    if (block * width >= q->end || (block + 1) * width <= q->begin)
        return;
    if (level == 0) {
        double p[3];
        ebpo_mesh_position(q->b->mesh, block, p);
        double v = value(q, p, p);
        if (v > q->best) {
            q->best = v;
            q->at = block;
        }
        return;
    }
    const double(*box)[3] = (const double(*)[3])q->b->bounds.box[level - 1][block];
    if (value(q, box[0], box[1]) <= q->best)
        return;
    uint64_t below = level > 1 ? q->b->bounds.count[level - 2] : q->b->vertex_count;
    for (uint64_t i = block * EBPO_BOUNDS_FAN; i < (block + 1) * EBPO_BOUNDS_FAN && i < below; i++)
        visit(q, level - 1, i);
}

double ebpo_bounds_support(const ebpo_builder *b, ebpo_cell cell, const double n[3], uint64_t begin,
                           uint64_t end, double least, uint64_t *at)
{
    query q = { .b = b, .begin = begin, .end = end, .at = EBPO_NO_VERTEX, .best = least };
    for (int k = 0; k < 3; k++) {
        q.corner[k] = ebpo_wall(&b->box, k, cell.level, cell.at[k]);
        q.size[k] = b->box.size[k] / (double)(1u << cell.level);
        q.n[k] = n[k];
    }
    /* Start at the level where the run covers some blocks, not at the top. */
    int level = 0;
    uint64_t width = 1;
    while (level < b->bounds.levels && width * EBPO_BOUNDS_FAN <= end - begin) {
        width *= EBPO_BOUNDS_FAN;
        level++;
    }
    if (begin < end)
        for (uint64_t block = begin / width; block * width < end; block++)
            visit(&q, level, block);
    *at = q.at;
    return q.best;
}

static uint64_t lower_bound(const uint64_t *key, uint64_t count, uint64_t wanted)
{
    uint64_t low = 0;
    while (count) {
        uint64_t half = count / 2;
        if (key[low + half] < wanted) {
            low += half + 1;
            count -= half + 1;
        } else
            count = half;
    }
    return low;
}

void ebpo_build_vertex_range(const ebpo_builder *b, ebpo_cell cell, uint64_t *begin, uint64_t *end)
{
    ebpo_octcode code = ebpo_octcode_of_cell(cell);
    int below = 3 * (b->box.grid_level - cell.level);
    *begin = lower_bound(b->key, b->vertex_count, code << below);
    *end = *begin + lower_bound(b->key + *begin, b->vertex_count - *begin, (code + 1) << below);
}
