/* Where a ray meets a triangle, as fractions of expansions: exact without allocation, for rays that
 * the filters of ray_close.c leave open. What returns false or
 * EBPO_SIGN_UNKNOWN cannot tell: numbers are too large or too small. */
#ifndef EBPO_GEOMETRY_RAY_EXPANSION_H
#define EBPO_GEOMETRY_RAY_EXPANSION_H

#include "geometry/expansion.h"
#include "geometry/ray.h"

/* numerator / denominator; the denominator is not 0. */
typedef struct ebpo_fraction {
    int n, m;
    double numerator[192], denominator[96];
} ebpo_fraction;

/* Zero, or of a size that no product of four such numbers leaves the doubles. */
bool ebpo_ray_in_range(const ebpo_segment *ray, const double triangle[3][3]);

/* The t at which the line meets the triangle's plane: normal . (corner - origin) over normal .
 * direction, for what ebpo_ray_in_range accepts. False: it is parallel. */
bool ebpo_plane_fraction(const ebpo_segment *ray, const double triangle[3][3], ebpo_fraction *out);

int ebpo_fraction_sign(const ebpo_fraction *f);
/* Sign of f - t for t >= 0. */
int ebpo_fraction_beyond(const ebpo_fraction *f, double t);
/* *t: the fraction, positive, correctly rounded. It keeps its value, in fewer components. */
bool ebpo_fraction_value(ebpo_fraction *f, double *t);

/* The meeting, for a line that lies in the triangle's plane or in one with a triangle without area,
 * for what ebpo_ray_in_range accepts. */
bool ebpo_ray_within_plane(const ebpo_segment *ray, const double triangle[3][3],
                           ebpo_ray_meeting *out);

/* Sign of t(a) - t(b), as ebpo_ray_compare. */
int ebpo_ray_compare_expansion(const ebpo_segment *ray, const double a[3][3], const double b[3][3]);

#endif
