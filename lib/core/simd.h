/* Provides vector types for kernels (core/cpu.h): f8 is eight floats, v4d is four doubles, and d3
 * is three doubles, one for each axis. A lane is one of these numbers. An f8 is one register with
 * AVX2, otherwise two vectors of 16 bytes (gcc 12 generates poor code for 32-byte vectors without
 * AVX2). A mask has all bits of a lane set (true) or clear (false).
 *
 * f8_all(x): x in all lanes. f8_load_twice(x): x[0] to x[3] in lanes 0 to 3 and 4 to 7; f8_spread0
 * to f8_spread3 of this vector: one of these four floats in all lanes. f8_pick(mask, yes, no): a
 * lane has the float of `yes` if the mask is set in this lane, else the float of `no`.
 * f8_bits(mask): bit i is set if lane i of the mask is set. f8_about_inverse(a): a rough
 * approximation of 1 / a. */
#ifndef EBPO_CORE_SIMD_H
#define EBPO_CORE_SIMD_H

#include <stdint.h>
#include <string.h>

/* EBPO_PORTABLE_SIMD: tests compile the functions for machines without vectors. */
#if defined(EBPO_PORTABLE_SIMD)
#elif defined(__SSE2__)
#include <immintrin.h>
#define EBPO_SIMD_SSE2
#if defined(__AVX2__)
#define EBPO_SIMD_AVX2
#endif
#elif defined(__wasm_simd128__)
#include <wasm_simd128.h>
#define EBPO_SIMD_WASM
#elif defined(__aarch64__)
#include <arm_neon.h>
#define EBPO_SIMD_NEON
#endif

#define EBPO_EIGHT static inline __attribute__((always_inline))

#if defined(EBPO_SIMD_AVX2)

typedef __m256 f8;

EBPO_EIGHT f8 f8_all(float x) { return _mm256_set1_ps(x); }
EBPO_EIGHT f8 f8_load(const float *x) { return _mm256_loadu_ps(x); }
EBPO_EIGHT f8 f8_load_twice(const float *x) { return _mm256_broadcast_ps((const __m128 *)x); }
EBPO_EIGHT f8 f8_spread0(f8 a) { return _mm256_permute_ps(a, 0x00); }
EBPO_EIGHT f8 f8_spread1(f8 a) { return _mm256_permute_ps(a, 0x55); }
EBPO_EIGHT f8 f8_spread2(f8 a) { return _mm256_permute_ps(a, 0xaa); }
EBPO_EIGHT f8 f8_spread3(f8 a) { return _mm256_permute_ps(a, 0xff); }
EBPO_EIGHT void f8_store(float *x, f8 a) { _mm256_storeu_ps(x, a); }
EBPO_EIGHT f8 f8_add(f8 a, f8 b) { return _mm256_add_ps(a, b); }
EBPO_EIGHT f8 f8_sub(f8 a, f8 b) { return _mm256_sub_ps(a, b); }
EBPO_EIGHT f8 f8_mul(f8 a, f8 b) { return _mm256_mul_ps(a, b); }
EBPO_EIGHT f8 f8_div(f8 a, f8 b) { return _mm256_div_ps(a, b); }
EBPO_EIGHT f8 f8_min(f8 a, f8 b) { return _mm256_min_ps(a, b); }
EBPO_EIGHT f8 f8_max(f8 a, f8 b) { return _mm256_max_ps(a, b); }
EBPO_EIGHT f8 f8_sqrt(f8 a) { return _mm256_sqrt_ps(a); }
EBPO_EIGHT f8 f8_about_inverse(f8 a) { return _mm256_rcp_ps(a); }
EBPO_EIGHT f8 f8_less(f8 a, f8 b) { return _mm256_cmp_ps(a, b, _CMP_LT_OQ); }
EBPO_EIGHT f8 f8_at_most(f8 a, f8 b) { return _mm256_cmp_ps(a, b, _CMP_LE_OQ); }
EBPO_EIGHT f8 f8_and(f8 a, f8 b) { return _mm256_and_ps(a, b); }
EBPO_EIGHT f8 f8_or(f8 a, f8 b) { return _mm256_or_ps(a, b); }
EBPO_EIGHT f8 f8_xor(f8 a, f8 b) { return _mm256_xor_ps(a, b); }
EBPO_EIGHT f8 f8_pick(f8 mask, f8 yes, f8 no) { return _mm256_blendv_ps(no, yes, mask); }
EBPO_EIGHT unsigned f8_bits(f8 mask) { return (unsigned)_mm256_movemask_ps(mask); }
/* Returns x[from[0]], x[from[1]], ...; all of x[0] to x[7] may be read. */
EBPO_EIGHT f8 f8_load_lanes(const float *x, const int32_t *from)
{
    return _mm256_permutevar8x32_ps(_mm256_loadu_ps(x), _mm256_loadu_si256((const __m256i *)from));
}
/* Returns a mask in which lane i is set if bit i of `lanes` is set. */
EBPO_EIGHT f8 f8_mask(unsigned lanes)
{
    __m256i bit = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128),
            on = _mm256_and_si256(_mm256_set1_epi32((int)lanes), bit);
    return _mm256_castsi256_ps(_mm256_cmpeq_epi32(on, bit));
}
EBPO_EIGHT f8 f8_abs(f8 a)
{
    return _mm256_and_ps(a, _mm256_castsi256_ps(_mm256_set1_epi32(0x7fffffff)));
}
/* Eight numbers below 16, which select from the 16 floats of an f8_table (f8_look_up). */
typedef struct n8 {
    /* low: the numbers; only their lower three bits are used. high: a lane's upper bit is set if
     * its number is at least 8 */
    __m256i low, high;
} n8;
typedef struct f8_table {
    f8 low, high; /* floats 0 to 7, floats 8 to 15 */
} f8_table;
EBPO_EIGHT n8 n8_from_bits(uint32_t bits)
{
    __m256i x = _mm256_srlv_epi32(_mm256_set1_epi32((int)bits),
                                  _mm256_setr_epi32(0, 4, 8, 12, 16, 20, 24, 28));
    return (n8){ x, _mm256_slli_epi32(x, 28) };
}
EBPO_EIGHT f8_table f8_table_load(const float *x)
{
    return (f8_table){ f8_load(x), f8_load(x + 8) };
}
EBPO_EIGHT f8 f8_look_up(f8_table t, n8 at)
{
    return f8_pick(_mm256_castsi256_ps(at.high), _mm256_permutevar8x32_ps(t.high, at.low),
                   _mm256_permutevar8x32_ps(t.low, at.low));
}
EBPO_EIGHT f8 f8_from_bytes(const uint8_t *x)
{
    return _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)x)));
}
EBPO_EIGHT f8 f8_from_shorts(const int16_t *x)
{
    return _mm256_cvtepi32_ps(_mm256_cvtepi16_epi32(_mm_loadu_si128((const __m128i *)x)));
}

#else

typedef float f4 __attribute__((vector_size(16)));
typedef int32_t i4 __attribute__((vector_size(16)));
typedef struct f8 {
    f4 half[2];
} f8;
#define EBPO_BOTH(expression_of_h)           \
    f8 out;                                  \
    for (int h = 0; h < 2; h++)              \
        out.half[h] = (f4)(expression_of_h); \
    return out

EBPO_EIGHT f8 f8_all(float x) { EBPO_BOTH(((f4){ x, x, x, x })); }
EBPO_EIGHT f8 f8_load(const float *x)
{
    f8 out;
    memcpy(&out, x, sizeof out);
    return out;
}
EBPO_EIGHT f8 f8_load_twice(const float *x)
{
    f4 a;
    memcpy(&a, x, sizeof a);
    return (f8){ { a, a } };
}
EBPO_EIGHT f8 f8_load_lanes(const float *x, const int32_t *from)
{
    return (f8){ { { x[from[0]], x[from[1]], x[from[2]], x[from[3]] },
                   { x[from[4]], x[from[5]], x[from[6]], x[from[7]] } } };
}
EBPO_EIGHT void f8_store(float *x, f8 a) { memcpy(x, &a, sizeof a); }
EBPO_EIGHT f8 f8_add(f8 a, f8 b) { EBPO_BOTH(a.half[h] + b.half[h]); }
EBPO_EIGHT f8 f8_sub(f8 a, f8 b) { EBPO_BOTH(a.half[h] - b.half[h]); }
EBPO_EIGHT f8 f8_mul(f8 a, f8 b) { EBPO_BOTH(a.half[h] * b.half[h]); }
EBPO_EIGHT f8 f8_div(f8 a, f8 b) { EBPO_BOTH(a.half[h] / b.half[h]); }
EBPO_EIGHT f8 f8_less(f8 a, f8 b) { EBPO_BOTH(a.half[h] < b.half[h]); }
EBPO_EIGHT f8 f8_at_most(f8 a, f8 b) { EBPO_BOTH(a.half[h] <= b.half[h]); }
EBPO_EIGHT f8 f8_and(f8 a, f8 b) { EBPO_BOTH((i4)a.half[h] & (i4)b.half[h]); }
EBPO_EIGHT f8 f8_or(f8 a, f8 b) { EBPO_BOTH((i4)a.half[h] | (i4)b.half[h]); }
EBPO_EIGHT f8 f8_xor(f8 a, f8 b) { EBPO_BOTH((i4)a.half[h] ^ (i4)b.half[h]); }
EBPO_EIGHT f8 f8_mask(unsigned lanes)
{
    EBPO_BOTH((((int32_t)lanes >> 4 * h) & (i4){ 1, 2, 4, 8 }) != 0);
}
EBPO_EIGHT f8 f8_abs(f8 a) { EBPO_BOTH((i4)a.half[h] & 0x7fffffff); }
EBPO_EIGHT f8 f8_pick(f8 mask, f8 yes, f8 no)
{
    EBPO_BOTH(((i4)yes.half[h] & (i4)mask.half[h]) | ((i4)no.half[h] & ~(i4)mask.half[h]));
}

/* Eight numbers below 16, which select from the 16 floats of an f8_table (f8_look_up). */
typedef struct n8 {
    uint32_t bits; /* four bits for each number */
} n8;
typedef struct f8_table {
    const float *x;
} f8_table;
EBPO_EIGHT n8 n8_from_bits(uint32_t bits) { return (n8){ bits }; }
EBPO_EIGHT f8_table f8_table_load(const float *x) { return (f8_table){ x }; }
EBPO_EIGHT f8 f8_look_up(f8_table t, n8 at)
{
    EBPO_BOTH(((f4){ t.x[at.bits >> 16 * h & 15], t.x[at.bits >> (16 * h + 4) & 15],
                     t.x[at.bits >> (16 * h + 8) & 15], t.x[at.bits >> (16 * h + 12) & 15] }));
}

#if defined(EBPO_SIMD_SSE2)
EBPO_EIGHT f8 f8_min(f8 a, f8 b) { EBPO_BOTH(_mm_min_ps(a.half[h], b.half[h])); }
EBPO_EIGHT f8 f8_max(f8 a, f8 b) { EBPO_BOTH(_mm_max_ps(a.half[h], b.half[h])); }
EBPO_EIGHT f8 f8_sqrt(f8 a) { EBPO_BOTH(_mm_sqrt_ps(a.half[h])); }
EBPO_EIGHT f8 f8_about_inverse(f8 a) { EBPO_BOTH(_mm_rcp_ps(a.half[h])); }
EBPO_EIGHT unsigned f8_bits(f8 mask)
{
    return (unsigned)(_mm_movemask_ps(mask.half[0]) | _mm_movemask_ps(mask.half[1]) << 4);
}
EBPO_EIGHT f8 f8_spread0(f8 a) { EBPO_BOTH(_mm_shuffle_ps(a.half[h], a.half[h], 0x00)); }
EBPO_EIGHT f8 f8_spread1(f8 a) { EBPO_BOTH(_mm_shuffle_ps(a.half[h], a.half[h], 0x55)); }
EBPO_EIGHT f8 f8_spread2(f8 a) { EBPO_BOTH(_mm_shuffle_ps(a.half[h], a.half[h], 0xaa)); }
EBPO_EIGHT f8 f8_spread3(f8 a) { EBPO_BOTH(_mm_shuffle_ps(a.half[h], a.half[h], 0xff)); }
EBPO_EIGHT f8 f8_from_bytes(const uint8_t *x)
{
    __m128i none = _mm_setzero_si128(),
            words = _mm_unpacklo_epi8(_mm_loadl_epi64((const __m128i *)x), none);
    return (f8){ { _mm_cvtepi32_ps(_mm_unpacklo_epi16(words, none)),
                   _mm_cvtepi32_ps(_mm_unpackhi_epi16(words, none)) } };
}
EBPO_EIGHT f8 f8_from_shorts(const int16_t *x)
{
    __m128i words = _mm_loadu_si128((const __m128i *)x);
    return (f8){ { _mm_cvtepi32_ps(_mm_srai_epi32(_mm_unpacklo_epi16(words, words), 16)),
                   _mm_cvtepi32_ps(_mm_srai_epi32(_mm_unpackhi_epi16(words, words), 16)) } };
}
#elif defined(EBPO_SIMD_WASM)
/* The pseudo-minimum of WebAssembly returns the second operand if it is less, else the first
 * operand. The calls swap the operands, because the minimum of SSE returns its second operand,
 * except if the first operand is less. */
EBPO_EIGHT f8 f8_min(f8 a, f8 b)
{
    EBPO_BOTH(wasm_f32x4_pmin((v128_t)b.half[h], (v128_t)a.half[h]));
}
EBPO_EIGHT f8 f8_max(f8 a, f8 b)
{
    EBPO_BOTH(wasm_f32x4_pmax((v128_t)b.half[h], (v128_t)a.half[h]));
}
EBPO_EIGHT f8 f8_sqrt(f8 a) { EBPO_BOTH(wasm_f32x4_sqrt((v128_t)a.half[h])); }
EBPO_EIGHT f8 f8_about_inverse(f8 a) { return f8_div(f8_all(1), a); }
EBPO_EIGHT unsigned f8_bits(f8 mask)
{
    return (unsigned)(wasm_i32x4_bitmask((v128_t)mask.half[0]) |
                      wasm_i32x4_bitmask((v128_t)mask.half[1]) << 4);
}
#define EBPO_SPREAD(a, lane) \
    EBPO_BOTH(__builtin_shufflevector((a).half[h], (a).half[h], lane, lane, lane, lane))
EBPO_EIGHT f8 f8_spread0(f8 a) { EBPO_SPREAD(a, 0); }
EBPO_EIGHT f8 f8_spread1(f8 a) { EBPO_SPREAD(a, 1); }
EBPO_EIGHT f8 f8_spread2(f8 a) { EBPO_SPREAD(a, 2); }
EBPO_EIGHT f8 f8_spread3(f8 a) { EBPO_SPREAD(a, 3); }
#undef EBPO_SPREAD
EBPO_EIGHT f8 f8_from_bytes(const uint8_t *x)
{
    v128_t words = wasm_u16x8_load8x8(x);
    return (f8){ { (f4)wasm_f32x4_convert_i32x4(wasm_u32x4_extend_low_u16x8(words)),
                   (f4)wasm_f32x4_convert_i32x4(wasm_u32x4_extend_high_u16x8(words)) } };
}
EBPO_EIGHT f8 f8_from_shorts(const int16_t *x)
{
    EBPO_BOTH(wasm_f32x4_convert_i32x4(wasm_i32x4_load16x4(x + 4 * h)));
}
#elif defined(EBPO_SIMD_NEON)
/* The minimum of NEON differs for NaN and for zeros of both signs, so a comparison selects. */
EBPO_EIGHT f8 f8_min(f8 a, f8 b) { return f8_pick(f8_less(a, b), a, b); }
EBPO_EIGHT f8 f8_max(f8 a, f8 b) { return f8_pick(f8_less(b, a), a, b); }
EBPO_EIGHT f8 f8_sqrt(f8 a) { EBPO_BOTH(vsqrtq_f32((float32x4_t)a.half[h])); }
EBPO_EIGHT f8 f8_about_inverse(f8 a) { return f8_div(f8_all(1), a); }
EBPO_EIGHT unsigned f8_bits(f8 mask)
{
    const int32x4_t first = { 1, 2, 4, 8 };
    int32x4_t low = vandq_s32(vshrq_n_s32((int32x4_t)mask.half[0], 31), first),
              high = vandq_s32(vshrq_n_s32((int32x4_t)mask.half[1], 31), vshlq_n_s32(first, 4));
    return (unsigned)vaddvq_s32(vorrq_s32(low, high));
}
EBPO_EIGHT f8 f8_spread0(f8 a) { EBPO_BOTH(vdupq_laneq_f32((float32x4_t)a.half[h], 0)); }
EBPO_EIGHT f8 f8_spread1(f8 a) { EBPO_BOTH(vdupq_laneq_f32((float32x4_t)a.half[h], 1)); }
EBPO_EIGHT f8 f8_spread2(f8 a) { EBPO_BOTH(vdupq_laneq_f32((float32x4_t)a.half[h], 2)); }
EBPO_EIGHT f8 f8_spread3(f8 a) { EBPO_BOTH(vdupq_laneq_f32((float32x4_t)a.half[h], 3)); }
EBPO_EIGHT f8 f8_from_bytes(const uint8_t *x)
{
    uint16x8_t words = vmovl_u8(vld1_u8(x));
    return (f8){ { (f4)vcvtq_f32_u32(vmovl_u16(vget_low_u16(words))),
                   (f4)vcvtq_f32_u32(vmovl_high_u16(words)) } };
}
EBPO_EIGHT f8 f8_from_shorts(const int16_t *x)
{
    EBPO_BOTH(vcvtq_f32_s32(vmovl_s16(vld1_s16(x + 4 * h))));
}
#else
#include <math.h>
EBPO_EIGHT f8 f8_min(f8 a, f8 b) { return f8_pick(f8_less(a, b), a, b); }
EBPO_EIGHT f8 f8_max(f8 a, f8 b) { return f8_pick(f8_less(b, a), a, b); }
EBPO_EIGHT f8 f8_about_inverse(f8 a) { return f8_div(f8_all(1), a); }
EBPO_EIGHT f8 f8_spread0(f8 a) { return f8_all(a.half[0][0]); }
EBPO_EIGHT f8 f8_spread1(f8 a) { return f8_all(a.half[0][1]); }
EBPO_EIGHT f8 f8_spread2(f8 a) { return f8_all(a.half[0][2]); }
EBPO_EIGHT f8 f8_spread3(f8 a) { return f8_all(a.half[0][3]); }
EBPO_EIGHT f8 f8_sqrt(f8 a)
{
    for (int i = 0; i < 8; i++)
        a.half[i / 4][i % 4] = sqrtf(a.half[i / 4][i % 4]);
    return a;
}
EBPO_EIGHT unsigned f8_bits(f8 mask)
{
    unsigned out = 0;
    for (int i = 0; i < 8; i++)
        out |= (unsigned)(((i4)mask.half[i / 4])[i % 4] < 0) << i;
    return out;
}
EBPO_EIGHT f8 f8_from_bytes(const uint8_t *x)
{
    f8 out;
    for (int i = 0; i < 8; i++)
        out.half[i / 4][i % 4] = x[i];
    return out;
}
EBPO_EIGHT f8 f8_from_shorts(const int16_t *x)
{
    f8 out;
    for (int i = 0; i < 8; i++)
        out.half[i / 4][i % 4] = x[i];
    return out;
}
#endif
#endif

EBPO_EIGHT f8 f8_min3(f8 a, f8 b, f8 c) { return f8_min(a, f8_min(b, c)); }
EBPO_EIGHT f8 f8_max3(f8 a, f8 b, f8 c) { return f8_max(a, f8_max(b, c)); }

/* Returns a * b + c, and a * b - c, rounded once or twice. Results differ between processors, so
 * use these functions only for filters. */
#if defined(EBPO_SIMD_AVX2) && defined(__FMA__)
EBPO_EIGHT f8 f8_mul_add(f8 a, f8 b, f8 c) { return _mm256_fmadd_ps(a, b, c); }
EBPO_EIGHT f8 f8_mul_sub(f8 a, f8 b, f8 c) { return _mm256_fmsub_ps(a, b, c); }
#else
EBPO_EIGHT f8 f8_mul_add(f8 a, f8 b, f8 c) { return f8_add(f8_mul(a, b), c); }
EBPO_EIGHT f8 f8_mul_sub(f8 a, f8 b, f8 c) { return f8_sub(f8_mul(a, b), c); }
#endif

/* Returns 1 / a with a relative error of about 2^-22; NaN if a is 0. Results differ between
 * processors, so use this function only for filters. */
EBPO_EIGHT f8 f8_inverse(f8 a)
{
    f8 x = f8_about_inverse(a);
    return f8_mul(x, f8_sub(f8_all(2), f8_mul(a, x)));
}

/* Returns the least of the eight floats. No float may be NaN. */
EBPO_EIGHT float f8_least(f8 a)
{
#if defined(EBPO_SIMD_AVX2)
    __m128 x = _mm_min_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps(a, 1));
    x = _mm_min_ps(x, _mm_movehl_ps(x, x));
    return _mm_cvtss_f32(_mm_min_ss(x, _mm_movehdup_ps(x)));
#elif defined(EBPO_SIMD_SSE2)
    __m128 x = _mm_min_ps(a.half[0], a.half[1]);
    x = _mm_min_ps(x, _mm_movehl_ps(x, x));
    return _mm_cvtss_f32(_mm_min_ss(x, _mm_shuffle_ps(x, x, 1)));
#elif defined(EBPO_SIMD_NEON)
    return vminvq_f32(vminq_f32((float32x4_t)a.half[0], (float32x4_t)a.half[1]));
#else
    float least = a.half[0][0];
    for (int i = 1; i < 8; i++)
        least = a.half[i / 4][i % 4] < least ? a.half[i / 4][i % 4] : least;
    return least;
#endif
}

/* Four doubles at a time, in the compiler's own vectors. The warning about the ABI of such vectors
 * is switched off: all functions are inline, so no vector is passed in a call. */

#if !defined(__clang__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpsabi"
#endif

typedef double v4d __attribute__((vector_size(32)));
typedef int64_t v4l __attribute__((vector_size(32)));

static inline v4d v4d_all(double x) { return (v4d){ x, x, x, x }; }

/* v4l_mask returns bit i set if lane i of a mask is set. */

#if defined(EBPO_SIMD_AVX2)
static inline unsigned v4l_mask(v4l m) { return (unsigned)_mm256_movemask_pd((__m256d)m); }
#elif defined(EBPO_SIMD_SSE2)
static inline unsigned v4l_mask(v4l m)
{
    union {
        v4l l;
        __m128d pd[2];
    } x = { .l = m };
    return (unsigned)(_mm_movemask_pd(x.pd[0]) | _mm_movemask_pd(x.pd[1]) << 2);
}
#elif defined(EBPO_SIMD_WASM)
static inline unsigned v4l_mask(v4l m)
{
    union {
        v4l l;
        v128_t half[2];
    } x = { .l = m };
    return (unsigned)(wasm_i64x2_bitmask(x.half[0]) | wasm_i64x2_bitmask(x.half[1]) << 2);
}
#elif defined(EBPO_SIMD_NEON)
static inline unsigned v4l_mask(v4l m)
{
    union {
        v4l l;
        int32x4_t half[2];
    } x = { .l = m };
    const int32x4_t bit = { 1, 2, 4, 8 };
    int32x4_t high_words = vuzp2q_s32(x.half[0], x.half[1]);
    return (unsigned)vaddvq_s32(vandq_s32(vshrq_n_s32(high_words, 31), bit));
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

EBPO_EIGHT v4d v4d_abs(v4d a) { return (v4d)((v4l)a & INT64_MAX); }
/* v4d_signed: `a`, which is not negative, with the signs of b. v4d_max and v4d_min return b in
 * lanes with a NaN. */
EBPO_EIGHT v4d v4d_signed(v4d a, v4d b) { return (v4d)((v4l)a | ((v4l)b & INT64_MIN)); }
EBPO_EIGHT v4d v4d_pick(v4l mask, v4d yes, v4d no)
{
    return (v4d)(((v4l)yes & mask) | ((v4l)no & ~mask));
}
#if defined(EBPO_SIMD_AVX2)
EBPO_EIGHT v4d v4d_max(v4d a, v4d b) { return (v4d)_mm256_max_pd((__m256d)a, (__m256d)b); }
EBPO_EIGHT v4d v4d_min(v4d a, v4d b) { return (v4d)_mm256_min_pd((__m256d)a, (__m256d)b); }
#else
EBPO_EIGHT v4d v4d_max(v4d a, v4d b) { return v4d_pick(a > b, a, b); }
EBPO_EIGHT v4d v4d_min(v4d a, v4d b) { return v4d_pick(a < b, a, b); }
#endif
/* Returns the greatest of the four doubles. */
EBPO_EIGHT double v4d_greatest(v4d a)
{
    double x = a[0] > a[1] ? a[0] : a[1], y = a[2] > a[3] ? a[2] : a[3];
    return x > y ? x : y;
}

/* Returns eight doubles, `low` in lanes 0 to 3, rounded to nearest. */
EBPO_EIGHT f8 f8_from_doubles(v4d low, v4d high)
{
#if defined(EBPO_SIMD_AVX2)
    return _mm256_set_m128(_mm256_cvtpd_ps((__m256d)high), _mm256_cvtpd_ps((__m256d)low));
#else
    return (f8){ { __builtin_convertvector(low, f4), __builtin_convertvector(high, f4) } };
#endif
}

#if !defined(__clang__)
#pragma GCC diagnostic pop
#endif

/* Three doubles at a time, one for each axis: a register with AVX2, otherwise plain arithmetic,
 * with the same bits. */

#if defined(EBPO_SIMD_AVX2)

typedef __m256d d3; /* the fourth lane is unused */

EBPO_EIGHT d3 d3_all(double x) { return _mm256_set1_pd(x); }
EBPO_EIGHT d3 d3_load(const double x[3])
{
    return _mm256_insertf128_pd(_mm256_castpd128_pd256(_mm_loadu_pd(x)), _mm_loaddup_pd(x + 2), 1);
}
EBPO_EIGHT d3 d3_add(d3 a, d3 b) { return _mm256_add_pd(a, b); }
EBPO_EIGHT d3 d3_sub(d3 a, d3 b) { return _mm256_sub_pd(a, b); }
EBPO_EIGHT d3 d3_mul(d3 a, d3 b) { return _mm256_mul_pd(a, b); }
EBPO_EIGHT d3 d3_div(d3 a, d3 b) { return _mm256_div_pd(a, b); }
EBPO_EIGHT d3 d3_max(d3 a, d3 b) { return _mm256_max_pd(a, b); }
EBPO_EIGHT d3 d3_abs(d3 a) { return _mm256_andnot_pd(_mm256_set1_pd(-0.0), a); }
/* Returns the components of `a` with the signs of the components of `b`. No component of `a` may be
 * negative. */
EBPO_EIGHT d3 d3_signed(d3 a, d3 b)
{
    return _mm256_or_pd(a, _mm256_and_pd(b, _mm256_set1_pd(-0.0)));
}
/* Returns a bit for each component with its sign bit set. */
EBPO_EIGHT unsigned d3_signs(d3 a) { return (unsigned)_mm256_movemask_pd(a) & 7; }
/* Returns the greatest component. */
EBPO_EIGHT double d3_greatest(d3 a)
{
    __m128d x = _mm256_castpd256_pd128(a), z = _mm256_extractf128_pd(a, 1);
    return _mm_cvtsd_f64(_mm_max_sd(_mm_max_sd(x, _mm_unpackhi_pd(x, x)), z));
}
EBPO_EIGHT void d3_store(double x[4], d3 a) { _mm256_storeu_pd(x, a); }
/* Stores as floats, rounded to nearest, to x[0] .. x[2]; also overwrites x[3]. */
EBPO_EIGHT void d3_store_floats(float x[4], d3 a) { _mm_storeu_ps(x, _mm256_cvtpd_ps(a)); }
/* Stores as d3_store_floats does, but to x[1] .. x[3]; also overwrites x[0]. */
EBPO_EIGHT void d3_store_floats_after(float x[4], d3 a)
{
    __m128 y = _mm256_cvtpd_ps(a);
    _mm_storeu_ps(x, _mm_shuffle_ps(y, y, _MM_SHUFFLE(2, 1, 0, 3)));
}
/* Returns the rounding errors of the conversion to floats: `a` minus the floats. */
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
EBPO_EIGHT double d3_greatest(d3 a)
{
    double x = a.x[0] > a.x[1] ? a.x[0] : a.x[1];
    return x > a.x[2] ? x : a.x[2];
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
