/* The predicates in exact arithmetic on doubles: tens to hundreds of nanoseconds, without
 * allocation. */
#ifndef EBPO_GEOMETRY_PREDICATES_EXPANSION_H
#define EBPO_GEOMETRY_PREDICATES_EXPANSION_H

#include "geometry/expansion.h"

/* Returned instead of a sign when coordinates are too large or too small for this stage. */
enum { EBPO_SIGN_UNKNOWN = 2 };

/* The same meaning as the functions of predicates.h without "_expansion"; -1, 0, 1 are exact. */
int ebpo_orient2d_expansion(const double a[2], const double b[2], const double c[2]);
int ebpo_orient3d_expansion(const double a[3], const double b[3], const double c[3],
                            const double d[3]);
int ebpo_sign_of_products_expansion(const double *factor, int n);

/* Sign of the determinant of three columns of differences, m[axis][column]; coordinates as large
 * and small as those that ebpo_orient3d_expansion takes, or closer to 1. Exact. */
int ebpo_determinant_expansion(ebpo_pair m[3][3]);

#endif
