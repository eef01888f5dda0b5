/* A ray goes through stages, cheapest first: on which side of each edge the line passes, in
 * floating point with error bounds; then numerator and denominator of t in double-double
 * arithmetic, which gives t to its last bits; rational numbers where these are not certain.
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
#include "geom/strict_fp.h"

#include "geom/ray_triangle.h"

#include "geom/double_double.h"
#include "geom/ray_exact.h"

static const double eps = 0x1p-53;
/* Far above every underflow error (2^-1075 each), and normal: arithmetic on denormals is slow. */
static const double slack = 0x1p-960;

enum { NOT_SURE = 2 };

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
    return det > bound ? 1 : det < -bound ? -1 : NOT_SURE;
}

/* --- the parameter, in double-double arithmetic --- */

/* A normal and the sum of absolute values behind each component. */
typedef struct plane_normal {
    ebpo_pair x[3];
    double permanent[3];
} plane_normal;

static inline plane_normal normal_of(const double triangle[3][3])
{
    ebpo_pair f[3], g[3];
    plane_normal n;
    for (int k = 0; k < 3; k++) {
        f[k] = ebpo_two_difference(triangle[1][k], triangle[0][k]);
        g[k] = ebpo_two_difference(triangle[2][k], triangle[0][k]);
    }
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        ebpo_pair p = ebpo_pair_multiply(f[u], g[v]), q = ebpo_pair_multiply(f[v], g[u]);
        n.x[k] = ebpo_pair_subtract(p, q);
        n.permanent[k] = fabs(p.head) + fabs(q.head);
    }
    return n;
}

/* *out = n . y to 2^-55 of itself; false when that is not certain.
 * Errors: some 12 * 2^-106 of the permanent in n, 12 more in products and sums; 2^-97 leaves a
 * margin. */
static inline bool accurate_dot(const plane_normal *n, const ebpo_pair y[3], ebpo_pair *out)
{
    ebpo_pair first = ebpo_pair_multiply(n->x[0], y[0]), second = ebpo_pair_multiply(n->x[1], y[1]);
    *out = ebpo_pair_add(ebpo_pair_add(first, second), ebpo_pair_multiply(n->x[2], y[2]));
    double a = fabs(y[0].head), b = fabs(y[1].head), c = fabs(y[2].head);
    double permanent = n->permanent[0] * a + n->permanent[1] * b + n->permanent[2] * c;
    double error = 0x1p-97 * permanent + slack * (1 + a + b + c);
    return error <= 0x1p-56 * fabs(out->head) && fabs(out->head) <= DBL_MAX;
}

/* *t: where the line meets the triangle's plane, less than 2^-52 of itself off; false when that is
 * not certain. */
static bool plane_parameter(const ebpo_segment *ray, const double triangle[3][3], double *t)
{
    plane_normal n = normal_of(triangle);
    ebpo_pair to_plane[3], d[3], numerator, denominator;
    for (int k = 0; k < 3; k++) {
        to_plane[k] = ebpo_two_difference(triangle[0][k], ray->origin[k]);
        d[k] = ebpo_pair_of(ray->direction[k]);
    }
    if (!accurate_dot(&n, d, &denominator) || !accurate_dot(&n, to_plane, &numerator))
        return false;
    double quotient = numerator.head / denominator.head;
    if (!(fabs(quotient) >= 0x1p-900 && fabs(quotient) <= 0x1p900))
        return false;
    ebpo_pair back = ebpo_two_product(quotient, denominator.head);
    double rest =
        ((numerator.head - back.head) - back.tail) + (numerator.tail - quotient * denominator.tail);
    *t = quotient + rest / denominator.head;
    return *t == *t;
}

/* --- rays --- */

/* What is further apart than this is certainly in this order. */
static inline bool certainly_less(double a, double b)
{
    return b - a > 0x1p-50 * (fabs(a) + fabs(b));
}

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

/* The line goes through the triangle's interior; `sign`: that of normal . direction. False when t
 * is not certain enough. */
static bool meet_interior(const ebpo_segment *ray, const double triangle[3][3], int sign,
                          ebpo_ray_meeting *out)
{
    double t;
    if (!plane_parameter(ray, triangle, &t))
        return false;
    if (t < 0 || certainly_less(ray->t_max, t)) {
        set_miss(out);
        return true;
    }
    *out = (ebpo_ray_meeting){ true, -sign, -sign, t };
    return ray->t_max == INFINITY || certainly_less(t, ray->t_max);
}

void ebpo_ray_triangle(const ebpo_segment *ray, const double triangle[3][3], ebpo_ray_meeting *out)
{
    const double *d = ray->direction;
    double e[3][3], weight = 1 + fabs(d[0]) + fabs(d[1]) + fabs(d[2]);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            e[i][k] = triangle[i][k] - ray->origin[k];
    int a = edge_side(d, weight, e[0], e[1]), b = edge_side(d, weight, e[1], e[2]),
        c = edge_side(d, weight, e[2], e[0]);
    if (a + b == 0 || b + c == 0 || c + a == 0)
        set_miss(out);
    else if (a == b && b == c && a != NOT_SURE && meet_interior(ray, triangle, a, out))
        return;
    else if (apart_on_an_axis(ray, e))
        set_miss(out);
    else
        ebpo_ray_triangle_exact(ray, triangle, out);
}

int ebpo_ray_compare(const ebpo_segment *ray, const double a[3][3], const double b[3][3])
{
    double t, u;
    if (plane_parameter(ray, a, &t) && plane_parameter(ray, b, &u)) {
        if (certainly_less(t, u))
            return -1;
        if (certainly_less(u, t))
            return 1;
    }
    return ebpo_ray_compare_exact(ray, a, b);
}
