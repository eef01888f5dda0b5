/* Sums volumes below faces without rounding: in a long accumulator (mesh/sum.h) if products of
 * coordinates are exact in doubles, else in integers (GMP). */
#include "core/strict_fp.h"

#include "extras/boolean/volume_sum.h"

#include <math.h>

#include "geometry/expansion.h"
#include "geometry/integer_vectors.h"

/* Exponent of the unit of volumes. Every double is a multiple of 2^-1074, so a product of three
 * doubles is a multiple of the unit. The 3 * 52 additional bits make the rounding errors of volumes
 * below faces with rational corners small. */
enum { EBPO_VOLUME_UNIT = -3 * (1074 + 52) };

void ebpo_volume_sum_begin(ebpo_volume_sum *s)
{
    s->by_doubles = (ebpo_sum){ 0 };
    mpz_init(s->by_integers);
}

void ebpo_volume_sum_end(ebpo_volume_sum *s) { mpz_clear(s->by_integers); }

/* Returns true if each product of three of these coordinates is exactly a sum of doubles. This is
 * true for coordinates from 2^-250 to 2^250, because the lowest bit of a product is then at least
 * 2^(-3 (250 + 52)), which is a double. */
static bool has_exact_products(const double t[3][3])
{
    bool by_doubles = true;
    for (int i = 0; i < 9; i++) {
        double x = fabs(t[i / 3][i % 3]);
        by_doubles &= x == 0 || (x >= 0x1p-250 && x <= 0x1p250);
    }
    return by_doubles;
}

/* Adds the product x y z exactly, as a sum of doubles. */
static void add_product(ebpo_sum *s, double x, double y, double z)
{
    double product[2], all[4];
    int n = ebpo_expansion_of_pair(product, ebpo_two_product(x, y));
    n = ebpo_expansion_scale(all, product, n, z);
    for (int i = 0; i < n; i++)
        ebpo_sum_add(s, all[i]);
}

static void add_by_doubles(ebpo_sum *s, const double t[3][3], int sign)
{
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        add_product(s, sign * t[0][k], t[1][u], t[2][v]);
        add_product(s, -sign * t[0][k], t[1][v], t[2][u]);
    }
}

static void add_by_integers(mpz_t sum, const double t[3][3], int sign)
{
    ebpo_vectorz corner[3], cross;
    mpz_t volume;
    mpz_init(volume);
    ebpo_vectorz_init(&cross);
    for (int i = 0; i < 3; i++) {
        ebpo_vectorz_init(&corner[i]);
        for (int k = 0; k < 3; k++)
            ebpo_set_integer(corner[i].x[k], t[i][k], EBPO_VOLUME_UNIT / 3);
    }
    ebpo_vectorz_cross(&cross, &corner[1], &corner[2]);
    ebpo_vectorz_dot(volume, &corner[0], &cross);
    mpz_mul_si(volume, volume, sign);
    mpz_add(sum, sum, volume);
    for (int i = 0; i < 3; i++)
        ebpo_vectorz_clear(&corner[i]);
    ebpo_vectorz_clear(&cross);
    mpz_clear(volume);
}

void ebpo_volume_sum_add(ebpo_volume_sum *s, const double t[3][3], int sign)
{
    if (has_exact_products(t))
        add_by_doubles(&s->by_doubles, t, sign);
    else
        add_by_integers(s->by_integers, t, sign);
}

void ebpo_volume_sum_merge(ebpo_volume_sum *s, const ebpo_volume_sum *more)
{
    ebpo_sum_merge(&s->by_doubles, &more->by_doubles);
    mpz_add(s->by_integers, s->by_integers, more->by_integers);
}

/* Converts the accumulator to an integer in units of 2^-1074. */
static void to_integer(mpz_t out, const ebpo_sum *sum)
{
    ebpo_sum s = *sum;
    ebpo_sum_carry(&s);
    mpz_set_si(out, 0);
    for (int i = EBPO_SUM_LIMBS - 1; i >= 0; i--) {
        mpz_mul_2exp(out, out, 32);
        if (s.limb[i] < 0)
            mpz_sub_ui(out, out, (unsigned long)-s.limb[i]);
        else
            mpz_add_ui(out, out, (unsigned long)s.limb[i]);
    }
}

/* Computes six times the volume in units of 2^EBPO_VOLUME_UNIT. */
static void join_sums(mpz_t out, const ebpo_volume_sum *s)
{
    to_integer(out, &s->by_doubles);
    mpz_mul_2exp(out, out, -1074 - EBPO_VOLUME_UNIT);
    mpz_add(out, out, s->by_integers);
}

/* Converts six times a volume, in units of 2^EBPO_VOLUME_UNIT, to the results of
 * ebpo_volume_sum_value. */
static double round_volume(const mpz_t all, double *scaled, int64_t *exponent)
{
    mpz_t six;
    mpz_init_set_ui(six, 6);
    double value = ebpo_round_quotient(all, six, EBPO_VOLUME_UNIT);
    int bits = mpz_sgn(all) ? (int)mpz_sizeinbase(all, 2) : -EBPO_VOLUME_UNIT;
    *scaled = ebpo_round_quotient(all, six, -bits);
    *exponent = EBPO_VOLUME_UNIT + bits;
    mpz_clear(six);
    return value;
}

double ebpo_volume_sum_value(const ebpo_volume_sum *s, double *scaled, int64_t *exponent)
{
    mpz_t all;
    mpz_init(all);
    join_sums(all, s);
    double value = round_volume(all, scaled, exponent);
    mpz_clear(all);
    return value;
}

/* --- faces with rational corners --- */

void ebpo_volume_sum_add_rational(ebpo_volume_sum *s, mpq_t (*t)[3], int sign)
{
    mpq_t sum, term;
    mpz_t below;
    mpq_inits(sum, term, NULL);
    mpz_init(below);
    for (int k = 0; k < 6; k++) {
        int i = k % 3, u = (i + (k < 3 ? 1 : 2)) % 3, v = 3 - i - u;
        mpq_mul(term, t[0][i], t[1][u]);
        mpq_mul(term, term, t[2][v]);
        if (k < 3)
            mpq_add(sum, sum, term);
        else
            mpq_sub(sum, sum, term);
    }
    if (sign < 0)
        mpq_neg(sum, sum);
    mpq_mul_2exp(sum, sum, -EBPO_VOLUME_UNIT);
    mpz_fdiv_q(below, mpq_numref(sum), mpq_denref(sum));
    mpz_add(s->by_integers, s->by_integers, below);
    s->rounded += mpz_divisible_p(mpq_numref(sum), mpq_denref(sum)) ? 0 : 1;
    mpz_clear(below);
    mpq_clears(sum, term, NULL);
}

ebpo_value_bounds ebpo_volume_sum_interval(const ebpo_volume_sum *s, double *scaled,
                                           int64_t *exponent)
{
    ebpo_value_bounds out = { .kind = EBPO_VALUE_EXACT };
    double scaled_hi;
    int64_t exponent_hi;
    mpz_t all;
    mpz_init(all);
    join_sums(all, s);
    out.lo = round_volume(all, scaled, exponent);
    mpz_add_ui(all, all, s->rounded);
    out.hi = round_volume(all, &scaled_hi, &exponent_hi);
    if (out.lo != out.hi || *scaled != scaled_hi ||
        *exponent !=
            exponent_hi) { /* rounding to the nearest double may have moved both bounds inwards */
        out.kind = EBPO_VALUE_INTERVAL;
        out.lo = nextafter(out.lo, -INFINITY);
        out.hi = nextafter(out.hi, INFINITY);
    }
    mpz_clear(all);
    return out;
}
