/* Computes with integers of 128 bits, modulo 2^128. Also works with compilers that have no such
 * type (on 32-bit machines). */
#ifndef EBPO_CORE_WIDE_H
#define EBPO_CORE_WIDE_H

#include <stdbool.h>
#include <stdint.h>

/* The number 2^64 high + low. Signed numbers are in two's complement. */
typedef struct ebpo_wide {
    uint64_t high, low;
} ebpo_wide;

static inline ebpo_wide ebpo_wide_plus(ebpo_wide a, ebpo_wide b)
{
    uint64_t low = a.low + b.low;
    return (ebpo_wide){ a.high + b.high + (low < a.low), low };
}

/* Returns the exact product, without a type of 128 bits. */
static inline ebpo_wide ebpo_wide_product_by_halves(uint64_t a, uint64_t b)
{
    uint64_t al = (uint32_t)a, ah = a >> 32, bl = (uint32_t)b, bh = b >> 32;
    uint64_t middle_a = al * bh, middle_b = ah * bl;
    ebpo_wide p = ebpo_wide_plus((ebpo_wide){ ah * bh, al * bl },
                                 (ebpo_wide){ middle_a >> 32, middle_a << 32 });
    return ebpo_wide_plus(p, (ebpo_wide){ middle_b >> 32, middle_b << 32 });
}

/* Returns the exact product. */
static inline ebpo_wide ebpo_wide_product(uint64_t a, uint64_t b)
{
#ifdef EBPO_HAVE_INT128
    __extension__ unsigned __int128 p = (unsigned __int128)a * b;
    return (ebpo_wide){ (uint64_t)(p >> 64), (uint64_t)p };
#else
    return ebpo_wide_product_by_halves(a, b);
#endif
}

/* Returns the exact signed product. */
static inline ebpo_wide ebpo_wide_signed_product(int64_t a, int64_t b)
{
    ebpo_wide p = ebpo_wide_product((uint64_t)a, (uint64_t)b);
    p.high -= (a < 0 ? (uint64_t)b : 0) + (b < 0 ? (uint64_t)a : 0);
    return p;
}

/* Returns a * b modulo 2^128. */
static inline ebpo_wide ebpo_wide_times(ebpo_wide a, uint64_t b)
{
    ebpo_wide p = ebpo_wide_product(a.low, b);
    p.high += a.high * b;
    return p;
}

/* Shifts left by n in 0 .. 127. */
static inline ebpo_wide ebpo_wide_left(ebpo_wide a, int n)
{
    if (n >= 64)
        return (ebpo_wide){ a.low << (n - 64), 0 };
    return n ? (ebpo_wide){ a.high << n | a.low >> (64 - n), a.low << n } : a;
}

/* Shifts an unsigned value right by n in 0 .. 127. */
static inline ebpo_wide ebpo_wide_right(ebpo_wide a, int n)
{
    if (n >= 64)
        return (ebpo_wide){ 0, a.high >> (n - 64) };
    return n ? (ebpo_wide){ a.high >> n, a.low >> n | a.high << (64 - n) } : a;
}

/* Returns true if a < b, as unsigned numbers. */
static inline bool ebpo_wide_less(ebpo_wide a, ebpo_wide b)
{
    return a.high != b.high ? a.high < b.high : a.low < b.low;
}

/* Returns true if a <= b, as signed numbers. */
static inline bool ebpo_wide_signed_at_most(ebpo_wide a, ebpo_wide b)
{
    const uint64_t sign = UINT64_C(1) << 63;
    return !ebpo_wide_less((ebpo_wide){ b.high ^ sign, b.low },
                           (ebpo_wide){ a.high ^ sign, a.low });
}

/* Returns the remainder of the unsigned number `a` divided by `m`. `m` must be 1 to 2^63. */
static inline uint64_t ebpo_wide_modulo(ebpo_wide a, uint64_t m)
{
    uint64_t remainder = a.high % m;
    for (int bit = 63; bit >= 0; bit--) {
        remainder = remainder * 2 + (a.low >> bit & 1);
        remainder -= remainder >= m ? m : 0;
    }
    return remainder;
}

#endif
