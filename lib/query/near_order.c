#include "core/strict_fp.h"

#include "query/nearest.h"

static bool same_corner(const double a[3], const double b[3])
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

static bool is_edge(ebpo_feature feature)
{
    return feature >= EBPO_NEAR_EDGE0 && feature <= EBPO_NEAR_EDGE2;
}

/* Faces around one vertex or edge are the usual tie. */
static bool same_feature(const double a[3][3], ebpo_feature of_a, const double b[3][3],
                         ebpo_feature of_b)
{
    if (of_a <= EBPO_NEAR_CORNER2 && of_b <= EBPO_NEAR_CORNER2)
        return same_corner(a[of_a], b[of_b]);
    if (!is_edge(of_a) || !is_edge(of_b))
        return false;
    const double *a0 = a[of_a - EBPO_NEAR_EDGE0], *a1 = a[(of_a - EBPO_NEAR_EDGE0 + 1) % 3],
                 *b0 = b[of_b - EBPO_NEAR_EDGE0], *b1 = b[(of_b - EBPO_NEAR_EDGE0 + 1) % 3];
    return (same_corner(a0, b1) && same_corner(a1, b0)) ||
           (same_corner(a0, b0) && same_corner(a1, b1));
}

int ebpo_near_compare(const double p[3], const double a[3][3], const ebpo_distance_bounds *a_bounds,
                      const double b[3][3], const ebpo_distance_bounds *b_bounds)
{
    if (a_bounds->hi < b_bounds->lo)
        return -1;
    if (a_bounds->lo > b_bounds->hi)
        return 1;
    return same_feature(a, a_bounds->feature, b, b_bounds->feature)
               ? 0
               : ebpo_triangle_distance_compare(p, a, b);
}
