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

/* Return signs of rational determinants; the points are consecutive. */
int reference_orient2d(const double p[6]);
int reference_orient3d(const double p[12]);
int reference_sign_of_products(const double *factor, int n);

/* Fills `count` points of `dimension` (2 or 3) coordinates, count = dimension + 1, with a case of
 * the given kind. */
enum { REFERENCE_KINDS = 14 };
const char *reference_kind_name(int kind);
void reference_points(double *p, int dimension, int kind, uint64_t *state);

#endif
