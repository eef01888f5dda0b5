/* Four doubles at a time, in the compiler's own vectors. */
#ifndef EBPO_CORE_SIMD_H
#define EBPO_CORE_SIMD_H

#include <stdint.h>

#if defined(__SSE2__)
#include <immintrin.h>
#endif

typedef double v4d __attribute__((vector_size(32)));
typedef int64_t v4l __attribute__((vector_size(32)));

static inline v4d v4d_all(double x) { return (v4d){ x, x, x, x }; }

#if defined(__AVX__)
static inline unsigned v4l_mask(v4l m) { return (unsigned)_mm256_movemask_pd((__m256d)m); }
#elif defined(__SSE2__)
static inline unsigned v4l_mask(v4l m)
{
    union {
        v4l l;
        __m128d pd[2];
    } x = { .l = m };
    return (unsigned)(_mm_movemask_pd(x.pd[0]) | _mm_movemask_pd(x.pd[1]) << 2);
}
#else
static inline unsigned v4l_mask(v4l m)
{
    unsigned out = 0;
    for (int i = 0; i < 4; i++)
        out |= (unsigned)(m[i] < 0) << i;
    return out;
}
#endif

#endif
