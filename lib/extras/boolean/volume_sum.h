/* Sums the volumes below the faces of a closed mesh. The volume below a face is the signed volume
 * of the tetrahedron from the origin to the face. Each sum is for one thread. */
#ifndef EBPO_BOOLEAN_VOLUME_SUM_H
#define EBPO_BOOLEAN_VOLUME_SUM_H

#include <gmp.h>

#include <ebpo/collide.h>

#include "mesh/sum.h"

/* Six times the sum of the volumes below faces. */
typedef struct ebpo_volume_sum {
    ebpo_sum by_doubles;   /* sum for faces whose products are exact in doubles */
    mpz_t by_integers;     /* sum for all other faces, in units of 2^-3378 */
    unsigned long rounded; /* number of terms of `by_integers` that were rounded down, each by less
                              than a unit */
} ebpo_volume_sum;

void ebpo_volume_sum_begin(ebpo_volume_sum *s);
void ebpo_volume_sum_end(ebpo_volume_sum *s);

/* Adds `sign` (1 or -1) times the volume below the face t. The corners of t are finite, and
 * counter-clockwise seen from outside. */
void ebpo_volume_sum_add(ebpo_volume_sum *s, const double t[3][3], int sign);

/* Does the same as ebpo_volume_sum_add for rational corners. */
void ebpo_volume_sum_add_rational(ebpo_volume_sum *s, mpq_t (*t)[3], int sign);

void ebpo_volume_sum_merge(ebpo_volume_sum *s, const ebpo_volume_sum *more);

/* Returns the double nearest to the volume, ties to even; infinite beyond the range of doubles.
 * Sets *scaled and *exponent. *scaled is the double nearest to the volume divided by 2^*exponent.
 * Its absolute value is 1/12 to 1/6, or 0. No face may have been rounded (s->rounded is 0). */
double ebpo_volume_sum_value(const ebpo_volume_sum *s, double *scaled, int64_t *exponent);

/* Returns the double nearest to the volume, and sets *scaled and *exponent as ebpo_volume_sum_value
 * does. If the rounding of faces leaves open which doubles are nearest, returns an interval. */
ebpo_value_bounds ebpo_volume_sum_interval(const ebpo_volume_sum *s, double *scaled,
                                           int64_t *exponent);

#endif
