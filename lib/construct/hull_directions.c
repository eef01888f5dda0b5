/* Computes a small convex hull. Envelopes use only the directions of its facets. So a rounding
 * error in this file may enlarge an envelope, but the envelope still contains the model's faces.
 *
 * The hull grows point by point, by a beneath-beyond algorithm in doubles. A point outside the hull
 * is above the planes of some facets, its visible facets. The visible facets are replaced by new
 * facets with this point as a corner. Points that are extreme along the axes and diagonals come
 * first, so that most other points are inside the hull when they are tested. The planes of the
 * facets are stored as a structure of arrays (nx, ny, nz, d), for a vectorised loop, a kernel, that
 * tests a point against all planes (sweep.h).
 *
 * Limits: if there are more than EBPO_HULL_POINTS points, no hull is computed (0 facets). When the
 * capacity for facets is reached (at most EBPO_HULL_FACETS), the remaining points are omitted.
 * Equal values are ordered by indices of points, so that all machines return the same facets in the
 * same order. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "construct/planes.h"
#include "construct/sweep.h"
#include "geometry/vec3.h"

/* A point that is nearer to a plane than this distance counts as a point on the plane. */
static const double flat = 1e-9;

_Static_assert((int)EBPO_HULL_FACETS <= (int)EBPO_SWEEP_PLANES, "sweeps have space for the facets");

enum {
    FACETS_MAX = EBPO_HULL_FACETS,
    EXTREMES = EBPO_SWEEP_EXTREMES,
    VISIBLE_MAX = 192 /* maximum number of facets that one point replaces */
};

/* The hull so far. */
typedef struct hull {
    const ebpo_sweep *sweep; /* kernels for this processor */
    const double (*p)[3];    /* points */
    /* planes n . x = d of the facets; further planes, above which there is no point, make their
     * number a multiple of four */
    double nx[FACETS_MAX + 4], ny[FACETS_MAX + 4], nz[FACETS_MAX + 4], d[FACETS_MAX + 4];
    double length[FACETS_MAX];      /* length of the facet's cross product: twice its area */
    double tolerance;               /* points at most this far outside the hull are omitted */
    uint16_t corner[FACETS_MAX][3]; /* indices of points, counter-clockwise seen from outside */
    int count, capacity;            /* number of facets, and its limit */
} hull;

/* Computes the normal `n` of the triangle p[a], p[b], p[c]. The length of the normal is twice the
 * triangle's area. */
static void cross_of(const double (*p)[3], int a, int b, int c, double n[3])
{
    double u[3], v[3];
    ebpo_vec3_subtract(p[b], p[a], u);
    ebpo_vec3_subtract(p[c], p[a], v);
    ebpo_vec3_cross(u, v, n);
}

static void set_plane(hull *h, int i, const double n[3], double d)
{
    h->nx[i] = n[0];
    h->ny[i] = n[1];
    h->nz[i] = n[2];
    h->d[i] = d;
}

/* Makes facet i with the corners a, b and c. Returns false if the facet has no area. */
static bool make_facet(hull *h, int i, uint32_t a, uint32_t b, int c, const ebpo_sweep_plane *plane)
{
    static const double least_length = 1e-18; /* a shorter normal gives no direction */
    if (!(plane->length > least_length))
        return false;
    set_plane(h, i, plane->n, plane->d);
    h->length[i] = plane->length;
    h->corner[i][0] = (uint16_t)a;
    h->corner[i][1] = (uint16_t)b;
    h->corner[i][2] = (uint16_t)c;
    return true;
}

static void move_facet(hull *h, int to, int from)
{
    set_plane(h, to, (const double[3]){ h->nx[from], h->ny[from], h->nz[from] }, h->d[from]);
    h->length[to] = h->length[from];
    memcpy(h->corner[to], h->corner[from], sizeof h->corner[to]);
}

/* Sets the number of facets, and adds planes above which there is no point until the number of
 * planes is a multiple of four. */
static void set_count(hull *h, int count)
{
    static const double none[3];
    h->count = count;
    for (int i = count; i % 4; i++)
        set_plane(h, i, none, 1e300);
}

/* --- the first four facets --- */

static double distance_squared(const double a[3], const double b[3])
{
    double d[3];
    ebpo_vec3_subtract(a, b, d);
    return ebpo_vec3_dot(d, d);
}

/* Returns the height of p above the plane through `from` with normal n, multiplied by |n|. */
static double height_above(const double n[3], const double from[3], const double p[3])
{
    double difference[3];
    ebpo_vec3_subtract(p, from, difference);
    return ebpo_vec3_dot(n, difference);
}

/* Finds four points far from each other: the corners of a tetrahedron. The fourth point is below
 * the facet of the first three points. Returns false if the points span no volume. */
static bool first_four(const double (*p)[3], int count, const int extremes[EXTREMES], int corner[4])
{
    double best = -1, n[3];
    for (int w = 0; w < 6; w += 2)
        if (distance_squared(p[extremes[w]], p[extremes[w + 1]]) > best)
            best = distance_squared(p[extremes[w]], p[extremes[w + 1]]),
            corner[0] = extremes[w + 1], corner[1] = extremes[w];
    best = 0;
    corner[2] = corner[3] = 0;
    for (int i = 0; i < count; i++) {
        cross_of(p, corner[0], corner[1], i, n);
        if (ebpo_vec3_dot(n, n) > best)
            best = ebpo_vec3_dot(n, n), corner[2] = i;
    }
    if (!(best > flat * flat))
        return false;
    cross_of(p, corner[0], corner[1], corner[2], n);
    double length = ebpo_vec3_length(n), side = 0;
    for (int i = 0; i < count; i++) {
        double h = height_above(n, p[corner[0]], p[i]);
        if (fabs(h) > fabs(side))
            side = h, corner[3] = i;
    }
    if (side > 0) { /* the fourth point is above the facet: reverse the facet */
        int swap = corner[1];
        corner[1] = corner[2];
        corner[2] = swap;
    }
    return fabs(side) > flat * length;
}

/* Makes the four facets of a tetrahedron. Returns false if one of them has no area. */
static bool first_facets(hull *h, const int c[4])
{
    static const int sides[4][3] = { { 0, 1, 2 }, { 0, 3, 1 }, { 1, 3, 2 }, { 2, 3, 0 } };
    for (int i = 0; i < 4; i++) {
        uint32_t a = (uint32_t)c[sides[i][0]], b = (uint32_t)c[sides[i][1]];
        ebpo_sweep_plane plane;
        h->sweep->make_planes(h->p, (const uint32_t[1]){ a << 16 | b }, 1, c[sides[i][2]], &plane);
        if (!make_facet(h, i, a, b, c[sides[i][2]], &plane))
            return false;
    }
    set_count(h, 4);
    return true;
}

/* --- adding a point --- */

/* Lists the edges of the visible facets. An edge between the points `from` and `to` is from << 16 |
 * to in `edges`, and to << 16 | from in `reversed`. Returns the number of edges. Adds invalid edges
 * to `edges` until their number is a multiple of four. */
static int edges_of(const hull *h, const uint16_t *visible, int visible_count, uint32_t *edges,
                    uint32_t *reversed)
{
    int listed = 0;
    for (int i = 0; i < visible_count; i++) {
        const uint16_t *corner = h->corner[visible[i]];
        for (int e = 0; e < 3; e++) {
            uint32_t from = corner[e], to = corner[e == 2 ? 0 : e + 1];
            edges[listed] = from << 16 | to;
            reversed[listed++] = to << 16 | from;
        }
    }
    for (int i = listed; i % 4; i++)
        edges[i] = 0;
    return listed;
}

/* Returns true if the edge is in a list of 4 * fours edges. The loop has no early exit, so that
 * compilers can vectorise the loop. */
static bool has_edge(const uint32_t *edges, int fours, uint32_t edge)
{
    uint32_t found = 0;
    for (int i = 0; i < 4 * fours; i++)
        found |= edges[i] == edge;
    return found;
}

/* Removes the visible facets that no new facet has replaced. The indices of these facets are
 * index[from] to index[to - 1], in ascending order. `count`: number of facets before the removal.
 * Facets are removed in descending order of index. Each time, the last facet of the hull moves to
 * the free index. This order ensures that the facet that moves is not itself in the list. */
static void close_gaps(hull *h, const uint16_t *index, int from, int to, int count)
{
    for (int i = to - 1; i >= from; i--)
        if (index[i] != --count)
            move_facet(h, index[i], count);
    set_count(h, count);
}

/* Adds a point to the hull; a point inside the hull changes nothing. Returns false if the point
 * would replace more than VISIBLE_MAX facets or if the capacity is reached. Then the hull may have
 * overlapping facets, so no more points can be added. The directions of its facets can still be
 * used. */
static bool add_point(hull *h, int point)
{
    uint16_t visible[VISIBLE_MAX];
    uint32_t edges[3 * VISIBLE_MAX], reversed[3 * VISIBLE_MAX];
    ebpo_sweep_plane plane[3 * VISIBLE_MAX];
    const ebpo_sweep_planes planes = { h->nx, h->ny, h->nz, h->d, (h->count + 3) / 4 };
    int visible_count =
            h->sweep->find_visible(&planes, h->p[point], h->tolerance, flat, visible, VISIBLE_MAX),
        made = 0, count = h->count;
    if (visible_count == 0)
        return true;
    if (visible_count > VISIBLE_MAX)
        return false;
    int listed = edges_of(h, visible, visible_count, edges, reversed), rim = 0;
    for (int i = 0; i < listed; i++)
        if (!has_edge(edges, (listed + 3) / 4, reversed[i]))
            reversed[rim++] = reversed[i];
    for (int i = 0; i < rim; i++)
        edges[i] = reversed[i] << 16 | reversed[i] >> 16;
    h->sweep->make_planes(h->p, edges, rim, point, plane);
    for (int i = 0; i < rim; i++) {
        if (made >= visible_count && count == h->capacity)
            return false;
        int index = made < visible_count ? visible[made] : count;
        if (!make_facet(h, index, edges[i] >> 16, edges[i] & 0xffff, point, &plane[i]))
            continue;
        count += made++ >= visible_count;
    }
    if (made < visible_count)
        close_gaps(h, visible, made, visible_count, count);
    else
        set_count(h, count);
    return true;
}

/* Adds the extreme points, then all points, until a limit is reached. */
static void grow_hull(hull *h, int count, const int extremes[EXTREMES])
{
    for (int w = 0; w < EXTREMES; w++)
        if (!add_point(h, extremes[w]))
            return;
    for (int i = 0; i < count; i++)
        if (!add_point(h, i))
            return;
}

int ebpo_hull_facets(const double (*points)[3], int count, double tolerance,
                     ebpo_hull_facet *facets, int capacity)
{
    hull h;
    int corner[4] = { 0 }, extremes[EXTREMES];
    h.sweep = ebpo_sweep_best();
    h.p = points;
    h.count = 0;
    h.capacity = capacity < FACETS_MAX ? capacity : FACETS_MAX;
    h.tolerance = tolerance;
    if (count < 4 || capacity < 4 || count > EBPO_HULL_POINTS)
        return 0;
    h.sweep->find_extremes(points, count, extremes);
    if (!first_four(points, count, extremes, corner) || !first_facets(&h, corner))
        return 0;
    grow_hull(&h, count, extremes);
    for (int i = 0; i < h.count; i++)
        facets[i] = (ebpo_hull_facet){ .corner = { h.corner[i][0], h.corner[i][1], h.corner[i][2] },
                                       .n = { h.nx[i], h.ny[i], h.nz[i] },
                                       .d = h.d[i],
                                       .area = h.length[i] / 2 };
    return h.count;
}

int ebpo_hull_by_area(const void *a, const void *b)
{
    const ebpo_hull_facet *f = a, *g = b;
    if (f->area != g->area)
        return f->area < g->area ? 1 : -1;
    for (int i = 0; i < 3; i++)
        if (f->corner[i] != g->corner[i])
            return f->corner[i] < g->corner[i] ? -1 : 1;
    return 0;
}
