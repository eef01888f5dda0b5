/* Vectors of three doubles, in plain floating-point arithmetic. Each function has one order of
 * operations, on which results rest: sums go from x to z. */
#ifndef EBPO_GEOMETRY_VEC3_H
#define EBPO_GEOMETRY_VEC3_H

#include <math.h>

static inline double ebpo_vec3_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* `out` is neither a nor b. */
static inline void ebpo_vec3_cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* a - b; `out` may be one of them. */
static inline void ebpo_vec3_subtract(const double a[3], const double b[3], double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = a[k] - b[k];
}

/* Overflows and underflows where squares do. */
static inline double ebpo_vec3_length(const double v[3]) { return sqrt(ebpo_vec3_dot(v, v)); }

#endif
