/* What the stages of distance.h share. */
#ifndef EBPO_GEOMETRY_DISTANCE_EXACT_H
#define EBPO_GEOMETRY_DISTANCE_EXACT_H

#include <gmp.h>

#include "geometry/distance.h"

/* Scales everything by a power of two so that the largest coordinate lies in 1/2 .. 1; returns the
 * exponent of the way back. */
int ebpo_distance_scale(const double p[3], const double triangle[3][3], double q[3],
                        double t[3][3]);

/* The same as without _gmp, in integers of any size. Allocates through GMP. */
void ebpo_triangle_nearest_gmp(const double p[3], const double triangle[3][3],
                               ebpo_triangle_nearest *out);
int ebpo_triangle_distance_compare_gmp(const double p[3], const double a[3][3],
                                       const double b[3][3]);
int ebpo_triangle_distance_compare_to_gmp(const double p[3], const double triangle[3][3], double d);
/* The squared distance as a fraction, in squares of 2^unit; all coordinates are multiples of that.
 */
void ebpo_triangle_square_gmp(const double p[3], const double triangle[3][3], int unit,
                              mpz_t square, mpz_t denominator);
void ebpo_triangle_unit_normal_gmp(const double triangle[3][3], double normal[3]);

#endif
