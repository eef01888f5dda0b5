/* Converts doubles to multiples of a common power of two, and results back to doubles with one
 * rounding. Used for cases that neither filters (tests in doubles with error bounds) nor expansions
 * (expansion.h) decide. Quotients and roots are computed with some 70 bits. Their lowest bit is set
 * when the remainder is not 0, so that rounding to a double is always correct. */
#include "core/strict_fp.h"

#include "geometry/integer_vectors.h"

#include <math.h>
#include <stdbool.h>

void ebpo_vectorz_init(ebpo_vectorz *v)
{
    for (int k = 0; k < 3; k++)
        mpz_init(v->x[k]);
}

void ebpo_vectorz_clear(ebpo_vectorz *v)
{
    for (int k = 0; k < 3; k++)
        mpz_clear(v->x[k]);
}

void ebpo_vectorz_subtract(ebpo_vectorz *out, const ebpo_vectorz *a, const ebpo_vectorz *b)
{
    for (int k = 0; k < 3; k++)
        mpz_sub(out->x[k], a->x[k], b->x[k]);
}

void ebpo_vectorz_dot(mpz_t out, const ebpo_vectorz *a, const ebpo_vectorz *b)
{
    mpz_mul(out, a->x[0], b->x[0]);
    mpz_addmul(out, a->x[1], b->x[1]);
    mpz_addmul(out, a->x[2], b->x[2]);
}

void ebpo_vectorz_cross(ebpo_vectorz *out, const ebpo_vectorz *a, const ebpo_vectorz *b)
{
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        mpz_mul(out->x[k], a->x[u], b->x[v]);
        mpz_submul(out->x[k], a->x[v], b->x[u]);
    }
}

int ebpo_common_unit(const double *x, int n, int unit)
{
    for (int i = 0; i < n; i++) {
        int e;
        if (x[i] == 0)
            continue;
        frexp(x[i], &e);
        unit = e - 53 < unit ? e - 53 : unit;
    }
    return unit;
}

void ebpo_set_integer(mpz_t out, double x, int unit)
{
    int e;
    double fraction = frexp(x, &e);
    mpz_set_d(out, ldexp(fraction, 53));
    if (x != 0)
        mpz_mul_2exp(out, out, (mp_bitcnt_t)(e - 53 - unit));
}

/* Returns the double nearest to m * 2^exponent, ties to even; the lowest bit of m may stand for a
 * remainder that is less than this bit. */
static double round_integer(const mpz_t m, long exponent)
{
    if (mpz_sgn(m) == 0)
        return 0;
    long bits = (long)mpz_sizeinbase(m, 2), keep = bits + exponent + 1074;
    keep = keep > 53 ? 53 : keep;
    if (keep < 0)
        return 0;
    long drop = bits - keep;
    mpz_t q;
    mpz_init(q);
    if (drop <= 0) {
        double exact = ldexp(mpz_get_d(m), (int)exponent);
        mpz_clear(q);
        return exact;
    }
    mpz_fdiv_q_2exp(q, m, (mp_bitcnt_t)drop);
    bool half = mpz_tstbit(m, (mp_bitcnt_t)drop - 1),
         more = drop > 1 && mpz_scan1(m, 0) < (mp_bitcnt_t)drop - 1;
    if (half && (more || mpz_odd_p(q)))
        mpz_add_ui(q, q, 1);
    double value = exponent + drop > 2000 ? INFINITY : ldexp(mpz_get_d(q), (int)(exponent + drop));
    mpz_clear(q);
    return value;
}

double ebpo_round_root(const mpz_t square, const mpz_t denominator, int unit)
{
    if (mpz_sgn(square) == 0)
        return 0;
    mpz_t q, rest, root, rest2;
    mpz_inits(q, rest, root, rest2, NULL);
    long shift = 140 - ((long)mpz_sizeinbase(square, 2) - (long)mpz_sizeinbase(denominator, 2));
    shift += shift & 1;
    if (shift >= 0) {
        mpz_mul_2exp(q, square, (mp_bitcnt_t)shift);
        mpz_fdiv_qr(q, rest, q, denominator);
    } else {
        mpz_mul_2exp(rest2, denominator, (mp_bitcnt_t)-shift);
        mpz_fdiv_qr(q, rest, square, rest2);
    }
    mpz_sqrtrem(root, rest2, q);
    mpz_mul_2exp(root, root, 1);
    if (mpz_sgn(rest) || mpz_sgn(rest2))
        mpz_setbit(root, 0);
    double value = round_integer(root, (long)unit - shift / 2 - 1);
    mpz_clears(q, rest, root, rest2, NULL);
    return value;
}

double ebpo_round_quotient(const mpz_t numerator, const mpz_t denominator, int unit)
{
    mpz_t q, rest, size;
    mpz_inits(q, rest, size, NULL);
    mpz_abs(size, numerator);
    long shift = 70 - ((long)mpz_sizeinbase(size, 2) - (long)mpz_sizeinbase(denominator, 2));
    if (shift >= 0) {
        mpz_mul_2exp(q, size, (mp_bitcnt_t)shift);
        mpz_fdiv_qr(q, rest, q, denominator);
    } else {
        mpz_mul_2exp(rest, denominator, (mp_bitcnt_t)-shift);
        mpz_fdiv_qr(q, rest, size, rest);
    }
    mpz_mul_2exp(q, q, 1);
    if (mpz_sgn(rest))
        mpz_setbit(q, 0);
    double value = round_integer(q, (long)unit - shift - 1);
    int sign = mpz_sgn(numerator);
    mpz_clears(q, rest, size, NULL);
    return sign < 0 ? -value : value;
}
