/* Exact predicates over doubles: the sign is correct for all finite numbers, and does not depend on
 * the compiler and its flags. A filter, that is, a floating-point computation with an error bound,
 * gives nearly all results. If the filter does not decide, exact arithmetic on doubles (expansions)
 * or on integers of any size (GMP) decides. The filter detects overflow and underflow, and does not
 * decide in these cases. All functions are pure and thread-safe. Source of the filters: Shewchuk,
 * "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates", 1997. */
#ifndef EBPO_GEOMETRY_PREDICATES_H
#define EBPO_GEOMETRY_PREDICATES_H

#include <stdbool.h>
#include <stdint.h>

#include "geometry/expansion.h"

/* Returns the sign (-1, 0, 1) of the determinant | b - a, c - a |: 1 when a, b, c turn
 * counter-clockwise. */
int ebpo_orient2d(const double a[2], const double b[2], const double c[2]);

/* Returns the sign of (b - a) x (c - a) . (d - a): 1 when d is on the side to which the normal of
 * counter-clockwise a, b, c points. */
int ebpo_orient3d(const double a[3], const double b[3], const double c[3], const double d[3]);

/* Returns the sign of component `axis` of the normal (b - a) x (c - a). */
int ebpo_normal_sign(int axis, const double a[3], const double b[3], const double c[3]);

/* Returns true when a, b, c are collinear or equal, so that they form a face without area. */
bool ebpo_zero_area(const double a[3], const double b[3], const double c[3]);

/* Returns the exact sign of the sum of n products factor[2 * i] * factor[2 * i + 1]. The function
 * is fast for up to 8 products. */
int ebpo_sign_of_products(const double *factor, int n);

/* Computes signed crossings of the face (a, b, c) with an axis-parallel segment, for winding
 * numbers.
 *
 * The segment runs from `from` in direction +axis (0, 1, 2) to coordinate `to` >= from[axis] on
 * that axis. Both ends are shifted by (d0, d1, d2), three infinitely small positive numbers. d1 is
 * negligible compared with every power of d0, and d2 is negligible compared with every power of d1.
 * This is simulation of simplicity, with the same shift for every call. Therefore no end is on a
 * face, no segment intersects an edge or vertex, and crossing numbers are exact and consistent. A
 * face without area counts as no crossing.
 *
 * Returns the change of the winding number from `from` to the end. The result is +1 when the
 * segment enters (goes against the normal of the counter-clockwise face), -1 when the segment
 * leaves, and 0 when there is no crossing. */
int ebpo_axis_crossing(const double from[3], double to, int axis, const double a[3],
                       const double b[3], const double c[3]);

/* Returns true when p is on the closed triangle (a, b, c), which may have no area. Exact. */
bool ebpo_point_on_triangle(const double p[3], const double a[3], const double b[3],
                            const double c[3]);

/* --- the exact stages, separately --- */

/* Returned instead of a sign when coordinates are too large or too small for expansions. */
enum { EBPO_SIGN_UNKNOWN = 2 };

/* These functions use exact arithmetic on doubles. They take tens to hundreds of nanoseconds, and
 * allocate nothing. They return the same results as the functions without "_expansion" in the name,
 * or EBPO_SIGN_UNKNOWN. */
int ebpo_orient2d_expansion(const double a[2], const double b[2], const double c[2]);
int ebpo_orient3d_expansion(const double a[3], const double b[3], const double c[3],
                            const double d[3]);
int ebpo_sign_of_products_expansion(const double *factor, int n);

/* Returns the exact sign of the determinant of three columns, m[axis][column]. Each element is a
 * difference of two coordinates, with its rounding error. The coordinates must be in the range of
 * ebpo_orient3d_expansion. */
int ebpo_determinant_expansion(ebpo_pair m[3][3]);

/* These functions use integers of any size. They return the same results as the functions without
 * "_exact" in the name. Each call allocates through GMP, which ends the program when memory is
 * short (a few kilobytes suffice). */
int ebpo_orient2d_exact(const double a[2], const double b[2], const double c[2]);
int ebpo_orient3d_exact(const double a[3], const double b[3], const double c[3], const double d[3]);
int ebpo_sign_of_products_exact(const double *factor, int n);

#endif
