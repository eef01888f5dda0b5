/* Three doubles at a time, one for each axis: a register with AVX2, otherwise plain arithmetic. The
 * same bits either way. */
#ifndef EBPO_CORE_THREE_H
#define EBPO_CORE_THREE_H

#include "core/eight.h"

#if defined(__AVX2__)

typedef __m256d d3; /* the fourth is some number that nobody looks at */

EBPO_EIGHT d3 d3_all(double x) { return _mm256_set1_pd(x); }
/* One by one: what was just stored one by one is not there as a whole yet. */
EBPO_EIGHT d3 d3_load(const double x[3]) { return _mm256_setr_pd(x[0], x[1], x[2], 0); }
EBPO_EIGHT d3 d3_add(d3 a, d3 b) { return _mm256_add_pd(a, b); }
EBPO_EIGHT d3 d3_sub(d3 a, d3 b) { return _mm256_sub_pd(a, b); }
EBPO_EIGHT d3 d3_mul(d3 a, d3 b) { return _mm256_mul_pd(a, b); }
EBPO_EIGHT d3 d3_div(d3 a, d3 b) { return _mm256_div_pd(a, b); }
EBPO_EIGHT d3 d3_max(d3 a, d3 b) { return _mm256_max_pd(a, b); }
EBPO_EIGHT d3 d3_abs(d3 a) { return _mm256_andnot_pd(_mm256_set1_pd(-0.0), a); }
/* a, not negative, with the signs of b */
EBPO_EIGHT d3 d3_signed(d3 a, d3 b)
{
    return _mm256_or_pd(a, _mm256_and_pd(b, _mm256_set1_pd(-0.0)));
}
/* A bit for each that has a sign. */
EBPO_EIGHT unsigned d3_signs(d3 a) { return (unsigned)_mm256_movemask_pd(a) & 7; }
EBPO_EIGHT void d3_store(double x[4], d3 a) { _mm256_storeu_pd(x, a); }
/* As floats, rounded to nearest; of which the fourth counts for nothing. */
EBPO_EIGHT void d3_store_floats(float x[4], d3 a) { _mm_storeu_ps(x, _mm256_cvtpd_ps(a)); }
/* The same, one place later. */
EBPO_EIGHT void d3_store_floats_after(float x[4], d3 a)
{
    __m128 y = _mm256_cvtpd_ps(a);
    _mm_storeu_ps(x, _mm_shuffle_ps(y, y, _MM_SHUFFLE(2, 1, 0, 3)));
}
/* What is lost by rounding to floats. */
EBPO_EIGHT d3 d3_beyond_floats(d3 a) { return d3_sub(a, _mm256_cvtps_pd(_mm256_cvtpd_ps(a))); }

#else

typedef struct d3 {
    double x[3];
} d3;
#define EBPO_THREE(expression_of_k)   \
    d3 out;                           \
    for (int k = 0; k < 3; k++)       \
        out.x[k] = (expression_of_k); \
    return out

EBPO_EIGHT d3 d3_all(double x) { EBPO_THREE(x); }
EBPO_EIGHT d3 d3_load(const double x[3]) { EBPO_THREE(x[k]); }
EBPO_EIGHT d3 d3_add(d3 a, d3 b) { EBPO_THREE(a.x[k] + b.x[k]); }
EBPO_EIGHT d3 d3_sub(d3 a, d3 b) { EBPO_THREE(a.x[k] - b.x[k]); }
EBPO_EIGHT d3 d3_mul(d3 a, d3 b) { EBPO_THREE(a.x[k] * b.x[k]); }
EBPO_EIGHT d3 d3_div(d3 a, d3 b) { EBPO_THREE(a.x[k] / b.x[k]); }
EBPO_EIGHT d3 d3_max(d3 a, d3 b) { EBPO_THREE(a.x[k] > b.x[k] ? a.x[k] : b.x[k]); }
EBPO_EIGHT d3 d3_abs(d3 a) { EBPO_THREE(__builtin_fabs(a.x[k])); }
EBPO_EIGHT d3 d3_signed(d3 a, d3 b) { EBPO_THREE(__builtin_copysign(a.x[k], b.x[k])); }
EBPO_EIGHT unsigned d3_signs(d3 a)
{
    unsigned bits = 0;
    for (unsigned k = 0; k < 3; k++)
        bits |= (unsigned)(__builtin_signbit(a.x[k]) != 0) << k;
    return bits;
}
EBPO_EIGHT void d3_store(double x[4], d3 a) { memcpy(x, a.x, sizeof a.x); }
EBPO_EIGHT void d3_store_floats(float x[4], d3 a)
{
    f4 y = { (float)a.x[0], (float)a.x[1], (float)a.x[2], 0 };
    memcpy(x, &y, sizeof y);
}
EBPO_EIGHT void d3_store_floats_after(float x[4], d3 a)
{
    f4 y = { 0, (float)a.x[0], (float)a.x[1], (float)a.x[2] };
    memcpy(x, &y, sizeof y);
}
EBPO_EIGHT d3 d3_beyond_floats(d3 a) { EBPO_THREE(a.x[k] - (double)(float)a.x[k]); }
#undef EBPO_THREE
#endif

#endif
