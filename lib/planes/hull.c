/* Incremental: each point beyond the hull takes the place of the facets that it sees. */
#include "geom/strict_fp.h"

#include "planes/hull.h"

#include <math.h>
#include <stdbool.h>

static const double beyond = 1e-9;

typedef struct edge {
    uint16_t from, to;
} edge;

static bool make_facet(const double (*p)[3], int a, int b, int c, ebpo_hull_facet *out)
{
    double u[3], v[3];
    for (int k = 0; k < 3; k++) {
        u[k] = p[b][k] - p[a][k];
        v[k] = p[c][k] - p[a][k];
    }
    double n[3] = { u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0] };
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    *out = (ebpo_hull_facet){ .corner = { (uint16_t)a, (uint16_t)b, (uint16_t)c }, .area = length / 2 };
    if (!(length > 1e-18))
        return false;
    for (int k = 0; k < 3; k++) {
        out->n[k] = n[k] / length;
        out->d += out->n[k] * p[a][k];
    }
    return true;
}

static double height(const ebpo_hull_facet *f, const double p[3])
{
    return f->n[0] * p[0] + f->n[1] * p[1] + f->n[2] * p[2] - f->d;
}

static double distance2(const double a[3], const double b[3])
{
    return (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]);
}

/* Four points far from each other; false when there are none that span a volume. */
static bool first_four(const double (*p)[3], int count, int corner[4])
{
    ebpo_hull_facet f;
    double best = 0;
    corner[0] = corner[1] = corner[2] = corner[3] = 0;
    for (int i = 1; i < count; i++)
        if (p[i][0] < p[corner[0]][0])
            corner[0] = i;
    for (int i = 0; i < count; i++)
        if (distance2(p[i], p[corner[0]]) > best)
            best = distance2(p[corner[1] = i], p[corner[0]]);
    best = 0;
    for (int i = 0; i < count; i++)
        if (make_facet(p, corner[0], corner[1], i, &f) && f.area > best)
            best = f.area, corner[2] = i;
    if (!(best > beyond) || !make_facet(p, corner[0], corner[1], corner[2], &f))
        return false;
    best = 0;
    for (int i = 0; i < count; i++)
        if (fabs(height(&f, p[i])) > best)
            best = fabs(height(&f, p[corner[3] = i]));
    if (height(&f, p[corner[3]]) > 0) { /* the fourth lies behind the first three */
        int swap = corner[1];
        corner[1] = corner[2];
        corner[2] = swap;
    }
    return best > beyond;
}

static int first_facets(const double (*p)[3], const int c[4], ebpo_hull_facet *facets)
{
    static const int sides[4][3] = { { 0, 1, 2 }, { 0, 3, 1 }, { 1, 3, 2 }, { 2, 3, 0 } };
    for (int i = 0; i < 4; i++)
        if (!make_facet(p, c[sides[i][0]], c[sides[i][1]], c[sides[i][2]], &facets[i]))
            return 0;
    return 4;
}

/* Takes out the facets that see the point and lists their edges; returns how many edges, -1: more than fit. */
static int take_visible(ebpo_hull_facet *facets, int *count, const double p[3], edge *edges, int most)
{
    int listed = 0, kept = 0, seen = 0;
    for (int i = 0; i < *count; i++)
        seen += height(&facets[i], p) > beyond;
    if (3 * seen > most)
        return -1;
    for (int i = 0; i < *count; i++) {
        if (height(&facets[i], p) <= beyond) {
            facets[kept++] = facets[i];
            continue;
        }
        for (int e = 0; e < 3; e++)
            edges[listed++] = (edge){ facets[i].corner[e], facets[i].corner[(e + 1) % 3] };
    }
    *count = kept;
    return listed;
}

static bool has_twin(const edge *edges, int count, edge e)
{
    for (int i = 0; i < count; i++)
        if (edges[i].from == e.to && edges[i].to == e.from)
            return true;
    return false;
}

/* False when the hull is to stay as it is: too much in one step. */
static bool add_point(const double (*p)[3], int point, ebpo_hull_facet *facets, int *count, int room)
{
    enum { EDGES = 3 * 192 };
    edge edges[EDGES];
    int listed = take_visible(facets, count, p[point], edges, EDGES);
    if (listed < 0)
        return false;
    for (int i = 0; i < listed; i++) {
        if (has_twin(edges, listed, edges[i]))
            continue;
        if (*count == room)
            return false;
        if (make_facet(p, edges[i].from, edges[i].to, point, &facets[*count]))
            ++*count;
    }
    return true;
}

int ebpo_hull_facets(const double (*points)[3], int count, ebpo_hull_facet *facets, int room)
{
    int corner[4], made = 0;
    if (count < 4 || room < 4 || count > EBPO_HULL_POINTS || !first_four(points, count, corner))
        return 0;
    made = first_facets(points, corner, facets);
    for (int i = 0; i < count && made > 0; i++)
        if (i != corner[0] && i != corner[1] && i != corner[2] && i != corner[3] && !add_point(points, i, facets, &made, room))
            break;
    return made;
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
