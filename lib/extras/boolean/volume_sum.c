#include "core/strict_fp.h"

#include "extras/boolean/volume_sum.h"

#include "geometry/expansion.h"
#include "geometry/integer_vectors.h"

void ebpo_volume_sum_begin(ebpo_volume_sum *s)
{
    s->usual = (ebpo_sum){ 0 };
    mpz_init(s->other);
}

void ebpo_volume_sum_end(ebpo_volume_sum *s) { mpz_clear(s->other); }

/* Products of three such numbers, and what rounding leaves of them, are doubles: their lowest bit
 * is 3 (250 + 52) below 1 at most. */
static bool is_usual(const double t[3][3])
{
    bool usual = true;
    for (int i = 0; i < 9; i++) {
        double x = fabs(t[i / 3][i % 3]);
        usual &= x == 0 || (x >= 0x1p-250 && x <= 0x1p250);
    }
    return usual;
}

/* x y z, exactly. */
static void add_product(ebpo_sum *s, double x, double y, double z)
{
    double product[2], all[4];
    int n = ebpo_expansion_of_pair(product, ebpo_two_product(x, y));
    n = ebpo_expansion_scale(all, product, n, z);
    for (int i = 0; i < n; i++)
        ebpo_sum_add(s, all[i]);
}

static void add_usual(ebpo_sum *s, const double t[3][3], int times)
{
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        add_product(s, times * t[0][k], t[1][u], t[2][v]);
        add_product(s, -times * t[0][k], t[1][v], t[2][u]);
    }
}

static void add_other(mpz_t sum, const double t[3][3], int times)
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
    mpz_mul_si(volume, volume, times);
    mpz_add(sum, sum, volume);
    for (int i = 0; i < 3; i++)
        ebpo_vectorz_clear(&corner[i]);
    ebpo_vectorz_clear(&cross);
    mpz_clear(volume);
}

void ebpo_volume_sum_add(ebpo_volume_sum *s, const double t[3][3], int times)
{
    if (is_usual(t))
        add_usual(&s->usual, t, times);
    else
        add_other(s->other, t, times);
}

void ebpo_volume_sum_merge(ebpo_volume_sum *s, const ebpo_volume_sum *more)
{
    ebpo_sum_merge(&s->usual, &more->usual);
    mpz_add(s->other, s->other, more->other);
}

/* In units of 2^-1074, as limbs have it. */
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

double ebpo_volume_sum_value(const ebpo_volume_sum *s, double *scaled, int64_t *exponent)
{
    mpz_t all, six;
    mpz_init(all);
    mpz_init_set_ui(six, 6);
    to_integer(all, &s->usual);
    mpz_mul_2exp(all, all, -1074 - EBPO_VOLUME_UNIT);
    mpz_add(all, all, s->other);
    double value = ebpo_round_quotient(all, six, EBPO_VOLUME_UNIT);
    int bits = mpz_sgn(all) ? (int)mpz_sizeinbase(all, 2) : -EBPO_VOLUME_UNIT;
    *scaled = ebpo_round_quotient(all, six, -bits);
    *exponent = EBPO_VOLUME_UNIT + bits;
    mpz_clears(all, six, NULL);
    return value;
}
