/* Predicates on a triangle, made of orientations only: what is exact there is exact here.
 * Source of the shift: Edelsbrunner and Muecke, "Simulation of Simplicity", 1990. */
#include "core/strict_fp.h"

#include "geometry/vec3.h"
#include "geometry/predicates.h"

static inline int crossing_compare(double a, double b) { return (a > b) - (a < b); }

int ebpo_normal_sign(int k, const double a[3], const double b[3], const double c[3])
{
    int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
    return ebpo_orient2d((double[]){ a[u], a[v] }, (double[]){ b[u], b[v] },
                         (double[]){ c[u], c[v] });
}

bool ebpo_zero_area(const double a[3], const double b[3], const double c[3])
{
    return ebpo_normal_sign(2, a, b, c) == 0 && ebpo_normal_sign(0, a, b, c) == 0 &&
           ebpo_normal_sign(1, a, b, c) == 0;
}

/* Side of the shifted point p of the line a-b, all seen along `axis`, positive to the left; 0 only
 * when a and b coincide in this view. The orientation changes by (a_v - b_v) d_u + (b_u - a_u) d_v;
 * of u and v the lower axis has the larger shift. */
static int shifted_side2d(int axis, const double a[3], const double b[3], const double p[3])
{
    int sign = ebpo_normal_sign(axis, a, b, p);
    if (sign != 0)
        return sign;
    int u = axis == 2 ? 0 : axis + 1, v = axis == 0 ? 2 : axis - 1;
    int by_u = crossing_compare(a[v], b[v]), by_v = crossing_compare(b[u], a[u]);
    if (u < v)
        return by_u != 0 ? by_u : by_v;
    return by_v != 0 ? by_v : by_u;
}

/* Side of the shifted point p of the plane of a, b, c; the orientation changes by normal . (d0, d1,
 * d2). */
static int shifted_side3d(const double a[3], const double b[3], const double c[3],
                          const double p[3])
{
    int sign = ebpo_orient3d(a, b, c, p);
    for (int k = 0; k < 3 && sign == 0; k++)
        sign = ebpo_normal_sign(k, a, b, c);
    return sign;
}

/* Rejects by coordinates. The shift goes up on every axis, so an end equal to the face's maximum is
 * beyond it. */
static inline bool misses_bounds(const double from[3], double to, int axis, const double a[3],
                                 const double b[3], const double c[3])
{
    for (int k = 0; k < 3; k++)
        if ((k == axis ? to : from[k]) < ebpo_min3(a[k], b[k], c[k]) ||
            from[k] >= ebpo_max3(a[k], b[k], c[k]))
            return true;
    return false;
}

int ebpo_axis_crossing(const double from[3], double to, int axis, const double a[3],
                       const double b[3], const double c[3])
{
    if (!(from[axis] < to) || misses_bounds(from, to, axis, a, b, c))
        return 0;
    /* Against the axis the projection is inside when the face turns one way around the point:
     * `turn` is the sign of the normal along the axis. Faces seen edge-on never turn one way. */
    int turn = shifted_side2d(axis, a, b, from);
    if (turn == 0 || shifted_side2d(axis, b, c, from) != turn ||
        shifted_side2d(axis, c, a, from) != turn)
        return 0;
    if (from[axis] >= ebpo_min3(a[axis], b[axis], c[axis]) && shifted_side3d(a, b, c, from) == turn)
        return 0;
    if (to < ebpo_max3(a[axis], b[axis], c[axis])) {
        double end[3] = { from[0], from[1], from[2] };
        end[axis] = to;
        if (shifted_side3d(a, b, c, end) != turn)
            return 0;
    }
    return -turn;
}

/* True when p lies on the closed segment a-b; it may be a point. */
static bool point_on_segment(const double p[3], const double a[3], const double b[3])
{
    for (int k = 0; k < 3; k++)
        if (p[k] < (a[k] < b[k] ? a[k] : b[k]) || p[k] > (a[k] > b[k] ? a[k] : b[k]))
            return false;
    return ebpo_zero_area(a, b, p);
}

bool ebpo_point_on_triangle(const double p[3], const double a[3], const double b[3],
                            const double c[3])
{
    for (int k = 0; k < 3; k++)
        if (p[k] < ebpo_min3(a[k], b[k], c[k]) || p[k] > ebpo_max3(a[k], b[k], c[k]))
            return false;
    if (ebpo_orient3d(a, b, c, p) != 0)
        return false;
    for (int k = 0; k < 3; k++) {
        int turn = ebpo_normal_sign(k, a, b, c);
        if (turn != 0)
            return ebpo_normal_sign(k, a, b, p) != -turn && ebpo_normal_sign(k, b, c, p) != -turn &&
                   ebpo_normal_sign(k, c, a, p) != -turn;
    }
    return point_on_segment(p, a, b) || point_on_segment(p, b, c) || point_on_segment(p, c, a);
}
