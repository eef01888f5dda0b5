/* Intersects a ray or segment with a triangle. */
#ifndef EBPO_GEOMETRY_RAY_H
#define EBPO_GEOMETRY_RAY_H

#include <stdbool.h>

/* The points origin + t * direction with 0 <= t <= t_max. The direction is not zero; t_max >= 0, or
 * INFINITY. */
typedef struct ebpo_segment {
    double origin[3], direction[3];
    double t_max;
} ebpo_segment;

typedef struct ebpo_ray_intersection {
    bool intersects; /* the closed triangle and the ray have a common point with 0 <= t <= t_max */
    /* 1: the ray passes through the triangle's interior against the normal (enters). -1: the ray
     * passes through the interior with the normal (leaves). 0: the ray intersects an edge or
     * corner, or is within the plane, or the triangle has no area */
    int side;
    /* direction of the line relative to the normal; also set if the line intersects an edge or
     * corner. 1: against the normal; -1: with the normal; 0: the line is within the plane, or the
     * triangle has no area */
    int facing;
    double t; /* t of the first common point, correctly rounded */
    /* the part of the triangle in which the line certainly intersects it, if facing is not 0: a bit
     * (1 << i) for the corner, or two bits for the ends of the edge; 0: interior, or not known */
    unsigned part;
} ebpo_ray_intersection;

/* A corner or an edge in which a ray intersects a triangle that is not in one plane with it. Other
 * triangles with this corner or edge are intersected at the same t. */
typedef struct ebpo_ray_shared {
    unsigned count; /* 1: a corner; 2: an edge; 0: nothing is known */
    double corner[2][3];
    double t;
} ebpo_ray_shared;

/* Exact tests of rays and boxes against triangles. For all finite doubles, the decisions are the
 * same as in arithmetic without rounding. Floating-point filters are tried first, and then exact
 * arithmetic on doubles (expansions). If numbers are too large or too small for expansions,
 * integers of any size (GMP) are used. All functions are pure and may be called by any thread.
 * Results do not depend on the compiler and its flags. */

void ebpo_ray_triangle(const ebpo_segment *ray, const double triangle[3][3],
                       ebpo_ray_intersection *out);

/* Same as ebpo_ray_triangle, for a line that certainly passes through the triangle's interior.
 * `facing` has the meaning of the member in ebpo_ray_intersection, and is not 0. */
void ebpo_ray_interior(const ebpo_segment *ray, const double triangle[3][3], int facing,
                       ebpo_ray_intersection *out);

/* Sets *out to the corner or edge in which the ray intersects the triangle (at->part). */
void ebpo_ray_share(const double triangle[3][3], const ebpo_ray_intersection *at,
                    ebpo_ray_shared *out);

/* Same as ebpo_ray_triangle, but only for a triangle that has the shared corner or edge (count is
 * not 0). Returns false, without a result, for other triangles, and if the result is not certain.
 */
bool ebpo_ray_shares(const ebpo_segment *ray, const ebpo_ray_shared *shared,
                     const double triangle[3][3], ebpo_ray_intersection *out);

/* Four rays, each with a triangle whose interior the ray's line certainly passes. The last index is
 * the ray. facing: as in ebpo_ray_intersection, not 0. */
typedef struct ebpo_ray_four {
    double origin[3][4], direction[3][4], t_max[4], triangle[3][3][4];
    int facing[4];
} ebpo_ray_four;

/* Computes t of four intersections. Returns a bit for each ray for which ebpo_ray_interior would
 * return an intersection with this t. Rays without the bit need ebpo_ray_interior. */
unsigned ebpo_ray_interior_four(const ebpo_ray_four *four, double t[4]);

/* Returns the exact sign of t(a) - t(b), where t is the parameter of the first common point with a
 * triangle. The ray must intersect both triangles, and at_a and at_b must be the results of
 * ebpo_ray_triangle. */
int ebpo_ray_compare(const ebpo_segment *ray, const double a[3][3],
                     const ebpo_ray_intersection *at_a, const double b[3][3],
                     const ebpo_ray_intersection *at_b);

/* Same as ebpo_ray_triangle, computed in rational numbers. Each call allocates through GMP, which
 * ends the program when memory is short (a few kilobytes suffice). */
void ebpo_ray_triangle_exact(const ebpo_segment *ray, const double triangle[3][3],
                             ebpo_ray_intersection *out);
int ebpo_ray_compare_exact(const ebpo_segment *ray, const double a[3][3], const double b[3][3]);

/* Returns true when the closed triangle and the closed box [min, max] have a common point (min <=
 * max on each axis; a box may be flat or a point). */
bool ebpo_triangle_intersects_box(const double triangle[3][3], const double min[3],
                                  const double max[3]);

#endif
