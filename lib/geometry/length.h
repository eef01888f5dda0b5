/* Lengths of vectors of any size. Pure functions, any thread. */
#ifndef EBPO_GEOMETRY_LENGTH_H
#define EBPO_GEOMETRY_LENGTH_H

#include <math.h>

/* Within 2^-50 of itself, or 2^-1073, also where squares are beyond what doubles hold; INFINITY
 * when it overflows. */
static inline double ebpo_length(const double v[3])
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

static inline double ebpo_length_between(const double a[3], const double b[3])
{
    const double way[3] = { b[0] - a[0], b[1] - a[1], b[2] - a[2] };
    return ebpo_length(way);
}

#endif
