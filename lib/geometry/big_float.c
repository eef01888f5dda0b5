/* Computes with floating-point numbers of 512 bits. A limb is a machine word of GMP. The mantissa
 * fills its limbs, and results are truncated. */
#include "core/strict_fp.h"

#include "geometry/big_float.h"

#include <math.h>
#include <string.h>

_Static_assert(GMP_NAIL_BITS == 0 && EBPO_BIG_BITS % GMP_NUMB_BITS == 0,
               "limbs must fill the mantissa");

enum { LIMBS = EBPO_BIG_LIMBS, LIMB_BITS = GMP_NUMB_BITS };
static const ebpo_big zero = { 0 };

ebpo_big ebpo_big_of(double x)
{
    ebpo_big out = zero;
    int exponent;
    double fraction = frexp(fabs(x), &exponent);
    if (fraction == 0)
        return zero;
    uint64_t bits = (uint64_t)ldexp(fraction, 53) << 11;
    out.sign = x < 0 ? -1 : 1;
    out.exponent = exponent;
    for (int i = 0; i < 64 / LIMB_BITS; i++)
        out.limb[LIMBS - 1 - i] = (mp_limb_t)(bits >> (64 - LIMB_BITS * (i + 1)));
    return out;
}

/* Shifts the mantissa to the left until its top bit is set, and adapts the exponent. */
static ebpo_big normalise_limbs(ebpo_big a)
{
    int top = LIMBS - 1, bits = 0;
    while (top >= 0 && a.limb[top] == 0)
        top--;
    if (top < 0)
        return zero;
    int limbs = LIMBS - 1 - top;
    memmove(a.limb + limbs, a.limb, (size_t)(top + 1) * sizeof *a.limb);
    memset(a.limb, 0, (size_t)limbs * sizeof *a.limb);
    while (!(a.limb[LIMBS - 1] << bits >> (LIMB_BITS - 1)))
        bits++;
    if (bits)
        mpn_lshift(a.limb, a.limb, LIMBS, (unsigned)bits);
    a.exponent -= (int64_t)limbs * LIMB_BITS + bits;
    return a;
}

/* Shifts the limbs right by `by` bits (0 .. EBPO_BIG_BITS - 1), and drops the bits that are shifted
 * out. */
static void shift_right(mp_limb_t *limb, unsigned by)
{
    unsigned limbs = by / LIMB_BITS, bits = by % LIMB_BITS;
    memmove(limb, limb + limbs, (LIMBS - limbs) * sizeof *limb);
    memset(limb + LIMBS - limbs, 0, limbs * sizeof *limb);
    if (bits)
        mpn_rshift(limb, limb, LIMBS, bits);
}

ebpo_big ebpo_big_add(const ebpo_big *a, const ebpo_big *b)
{
    if (a->sign == 0 || b->sign == 0)
        return a->sign == 0 ? *b : *a;
    if (a->exponent < b->exponent) {
        const ebpo_big *t = a;
        a = b;
        b = t;
    }
    if (a->exponent - b->exponent >= EBPO_BIG_BITS)
        return *a;
    ebpo_big out = *a, low = *b;
    shift_right(low.limb, (unsigned)(a->exponent - b->exponent));
    if (a->sign == b->sign) {
        if (mpn_add_n(out.limb, out.limb, low.limb, LIMBS)) {
            shift_right(out.limb, 1);
            out.limb[LIMBS - 1] |= (mp_limb_t)1 << (LIMB_BITS - 1);
            out.exponent++;
        }
        return out;
    }
    if (mpn_cmp(out.limb, low.limb, LIMBS) >= 0) {
        mpn_sub_n(out.limb, out.limb, low.limb, LIMBS);
    } else {
        mpn_sub_n(out.limb, low.limb, out.limb, LIMBS);
        out.sign = -out.sign;
    }
    return normalise_limbs(out);
}

ebpo_big ebpo_big_subtract(const ebpo_big *a, const ebpo_big *b)
{
    ebpo_big minus = *b;
    minus.sign = -minus.sign;
    return ebpo_big_add(a, &minus);
}

ebpo_big ebpo_big_multiply(const ebpo_big *a, const ebpo_big *b)
{
    if (a->sign == 0 || b->sign == 0)
        return zero;
    mp_limb_t product[2 * LIMBS];
    ebpo_big out = { a->sign * b->sign, a->exponent + b->exponent, { 0 } };
    mpn_mul_n(product, a->limb, b->limb, LIMBS);
    if (!(product[2 * LIMBS - 1] >> (LIMB_BITS - 1))) {
        mpn_lshift(product, product, 2 * LIMBS, 1);
        out.exponent--;
    }
    memcpy(out.limb, product + LIMBS, sizeof out.limb);
    return out;
}

ebpo_big ebpo_big_root(const ebpo_big *a)
{
    if (a->sign <= 0)
        return zero;
    mp_limb_t square[2 * LIMBS] = { 0 };
    ebpo_big out = { 1, a->exponent, { 0 } };
    memcpy(square + LIMBS, a->limb, sizeof a->limb);
    if (out.exponent & 1) {
        mpn_rshift(square, square, 2 * LIMBS, 1);
        out.exponent++;
    }
    mpn_sqrtrem(out.limb, NULL, square,
                2 * LIMBS); /* square is in [1/4, 1), the root in [1/2, 1) */
    out.exponent /= 2;
    return out;
}

ebpo_big ebpo_big_scale(const ebpo_big *a, int64_t by)
{
    ebpo_big out = *a;
    out.exponent += by;
    return out;
}

double ebpo_big_double(const ebpo_big *a, int64_t unit)
{
    if (a->sign == 0)
        return 0;
    uint64_t bits = 0;
    for (int i = 0; i < 64 / LIMB_BITS; i++)
        bits |= (uint64_t)a->limb[LIMBS - 1 - i] << (64 - LIMB_BITS * (i + 1));
    int64_t exponent = a->exponent - unit;
    int bounded = exponent > 4000 ? 4000 : exponent < -4000 ? -4000 : (int)exponent;
    return a->sign * ldexp((double)(bits >> 11), bounded - 53);
}

ebpo_big_complex ebpo_big_complex_multiply(const ebpo_big_complex *a, const ebpo_big_complex *b)
{
    ebpo_big rr = ebpo_big_multiply(&a->real, &b->real),
             ii = ebpo_big_multiply(&a->imaginary, &b->imaginary),
             ri = ebpo_big_multiply(&a->real, &b->imaginary),
             ir = ebpo_big_multiply(&a->imaginary, &b->real);
    return (ebpo_big_complex){ ebpo_big_subtract(&rr, &ii), ebpo_big_add(&ri, &ir) };
}
