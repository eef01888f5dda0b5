/* Double-double arithmetic for distances, compiled twice on x86-64: for any processor, and for
 * those with FMA, whose one instruction gives a product's rounding error. Either is exact where it
 * has to be, and the results are the same. Pure functions. */
#ifndef EBPO_GEOMETRY_DISTANCE_PAIRS_H
#define EBPO_GEOMETRY_DISTANCE_PAIRS_H

#include "core/cpu.h"
#include "geometry/distance.h"
#include "geometry/expansion.h"

/* A distance (head + tail; they may overlap by some bits) with a bound on its relative error, and
 * the nearest point. */
typedef struct ebpo_measured {
    ebpo_pair distance;
    double error;
    double point[3];
} ebpo_measured;

typedef struct ebpo_distance_pairs {
    /* The triangle's distance when its nearest feature is known. Products of four coordinates, and
     * their rounding errors, must stay within the doubles. `normal`: what unit_normal gives and
     * returns, or NULL: true. */
    bool (*measure)(const double p[3], const double triangle[3][3], ebpo_feature feature,
                    double *normal, ebpo_measured *out);
    /* False when the arithmetic does not suffice: numbers beyond its range, or too much
     * cancellation. */
    bool (*unit_normal)(const double triangle[3][3], double normal[3]);
} ebpo_distance_pairs;

EBPO_KERNELS(ebpo_distance_pairs, ebpo_distance_pairs)

#endif
