/* Distance of a point to a triangle: bounds that are fast, values and comparisons that are exact.
 * For every finite double, triangles without area included. Pure functions, any thread; the results
 * are the same with every compiler and its flags. */
#ifndef EBPO_GEOMETRY_DISTANCE_H
#define EBPO_GEOMETRY_DISTANCE_H

#include <gmp.h>
#include <stdbool.h>

/* Which feature of the triangle (corners 0, 1, 2) is nearest. */
typedef enum ebpo_feature {
    EBPO_NEAR_CORNER0,
    EBPO_NEAR_CORNER1,
    EBPO_NEAR_CORNER2,
    EBPO_NEAR_EDGE0,
    EBPO_NEAR_EDGE1,
    EBPO_NEAR_EDGE2, /* corner k to k + 1 */
    EBPO_NEAR_INTERIOR,
    EBPO_NEAR_UNKNOWN /* rounding leaves it open */
} ebpo_feature;

/* lo <= distance <= hi, certainly; usually within some 1e-15 of the larger of distance and the
 * triangle's reach |p - corner|. `feature` is certain unless UNKNOWN. Overflow and underflow give
 * wide bounds (lo = 0, hi = INFINITY), never wrong ones. */
typedef struct ebpo_distance_bounds {
    double lo, hi;
    ebpo_feature feature;
} ebpo_distance_bounds;
void ebpo_triangle_distance_bounds(const double p[3], const double triangle[3][3],
                                   ebpo_distance_bounds *out);

typedef struct ebpo_triangle_nearest {
    /* the double nearest to the exact distance (ties to even); INFINITY when that overflows */
    double distance;
    /* nearest point, each coordinate within 8 ulp of the largest coordinate involved */
    double point[3];
    /* certain, never UNKNOWN; the lowest-dimensional one that contains the nearest point */
    ebpo_feature feature;
} ebpo_triangle_nearest;
/* Double-double arithmetic with an error bound, integers of any size (GMP) when that does not
 * decide the rounding. `bounds`: what ebpo_triangle_distance_bounds gave for the same, or NULL.
 * `normal`: what ebpo_triangle_unit_normal gives, for little more where the nearest point is in the
 * interior, or NULL. */
void ebpo_triangle_nearest_exact(const double p[3], const double triangle[3][3],
                                 const ebpo_distance_bounds *bounds, double *normal,
                                 ebpo_triangle_nearest *out);

/* Sign of distance(p, a) - distance(p, b), exact. */
int ebpo_triangle_distance_compare(const double p[3], const double a[3][3], const double b[3][3]);

/* Sign of distance(p, triangle) - d, exact; d >= 0 or INFINITY. */
int ebpo_triangle_distance_compare_to(const double p[3], const double triangle[3][3], double d);

/* Unit normal (b - a) x (c - a) / |...|, each component within 2 ulp; (0, 0, 0) for a triangle
 * without area. */
void ebpo_triangle_unit_normal(const double triangle[3][3], double normal[3]);

/* The squared distance as a fraction of integers, in squares of 2^unit; all coordinates are
 * multiples of 2^unit. Allocates through GMP. */
void ebpo_triangle_square_gmp(const double p[3], const double triangle[3][3], int unit,
                              mpz_t square, mpz_t denominator);

#endif
