/* Rays against triangles in rational numbers: slow, right for every finite double, and used when
 * the filters of ray_triangle.c give up. */
#ifndef EBPO_GEOMETRY_RAY_EXACT_H
#define EBPO_GEOMETRY_RAY_EXACT_H

#include "geometry/ray.h"

/* The same meaning and ranges as the functions of ray_triangle.h without "_exact". Each call
 * allocates through GMP, which ends the program when memory is out (a few kilobytes suffice). */
void ebpo_ray_triangle_exact(const ebpo_segment *ray, const double triangle[3][3],
                             ebpo_ray_meeting *out);
int ebpo_ray_compare_exact(const ebpo_segment *ray, const double a[3][3], const double b[3][3]);

#endif
