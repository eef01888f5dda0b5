/* Computes the distance of a point from a triangle: fast bounds, exact values and exact
 * comparisons, for all finite doubles, also for triangles without area. All functions are pure and
 * may be called by any thread. Results do not depend on the compiler and its flags. */
#ifndef EBPO_GEOMETRY_DISTANCE_H
#define EBPO_GEOMETRY_DISTANCE_H

#include <gmp.h>
#include <stdbool.h>

/* The nearest feature of the triangle (corners 0, 1, 2). */
typedef enum ebpo_feature {
    EBPO_NEAR_CORNER0,
    EBPO_NEAR_CORNER1,
    EBPO_NEAR_CORNER2,
    EBPO_NEAR_EDGE0,
    EBPO_NEAR_EDGE1,
    EBPO_NEAR_EDGE2, /* edge k is from corner k to corner k + 1 */
    EBPO_NEAR_INTERIOR,
    EBPO_NEAR_UNKNOWN /* not certain, because of rounding */
} ebpo_feature;

/* Guaranteed bounds: lo <= distance <= hi. The difference of the bounds is usually some 1e-15 of
 * the distance or of the largest |p - corner|, whichever is greater. `feature` is certain, or
 * EBPO_NEAR_UNKNOWN. Overflow and underflow give wide bounds (lo = 0, hi = INFINITY), never wrong
 * bounds. */
typedef struct ebpo_distance_bounds {
    double lo, hi;
    ebpo_feature feature;
} ebpo_distance_bounds;
void ebpo_triangle_distance_bounds(const double p[3], const double triangle[3][3],
                                   ebpo_distance_bounds *out);

typedef struct ebpo_triangle_nearest {
    /* the double nearest to the exact distance (ties to even); INFINITY if this double overflows */
    double distance;
    /* nearest point; the error of each coordinate is at most 8 ulp of the largest coordinate of p
     * and the triangle */
    double point[3];
    /* certain, never UNKNOWN; the lowest-dimensional feature that contains the nearest point */
    ebpo_feature feature;
} ebpo_triangle_nearest;
/* Computes the nearest point by double-double arithmetic with an error bound, or by integers of any
 * size (GMP) if the error bound does not decide the rounding. `bounds`: result of
 * ebpo_triangle_distance_bounds for the same input, or NULL. `normal`: receives the result of
 * ebpo_triangle_unit_normal, or NULL. The normal takes little extra time if the nearest point is in
 * the interior. */
void ebpo_triangle_nearest_exact(const double p[3], const double triangle[3][3],
                                 const ebpo_distance_bounds *bounds, double *normal,
                                 ebpo_triangle_nearest *out);

/* Returns the exact sign of distance(p, a) - distance(p, b). */
int ebpo_triangle_distance_compare(const double p[3], const double a[3][3], const double b[3][3]);

/* Returns the exact sign of distance(p, triangle) - d; d >= 0 or INFINITY. */
int ebpo_triangle_distance_compare_to(const double p[3], const double triangle[3][3], double d);

/* Computes the unit normal (b - a) x (c - a) / |...|, each component within 2 ulp; (0, 0, 0) for a
 * triangle without area. */
void ebpo_triangle_unit_normal(const double triangle[3][3], double normal[3]);

/* Computes the squared distance as a fraction of integers: square / denominator, in the unit
 * (2^unit)^2. All coordinates must be multiples of 2^unit. Allocates through GMP. */
void ebpo_triangle_square_gmp(const double p[3], const double triangle[3][3], int unit,
                              mpz_t square, mpz_t denominator);

#endif
