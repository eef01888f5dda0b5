#include "core/strict_fp.h"

#include "geometry/polygon.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "geometry/chain.h"
#include "geometry/polygon_ears.h"
#include "geometry/predicates.h"

/* Steps of cutting an outline that touches itself, after which it is given up as one that crosses
 * itself: thousands of corners at one place are compared with each other. */
#define TOUCHING_WORK (UINT64_C(1) << 28)

/* A polygon and its projection. */
typedef struct polygon {
    const double (*corner)[3];
    double (*flat)[2]; /* so that it runs counter-clockwise */
    uint32_t n;
    double
        scale; /* a power of two that makes products of differences neither overflow nor vanish */
    bool projected;
} polygon;

uint64_t ebpo_polygon_scratch_bytes(uint64_t n)
{
    uint64_t bytes, ears = ebpo_ears_scratch_bytes(n);
    if (!ears || !ebpo_mul_ok(n, 2 * sizeof(double), &bytes) ||
        __builtin_add_overflow(bytes, ears, &bytes))
        return 0;
    return bytes;
}

static void fan(uint32_t (*triangle)[3], uint32_t n)
{
    for (uint32_t i = 0; i + 2 < n; i++) {
        triangle[i][0] = 0;
        triangle[i][1] = i + 1;
        triangle[i][2] = i + 2;
    }
}

/* Half of what lies between the first corner and another one: that cannot overflow. */
static double from_first(const polygon *p, uint32_t i, int k)
{
    return p->scale * (0.5 * p->corner[i][k] - 0.5 * p->corner[0][k]);
}

/* False where a coordinate is not finite. */
static bool find_scale(polygon *p)
{
    enum { FAR = 400 };
    double most = 0;
    int exponent;
    p->scale = 1;
    for (uint32_t i = 0; i < p->n; i++)
        for (int k = 0; k < 3; k++) {
            if (!isfinite(p->corner[i][k]))
                return false;
            most = fmax(most, fabs(from_first(p, i, k)));
        }
    frexp(most, &exponent);
    if (exponent > FAR || exponent < -FAR)
        p->scale = ldexp(1, exponent < -1000 ? 1000 : -exponent);
    return true;
}

/* Half of the projected areas, relative to the first corner to keep digits. */
static void newell_normal(const polygon *p, double normal[3])
{
    normal[0] = normal[1] = normal[2] = 0;
    for (uint32_t i = 1; i + 1 < p->n; i++) {
        double a[3], b[3];
        for (int k = 0; k < 3; k++) {
            a[k] = from_first(p, i, k);
            b[k] = from_first(p, i + 1, k);
        }
        normal[0] += a[1] * b[2] - a[2] * b[1];
        normal[1] += a[2] * b[0] - a[0] * b[2];
        normal[2] += a[0] * b[1] - a[1] * b[0];
    }
}

/* False where it has no normal. */
static bool project(polygon *p)
{
    double normal[3];
    newell_normal(p, normal);
    int axis = 0;
    for (int k = 1; k < 3; k++)
        if (fabs(normal[k]) > fabs(normal[axis]))
            axis = k;
    if (normal[axis] == 0)
        return false;
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    if (normal[axis] < 0) {
        int swap = u;
        u = v;
        v = swap;
    }
    for (uint32_t i = 0; i < p->n; i++) {
        p->flat[i][0] = p->corner[i][u];
        p->flat[i][1] = p->corner[i][v];
    }
    return true;
}

static int turn(const polygon *p, uint32_t a, uint32_t b, uint32_t c)
{
    return ebpo_orient2d(p->flat[a], p->flat[b], p->flat[c]);
}

static bool goes_up(const double a[2], const double b[2])
{
    return a[0] < b[0] || (a[0] == b[0] && a[1] < b[1]);
}

/* Left turns alone do not make a convex polygon (a pentagram has them too): it must also change its
 * direction only twice. */
static ebpo_polygon_kind classify(const polygon *p)
{
    bool straight = false;
    uint32_t changes = 0;
    for (uint32_t i = 0; i < p->n; i++) {
        uint32_t j = i + 1 < p->n ? i + 1 : 0, k = j + 1 < p->n ? j + 1 : 0;
        int t = turn(p, i, j, k);
        if (t < 0)
            return EBPO_POLYGON_CONCAVE;
        straight = straight || t == 0;
        changes += goes_up(p->flat[i], p->flat[j]) != goes_up(p->flat[j], p->flat[k]);
    }
    if (changes > 2)
        return EBPO_POLYGON_GUESSED;
    return straight ? EBPO_POLYGON_FLAT : EBPO_POLYGON_CONVEX;
}

/* ---- outlines that cross themselves ---- */

static bool has_area(const polygon *p, const uint32_t t[3])
{
    return !ebpo_zero_area(p->corner[t[0]], p->corner[t[1]], p->corner[t[2]]);
}

/* What triangles of least area are: perhaps they cover the outline after all, or have no area at
 * all. */
static ebpo_polygon_kind kind_of_guess(const polygon *p, uint32_t (*triangle)[3])
{
    bool turned = !p->projected, empty = true;
    for (uint32_t i = 0; i + 2 < p->n; i++) {
        turned = turned || turn(p, triangle[i][0], triangle[i][1], triangle[i][2]) < 0;
        empty = empty && !has_area(p, triangle[i]);
    }
    if (empty)
        fan(triangle, p->n);
    return empty ? EBPO_POLYGON_DEGENERATE : turned ? EBPO_POLYGON_GUESSED : EBPO_POLYGON_CONCAVE;
}

static ebpo_polygon_kind guess(const polygon *p, uint32_t (*triangle)[3])
{
    double(*point)[3] = ebpo_alloc(p->n, sizeof *point);
    for (uint32_t i = 0; point && i < p->n; i++)
        for (int k = 0; k < 3; k++)
            point[i][k] = from_first(p, i, k);
    const ebpo_chain chain = { .n = p->n,
                               .optimal = EBPO_POLYGON_OPTIMAL,
                               .point = (const double(*)[3])point };
    bool done = point && ebpo_triangulate_chain(&chain, triangle);
    free(point);
    return done ? kind_of_guess(p, triangle) : EBPO_POLYGON_NO_MEMORY;
}

/* ---- all of it ---- */

static ebpo_polygon_kind cut(const polygon *p, uint32_t (*triangle)[3], void *scratch)
{
    const double(*flat)[2] = (const double(*)[2])p->flat;
    ebpo_polygon_kind kind = classify(p);
    ebpo_ears ears = EBPO_EARS_STUCK;
    if (kind == EBPO_POLYGON_CONVEX)
        return kind;
    if (kind != EBPO_POLYGON_GUESSED)
        ears = ebpo_ears_cut(triangle, flat, p->n, EBPO_EARS_CLOSED, EBPO_POLYGON_WORK, scratch);
    if (ears != EBPO_EARS_STUCK)
        return ears == EBPO_EARS_CUT ? kind : EBPO_POLYGON_TOO_LARGE;
    ears = ebpo_ears_cut(triangle, flat, p->n, EBPO_EARS_TOUCHING, TOUCHING_WORK, scratch);
    return ears == EBPO_EARS_CUT ? EBPO_POLYGON_CONCAVE : guess(p, triangle);
}

ebpo_polygon_kind ebpo_polygon_triangulate(uint32_t (*triangle)[3], const double (*corner)[3],
                                           uint32_t n, void *scratch)
{
    polygon p = { .corner = corner, .flat = scratch, .n = n };
    fan(triangle, n);
    if (n == 3)
        return EBPO_POLYGON_CONVEX;
    if (!find_scale(&p))
        return EBPO_POLYGON_DEGENERATE;
    p.projected = project(&p);
    return p.projected ? cut(&p, triangle, p.flat + n) : guess(&p, triangle);
}
