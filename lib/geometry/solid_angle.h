/* Computes solid angles of triangles, with error bounds.
 *
 * The half angle of the triangle (a, b, c) at p is half of its signed solid angle, in [-pi, pi]. It
 * is positive when p is on the side from which the triangle turns clockwise. The half angles of a
 * closed surface with outward faces sum up to 2 pi at points inside. With A = a - p, B = b - p and
 * C = c - p, the half angle is the argument of this complex number (van Oosterom and Strackee
 * 1983):
 *
 *   |A||B||C| + (A.B)|C| + (B.C)|A| + (C.A)|B|  +  i A.(B x C).
 *
 * The half angle is not continuous at points on the triangle. If p is such a point, the functions
 * shift p by an infinitely small vector, as ebpo_axis_crossing (predicates.h) does. So half angles
 * and crossings are computed for the same point. */
#ifndef EBPO_GEOMETRY_SOLID_ANGLE_H
#define EBPO_GEOMETRY_SOLID_ANGLE_H

#include <stdbool.h>

#include "geometry/big_float.h"

/* A value in [middle - error, middle + error]. */
typedef struct ebpo_bounded {
    double middle, error;
} ebpo_bounded;

/* Bounds of pi. */
#define EBPO_PI_LOW  0x1.921fb54442d18p+1
#define EBPO_PI_HIGH 0x1.921fb54442d19p+1

/* Returns the argument of the complex number x + i y in [-pi, pi], within 2^-49. Returns 0 for 0,
 * and for infinite or NaN numbers. */
double ebpo_argument(double y, double x);

/* Returns the half angle. Its error is pi if p is so close to an edge that doubles do not suffice.
 */
ebpo_bounded ebpo_half_angle(const double p[3], const double a[3], const double b[3],
                             const double c[3]);

/* A half angle, computed in 512 bits. */
typedef struct ebpo_exact_angle {
    ebpo_big_complex turn; /* a complex number, not 0, whose argument is the half angle */
    double error;          /* relative error of `turn`, at most 2^-300 */
    double angle;          /* the half angle, within 2^-47 */
} ebpo_exact_angle;

/* Computes the half angle. Returns false when p is a corner, or so close to an edge that 512 bits
 * do not suffice. */
bool ebpo_half_angle_exact(const double p[3], const double a[3], const double b[3],
                           const double c[3], ebpo_exact_angle *out);

#endif
