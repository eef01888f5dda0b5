/* Declares the double-double kernels of distances and rays, which are compiled once for each
 * instruction set. With FMA one instruction computes a product's rounding error. The error bounds
 * hold in each build, so all builds give the same decisions and results. All functions are pure. */
#ifndef EBPO_GEOMETRY_DOUBLE_DOUBLE_KERNELS_H
#define EBPO_GEOMETRY_DOUBLE_DOUBLE_KERNELS_H

#include "core/cpu.h"
#include "geometry/distance.h"
#include "geometry/expansion.h"
#include "geometry/ray.h"

/* A distance (head + tail, whose bits may overlap) with a bound of its relative error, and the
 * nearest point. */
typedef struct ebpo_measured {
    ebpo_pair distance;
    double error;
    double point[3];
} ebpo_measured;

typedef struct ebpo_distance_pairs {
    /* Computes the distance of p from the triangle, whose nearest feature is known. Products of
     * four coordinates, and their rounding errors, must be in the range of doubles. If `normal` is
     * not NULL, also computes the unit normal, and returns the result of unit_normal; otherwise
     * returns true. */
    bool (*measure)(const double p[3], const double triangle[3][3], ebpo_feature feature,
                    double *normal, ebpo_measured *out);
    /* Computes the unit normal. Returns false when double-double arithmetic does not suffice:
     * numbers are beyond its range, or too many digits cancel. */
    bool (*unit_normal)(const double triangle[3][3], double normal[3]);
} ebpo_distance_pairs;

EBPO_KERNELS(ebpo_distance_pairs, ebpo_distance_pairs)

/* A value with a bound of its error. */
typedef struct ebpo_bounded {
    ebpo_pair x;
    double error;
} ebpo_bounded;

/* Intersection of a line with a triangle's plane: t = numerator / denominator. The denominator is 0
 * when line and plane are parallel. */
typedef struct ebpo_plane_pairs {
    ebpo_bounded numerator, denominator;
    /* result of ebpo_pair_quotient, if it succeeded */
    bool has_quotient;
    double quotient[2];
} ebpo_plane_pairs;

/* The same for four lines at once, each with a triangle in the same lane. error: sum of the
 * relative errors of numerator and denominator. rounded: approximate t. least, greatest: the result
 * of ebpo_pair_quotient, if ebpo_pair_quotient_in_range is true for `rounded`. */
typedef struct ebpo_plane_four {
    double numerator[4], numerator_error[4], error[4], rounded[4], least[4], greatest[4];
} ebpo_plane_four;

typedef struct ebpo_ray_pairs {
    void (*plane)(const ebpo_segment *ray, const double triangle[3][3], ebpo_plane_pairs *out);
    void (*four_planes)(const ebpo_ray_four *in, ebpo_plane_four *out);
    /* Computes d . (a x e), where e = to - from is an edge. */
    void (*edge)(const double d[3], const ebpo_pair a[3], const double from[3], const double to[3],
                 ebpo_bounded *out);
} ebpo_ray_pairs;

EBPO_KERNELS(ebpo_ray_pairs, ebpo_ray_pairs)

/* A number that is added to error bounds to cover underflow. It is much larger than the sum of all
 * underflow errors (2^-1075 each). It is not a denormal, because arithmetic on denormals is slow.
 */
#define EBPO_RAY_SLACK 0x1p-960

#endif
