/* Distance to a triangle, correctly rounded: double-double arithmetic while its error bound decides the rounding, integers of any size otherwise.
 * Source of the test: Ziv, "Fast evaluation of elementary mathematical functions with correctly rounded last bit", 1991. */
#include "geom/strict_fp.h"

#include <math.h>
#include <string.h>

#include "geom/distance_parts.h"
#include "geom/double_double.h"

/* Beyond these, products of four coordinates or their rounding errors would leave the doubles. */
static const double most_reach = 0x1p120, least_size = 0x1p-120;

static ebpo_pair pair_sum3(ebpo_pair a, ebpo_pair b, ebpo_pair c)
{
    return ebpo_pair_add(ebpo_pair_add(a, b), c);
}

static ebpo_pair pair_dot(const ebpo_pair a[3], const ebpo_pair b[3])
{
    return pair_sum3(ebpo_pair_multiply(a[0], b[0]), ebpo_pair_multiply(a[1], b[1]), ebpo_pair_multiply(a[2], b[2]));
}

static void pair_cross(const ebpo_pair a[3], const ebpo_pair b[3], ebpo_pair out[3])
{
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        out[k] = ebpo_pair_subtract(ebpo_pair_multiply(a[u], b[v]), ebpo_pair_multiply(a[v], b[u]));
    }
}

/* b - a, exact. */
static void differences(const double a[3], const double b[3], ebpo_pair out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = ebpo_two_difference(b[k], a[k]);
}

/* To about 2^-100 of itself; x > 0. */
static ebpo_pair pair_root(ebpo_pair x)
{
    double first = sqrt(x.head);
    ebpo_pair rest = ebpo_pair_subtract(x, ebpo_two_product(first, first));
    return ebpo_pair_add(ebpo_pair_of(first), ebpo_pair_of(rest.head / (2 * first)));
}

static double size1(const ebpo_pair a[3])
{
    return fabs(a[0].head) + fabs(a[1].head) + fabs(a[2].head);
}

/* A distance with a bound on its relative error. */
typedef struct measured {
    ebpo_pair distance;
    double error;
    double point[3];
} measured;

static void to_corner(const double p[3], const double corner[3], measured *out)
{
    ebpo_pair d[3];
    differences(p, corner, d);
    out->distance = pair_root(pair_dot(d, d));
    out->error = 0x1p-95;
    memcpy(out->point, corner, sizeof out->point);
}

/* |corner x edge| / |edge|. */
static void to_edge(const double p[3], const double from[3], const double to[3], measured *out)
{
    ebpo_pair a[3], e[3], w[3];
    differences(p, from, a);
    differences(from, to, e);
    pair_cross(a, e, w);
    ebpo_pair area2 = pair_dot(w, w), length2 = pair_dot(e, e);
    out->distance = ebpo_pair_divide(pair_root(area2), pair_root(length2));
    out->error = 0x1p-94 * (1 + size1(a) / out->distance.head);
    double t = -pair_dot(a, e).head / length2.head;
    for (int k = 0; k < 3; k++)
        out->point[k] = t < 0.5 ? from[k] + t * e[k].head : to[k] - (1 - t) * e[k].head;
}

/* |corner . normal| / |normal|. */
static void to_plane(const double p[3], const double triangle[3][3], measured *out)
{
    ebpo_pair a[3], e[3], f[3], n[3];
    differences(p, triangle[0], a);
    differences(triangle[0], triangle[1], e);
    differences(triangle[0], triangle[2], f);
    pair_cross(e, f, n);
    ebpo_pair height = pair_dot(a, n), length2 = pair_dot(n, n), length = pair_root(length2);
    double size = size1(e) * size1(f), share = height.head / length2.head;
    out->distance = ebpo_pair_divide(height, length);
    if (out->distance.head < 0)
        out->distance = (ebpo_pair){ -out->distance.head, -out->distance.tail };
    out->error = 0x1p-94 * (1 + size / length.head + size1(a) * size / fabs(height.head));
    for (int k = 0; k < 3; k++)
        out->point[k] = p[k] + n[k].head * share;
}

static bool ordinary(const double p[3], const double triangle[3][3])
{
    double reach = 0, size = 0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            double r = fabs(triangle[i][k] - p[k]), l = fabs(triangle[i][k] - triangle[i == 2 ? 0 : i + 1][k]);
            reach = r > reach ? r : reach;
            size = l > size ? l : size;
        }
    return reach < most_reach && size > least_size;
}

void ebpo_triangle_nearest_exact(const double p[3], const double triangle[3][3], ebpo_triangle_nearest *out)
{
    ebpo_distance_bounds b;
    measured m = { { 0, 0 }, 1, { 0, 0, 0 } };
    ebpo_triangle_distance_bounds(p, triangle, &b);
    if (b.feature != EBPO_NEAR_UNKNOWN && b.lo > least_size && ordinary(p, triangle)) {
        int i = (int)(b.feature - EBPO_NEAR_EDGE0);
        if (b.feature <= EBPO_NEAR_CORNER2)
            to_corner(p, triangle[b.feature], &m);
        else if (b.feature <= EBPO_NEAR_EDGE2)
            to_edge(p, triangle[i], triangle[i == 2 ? 0 : i + 1], &m);
        else
            to_plane(p, triangle, &m);
        double error = m.error * m.distance.head;
        double least = m.distance.head + (m.distance.tail - error), most = m.distance.head + (m.distance.tail + error);
        if (m.error < 0x1p-56 && least == most) {
            out->distance = least;
            out->feature = b.feature;
            memcpy(out->point, m.point, sizeof out->point);
            return;
        }
    }
    ebpo_triangle_nearest_gmp(p, triangle, out);
}

int ebpo_triangle_distance_compare(const double p[3], const double a[3][3], const double b[3][3])
{
    ebpo_distance_bounds x, y;
    ebpo_triangle_distance_bounds(p, a, &x);
    ebpo_triangle_distance_bounds(p, b, &y);
    if (x.hi < y.lo)
        return -1;
    if (x.lo > y.hi)
        return 1;
    if (x.feature <= EBPO_NEAR_CORNER2 && y.feature <= EBPO_NEAR_CORNER2) {
        const double *c = a[x.feature], *d = b[y.feature];
        if (c[0] == d[0] && c[1] == d[1] && c[2] == d[2])
            return 0;
    }
    return ebpo_triangle_distance_compare_gmp(p, a, b);
}

int ebpo_triangle_distance_compare_to(const double p[3], const double triangle[3][3], double d)
{
    ebpo_distance_bounds b;
    if (isinf(d))
        return -1;
    ebpo_triangle_distance_bounds(p, triangle, &b);
    return b.hi < d ? -1 : b.lo > d ? 1 : ebpo_triangle_distance_compare_to_gmp(p, triangle, d);
}

void ebpo_triangle_unit_normal(const double triangle[3][3], double normal[3])
{
    ebpo_pair e[3], f[3], n[3];
    differences(triangle[0], triangle[1], e);
    differences(triangle[0], triangle[2], f);
    double reach = size1(e) * size1(f);
    bool sure = reach > 0x1p-200 && reach < 0x1p200;
    pair_cross(e, f, n);
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        double products = fabs(e[u].head * f[v].head) + fabs(e[v].head * f[u].head);
        bool nothing = (e[u].head == 0 || f[v].head == 0) && (e[v].head == 0 || f[u].head == 0);
        /* 2^-96 of the products is the error; where a factor of each is 0, so is the component. */
        sure = sure && (nothing || (fabs(n[k].head) > 0x1p-40 * products && products > 0x1p-800));
    }
    if (!sure) {
        ebpo_triangle_unit_normal_gmp(triangle, normal);
        return;
    }
    ebpo_pair length2 = pair_dot(n, n);
    double length = length2.head > 0 ? pair_root(length2).head : 1;
    for (int k = 0; k < 3; k++)
        normal[k] = n[k].head / length;
}
