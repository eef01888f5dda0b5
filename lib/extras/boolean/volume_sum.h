/* Sums the volumes below the faces of a closed mesh. Each sum is for one thread. */
#ifndef EBPO_BOOLEAN_VOLUME_SUM_H
#define EBPO_BOOLEAN_VOLUME_SUM_H

#include <gmp.h>

#include <ebpo/collide.h>

#include "mesh/sum.h"

/* Sum of six times the signed volumes of the tetrahedra from the origin to faces. */
typedef struct ebpo_volume_sum {
    ebpo_sum by_doubles;   /* sum for faces whose products are exact in doubles */
    mpz_t other;           /* sum for all other faces, in units of 2^-3378 */
    unsigned long rounded; /* terms of `other` that were rounded down, each by less than a unit */
} ebpo_volume_sum;

void ebpo_volume_sum_begin(ebpo_volume_sum *s);
void ebpo_volume_sum_end(ebpo_volume_sum *s);

/* Adds the volume below the face t, whose corners are counter-clockwise seen from outside and
 * finite; times: 1 or -1. */
void ebpo_volume_sum_add(ebpo_volume_sum *s, const double t[3][3], int times);

/* Does the same for rational corners. */
void ebpo_volume_sum_add_rational(ebpo_volume_sum *s, mpq_t (*t)[3], int times);

void ebpo_volume_sum_merge(ebpo_volume_sum *s, const ebpo_volume_sum *more);

/* Returns the double nearest to the volume, ties to even; infinite beyond the range of doubles.
 * Sets *scaled, about 1, and *exponent, so that the volume is *scaled * 2^*exponent, rounded
 * likewise. No face may have been rounded. */
double ebpo_volume_sum_value(const ebpo_volume_sum *s, double *scaled, int64_t *exponent);

/* Returns the volume: exact as ebpo_volume_sum_value, or an interval if the rounding of faces
 * leaves open which double is nearest. */
ebpo_value_bounds ebpo_volume_sum_interval(const ebpo_volume_sum *s);

#endif
