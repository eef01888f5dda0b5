/* Computes predicates on a triangle from orientation predicates only, so that they are exact.
 *
 * For crossings with a segment along an axis, both ends of the segment are shifted by infinitely
 * small amounts. So no case is degenerate (Edelsbrunner and Muecke, "Simulation of Simplicity",
 * 1990). predicates.h defines this shift.
 *
 * A triangle and a box are disjoint if and only if one of 13 axes separates them (Gottschalk, Lin
 * and Manocha 1996). These are the three axes of the box, the triangle's normal, and the nine cross
 * products of an axis of the box with an edge of the triangle. The tests of the nine cross products
 * use projections along an axis of the box. The projected box is a rectangle, and the test is
 * whether this rectangle is beyond an edge of the projected triangle. */
#include "core/strict_fp.h"

#include "geometry/predicates.h"
#include "geometry/ray.h"
#include "geometry/vec3.h"

/* --- crossings, and points on a triangle --- */

static inline int compare_values(double a, double b) { return (a > b) - (a < b); }

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

/* Returns the side of the shifted point p relative to the line from a to b, in the projection along
 * `axis`: 1 to the left, -1 to the right. Returns 0 only when a and b coincide in this projection.
 * The shift changes the orientation by (a_v - b_v) d_u + (b_u - a_u) d_v, where d_u and d_v are the
 * shifts. The lower of the axes u and v has the larger shift. */
static int shifted_side2d(int axis, const double a[3], const double b[3], const double p[3])
{
    int sign = ebpo_normal_sign(axis, a, b, p);
    if (sign != 0)
        return sign;
    int u = axis == 2 ? 0 : axis + 1, v = axis == 0 ? 2 : axis - 1;
    int by_u = compare_values(a[v], b[v]), by_v = compare_values(b[u], a[u]);
    if (u < v)
        return by_u != 0 ? by_u : by_v;
    return by_v != 0 ? by_v : by_u;
}

/* Returns the side of the shifted point p relative to the plane of a, b, c. The shift (d0, d1, d2)
 * changes the orientation by normal . (d0, d1, d2). */
static int shifted_side3d(const double a[3], const double b[3], const double c[3],
                          const double p[3])
{
    int sign = ebpo_orient3d(a, b, c, p);
    for (int k = 0; k < 3 && sign == 0; k++)
        sign = ebpo_normal_sign(k, a, b, c);
    return sign;
}

/* Returns true if the coordinates alone show that there is no crossing. The shift is positive on
 * every axis, so an end equal to the face's maximum is beyond this maximum. */
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
    /* In the projection along the axis, the point is inside the face when all edges turn in the
     * same direction around it. This direction is `turn`, the sign of the normal along the axis. No
     * point is inside a face whose projection has no area. */
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

/* Returns true when p is on the closed segment from a to b, which may be a point. */
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

/* --- triangles and boxes --- */

/* The projections of the triangle and the box along one axis. The projected box is the rectangle
 * from min to max. */
typedef struct shadow {
    double corner[3][2], min[2], max[2];
    int turn; /* sign of the projected area */
} shadow;

static shadow shadow_along(int axis, const double triangle[3][3], const double min[3],
                           const double max[3])
{
    const int to[2] = { axis == 2 ? 0 : axis + 1, axis == 0 ? 2 : axis - 1 };
    shadow s;
    for (int k = 0; k < 2; k++) {
        s.min[k] = min[to[k]];
        s.max[k] = max[to[k]];
        for (int i = 0; i < 3; i++)
            s.corner[i][k] = triangle[i][to[k]];
    }
    s.turn = ebpo_orient2d(s.corner[0], s.corner[1], s.corner[2]);
    return s;
}

/* Returns true when the rectangle is entirely on the side (1: left, -1: right) of the line from a
 * to b, without touching the line. */
static bool rectangle_on_side(const shadow *s, const double a[2], const double b[2], int side)
{
    /* Tests only the corner of the rectangle that is farthest in the direction of the other side.
     */
    bool far_x = side > 0 ? b[1] < a[1] : b[1] > a[1], far_y = side > 0 ? b[0] > a[0] : b[0] < a[0];
    const double corner[2] = { far_x ? s->min[0] : s->max[0], far_y ? s->min[1] : s->max[1] };
    return ebpo_orient2d(a, b, corner) == side;
}

/* Returns true if an edge of the projected triangle separates the triangle from the rectangle. */
static bool shadows_apart(const shadow *s)
{
    for (int i = 0; i < 3; i++) {
        const double *a = s->corner[i], *b = s->corner[i == 2 ? 0 : i + 1];
        if (s->turn >= 0 && rectangle_on_side(s, a, b, -1))
            return true;
        if (s->turn <= 0 && rectangle_on_side(s, a, b, 1))
            return true;
    }
    return false;
}

/* Returns true if the triangle's plane does not intersect the box. `normal`: signs of the normal's
 * components. */
static bool apart_from_plane(const double triangle[3][3], const double min[3], const double max[3],
                             const int normal[3])
{
    double lowest[3], highest[3];
    for (int k = 0; k < 3; k++) {
        lowest[k] = normal[k] > 0 ? min[k] : max[k];
        highest[k] = normal[k] > 0 ? max[k] : min[k];
    }
    return ebpo_orient3d(triangle[0], triangle[1], triangle[2], lowest) > 0 ||
           ebpo_orient3d(triangle[0], triangle[1], triangle[2], highest) < 0;
}

bool ebpo_triangle_intersects_box(const double triangle[3][3], const double min[3],
                                  const double max[3])
{
    int below[3] = { 0 }, above[3] = { 0 }, normal[3];
    bool corner_within[3] = { true, true, true };
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            below[k] += triangle[i][k] < min[k];
            above[k] += triangle[i][k] > max[k];
            corner_within[i] &= triangle[i][k] >= min[k] && triangle[i][k] <= max[k];
        }
    for (int k = 0; k < 3; k++)
        if (below[k] == 3 || above[k] == 3)
            return false;
    if (corner_within[0] || corner_within[1] || corner_within[2])
        return true;
    for (int axis = 0; axis < 3; axis++) {
        shadow s = shadow_along(axis, triangle, min, max);
        if (shadows_apart(&s))
            return false;
        normal[axis] = s.turn;
    }
    return !apart_from_plane(triangle, min, max, normal);
}
