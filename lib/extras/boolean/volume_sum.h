/* Signed volumes below faces, summed without rounding: of a closed surface that looks outward they
 * are the volume within. One thread each; sums of several threads are merged. */
#ifndef EBPO_BOOLEAN_VOLUME_SUM_H
#define EBPO_BOOLEAN_VOLUME_SUM_H

#include <gmp.h>

#include "mesh/sum.h"

/* Six times the volumes of tetrahedra from the origin. */
typedef struct ebpo_volume_sum {
    ebpo_sum usual; /* of faces whose products doubles can hold */
    mpz_t other;    /* of all others, in units of 2^EBPO_VOLUME_UNIT */
} ebpo_volume_sum;

/* Of products of three doubles; of each all 53 bits count, also of the least one, 2^-1074. */
enum { EBPO_VOLUME_UNIT = -3 * (1074 + 52) };

void ebpo_volume_sum_begin(ebpo_volume_sum *sum);
void ebpo_volume_sum_end(ebpo_volume_sum *sum);

/* Of the face t, counter-clockwise seen from outside; times: 1 or -1. Corners are finite. */
void ebpo_volume_sum_add(ebpo_volume_sum *sum, const double t[3][3], int times);
void ebpo_volume_sum_merge(ebpo_volume_sum *sum, const ebpo_volume_sum *more);

/* Returns the double nearest to the volume, ties to even; infinite beyond doubles. In *scaled and
 * *exponent the volume in units of 2^exponent, in which it is about 1, rounded likewise. */
double ebpo_volume_sum_value(const ebpo_volume_sum *sum, double *scaled, int64_t *exponent);

#endif
