/* Sums millions of doubles exactly and rounds only the result, so the result does not depend on the
 * order of the terms. Uses a fixed-point number wide enough for all doubles, in limbs of 32 bits
 * with delayed carries (Kulisch's long accumulator). */
#ifndef EBPO_MESH_SUM_H
#define EBPO_MESH_SUM_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "core/wide.h"

/* LIMBS: number of limbs, which hold the bits from 2^-1074 to 2^1024 and leave space for sums of
 * 2^62 terms. CARRY: number of additions after which carries are propagated. */
enum { EBPO_SUM_LIMBS = (1074 + 1024 + 63) / 32 + 2, EBPO_SUM_CARRY = 1 << 29 };

typedef struct ebpo_sum {
    int64_t limb[EBPO_SUM_LIMBS]; /* [i] counts 2^(32 i - 1074) */
    uint32_t adds;                /* number of additions since carries were propagated */
    double beyond;                /* sum of infinite or NaN terms */
} ebpo_sum;

/* Propagates carries, so that all limbs except the last are 0 .. 2^32 - 1. The last limb has the
 * sign. */
static inline void ebpo_sum_carry(ebpo_sum *s)
{
    for (int i = 0; i + 1 < EBPO_SUM_LIMBS; i++) {
        int64_t carry = s->limb[i] >> 32;
        s->limb[i] -= carry * (INT64_C(1) << 32);
        s->limb[i + 1] += carry;
    }
    s->adds = 0;
}

/* Adds a term. */
static inline void ebpo_sum_add(ebpo_sum *s, double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    unsigned exponent = bits >> 52 & 2047;
    if (exponent == 2047) {
        s->beyond += x;
        return;
    }
    uint64_t mantissa = (bits & ((UINT64_C(1) << 52) - 1)) | (uint64_t)(exponent > 0) << 52;
    unsigned position = exponent ? exponent - 1 : 0; /* position of the lowest bit, above 2^-1074 */
    int64_t *limb = s->limb + position / 32, sign = bits >> 63 ? -1 : 1;
    uint64_t low = mantissa << position % 32,
             high = position % 32 ? mantissa >> (64 - position % 32) : 0;
    limb[0] += sign * (int64_t)(low & 0xffffffff);
    limb[1] += sign * (int64_t)(low >> 32);
    limb[2] += sign * (int64_t)high;
    if (++s->adds == EBPO_SUM_CARRY)
        ebpo_sum_carry(s);
}

/* Adds another sum. */
static inline void ebpo_sum_merge(ebpo_sum *s, const ebpo_sum *other)
{
    ebpo_sum o = *other;
    ebpo_sum_carry(&o);
    ebpo_sum_carry(s);
    for (int i = 0; i < EBPO_SUM_LIMBS; i++)
        s->limb[i] += o.limb[i];
    s->adds = 1;
    s->beyond += o.beyond;
}

/* Returns the sum, rounded to nearest, ties to even. */
static inline double ebpo_sum_value(const ebpo_sum *sum)
{
    ebpo_sum s = *sum;
    if (s.beyond != 0)
        return s.beyond;
    ebpo_sum_carry(&s);
    bool negative = s.limb[EBPO_SUM_LIMBS - 1] < 0;
    for (int i = 0; i < EBPO_SUM_LIMBS && negative; i++)
        s.limb[i] = -s.limb[i];
    ebpo_sum_carry(&s);
    int top = EBPO_SUM_LIMBS - 1;
    while (top > 0 && s.limb[top] == 0)
        top--;
    /* Take the leading 64 bits or more, and a sticky bit for the rest. */
    ebpo_wide head = { (uint64_t)s.limb[top], top > 0 ? (uint64_t)s.limb[top - 1] << 32 : 0 };
    head.low |= top > 1 ? (uint64_t)s.limb[top - 2] : 0;
    bool rest = false;
    for (int i = 0; i < top - 2; i++)
        rest |= s.limb[i] != 0;
    int unit = 32 * (top - 2) - 1074; /* head counts 2^unit */
    int bits = head.high  ? 128 - __builtin_clzll(head.high)
               : head.low ? 64 - __builtin_clzll(head.low)
                          : 0,
        drop = bits - 53;
    if (unit + drop < -1074)
        drop = -1074 - unit; /* a denormal result */
    if (drop > 0) {
        /* below: the dropped bits; its top bit is half a unit */
        ebpo_wide below = ebpo_wide_left(head, 128 - drop), half = { UINT64_C(1) << 63, 0 };
        head = ebpo_wide_right(head, drop);
        unit += drop;
        bool tie = below.high == half.high && below.low == half.low;
        head.low += ebpo_wide_less(half, below) || (tie && (rest || (head.low & 1)));
    }
    double value = ldexp((double)head.low, unit);
    return negative ? -value : value;
}

#endif
