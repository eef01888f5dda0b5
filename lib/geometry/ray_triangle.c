/* A ray goes through stages, cheapest first: on which side of each edge the line passes, in
 * floating point with error bounds; then numerator and denominator of t in double-double
 * arithmetic, which gives t to its last bits (ray_close.c); expansions where these are not certain
 * (ray_expansion.c); rational numbers where exponents leave their range (ray_exact.c).
 *
 * With e_i = corner i - origin the line passes the edge (i, j) on the side given by the sign of d .
 * (e_i x e_j). Two edges with different signs: the line misses the triangle, also one without area
 * or seen edge-on, because all three signs are those of one planar figure, the triangle as seen
 * along d. Three equal signs: it goes through the interior. Anything else touches an edge or a
 * corner or is not certain.
 *
 * Error bounds: as in predicates.c; each holds for the computed permanent (the sum of absolute
 * values), the slack covers underflow, and an overflow makes the bound infinite or not a number, so
 * that no comparison succeeds. */
#include "core/strict_fp.h"

#include "geometry/ray_triangle.h"

#include <math.h>

#include "geometry/predicates_expansion.h"
#include "geometry/ray_close.h"
#include "geometry/ray_exact.h"
#include "geometry/ray_expansion.h"

static const double eps = 0x1p-53;
/* Far above every underflow error (2^-1075 each), and normal: arithmetic on denormals is slow. */
static const double slack = 0x1p-960;

/* Sign of d . (a x b), a and b being rounded differences; weight: 1 + |d0| + |d1| + |d2|. */
static inline int edge_side(const double d[3], double weight, const double a[3], const double b[3])
{
    double p0 = a[1] * b[2], q0 = a[2] * b[1];
    double p1 = a[2] * b[0], q1 = a[0] * b[2];
    double p2 = a[0] * b[1], q2 = a[1] * b[0];
    double det = d[0] * (p0 - q0) + d[1] * (p1 - q1) + d[2] * (p2 - q2);
    double permanent = fabs(d[0]) * (fabs(p0) + fabs(q0)) + fabs(d[1]) * (fabs(p1) + fabs(q1)) +
                       fabs(d[2]) * (fabs(p2) + fabs(q2));
    double bound = 8 * eps * permanent + slack * weight;
    return det > bound ? 1 : det < -bound ? -1 : EBPO_SIDE_OPEN;
}

/* --- rays --- */

/* True when some axis shows that ray and triangle are apart; signs of differences are always right.
 */
static bool apart_on_an_axis(const ebpo_segment *ray, double e[3][3])
{
    for (int k = 0; k < 3; k++) {
        bool all_above = e[0][k] > 0 && e[1][k] > 0 && e[2][k] > 0,
             all_below = e[0][k] < 0 && e[1][k] < 0 && e[2][k] < 0;
        if ((all_above && ray->direction[k] <= 0) || (all_below && ray->direction[k] >= 0))
            return true;
    }
    return false;
}

static inline void set_miss(ebpo_ray_meeting *out)
{
    *out = (ebpo_ray_meeting){ false, 0, 0, INFINITY };
}

void ebpo_ray_triangle(const ebpo_segment *ray, const double triangle[3][3], ebpo_ray_meeting *out)
{
    const double *d = ray->direction;
    double e[3][3], weight = 1 + fabs(d[0]) + fabs(d[1]) + fabs(d[2]);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            e[i][k] = triangle[i][k] - ray->origin[k];
    int sign[3] = { edge_side(d, weight, e[0], e[1]), edge_side(d, weight, e[1], e[2]),
                    edge_side(d, weight, e[2], e[0]) };
    bool done;
    if (sign[0] + sign[1] == 0 || sign[1] + sign[2] == 0 || sign[2] + sign[0] == 0) {
        set_miss(out);
        return;
    }
    if (sign[0] == sign[1] && sign[1] == sign[2] && sign[0] != EBPO_SIDE_OPEN) {
        done = ebpo_ray_meet_plane(ray, triangle, sign[0], -sign[0], out);
    } else if (apart_on_an_axis(ray, e)) {
        set_miss(out);
        return;
    } else {
        done = ebpo_ray_close(ray, triangle, sign, out);
    }
    if (!done)
        ebpo_ray_triangle_exact(ray, triangle, out);
}

void ebpo_ray_interior(const ebpo_segment *ray, const double triangle[3][3], int facing,
                       ebpo_ray_meeting *out)
{
    if (!ebpo_ray_meet_plane(ray, triangle, -facing, facing, out))
        ebpo_ray_triangle_exact(ray, triangle, out);
}

int ebpo_ray_compare(const ebpo_segment *ray, const double a[3][3], const ebpo_ray_meeting *at_a,
                     const double b[3][3], const ebpo_ray_meeting *at_b)
{
    if (ebpo_certainly_less(at_a->t, at_b->t))
        return -1;
    if (ebpo_certainly_less(at_b->t, at_a->t))
        return 1;
    if (ebpo_ray_meets_shared(ray, a, b, at_a->facing && at_b->facing))
        return 0;
    int order = ebpo_ray_compare_expansion(ray, a, b);
    return order != EBPO_SIGN_UNKNOWN ? order : ebpo_ray_compare_exact(ray, a, b);
}
