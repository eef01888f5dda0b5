/* Bounds of the distance to a triangle, in doubles.
 *
 * With corners a, b, c relative to p, the nearest feature is certain when the signs of a few
 * products are: a corner when p lies behind it along both of its edges; an edge when p projects
 * between its ends and lies outside of it in the plane; the interior when p projects inside all
 * edges (the features' Voronoi regions).
 *
 * Rounding (u = 2^-53; r: 1-norms of the relative corners at most; l: of the edges; s = l^2, at
 * least the normal's length): relative corners are off by u of themselves, edges likewise. So
 * products of a corner and an edge are off by 8 u r l, the normal by 8 u l^2 on each axis, products
 * of a corner with edge x normal by 64 u r l^3. Distances to points of corners and edges are off by
 * 16 u r. The distance to the plane is off by what tilting the normal by 16 u l^2 / |n| moves the
 * plane within the triangle, and by 16 u r. Everything below doubles these at least. Numbers whose
 * fourth powers leave the doubles are scaled first. */
#include "core/strict_fp.h"

#include "geometry/distance.h"

#include <math.h>
#include <string.h>

#include "geometry/distance_far.h"
#include "geometry/distance_parts.h"

static const double huge_reach = 0x1p200, tiny_reach = 0x1p-200;
/* From so many times the triangle's size on, errors that are relative to the greatest product tell
 * little: distance_far.h. */
static const double far_ratio = 0x1p20;

static inline double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static inline double size1(const double a[3]) { return fabs(a[0]) + fabs(a[1]) + fabs(a[2]); }

static inline double greater(double a, double b) { return a > b ? a : b; }

typedef struct relation {
    double corner[3][3]; /* relative to p */
    double edge[3][3];   /* corner k to k + 1 */
    double reach, size;  /* r and l */
    /* corner k . edge k: how far p is behind corner k along its edge, times the edge's length */
    double along[3];
    double back[3]; /* corner k + 1 . edge k */
    double normal[3];
    double side[3]; /* positive where p is within edge k */
} relation;

static void relate(const double p[3], const double triangle[3][3], relation *r)
{
    r->reach = r->size = 0;
    for (int i = 0; i < 3; i++) {
        int j = i == 2 ? 0 : i + 1;
        for (int k = 0; k < 3; k++) {
            r->corner[i][k] = triangle[i][k] - p[k];
            r->edge[i][k] = triangle[j][k] - triangle[i][k];
        }
        r->reach = greater(r->reach, size1(r->corner[i]));
        r->size = greater(r->size, size1(r->edge[i]));
    }
}

static void multiply(relation *r)
{
    cross(r->edge[0], r->edge[1], r->normal);
    for (int i = 0; i < 3; i++) {
        double outward[3];
        r->along[i] = dot(r->corner[i], r->edge[i]);
        r->back[i] = dot(r->corner[i == 2 ? 0 : i + 1], r->edge[i]);
        cross(r->edge[i], r->normal, outward);
        r->side[i] = dot(outward, r->corner[i]);
    }
}

/* Distance to the line through edge i, p projecting between its ends: to corner plus a share of the
 * edge. */
static double edge_distance(const relation *r, int i)
{
    double length2 = dot(r->edge[i], r->edge[i]), t = length2 > 0 ? -r->along[i] / length2 : 0,
           q[3];
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    for (int k = 0; k < 3; k++)
        q[k] = r->corner[i][k] + t * r->edge[i][k];
    return sqrt(dot(q, q));
}

static ebpo_feature certain_feature(const relation *r)
{
    double flat = 0x1p-48 * r->reach * r->size,
           solid = 0x1p-44 * r->reach * r->size * r->size * r->size;
    bool inside = true;
    for (int i = 0; i < 3; i++) {
        int before = i == 0 ? 2 : i - 1;
        /* Behind corner i along edge i, and beyond it along the edge before. */
        if (r->along[i] > flat && r->back[before] < -flat)
            return (ebpo_feature)(EBPO_NEAR_CORNER0 + i);
        if (r->along[i] < -flat && r->back[i] > flat && r->side[i] < -solid)
            return (ebpo_feature)(EBPO_NEAR_EDGE0 + i);
        inside = inside && r->side[i] > solid;
    }
    return inside ? EBPO_NEAR_INTERIOR : EBPO_NEAR_UNKNOWN;
}

static double plane_distance(const relation *r, double *error)
{
    double length = sqrt(dot(r->normal, r->normal));
    *error = 0x1p-47 * r->reach + 0x1p-46 * r->size * r->size * r->size / length;
    return fabs(dot(r->normal, r->corner[0])) / length;
}

/* The plane is never farther than the triangle; a plane of unknown tilt says nothing, but no point
 * of the triangle is farther from its edges than its height. */
static void bound_by_edges(const relation *r, double plane, double error, ebpo_distance_bounds *out)
{
    double edges = edge_distance(r, 0), length = sqrt(dot(r->normal, r->normal));
    for (int i = 1; i < 3; i++) {
        double other = edge_distance(r, i);
        edges = other < edges ? other : edges;
    }
    double height = length > 0 ? 2 * length / r->size + 0x1p-44 * r->size : 0x1p-44 * r->size;
    double low = edges - error - 4 * height,
           tilted = 0x1p-47 * r->reach + 0x1p-46 * r->size * r->size / length * r->reach;
    if (tilted < 0x1p-20 * r->reach)
        low = greater(low, plane < edges ? plane - tilted : edges - tilted);
    out->lo = low > 0 ? low : 0;
    out->hi = edges + error;
}

static void bound(const relation *r, ebpo_distance_bounds *out)
{
    double error = 0x1p-47 * r->reach, d;
    out->feature = certain_feature(r);
    if (out->feature <= EBPO_NEAR_CORNER2) {
        const double *q = r->corner[out->feature];
        d = sqrt(dot(q, q));
        error = 0x1p-49 * d;
    } else if (out->feature <= EBPO_NEAR_EDGE2) {
        d = edge_distance(r, (int)(out->feature - EBPO_NEAR_EDGE0));
    } else {
        double plane_error;
        d = plane_distance(r, &plane_error);
        if (out->feature != EBPO_NEAR_INTERIOR || !(plane_error < 0x1p-20 * r->reach)) {
            bound_by_edges(r, d, error, out);
            return;
        }
        error = plane_error;
    }
    out->lo = d > error ? d - error : 0;
    out->hi = d + error;
}

static void bound_scaled(const double p[3], const double triangle[3][3], ebpo_distance_bounds *out)
{
    double q[3], t[3][3];
    int exponent = ebpo_distance_scale(p, triangle, q, t);
    relation r;
    relate(q, (const double(*)[3])t, &r);
    if (!(r.reach > tiny_reach * 0x1p-100) || !(r.size > tiny_reach || r.size == 0)) {
        /* Next to a point: only that much is known. */
        *out = (ebpo_distance_bounds){
            0, ldexp(r.reach + 0x1p-1000, exponent) * (1 + 0x1p-50) + 0x1p-1074, EBPO_NEAR_UNKNOWN
        };
        out->feature = ebpo_far_feature(p, triangle, out);
        return;
    }
    multiply(&r);
    bound(&r, out);
    /* Scaling up is exact, scaling down may have lost what lies below 2^-1074. */
    out->feature = ebpo_far_feature(p, triangle, NULL);
    out->lo = nextafter(ldexp(out->lo - 0x1p-1000, exponent), -INFINITY);
    out->lo = out->lo > 0 ? out->lo : 0;
    out->hi = nextafter(ldexp(out->hi + 0x1p-1000, exponent), INFINITY);
}

void ebpo_triangle_distance_bounds(const double p[3], const double triangle[3][3],
                                   ebpo_distance_bounds *out)
{
    relation r;
    relate(p, triangle, &r);
    if (!(r.reach < huge_reach) || !(r.reach > tiny_reach) || !(r.size > tiny_reach)) {
        bound_scaled(p, triangle, out);
        return;
    }
    multiply(&r);
    bound(&r, out);
    if (out->feature == EBPO_NEAR_UNKNOWN && r.reach > far_ratio * r.size)
        out->feature = ebpo_far_feature(p, triangle, NULL);
}

int ebpo_distance_scale(const double p[3], const double triangle[3][3], double q[3], double t[3][3])
{
    double most = 0;
    int exponent;
    for (int k = 0; k < 3; k++) {
        most = greater(most, fabs(p[k]));
        for (int i = 0; i < 3; i++)
            most = greater(most, fabs(triangle[i][k]));
    }
    frexp(most, &exponent);
    for (int k = 0; k < 3; k++) {
        q[k] = ldexp(p[k], -exponent);
        for (int i = 0; i < 3; i++)
            t[i][k] = ldexp(triangle[i][k], -exponent);
    }
    return exponent;
}
