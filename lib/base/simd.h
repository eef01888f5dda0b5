/* Eight floats or four doubles at a time, in the compiler's own vectors. */
#ifndef EBPO_BASE_SIMD_H
#define EBPO_BASE_SIMD_H

#include <stdint.h>

#if defined(__SSE2__)
#include <immintrin.h>
#endif

typedef float v8f __attribute__((vector_size(32)));
typedef int32_t v8i __attribute__((vector_size(32)));
typedef double v4d __attribute__((vector_size(32)));
typedef int64_t v4l __attribute__((vector_size(32)));
/* eight floats in an array, aligned to 32 bytes */
typedef float v8f_stored __attribute__((vector_size(32), may_alias));

static inline v8f v8f_all(float x) { return (v8f){ x, x, x, x, x, x, x, x }; }
static inline v4d v4d_all(double x) { return (v4d){ x, x, x, x }; }
static inline v8f v8f_abs(v8f x) { return (v8f)((v8i)x & 0x7fffffff); }
static inline v4d v4d_abs(v4d x) { return (v4d)((v4l)x & INT64_MAX); }
static inline v8f v8f_pick(v8i mask, v8f yes, v8f no)
{
    return (v8f)(((v8i)yes & mask) | ((v8i)no & ~mask));
}

/* The greater, and the lesser; the second one when one is no number. */
#if defined(__AVX__)
static inline v8f v8f_max(v8f a, v8f b) { return (v8f)_mm256_max_ps((__m256)a, (__m256)b); }
static inline v8f v8f_min(v8f a, v8f b) { return (v8f)_mm256_min_ps((__m256)a, (__m256)b); }
static inline v8f v8f_sqrt(v8f a) { return (v8f)_mm256_sqrt_ps((__m256)a); }
static inline v8f v8f_about_inverse(v8f a) { return (v8f)_mm256_rcp_ps((__m256)a); }
static inline unsigned v8i_mask(v8i m) { return (unsigned)_mm256_movemask_ps((__m256)m); }
static inline unsigned v4l_mask(v4l m) { return (unsigned)_mm256_movemask_pd((__m256d)m); }
static inline v4d v4d_from_floats(const float *p) { return (v4d)_mm256_cvtps_pd(_mm_loadu_ps(p)); }
#elif defined(__SSE2__)
typedef union ebpo_halves {
    v8f f;
    v8i i;
    v4l l;
    v4d d;
    __m128 ps[2];
    __m128d pd[2];
} ebpo_halves;
#define EBPO_HALVES(op, a, b)                   \
    ebpo_halves x = { .f = a }, y = { .f = b }; \
    x.ps[0] = op(x.ps[0], y.ps[0]);             \
    x.ps[1] = op(x.ps[1], y.ps[1]);             \
    return x.f
static inline v8f v8f_max(v8f a, v8f b) { EBPO_HALVES(_mm_max_ps, a, b); }
static inline v8f v8f_min(v8f a, v8f b) { EBPO_HALVES(_mm_min_ps, a, b); }
static inline v8f v8f_sqrt(v8f a)
{
    ebpo_halves x = { .f = a };
    x.ps[0] = _mm_sqrt_ps(x.ps[0]);
    x.ps[1] = _mm_sqrt_ps(x.ps[1]);
    return x.f;
}
static inline v8f v8f_about_inverse(v8f a)
{
    ebpo_halves x = { .f = a };
    x.ps[0] = _mm_rcp_ps(x.ps[0]);
    x.ps[1] = _mm_rcp_ps(x.ps[1]);
    return x.f;
}
static inline unsigned v8i_mask(v8i m)
{
    ebpo_halves x = { .i = m };
    return (unsigned)(_mm_movemask_ps(x.ps[0]) | _mm_movemask_ps(x.ps[1]) << 4);
}
static inline unsigned v4l_mask(v4l m)
{
    ebpo_halves x = { .l = m };
    return (unsigned)(_mm_movemask_pd(x.pd[0]) | _mm_movemask_pd(x.pd[1]) << 2);
}
static inline v4d v4d_from_floats(const float *p)
{
    return (v4d){ (double)p[0], (double)p[1], (double)p[2], (double)p[3] };
}
#else
#include <math.h>
static inline v8f v8f_max(v8f a, v8f b) { return v8f_pick(a > b, a, b); }
static inline v8f v8f_min(v8f a, v8f b) { return v8f_pick(a < b, a, b); }
static inline v8f v8f_about_inverse(v8f a) { return 1 / a; }
static inline v8f v8f_sqrt(v8f a)
{
    for (int i = 0; i < 8; i++)
        a[i] = sqrtf(a[i]);
    return a;
}
static inline unsigned v8i_mask(v8i m)
{
    unsigned out = 0;
    for (int i = 0; i < 8; i++)
        out |= (unsigned)(m[i] < 0) << i;
    return out;
}
static inline unsigned v4l_mask(v4l m)
{
    unsigned out = 0;
    for (int i = 0; i < 4; i++)
        out |= (unsigned)(m[i] < 0) << i;
    return out;
}
static inline v4d v4d_from_floats(const float *p)
{
    return (v4d){ (double)p[0], (double)p[1], (double)p[2], (double)p[3] };
}
#endif

/* 1 / a to about 2^-22, not always the same on all processors: for filters only. No number for 0.
 */
static inline v8f v8f_inverse(v8f a)
{
    v8f x = v8f_about_inverse(a);
    return x * (2 - a * x);
}

#endif
