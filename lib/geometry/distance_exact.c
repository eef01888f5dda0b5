/* Distance to a triangle, correctly rounded: double-double arithmetic while its error bound decides
 * the rounding, integers of any size otherwise. Source of the test: Ziv, "Fast evaluation of
 * elementary mathematical functions with correctly rounded last bit", 1991. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "geometry/distance_far.h"
#include "geometry/distance_pairs.h"
#include "geometry/distance_parts.h"

/* Beyond these, products of four coordinates or their rounding errors would leave the doubles. */
static const double most_reach = 0x1p120, least_size = 0x1p-120;

static bool ordinary(const double p[3], const double triangle[3][3])
{
    double reach = 0, size = 0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            double r = fabs(triangle[i][k] - p[k]),
                   l = fabs(triangle[i][k] - triangle[i == 2 ? 0 : i + 1][k]);
            reach = r > reach ? r : reach;
            size = l > size ? l : size;
        }
    return reach < most_reach && size > least_size;
}

/* Ziv's test. */
static bool rounds(const ebpo_measured *m, double *distance)
{
    double error = m->error * m->distance.head;
    double least = m->distance.head + (m->distance.tail - error),
           most = m->distance.head + (m->distance.tail + error);
    *distance = least;
    return m->error < 0x1p-56 && least == most;
}

/* A corner of a triangle that is far away: scaled, so that nothing overflows. What gets lost of
 * small coordinates is below 2^-1000 of the distance. */
static bool corner_by_pairs(const double p[3], const double triangle[3][3],
                            const ebpo_distance_bounds *bounds, ebpo_triangle_nearest *out)
{
    double q[3], t[3][3];
    ebpo_measured m;
    if (bounds->feature > EBPO_NEAR_CORNER2 || !(bounds->lo > 0x1p-900))
        return false;
    int exponent = ebpo_distance_scale(p, triangle, q, t);
    if (ldexp(bounds->lo, -exponent) < 0x1p-10)
        return false;
    ebpo_distance_pairs_best()->measure(q, (const double(*)[3])t, bounds->feature, NULL, &m);
    if (!rounds(&m, &out->distance))
        return false;
    out->distance = ldexp(out->distance, exponent);
    out->feature = bounds->feature;
    memcpy(out->point, triangle[out->feature], sizeof out->point);
    return true;
}

/* False: the arithmetic does not decide. *known: the normal (if it is wanted) is there. */
static bool nearest_by_pairs(const double p[3], const double triangle[3][3],
                             const ebpo_distance_bounds *bounds, double *normal, bool *known,
                             ebpo_triangle_nearest *out)
{
    ebpo_measured m;
    *known = false;
    if (bounds->feature == EBPO_NEAR_UNKNOWN || !(bounds->lo > least_size))
        return false;
    if (!ordinary(p, triangle))
        return corner_by_pairs(p, triangle, bounds, out);
    *known = ebpo_distance_pairs_best()->measure(p, triangle, bounds->feature, normal, &m);
    if (!rounds(&m, &out->distance))
        return false;
    out->feature = bounds->feature;
    memcpy(out->point, m.point, sizeof out->point);
    return true;
}

void ebpo_triangle_nearest_exact(const double p[3], const double triangle[3][3],
                                 const ebpo_distance_bounds *bounds, double *normal,
                                 ebpo_triangle_nearest *out)
{
    ebpo_distance_bounds b;
    bool known;
    if (bounds)
        b = *bounds;
    else
        ebpo_triangle_distance_bounds(p, triangle, &b);
    if (!nearest_by_pairs(p, triangle, &b, normal, &known, out))
        ebpo_triangle_nearest_gmp(p, triangle, out);
    if (normal && !known)
        ebpo_triangle_unit_normal(triangle, normal);
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
    int sign;
    if (x.feature <= EBPO_NEAR_CORNER2 && y.feature <= EBPO_NEAR_CORNER2 &&
        ebpo_far_corners_compare(p, a[x.feature], b[y.feature], &sign))
        return sign;
    double foot[3], c[3][3], d[3][3];
    memcpy(foot, p, sizeof foot);
    memcpy(c, a, sizeof c);
    memcpy(d, b, sizeof d);
    if (ebpo_far_flatten(foot, c, x.feature, d, y.feature))
        return ebpo_triangle_distance_compare(foot, (const double(*)[3])c, (const double(*)[3])d);
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
    if (!ebpo_distance_pairs_best()->unit_normal(triangle, normal))
        ebpo_triangle_unit_normal_gmp(triangle, normal);
}
