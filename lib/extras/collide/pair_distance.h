/* Distance of two faces: docs/develop/collision.md, "Distance of two faces". For every finite
 * double, faces without area included. Pure functions, any thread; results are the same with every
 * compiler and its flags. */
#ifndef EBPO_COLLIDE_PAIR_DISTANCE_H
#define EBPO_COLLIDE_PAIR_DISTANCE_H

#include <stdbool.h>

/* lo <= distance <= hi, certainly; of ordinary faces that are apart within 2^-42 of their sizes and
 * distance, of faces that meet hi may be far too great. point: of A and of B, at hi or less,
 * nearest ones as far as doubles tell. Overflow and underflow give wide bounds, never wrong ones.
 */
typedef struct ebpo_pair_distance_bounds {
    double lo, hi;
    double point[2][3];
    int feature[2]; /* that the points are on: 0 to 2 corners, 3 to 5 the edges after them, 6 inside
                     */
    bool certain;   /* the exact nearest points are on these, so their distance is the faces' */
} ebpo_pair_distance_bounds;
void ebpo_triangles_distance_bounds(const double a[3][3], const double b[3][3],
                                    ebpo_pair_distance_bounds *out);

/* True: the exact distances of both pairs are certainly equal, as they are those of the same
 * corners or edges, or of faces with the same corners, or of two planes across an axis. Faces
 * around an edge or corner often are so, and those of flat sides. */
bool ebpo_same_distance(const double a[3][3], const double b[3][3],
                        const ebpo_pair_distance_bounds *ab, const double c[3][3],
                        const double d[3][3], const ebpo_pair_distance_bounds *cd);

/* The double nearest to the exact distance, ties to even; 0 where the faces meet, INFINITY when it
 * overflows. Allocates through GMP. */
double ebpo_triangles_distance(const double a[3][3], const double b[3][3]);

/* Sign of distance(a, b) - distance(c, d), exact. */
int ebpo_triangles_distance_compare(const double a[3][3], const double b[3][3],
                                    const double c[3][3], const double d[3][3]);

/* Sign of distance(a, b) - distance, exact; distance >= 0 or INFINITY. */
int ebpo_triangles_distance_compare_to(const double a[3][3], const double b[3][3], double distance);

#endif
