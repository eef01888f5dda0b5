/* Rays that come close to an edge, a corner, a plane or their own end: where the first filter does
 * not suffice. */
#ifndef EBPO_GEOMETRY_RAY_CLOSE_H
#define EBPO_GEOMETRY_RAY_CLOSE_H

#include "geometry/ray.h"

/* Sign of the determinant of direction, corner i and corner i + 1 (relative to the origin), where
 * it is certain; else: */
enum { EBPO_SIDE_OPEN = 2 };

/* The meeting, no two of the given signs being different unless open. False: not certain; numbers
 * are too large or too small. */
bool ebpo_ray_close(const ebpo_segment *ray, const double triangle[3][3], int sign[3],
                    ebpo_ray_meeting *out);

/* The same where the line meets the triangle: `side` as in the answer, `sign` that of normal .
 * direction. */
bool ebpo_ray_meet_plane(const ebpo_segment *ray, const double triangle[3][3], int sign, int side,
                         ebpo_ray_meeting *out);

/* What is further apart than this is certainly in this order, when a and b are rounded. */
static inline bool ebpo_certainly_less(double a, double b)
{
    return b - a > 0x1p-50 * (__builtin_fabs(a) + __builtin_fabs(b));
}

/* True when the ray, which meets both triangles, certainly does so in a corner or an edge that they
 * share, and therefore at the same t. `across`: it lies in the plane of neither. */
bool ebpo_ray_meets_shared(const ebpo_segment *ray, const double a[3][3], const double b[3][3],
                           bool across);

#endif
