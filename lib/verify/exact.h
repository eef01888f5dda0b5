/* Triangle against cell in rationals (GMP): the last word where floating point cannot tell. Slow;
 * pure; any thread. */
#ifndef EBPO_VERIFY_EXACT_H
#define EBPO_VERIFY_EXACT_H

#include <stdbool.h>
#include <stdint.h>

/* A face: corners in the model's coordinates, exact. */
typedef struct ebpo_corners {
    double at[3][3];
} ebpo_corners;

/* True when the closed face meets the closed box [low, high]. */
bool ebpo_exact_touches(const double low[3], const double high[3], const ebpo_corners *face);

/* True when every point of the face in the closed box satisfies 4096 * (n . xi) <= d, xi = (point -
 * low) / (high - low). */
bool ebpo_exact_half_space(const double low[3], const double high[3], const ebpo_corners *face,
                           const int32_t n[3], int32_t d);

#endif
