/* Rational reference implementations of the exact predicates, and hard inputs for them. Independent
 * of the library: calls none of its code. */
#ifndef EBPO_TESTS_EXACT_REFERENCE_H
#define EBPO_TESTS_EXACT_REFERENCE_H

#include <stdint.h>

#include <gmp.h>

/* Returns deterministic random numbers (splitmix64). */
uint64_t reference_random(uint64_t *state);
/* Returns a uniform integer in low .. high. */
int64_t reference_integer(uint64_t *state, int64_t low, int64_t high);
/* Returns a uniform value in [-1, 1). */
double reference_uniform(uint64_t *state);

/* Return the exact sign, -1, 0 or 1, by rational arithmetic. p: the coordinates of all points, one
 * point after the other. The last function returns the sign of the sum of the n products
 * factor[0] * factor[1] + factor[2] * factor[3] + ... */
int reference_orient2d(const double p[6]);
int reference_orient3d(const double p[12]);
int reference_sign_of_products(const double *factor, int n);

enum { REFERENCE_KINDS = 14 };
const char *reference_kind_name(int kind);
/* Fills p with dimension + 1 points of `dimension` (2 or 3) coordinates: a random case of `kind`,
 * which is below REFERENCE_KINDS. */
void reference_points(double *p, int dimension, int kind, uint64_t *state);

#endif
