/* Triangle against cell in rationals (GMP): the last word where floating point cannot tell. Slow; pure; any thread. */
#ifndef EBPO_VERIFY_EXACT_H
#define EBPO_VERIFY_EXACT_H

#include <stdbool.h>
#include <stdint.h>

/* True when the closed triangle p meets the closed box [low, high]. */
bool ebpo_exact_touches(const double low[3], const double high[3], const double p[3][3]);

/* True when every point of the triangle in the closed box satisfies 4096 * (n . xi) <= d, xi = (point - low) / (high - low). */
bool ebpo_exact_half_space(const double low[3], const double high[3], const double p[3][3], const int32_t n[3], int32_t d);

#endif
