/* Boxes and round slabs around the blocks below each child. All in doubles, in the subtree's frame,
 * then rounded outward to floats. */
#include "geom/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/parallel.h"
#include "accel/accel_parts.h"

/* Above so many blocks the slab is left away (a ball takes its place): such patches curve too much
 * for one. */
enum { SLAB_BLOCKS_MAX = 1024 };
/* A subtree lists faces that reach beyond its cell. Where they reach beyond this, in units of the
 * frame, floats cannot hold a slab closely enough and the box alone bounds. */
static const double slab_reach = 2;
/* Widening, in units of the frame (1 is half the subtree's size), for the rounding of what is
 * computed here and of the axis to floats. */
static const double slack = 0x1p-22;

typedef struct job {
    ebpo_accel *s;
    const ebpo_layout *layout;
} job;

typedef struct extent {
    double low[3], high[3], normal[3];
} extent;

/* A block's corners in the frame, [corner][axis][lane]; lanes without a face repeat the first one.
 */
typedef struct lanes {
    double x[3][3][EBPO_BLOCK];
} lanes;

static void load_lanes(const ebpo_accel *s, uint32_t block, lanes *out)
{
    for (int i = 0; i < 9; i++) {
        uint64_t at = (uint64_t)block * EBPO_BLOCK_NUMBERS + (uint64_t)i * EBPO_BLOCK;
        double *x = out->x[i / 3][i % 3], centre = s->centre[i % 3];
        for (int lane = 0; lane < EBPO_BLOCK; lane++)
            x[lane] =
                s->wide ? s->block64[at + (uint64_t)lane] : (double)s->block32[at + (uint64_t)lane];
        for (int lane = 0; lane < EBPO_BLOCK; lane++)
            x[lane] = s->slot_face[block * EBPO_BLOCK + (uint32_t)lane] == EBPO_NO_SLOT
                          ? x[0]
                          : (x[lane] - centre) * s->scale;
    }
}

static void add_block(const lanes *l, extent *e)
{
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        double low = e->low[k], high = e->high[k], normal = 0;
        for (int i = 0; i < 3; i++)
            for (int lane = 0; lane < EBPO_BLOCK; lane++) {
                double x = l->x[i][k][lane];
                low = x < low ? x : low;
                high = x > high ? x : high;
            }
        for (int lane = 0; lane < EBPO_BLOCK; lane++)
            normal +=
                (l->x[1][u][lane] - l->x[0][u][lane]) * (l->x[2][v][lane] - l->x[0][v][lane]) -
                (l->x[1][v][lane] - l->x[0][v][lane]) * (l->x[2][u][lane] - l->x[0][u][lane]);
        e->low[k] = low;
        e->high[k] = high;
        e->normal[k] += normal;
    }
}

/* The axis as the floats that readers will use; a zero axis makes the slab a ball. */
static void choose_axis(const extent *e, float axis[3])
{
    double length = sqrt(e->normal[0] * e->normal[0] + e->normal[1] * e->normal[1] +
                         e->normal[2] * e->normal[2]);
    for (int k = 0; k < 3; k++)
        axis[k] = length > 0 ? (float)(e->normal[k] / length) : 0;
}

typedef struct slab {
    double from, to, radius2;
} slab;

static void add_to_slab(const lanes *l, const double middle[3], const float axis[3], slab *out)
{
    for (int i = 0; i < 3; i++) {
        double along[EBPO_BLOCK] = { 0 }, square[EBPO_BLOCK] = { 0 };
        for (int k = 0; k < 3; k++)
            for (int lane = 0; lane < EBPO_BLOCK; lane++) {
                double d = l->x[i][k][lane] - middle[k];
                along[lane] += d * (double)axis[k];
                square[lane] += d * d;
            }
        for (int lane = 0; lane < EBPO_BLOCK; lane++) {
            /* the axis is a unit vector up to its rounding */
            double radius2 = square[lane] - along[lane] * along[lane] + square[lane] * 0x1p-22;
            out->from = along[lane] < out->from ? along[lane] : out->from;
            out->to = along[lane] > out->to ? along[lane] : out->to;
            out->radius2 = radius2 > out->radius2 ? radius2 : out->radius2;
        }
    }
}

static float down(double x) { return nextafterf((float)(x - slack), -INFINITY); }

static float up(double x) { return nextafterf((float)(x + slack), INFINITY); }

static void set_child(ebpo_bound *b, int lane, const extent *e, const float axis[3],
                      const double middle[3], const slab *w)
{
    double shift = (w->from + w->to) / 2;
    for (int k = 0; k < 3; k++) {
        b->low[k][lane] = down(e->low[k]);
        b->high[k][lane] = up(e->high[k]);
        b->axis[k][lane] = axis[k];
        b->middle[k][lane] = (float)(middle[k] + shift * (double)axis[k]);
    }
    /* The middle, less than slab_reach, is rounded to floats, which moves it by less than the
     * slack. */
    b->radius[lane] = up(sqrt(w->radius2 > 0 ? w->radius2 : 0) + slack);
    b->half[lane] = up((w->to - w->from) / 2 + slack);
}

static void bound_blocks(const ebpo_accel *s, ebpo_bound *b, int lane, uint32_t first,
                         uint32_t last)
{
    extent e = { { INFINITY, INFINITY, INFINITY },
                 { -INFINITY, -INFINITY, -INFINITY },
                 { 0, 0, 0 } };
    lanes l;
    for (uint32_t block = first; block < last; block++) {
        load_lanes(s, block, &l);
        add_block(&l, &e);
    }
    float axis[3] = { 0, 0, 0 };
    double middle[3];
    for (int k = 0; k < 3; k++)
        middle[k] = (e.low[k] + e.high[k]) / 2;
    slab w = { 0, 0, 0 };
    double reach = 0;
    for (int k = 0; k < 3; k++)
        reach = fmax(reach, fmax(fabs(e.low[k]), fabs(e.high[k])));
    if (!(reach < slab_reach)) {
        middle[0] = middle[1] = middle[2] = 0;
        w.radius2 = INFINITY;
    } else if (last - first > SLAB_BLOCKS_MAX) {
        for (int k = 0; k < 3; k++)
            w.radius2 += (e.high[k] - middle[k]) * (e.high[k] - middle[k]);
    } else {
        choose_axis(&e, axis);
        w = (slab){ INFINITY, -INFINITY, 0 };
        for (uint32_t block = first; block < last; block++) {
            if (last - first > 1)
                load_lanes(s, block, &l);
            add_to_slab(&l, middle, axis, &w);
        }
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

static ebpo_status bound_nodes(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
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
                bound_blocks(j->s, b, lane, j->layout->first_block[child],
                             j->layout->last_block[child]);
        }
    }
    return EBPO_OK;
}

ebpo_status ebpo_accel_fill_bounds(ebpo_accel *s, const ebpo_layout *layout, unsigned threads,
                                   ebpo_error *error)
{
    s->bound_count = (uint32_t)layout->bound_count;
    s->top = layout->top;
    s->bound = aligned_alloc(64, (layout->bound_count * sizeof *s->bound + 127) / 64 * 64);
    if (!s->bound)
        return ebpo_fail_memory(error, layout->bound_count * sizeof *s->bound);
    job j = { s, layout };
    return ebpo_parallel_for(threads, NULL, layout->bound_count, 64, bound_nodes, &j, NULL, "open",
                             error);
}
