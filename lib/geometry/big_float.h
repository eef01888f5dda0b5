/* Floating-point numbers of 512 bits. Each operation has an error of at most one unit in the last
 * place. Uses GMP's functions for arrays of limbs (machine words), and allocates no memory. */
#ifndef EBPO_GEOMETRY_BIG_FLOAT_H
#define EBPO_GEOMETRY_BIG_FLOAT_H

#include <gmp.h>
#include <stdint.h>

enum { EBPO_BIG_BITS = 512, EBPO_BIG_LIMBS = EBPO_BIG_BITS / GMP_NUMB_BITS };

/* The value is sign * 2^exponent * m, where m in [1/2, 1) has the bits of `limb`. The last limb has
 * the highest bits. */
typedef struct ebpo_big {
    int sign; /* 0: the value is 0, and the other members are unused */
    int64_t exponent;
    mp_limb_t limb[EBPO_BIG_LIMBS];
} ebpo_big;

/* Converts a finite double, exactly. */
ebpo_big ebpo_big_of(double x);
/* These functions return the truncated result. The relative error is at most 2^-510. Exception: if
 * numbers of opposite signs are added, the error is at most 2^-510 of the larger operand. */
ebpo_big ebpo_big_add(const ebpo_big *a, const ebpo_big *b);
ebpo_big ebpo_big_subtract(const ebpo_big *a, const ebpo_big *b);
ebpo_big ebpo_big_multiply(const ebpo_big *a, const ebpo_big *b);
/* Returns the square root; 0 for negative numbers. */
ebpo_big ebpo_big_root(const ebpo_big *a);
/* Returns a * 2^by. */
ebpo_big ebpo_big_scale(const ebpo_big *a, int64_t by);
/* Returns a * 2^-unit as a double, rounded towards 0. Beyond the range of doubles, returns infinity
 * or 0. */
double ebpo_big_double(const ebpo_big *a, int64_t unit);

/* A complex number. */
typedef struct ebpo_big_complex {
    ebpo_big real, imaginary;
} ebpo_big_complex;

/* Returns the product, with an error of at most 2^-506 of its absolute value. */
ebpo_big_complex ebpo_big_complex_multiply(const ebpo_big_complex *a, const ebpo_big_complex *b);

#endif
