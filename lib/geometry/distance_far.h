/* Points that are far from a triangle for its size: what products of a coordinate of the point and
 * a side of the triangle tell, each with an error that is relative to itself. Signs only; certain.
 */
#ifndef EBPO_GEOMETRY_DISTANCE_FAR_H
#define EBPO_GEOMETRY_DISTANCE_FAR_H

#include <stdbool.h>

#include "geometry/distance.h"

/* The nearest feature, or EBPO_NEAR_UNKNOWN. `out`, unless NULL: bounds of the distance that are as
 * near as the triangle is small. */
ebpo_feature ebpo_far_feature(const double p[3], const double triangle[3][3],
                              ebpo_distance_bounds *out);

/* Sign of |p - a| - |p - b|; false: it is not certain. */
bool ebpo_far_corners_compare(const double p[3], const double a[3], const double b[3], int *sign);

/* What lies in one plane across an axis is as near as it is to the foot of the point in that plane.
 * True: p has been moved there, and a and b have become no more than their features. */
bool ebpo_far_flatten(double p[3], double a[3][3], ebpo_feature of_a, double b[3][3],
                      ebpo_feature of_b);

#endif
