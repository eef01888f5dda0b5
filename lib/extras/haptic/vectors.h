/* Inside lib/extras/haptic: vectors of three doubles. */
#ifndef EBPO_HAPTIC_VECTORS_H
#define EBPO_HAPTIC_VECTORS_H

static inline double dot(const double a[3], const double b[3])
{
    return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
}

static inline void difference(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[i] - b[i];
}

static inline void cross(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

static inline void copy(const double a[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[i];
}

#endif
