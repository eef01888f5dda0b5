/* A finite double is an integer times a power of two. Coordinates of one axis are brought to a
 * common power, which scales the determinant by a positive factor and leaves integers. */
#include "core/strict_fp.h"

#include "geometry/predicates_exact.h"

#include <limits.h>
#include <math.h>

#include <gmp.h>

/* Largest e such that x is an integer multiple of 2^e with a 53-bit factor; INT_MAX for 0, which is
 * a multiple of all. */
static int unit_exponent(double x)
{
    int e;
    if (x == 0)
        return INT_MAX;
    frexp(x, &e);
    return e - 53;
}

static int common_exponent(const double *x, int n)
{
    int least = INT_MAX;
    for (int i = 0; i < n; i++) {
        int e = unit_exponent(x[i]);
        if (e < least)
            least = e;
    }
    return least;
}

/* out = x / 2^unit, an integer by choice of unit. */
static void set_integer(mpz_t out, double x, int unit)
{
    if (x == 0) {
        mpz_set_ui(out, 0);
        return;
    }
    int e;
    mpz_set_d(out, ldexp(frexp(x, &e), 53));
    mpz_mul_2exp(out, out, (mp_bitcnt_t)(e - 53 - unit));
}

/* out[i] = (x[i + 1] - x[0]) / a common positive power of two, i = 0 .. n-2. */
static void set_differences(mpz_t *out, const double *x, int n)
{
    mpz_t base;
    int unit = common_exponent(x, n);
    mpz_init(base);
    set_integer(base, x[0], unit);
    for (int i = 1; i < n; i++) {
        set_integer(out[i - 1], x[i], unit);
        mpz_sub(out[i - 1], out[i - 1], base);
    }
    mpz_clear(base);
}

/* out = p * q - r * s */
static void minor2(mpz_t out, const mpz_t p, const mpz_t q, const mpz_t r, const mpz_t s)
{
    mpz_mul(out, p, q);
    mpz_submul(out, r, s);
}

static void init_all(mpz_t *z, int n)
{
    for (int i = 0; i < n; i++)
        mpz_init(z[i]);
}

static void clear_all(mpz_t *z, int n)
{
    for (int i = 0; i < n; i++)
        mpz_clear(z[i]);
}

int ebpo_orient2d_exact(const double a[2], const double b[2], const double c[2])
{
    mpz_t m[2][2], det;
    for (int k = 0; k < 2; k++) {
        init_all(m[k], 2);
        set_differences(m[k], (double[]){ a[k], b[k], c[k] }, 3);
    }
    mpz_init(det);
    minor2(det, m[0][0], m[1][1], m[0][1], m[1][0]);
    int sign = mpz_sgn(det);
    mpz_clear(det);
    for (int k = 0; k < 2; k++)
        clear_all(m[k], 2);
    return sign;
}

int ebpo_orient3d_exact(const double a[3], const double b[3], const double c[3], const double d[3])
{
    mpz_t m[3][3], minor, det;
    for (int k = 0; k < 3; k++) {
        init_all(m[k], 3);
        set_differences(m[k], (double[]){ a[k], b[k], c[k], d[k] }, 4);
    }
    mpz_init(minor);
    mpz_init(det);
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        minor2(minor, m[u][0], m[v][1], m[v][0], m[u][1]);
        mpz_addmul(det, minor, m[k][2]);
    }
    int sign = mpz_sgn(det);
    mpz_clear(det);
    mpz_clear(minor);
    for (int k = 0; k < 3; k++)
        clear_all(m[k], 3);
    return sign;
}

int ebpo_sign_of_products_exact(const double *factor, int n)
{
    int unit = common_exponent(factor, 2 * n);
    mpz_t p, q, sum;
    mpz_init(p);
    mpz_init(q);
    mpz_init(sum);
    for (int i = 0; i < n; i++) {
        set_integer(p, factor[2 * i], unit);
        set_integer(q, factor[2 * i + 1], unit);
        mpz_addmul(sum, p, q);
    }
    int sign = mpz_sgn(sum);
    mpz_clear(sum);
    mpz_clear(q);
    mpz_clear(p);
    return sign;
}
