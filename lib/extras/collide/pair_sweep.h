/* Two faces of which one moves along a direction: until when they have a common point
 * (docs/develop/collision.md, "The way out"). For every finite double, faces without area included.
 * Pure functions, any thread; results are the same with every compiler and its flags. */
#ifndef EBPO_COLLIDE_PAIR_SWEEP_H
#define EBPO_COLLIDE_PAIR_SWEEP_H

#include <gmp.h>
#include <stdbool.h>

/* numerator / denominator * 2^unit, denominator > 0; or never. */
typedef struct ebpo_sweep_time {
    mpz_t numerator, denominator;
    int unit;
    bool ever;
} ebpo_sweep_time;

void ebpo_sweep_time_init(ebpo_sweep_time *t); /* never */
void ebpo_sweep_time_clear(ebpo_sweep_time *t);
/* Sign of x - y; never is less than all. */
int ebpo_sweep_time_compare(const ebpo_sweep_time *x, const ebpo_sweep_time *y);
/* The nearest double, ties to even; -INFINITY: never. */
double ebpo_sweep_time_round(const ebpo_sweep_time *t);

/* The greatest t, also less than 0, for which `a` moved by t * direction and `b` have a common
 * point. The direction is not 0. Allocates through GMP. */
void ebpo_sweep_last(const double a[3][3], const double b[3][3], const double direction[3],
                     ebpo_sweep_time *out);

/* At least the greatest such t within 0 .. limit; less than 0: certainly none is there. The
 * direction's greatest component is within 1/2 .. 2 in size; limit may be INFINITY. */
double ebpo_sweep_most(const double a[3][3], const double b[3][3], const double direction[3],
                       double limit);

#endif
