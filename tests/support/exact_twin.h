/* Plain rational twins of the exact predicates, and hard inputs for them. Written apart from the
 * library: nothing of it is called here. */
#ifndef EBPO_TESTS_EXACT_TWIN_H
#define EBPO_TESTS_EXACT_TWIN_H

#include <stdint.h>

#include <gmp.h>

/* Deterministic random numbers (splitmix64). */
uint64_t twin_random(uint64_t *state);
/* Uniform integer in low .. high. */
int64_t twin_integer(uint64_t *state, int64_t low, int64_t high);
/* Uniform in [-1, 1). */
double twin_uniform(uint64_t *state);

/* Signs by rational determinants; points are consecutive. */
int twin_orient2d(const double p[6]);
int twin_orient3d(const double p[12]);
int twin_sign_of_products(const double *factor, int n);

/* Fills `count` points of `dimension` (2 or 3) coordinates, count = dimension + 1, with a case of
 * the given kind. */
enum { TWIN_KINDS = 14 };
const char *twin_kind_name(int kind);
void twin_points(double *p, int dimension, int kind, uint64_t *state);

#endif
