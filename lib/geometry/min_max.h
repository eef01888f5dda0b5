/* The least and the greatest of three numbers. */
#ifndef EBPO_GEOMETRY_MIN_MAX_H
#define EBPO_GEOMETRY_MIN_MAX_H

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

#endif
