#include "geom/strict_fp.h"

#include "geom/polygon.h"

#include <math.h>

#include "base/alloc.h"
#include "geom/predicates.h"

typedef struct outline {
    double (*flat)[2]; /* projected so that the polygon runs counter-clockwise */
    uint32_t *next, *previous;
    uint32_t n, left; /* corners in all, and not yet cut off */
    uint64_t work;
} outline;

uint64_t ebpo_polygon_scratch_bytes(uint64_t n)
{
    uint64_t bytes;
    return ebpo_mul_ok(n, 2 * sizeof(double) + 2 * sizeof(uint32_t), &bytes) ? bytes : 0;
}

static void fan(uint32_t (*triangle)[3], uint32_t n)
{
    for (uint32_t i = 0; i + 2 < n; i++) {
        triangle[i][0] = 0;
        triangle[i][1] = i + 1;
        triangle[i][2] = i + 2;
    }
}

/* Twice the projected areas, relative to the first corner to keep digits. */
static void newell_normal(const double (*p)[3], uint32_t n, double normal[3])
{
    normal[0] = normal[1] = normal[2] = 0;
    for (uint32_t i = 1; i + 1 < n; i++) {
        double a[3], b[3];
        for (int k = 0; k < 3; k++) {
            a[k] = p[i][k] - p[0][k];
            b[k] = p[i + 1][k] - p[0][k];
        }
        normal[0] += a[1] * b[2] - a[2] * b[1];
        normal[1] += a[2] * b[0] - a[0] * b[2];
        normal[2] += a[0] * b[1] - a[1] * b[0];
    }
}

static bool project(outline *o, const double (*p)[3])
{
    double normal[3];
    newell_normal(p, o->n, normal);
    int axis = 0;
    for (int k = 1; k < 3; k++)
        if (fabs(normal[k]) > fabs(normal[axis]))
            axis = k;
    double sum = normal[0] + normal[1] + normal[2];
    if (!isfinite(sum) || normal[axis] == 0)
        return false;
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    if (normal[axis] < 0) {
        int swap = u;
        u = v;
        v = swap;
    }
    for (uint32_t i = 0; i < o->n; i++) {
        o->flat[i][0] = p[i][u];
        o->flat[i][1] = p[i][v];
    }
    return true;
}

static int turn(const outline *o, uint32_t a, uint32_t b, uint32_t c)
{
    return ebpo_orient2d(o->flat[a], o->flat[b], o->flat[c]);
}

static bool goes_up(const double a[2], const double b[2])
{
    return a[0] < b[0] || (a[0] == b[0] && a[1] < b[1]);
}

/* Left turns alone do not make a convex polygon (a pentagram has them too): it must also change its
 * direction only twice. */
static ebpo_polygon_kind classify(const outline *o)
{
    bool straight = false;
    uint32_t changes = 0;
    for (uint32_t i = 0; i < o->n; i++) {
        uint32_t j = i + 1 < o->n ? i + 1 : 0, k = j + 1 < o->n ? j + 1 : 0;
        int t = turn(o, i, j, k);
        if (t < 0)
            return EBPO_POLYGON_CONCAVE;
        straight = straight || t == 0;
        changes += goes_up(o->flat[i], o->flat[j]) != goes_up(o->flat[j], o->flat[k]);
    }
    if (changes > 2)
        return EBPO_POLYGON_DEGENERATE;
    return straight ? EBPO_POLYGON_FLAT : EBPO_POLYGON_CONVEX;
}

static bool same_place(const double a[2], const double b[2])
{
    return a[0] == b[0] && a[1] == b[1];
}

static double least(double a, double b, double c)
{
    return a < b ? (a < c ? a : c) : (b < c ? b : c);
}

/* Any other corner in the closed triangle, unless it coincides with a corner (outlines with a slit
 * to a hole repeat corners). */
static bool ear_holds_corner(outline *o, uint32_t a, uint32_t b, uint32_t c)
{
    const double *pa = o->flat[a], *pb = o->flat[b], *pc = o->flat[c];
    double low[2], high[2];
    for (int k = 0; k < 2; k++) {
        low[k] = least(pa[k], pb[k], pc[k]);
        high[k] = -least(-pa[k], -pb[k], -pc[k]);
    }
    o->work += o->left;
    for (uint32_t i = o->next[c]; i != a; i = o->next[i]) {
        const double *p = o->flat[i];
        if (p[0] < low[0] || p[0] > high[0] || p[1] < low[1] || p[1] > high[1])
            continue;
        if (same_place(p, pa) || same_place(p, pb) || same_place(p, pc))
            continue;
        if (turn(o, a, b, i) >= 0 && turn(o, b, c, i) >= 0 && turn(o, c, a, i) >= 0)
            return true;
    }
    return false;
}

static void cut_off(outline *o, uint32_t b, uint32_t triangle[3])
{
    uint32_t a = o->previous[b], c = o->next[b];
    triangle[0] = a;
    triangle[1] = b;
    triangle[2] = c;
    o->next[a] = c;
    o->previous[c] = a;
    o->left--;
}

/* Goes around and cuts every ear it meets, skipping one corner after each cut so that fans of
 * slivers stay short. */
static ebpo_polygon_kind cut_ears(outline *o, uint32_t (*triangle)[3])
{
    uint32_t done = 0, idle = 0, b = 0;
    while (o->left > 3) {
        if (idle >= o->left)
            return EBPO_POLYGON_DEGENERATE;
        if (o->work > EBPO_POLYGON_WORK)
            return EBPO_POLYGON_TOO_LARGE;
        uint32_t a = o->previous[b], c = o->next[b];
        if (turn(o, a, b, c) > 0 && !ear_holds_corner(o, a, b, c)) {
            cut_off(o, b, triangle[done++]);
            b = o->next[c];
            idle = 0;
        } else {
            b = c;
            idle++;
        }
    }
    if (turn(o, o->previous[b], b, o->next[b]) < 0)
        return EBPO_POLYGON_DEGENERATE;
    cut_off(o, b, triangle[done]);
    return EBPO_POLYGON_CONCAVE;
}

ebpo_polygon_kind ebpo_polygon_triangulate(uint32_t (*triangle)[3], const double (*corner)[3],
                                           uint32_t n, void *scratch)
{
    outline o = { .flat = scratch, .n = n, .left = n };
    fan(triangle, n);
    if (n == 3)
        return EBPO_POLYGON_CONVEX;
    o.next = (uint32_t *)(o.flat + n);
    o.previous = o.next + n;
    if (!project(&o, corner))
        return EBPO_POLYGON_DEGENERATE;
    ebpo_polygon_kind kind = classify(&o);
    if (kind == EBPO_POLYGON_CONVEX || kind == EBPO_POLYGON_DEGENERATE)
        return kind;
    for (uint32_t i = 0; i < n; i++) {
        o.next[i] = i + 1 < n ? i + 1 : 0;
        o.previous[i] = i ? i - 1 : n - 1;
    }
    ebpo_polygon_kind cut = cut_ears(&o, triangle);
    if (cut == EBPO_POLYGON_DEGENERATE)
        fan(triangle, n);
    return cut == EBPO_POLYGON_CONCAVE ? kind : cut;
}
