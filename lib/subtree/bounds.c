/* Boxes and round slabs around the blocks below each child. All in doubles, in the subtree's frame, then rounded outward to floats. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/parallel.h"
#include "subtree/parts.h"

/* Above so many blocks the slab is left away (a ball takes its place): such patches curve too much for one. */
enum { SLAB_BLOCKS_MAX = 1024 };
/* Widening, in units of the frame (1 is half the subtree's size), for the rounding of what is computed here and of the axis to floats. */
static const double slack = 0x1p-22;

typedef struct job {
    ebpo_subtree *s;
    const ebpo_layout *layout;
} job;

typedef struct extent {
    double low[3], high[3], normal[3];
} extent;

static inline void corner(const ebpo_subtree *s, double t[3][3], int i, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = (t[i][k] - s->centre[k]) * s->scale;
}

static void add_face(const ebpo_subtree *s, uint32_t slot, extent *e)
{
    double t[3][3], p[3][3];
    ebpo_subtree_triangle(s, slot, t);
    for (int i = 0; i < 3; i++) {
        corner(s, t, i, p[i]);
        for (int k = 0; k < 3; k++) {
            e->low[k] = p[i][k] < e->low[k] ? p[i][k] : e->low[k];
            e->high[k] = p[i][k] > e->high[k] ? p[i][k] : e->high[k];
        }
    }
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        e->normal[k] += (p[1][u] - p[0][u]) * (p[2][v] - p[0][v]) - (p[1][v] - p[0][v]) * (p[2][u] - p[0][u]);
    }
}

/* The axis as the floats that readers will use; a zero axis makes the slab a ball. */
static void choose_axis(const extent *e, float axis[3])
{
    double length = sqrt(e->normal[0] * e->normal[0] + e->normal[1] * e->normal[1] + e->normal[2] * e->normal[2]);
    for (int k = 0; k < 3; k++)
        axis[k] = length > 0 ? (float)(e->normal[k] / length) : 0;
}

typedef struct slab {
    double from, to, radius2;
} slab;

static void add_to_slab(const ebpo_subtree *s, uint32_t slot, const double middle[3], const float axis[3], slab *out)
{
    double t[3][3], p[3];
    ebpo_subtree_triangle(s, slot, t);
    for (int i = 0; i < 3; i++) {
        corner(s, t, i, p);
        double along = 0, square = 0;
        for (int k = 0; k < 3; k++) {
            double d = p[k] - middle[k];
            along += d * (double)axis[k];
            square += d * d;
        }
        out->from = along < out->from ? along : out->from;
        out->to = along > out->to ? along : out->to;
        double radius2 = square - along * along + square * 0x1p-22; /* the axis is a unit vector up to its rounding */
        out->radius2 = radius2 > out->radius2 ? radius2 : out->radius2;
    }
}

static float down(double x)
{
    return nextafterf((float)(x - slack), -INFINITY);
}

static float up(double x)
{
    return nextafterf((float)(x + slack), INFINITY);
}

static void set_child(ebpo_bound *b, int lane, const extent *e, const float axis[3], const double middle[3], const slab *w)
{
    double shift = (w->from + w->to) / 2;
    for (int k = 0; k < 3; k++) {
        b->low[k][lane] = down(e->low[k]);
        b->high[k][lane] = up(e->high[k]);
        b->axis[k][lane] = axis[k];
        b->middle[k][lane] = (float)(middle[k] + shift * (double)axis[k]);
    }
    /* The middle is rounded to floats, which moves it by less than the slack. */
    b->radius[lane] = up(sqrt(w->radius2 > 0 ? w->radius2 : 0) + slack);
    b->half[lane] = up((w->to - w->from) / 2 + slack);
}

static void bound_blocks(const ebpo_subtree *s, ebpo_bound *b, int lane, uint32_t first, uint32_t last)
{
    extent e = { { INFINITY, INFINITY, INFINITY }, { -INFINITY, -INFINITY, -INFINITY }, { 0, 0, 0 } };
    for (uint64_t slot = (uint64_t)first * EBPO_BLOCK; slot < (uint64_t)last * EBPO_BLOCK; slot++)
        if (s->slot_face[slot] != EBPO_NO_SLOT)
            add_face(s, (uint32_t)slot, &e);
    float axis[3] = { 0, 0, 0 };
    double middle[3];
    for (int k = 0; k < 3; k++)
        middle[k] = (e.low[k] + e.high[k]) / 2;
    slab w = { 0, 0, 0 };
    if (last - first > SLAB_BLOCKS_MAX) {
        for (int k = 0; k < 3; k++)
            w.radius2 += (e.high[k] - middle[k]) * (e.high[k] - middle[k]);
    } else {
        choose_axis(&e, axis);
        w = (slab){ INFINITY, -INFINITY, 0 };
        for (uint64_t slot = (uint64_t)first * EBPO_BLOCK; slot < (uint64_t)last * EBPO_BLOCK; slot++)
            if (s->slot_face[slot] != EBPO_NO_SLOT)
                add_to_slab(s, (uint32_t)slot, middle, axis, &w);
    }
    set_child(b, lane, &e, axis, middle, &w);
}

static void bound_nothing(ebpo_bound *b, int lane)
{
    for (int k = 0; k < 3; k++) {
        b->low[k][lane] = INFINITY;
        b->high[k][lane] = -INFINITY;
        b->axis[k][lane] = b->middle[k][lane] = 0;
    }
    b->radius[lane] = b->half[lane] = 0;
}

static ebpo_status bound_nodes(void *context, uint64_t begin, uint64_t end, unsigned worker, ebpo_error *error)
{
    (void)worker;
    (void)error;
    job *j = context;
    for (uint64_t n = begin; n < end; n++) {
        ebpo_bound *b = &j->s->bound[n];
        for (int lane = 0; lane < 8; lane++) {
            uint32_t child = b->child[lane] = j->layout->child[n][lane];
            if (child == EBPO_NO_CHILD)
                bound_nothing(b, lane);
            else if (child & EBPO_IS_BLOCK)
                bound_blocks(j->s, b, lane, child & ~EBPO_IS_BLOCK, (child & ~EBPO_IS_BLOCK) + 1);
            else
                bound_blocks(j->s, b, lane, j->layout->first_block[child], j->layout->last_block[child]);
        }
    }
    return EBPO_OK;
}

ebpo_status ebpo_subtree_fill_bounds(ebpo_subtree *s, const ebpo_layout *layout, unsigned threads, ebpo_error *error)
{
    s->bound_count = (uint32_t)layout->bound_count;
    s->top = layout->top;
    s->bound = aligned_alloc(64, (layout->bound_count * sizeof *s->bound + 127) / 64 * 64);
    if (!s->bound)
        return ebpo_fail_memory(error, layout->bound_count * sizeof *s->bound);
    job j = { s, layout };
    return ebpo_parallel_for(threads, layout->bound_count, 64, bound_nodes, &j, NULL, "open", error);
}
