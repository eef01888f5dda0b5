/* A leaf's walls that no face comes to, and the boxes of its list: found when the first question
 * comes to it, in less time than an answer takes without them. */
#include "geom/strict_fp.h"

#include <math.h>
#include <string.h>

#include "geom/min_max.h"
#include "octree/cells.h"
#include "accel/accel_parts.h"
#include "accel/face_block.h"

/* A cell's walls, and the floats next to them: nothing that is a float lies between. */
typedef struct cell_walls {
    double low[3], high[3];
    double inverse[3]; /* of its size */
    float low_down[3], low_up[3], high_down[3], high_up[3];
    bool fine; /* in cells too small for the boxes these stay as they are: all of the cell */
} cell_walls;

static float below(double x)
{
    float f = (float)x;
    return (double)f > x ? nextafterf(f, -INFINITY) : f;
}

static float above(double x)
{
    float f = (float)x;
    return (double)f < x ? nextafterf(f, INFINITY) : f;
}

static void find_walls(const ebpo_accel *s, ebpo_cell cell, cell_walls *out)
{
    ebpo_cell_bounds(&s->box, cell, out->low, out->high);
    out->fine = true;
    for (int k = 0; k < 3; k++) {
        double size = out->high[k] - out->low[k];
        out->inverse[k] = 1 / size;
        out->fine = out->fine && size > 0x1p-900;
        out->low_down[k] = below(out->low[k]);
        out->low_up[k] = above(out->low[k]);
        out->high_down[k] = below(out->high[k]);
        out->high_up[k] = above(out->high[k]);
    }
}

/* What a block's faces have on an axis; a bit for each lane. */
typedef struct spans {
    f8 least, most;      /* rounded outward */
    unsigned away;       /* from the cell */
    unsigned touches[2]; /* its lower wall, its upper one */
} spans;

static inline spans span_floats(const ebpo_face_block *b, const cell_walls *w, int k)
{
    f8 x[3];
    spans out;
    ebpo_face_block_floats(b, k, x);
    out.least = f8_min3(x[0], x[1], x[2]);
    out.most = f8_max3(x[0], x[1], x[2]);
    out.away = f8_bits(f8_or(f8_less(f8_all(w->high_down[k]), out.least),
                             f8_less(out.most, f8_all(w->low_up[k]))));
    out.touches[0] = f8_bits(f8_at_most(out.least, f8_all(w->low_down[k])));
    out.touches[1] = f8_bits(f8_at_most(f8_all(w->high_up[k]), out.most));
    return out;
}

static spans span_doubles(const ebpo_face_block *b, const cell_walls *w, int k)
{
    double x[3][EBPO_BLOCK];
    float lows[EBPO_BLOCK], highs[EBPO_BLOCK];
    spans out = { .away = 0 };
    ebpo_face_block_doubles(b, k, x);
    for (unsigned lane = 0; lane < EBPO_BLOCK; lane++) {
        double least = ebpo_min3(x[0][lane], x[1][lane], x[2][lane]),
               most = ebpo_max3(x[0][lane], x[1][lane], x[2][lane]);
        lows[lane] = below(least);
        highs[lane] = above(most);
        out.away |= (unsigned)((least > w->high[k]) | (most < w->low[k])) << lane;
        out.touches[0] |= (unsigned)(least <= w->low[k]) << lane;
        out.touches[1] |= (unsigned)(most >= w->high[k]) << lane;
    }
    out.least = f8_load(lows);
    out.most = f8_load(highs);
    return out;
}

/* A coordinate in the cell, 0 .. EBPO_LISTED_CELLS, widened by far more than the rounding here and
 * in those that ask (2^-20). */
static uint8_t listed(float x, double low, double inverse, double widening)
{
    double cells = ((double)x - low) * inverse * EBPO_LISTED_CELLS + widening;
    return cells < 0 ? 0 : cells < 255 ? (uint8_t)cells : 255;
}

static f8 lanes_mask(unsigned lanes)
{
    float on[EBPO_BLOCK];
    for (unsigned lane = 0; lane < EBPO_BLOCK; lane++)
        on[lane] = (float)(lanes >> lane & 1);
    return f8_less(f8_all(0), f8_load(on));
}

/* Those of the listed faces whose boxes meet the cell, in its own units. */
static void set_box(ebpo_listed_block *out, const spans span[3], unsigned near, const cell_walls *w)
{
    f8 none = f8_all(INFINITY), mask = lanes_mask(near), zero = f8_all(0);
    for (int k = 0; k < 3; k++) {
        float least = f8_least(f8_pick(mask, span[k].least, none)),
              most = -f8_least(f8_pick(mask, f8_sub(zero, span[k].most), none));
        out->low[k] = listed(least, w->low[k], w->inverse[k], -0x1p-8);
        out->high[k] = listed(most, w->low[k], w->inverse[k], 0x1p-8);
    }
}

/* Sets the block's box; returns the walls that its listed faces come to, if their boxes meet the
 * cell (bit 2 axis + side). Exact comparisons. */
static unsigned bound_block(const ebpo_accel *s, ebpo_listed_block *listed, const cell_walls *w)
{
    ebpo_face_block b = ebpo_face_block_open(s, listed->block);
    spans span[3];
    unsigned near = listed->lanes, walls = 0;
    for (int k = 0; k < 3; k++) {
        span[k] = s->wide ? span_doubles(&b, w, k) : span_floats(&b, w, k);
        near &= ~span[k].away;
    }
    if (!near) {
        memset(listed->low, 255, sizeof listed->low);
        memset(listed->high, 0, sizeof listed->high);
        return 0;
    }
    for (int i = 0; i < 6; i++)
        walls |= (unsigned)((near & span[i / 2].touches[i % 2]) != 0) << i;
    if (w->fine)
        set_box(listed, span, near, w);
    return walls;
}

unsigned ebpo_leaf_bound(const ebpo_accel *s, const ebpo_accel_leaf *leaf, ebpo_cell cell)
{
    cell_walls w;
    unsigned walls = 0;
    find_walls(s, cell, &w);
    for (uint32_t b = 0; b < leaf->blocks; b++)
        walls |= bound_block(s, &s->list[leaf->list + b], &w);
    return walls;
}
