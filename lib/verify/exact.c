/* A triangle is clipped by the six walls, one after the other (Sutherland and Hodgman, "Reentrant
 * polygon clipping", 1974). With exact numbers and closed half-spaces the corners that remain span
 * the intersection, down to a single point of contact. */
#include "core/strict_fp.h"

#include "verify/exact.h"

#include <gmp.h>

enum { CORNERS = 9 }; /* three, and at most one more for each wall */

typedef struct polygon {
    int count;
    mpq_t at[CORNERS][3]; /* in coordinates of the box, 0 to 1 */
} polygon;

static void polygon_init(polygon *g)
{
    g->count = 0;
    for (int i = 0; i < CORNERS; i++)
        for (int k = 0; k < 3; k++)
            mpq_init(g->at[i][k]);
}

static void polygon_clear(polygon *g)
{
    for (int i = 0; i < CORNERS; i++)
        for (int k = 0; k < 3; k++)
            mpq_clear(g->at[i][k]);
}

static void set_triangle(polygon *g, const double low[3], const double high[3],
                         const ebpo_corners *face)
{
    mpq_t first, size;
    mpq_inits(first, size, NULL);
    g->count = 3;
    for (int k = 0; k < 3; k++) {
        mpq_set_d(first, low[k]);
        mpq_set_d(size, high[k]);
        mpq_sub(size, size, first);
        for (int i = 0; i < 3; i++) {
            mpq_set_d(g->at[i][k], face->at[i][k]);
            mpq_sub(g->at[i][k], g->at[i][k], first);
            mpq_div(g->at[i][k], g->at[i][k], size);
        }
    }
    mpq_clears(first, size, NULL);
}

/* Whether a corner keeps to its side of a wall: at least 0, or at most 1. */
static bool within(const mpq_t x, int wall)
{
    return wall == 0 ? mpq_sgn(x) >= 0 : mpq_cmp_ui(x, 1, 1) <= 0;
}

/* Appends the point where a-b meets the wall; exactly one of the two is within. */
static void append_crossing(polygon *out, mpq_t a[3], mpq_t b[3], int axis, int wall)
{
    mpq_t t, part;
    mpq_inits(t, part, NULL);
    mpq_set_si(t, wall, 1);
    mpq_sub(t, t, a[axis]);
    mpq_sub(part, b[axis], a[axis]);
    mpq_div(t, t, part);
    for (int k = 0; k < 3; k++) {
        mpq_sub(part, b[k], a[k]);
        mpq_mul(part, part, t);
        mpq_add(out->at[out->count][k], a[k], part);
    }
    mpq_set_si(out->at[out->count][axis], wall, 1);
    out->count++;
    mpq_clears(t, part, NULL);
}

static void clip(polygon *out, polygon *in, int axis, int wall)
{
    out->count = 0;
    for (int i = 0; i < in->count; i++) {
        int j = i + 1 < in->count ? i + 1 : 0;
        bool here = within(in->at[i][axis], wall), there = within(in->at[j][axis], wall);
        if (here) {
            for (int k = 0; k < 3; k++)
                mpq_set(out->at[out->count][k], in->at[i][k]);
            out->count++;
        }
        if (here != there)
            append_crossing(out, in->at[i], in->at[j], axis, wall);
    }
}

/* Leaves the intersection in *g. */
static void clip_to_box(polygon *g, const double low[3], const double high[3],
                        const ebpo_corners *face)
{
    polygon other;
    polygon_init(&other);
    set_triangle(g, low, high, face);
    for (int axis = 0; axis < 3; axis++) {
        clip(&other, g, axis, 0);
        clip(g, &other, axis, 1);
    }
    polygon_clear(&other);
}

bool ebpo_exact_touches(const double low[3], const double high[3], const ebpo_corners *face)
{
    polygon g;
    polygon_init(&g);
    clip_to_box(&g, low, high, face);
    bool touches = g.count > 0;
    polygon_clear(&g);
    return touches;
}

static bool corner_satisfies(mpq_t at[3], const int32_t n[3], int32_t d)
{
    mpq_t sum, part;
    mpq_inits(sum, part, NULL);
    for (int k = 0; k < 3; k++) {
        mpq_set_si(part, 4096L * n[k], 1);
        mpq_mul(part, part, at[k]);
        mpq_add(sum, sum, part);
    }
    bool holds = mpq_cmp_si(sum, d, 1) <= 0;
    mpq_clears(sum, part, NULL);
    return holds;
}

bool ebpo_exact_half_space(const double low[3], const double high[3], const ebpo_corners *face,
                           const int32_t n[3], int32_t d)
{
    polygon g;
    polygon_init(&g);
    clip_to_box(&g, low, high, face);
    bool holds = true;
    for (int i = 0; i < g.count && holds; i++)
        holds = corner_satisfies(g.at[i], n, d);
    polygon_clear(&g);
    return holds;
}
