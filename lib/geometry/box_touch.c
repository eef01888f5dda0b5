/* A triangle and a box are apart exactly when they are so along one of 13 axes: those of the box,
 * the triangle's normal, the products of an axis of the box with an edge of the triangle
 * (separating axes; Gottschalk, Lin and Manocha 1996). The last nine are questions in the plane:
 * along each axis of the box the triangle becomes a triangle and the box a rectangle, and the
 * rectangle lies beyond an edge. All signs come from the exact predicates, which begin with
 * filters. */
#include "core/strict_fp.h"

#include "geometry/ray.h"

#include "geometry/predicates.h"

/* The projections of the triangle and the box along one axis. */
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

/* True when the rectangle lies wholly to the side (1: left, -1: right) of the line from a to b,
 * which it does not touch. */
static bool rectangle_on_side(const shadow *s, const double a[2], const double b[2], int side)
{
    /* The corner that is farthest to the other side. */
    bool far_x = side > 0 ? b[1] < a[1] : b[1] > a[1], far_y = side > 0 ? b[0] > a[0] : b[0] < a[0];
    const double corner[2] = { far_x ? s->min[0] : s->max[0], far_y ? s->min[1] : s->max[1] };
    return ebpo_orient2d(a, b, corner) == side;
}

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

/* `normal`: signs of the normal's components. */
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

bool ebpo_triangle_meets_box(const double triangle[3][3], const double min[3], const double max[3])
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
