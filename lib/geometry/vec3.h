/* Computes with vectors of three doubles, in plain floating-point arithmetic. Each function has a
 * fixed order of operations, on which results depend: sums are computed from x to z. */
#ifndef EBPO_GEOMETRY_VEC3_H
#define EBPO_GEOMETRY_VEC3_H

#include <math.h>

static inline double ebpo_vec3_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Computes a x b; `out` is neither a nor b. */
static inline void ebpo_vec3_cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Computes a - b; `out` may be a or b. */
static inline void ebpo_vec3_subtract(const double a[3], const double b[3], double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = a[k] - b[k];
}

static inline void ebpo_vec3_copy(const double a[3], double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = a[k];
}

/* Returns the length, which overflows or underflows if its square does. */
static inline double ebpo_vec3_length(const double v[3]) { return sqrt(ebpo_vec3_dot(v, v)); }

/* These functions return the least and the greatest of three numbers. */

static inline double ebpo_min3(double a, double b, double c)
{
    double low = a < b ? a : b;
    return low < c ? low : c;
}

static inline double ebpo_max3(double a, double b, double c)
{
    double high = a > b ? a : b;
    return high > c ? high : c;
}

/* Returns the length with a relative error of at most 2^-50 or an absolute error of at most
 * 2^-1073. The squares may overflow or underflow. Returns INFINITY when the length itself
 * overflows. */
static inline double ebpo_vec3_scaled_length(const double v[3])
{
    double square = (v[0] * v[0] + v[1] * v[1]) + v[2] * v[2];
    if (square > 0x1p-900 && square < 0x1p900)
        return sqrt(square);
    double most = fmax(fmax(fabs(v[0]), fabs(v[1])), fabs(v[2])), w[3];
    int power;
    if (!(most > 0 && most < INFINITY))
        return most;
    (void)frexp(most, &power);
    for (int k = 0; k < 3; k++)
        w[k] = scalbn(v[k], -power);
    return scalbn(sqrt((w[0] * w[0] + w[1] * w[1]) + w[2] * w[2]), power);
}

static inline double ebpo_vec3_scaled_distance(const double a[3], const double b[3])
{
    const double difference[3] = { b[0] - a[0], b[1] - a[1], b[2] - a[2] };
    return ebpo_vec3_scaled_length(difference);
}

#endif
