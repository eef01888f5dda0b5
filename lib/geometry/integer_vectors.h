/* Vectors of integers of any size, for cases that floating-point arithmetic does not decide.
 * Coordinates are in units of a power of two. GMP ends the program when memory is short. All
 * functions are pure and may be called by any thread. */
#ifndef EBPO_GEOMETRY_INTEGER_VECTORS_H
#define EBPO_GEOMETRY_INTEGER_VECTORS_H

#include <gmp.h>

typedef struct ebpo_vectorz {
    mpz_t x[3];
} ebpo_vectorz;

void ebpo_vectorz_init(ebpo_vectorz *v);
void ebpo_vectorz_clear(ebpo_vectorz *v);
void ebpo_vectorz_subtract(ebpo_vectorz *out, const ebpo_vectorz *a, const ebpo_vectorz *b);
void ebpo_vectorz_dot(mpz_t out, const ebpo_vectorz *a, const ebpo_vectorz *b);
/* Computes a x b; `out` is neither a nor b. */
void ebpo_vectorz_cross(ebpo_vectorz *out, const ebpo_vectorz *a, const ebpo_vectorz *b);

/* Returns the greatest e, not above `unit`, for which all numbers are multiples of 2^e. For the
 * first numbers, `unit` is EBPO_UNIT_OF_ZEROS. */
enum { EBPO_UNIT_OF_ZEROS = 0x7fffffff - 64 };
int ebpo_common_unit(const double *x, int n, int unit);

/* Computes out = x / 2^unit. */
void ebpo_set_integer(mpz_t out, double x, int unit);

/* Returns sqrt(square / denominator) * 2^unit, rounded to the nearest double, ties to even. Returns
 * INFINITY if the result is beyond the range of doubles. */
double ebpo_round_root(const mpz_t square, const mpz_t denominator, int unit);

/* Returns (numerator / denominator) * 2^unit, rounded in the same way; denominator > 0. */
double ebpo_round_quotient(const mpz_t numerator, const mpz_t denominator, int unit);

#endif
