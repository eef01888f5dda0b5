/* Bounds the volume of the convex hull of a loop of border edges, by the volumes of two boxes that
 * contain the loop. The sides of one box are parallel to the coordinate axes. One side of the other
 * box is parallel to the loop's vector area, so this box is thin if the loop is nearly flat.
 *
 * Rounding. Points relative to the first point are at most `span` long. The axes are unit vectors
 * up to an error of 2^-50. So the products of these points with the axes have an error below 2^-49
 * span, and boxes are enlarged by this error on both sides. Three axes that are orthogonal up to an
 * error of 2^-45 span the volume of an exact box up to a relative error of 2^-40. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdbool.h>

#include "geometry/vec3.h"
#include "query/measure_caps.h"

/* Sets `out` to point i minus the first point, with coordinates multiplied by both factors. */
static void relative_point(const double *point, uint64_t i, const double factor[2], double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = (point[3 * i + (uint64_t)k] * factor[0] * factor[1]) -
                 (point[k] * factor[0] * factor[1]);
}

/* Returns the volume of the box of the points along three axes. */
static double box_volume(const double *point, uint64_t count, const double factor[2],
                         const double axis[3][3], double span)
{
    double volume = 1;
    for (int a = 0; a < 3; a++) {
        double low = 0, high = 0, p[3];
        for (uint64_t i = 1; i < count; i++) {
            relative_point(point, i, factor, p);
            double x = ebpo_vec3_dot(p, axis[a]);
            low = fmin(low, x);
            high = fmax(high, x);
        }
        volume *= high - low + 0x1p-47 * span;
    }
    return volume * (1 + 0x1p-38);
}

/* Scales a vector to the length 1; returns false if it is too short. */
static bool scale_to_unit(double v[3])
{
    double length = ebpo_vec3_length(v);
    for (int k = 0; k < 3; k++)
        v[k] /= length;
    return length > 0x1p-400;
}

/* Sets three axes. The first axis has the direction of the loop's vector area. The second axis is
 * perpendicular to the first axis, towards the point that is farthest from the first axis. The
 * third axis is the cross product of the first two axes. Returns false if rounding makes the axes
 * too inexact. */
static bool find_axes(const double *point, uint64_t count, const double factor[2],
                      double axis[3][3])
{
    double area[3] = { 0, 0, 0 }, p[3], q[3] = { 0, 0, 0 }, cross[3], most = -1;
    for (uint64_t i = 1; i < count; i++) {
        relative_point(point, i, factor, p);
        ebpo_vec3_cross(q, p, cross);
        for (int k = 0; k < 3; k++)
            area[k] += cross[k];
        ebpo_vec3_copy(p, q);
    }
    ebpo_vec3_copy(area, axis[0]);
    if (!scale_to_unit(axis[0]))
        return false;
    for (uint64_t i = 1; i < count; i++) {
        relative_point(point, i, factor, p);
        double along = ebpo_vec3_dot(p, axis[0]);
        for (int k = 0; k < 3; k++)
            p[k] -= along * axis[0][k];
        double length = ebpo_vec3_length(p);
        if (length > most) {
            most = length;
            ebpo_vec3_copy(p, axis[1]);
        }
    }
    if (!scale_to_unit(axis[1]))
        return false;
    ebpo_vec3_cross(axis[0], axis[1], axis[2]);
    return fabs(ebpo_vec3_dot(axis[0], axis[1])) < 0x1p-46 && scale_to_unit(axis[2]);
}

double ebpo_loop_hull(const double *point, uint64_t count, const double factor[2],
                      const double from[3], double *farthest)
{
    static const double unit[3][3] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } };
    double span = 0, p[3], first[3], axis[3][3];
    for (uint64_t i = 1; i < count; i++) {
        relative_point(point, i, factor, p);
        span = fmax(span, ebpo_vec3_length(p));
    }
    for (int k = 0; k < 3; k++)
        first[k] = point[k] * factor[0] * factor[1] - from[k];
    *farthest = (ebpo_vec3_length(first) + span) * (1 + 0x1p-40);
    double volume = box_volume(point, count, factor, unit, span);
    if (find_axes(point, count, factor, axis))
        volume = fmin(volume, box_volume(point, count, factor, (const double(*)[3])axis, span));
    return volume;
}
