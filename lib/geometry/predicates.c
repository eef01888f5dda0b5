/* Computes orientation predicates and signs of sums of products, exact for all finite doubles.
 *
 * Each predicate tries stages, the fastest first, until one stage gives a certain sign. The stages
 * are: signs of factors; a floating-point filter, that is, a computation with an error bound; exact
 * arithmetic on doubles (expansions), if exponents are in range; and integers of any size. Sources:
 * Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates",
 * 1997; docs/develop/design.md. */
#include "core/strict_fp.h"

#include <gmp.h>
#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "geometry/expansion.h"
#include "geometry/predicates.h"

/* --- integers of any size --- */

/* A finite double is an integer times a power of two. The coordinates of one axis are divided by a
 * common power of two, which scales the determinant by a positive factor and leaves integers. */

/* Returns the e for which x is 2^e times an integer of exactly 53 bits. Returns INT_MAX for 0,
 * for which any e is possible. */
static int unit_exponent(double x)
{
    int e;
    if (x == 0)
        return INT_MAX;
    frexp(x, &e);
    return e - 53;
}

/* Returns the least unit_exponent of the numbers; INT_MAX if all are 0. */
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

/* Computes out = x / 2^unit. The result must be an integer, so `unit` is at most unit_exponent(x).
 */
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

/* Computes out[i] = (x[i + 1] - x[0]) / 2^unit for i = 0 .. n - 2, with the same unit for all i. */
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

/* Computes out = p * q - r * s. */
static void minor_2x2(mpz_t out, const mpz_t p, const mpz_t q, const mpz_t r, const mpz_t s)
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
    minor_2x2(det, m[0][0], m[1][1], m[0][1], m[1][0]);
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
        minor_2x2(minor, m[u][0], m[v][1], m[v][0], m[u][1]);
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

/* --- expansions --- */

/* Ranges. A double x with 2^-247 <= |x| <= 2^300 is an integer multiple of 2^-300. So are
 * differences of such numbers and the rounding errors of these differences. Products of three
 * differences are multiples of 2^-900 and below 2^910, so no operation here overflows or
 * underflows. */

/* A difference is a pair: the head is the rounded difference, the tail its rounding error. The
 * permanent is the sum of the absolute values of all products in the determinant. The determinant
 * of the heads differs from the exact determinant by at most 3 * 2^-53 times the permanent.
 * heads_error has the factor 4 instead of 3, for terms of higher order. */
static const double heads_error = 4 * 0x1p-53;

static bool in_range(const double *x, int n, double least, double largest)
{
    bool ok = true;
    for (int i = 0; i < n; i++)
        ok &= (x[i] == 0) | ((fabs(x[i]) >= least) & (fabs(x[i]) <= largest));
    return ok;
}

static bool coordinates_in_range(const double *x, int n)
{
    return in_range(x, n, 0x1p-247, 0x1p300);
}

int ebpo_orient2d_expansion(const double a[2], const double b[2], const double c[2])
{
    const double all[6] = { a[0], a[1], b[0], b[1], c[0], c[1] };
    if (!coordinates_in_range(all, 6))
        return EBPO_SIGN_UNKNOWN;
    ebpo_difference m[2][2];
    for (int k = 0; k < 2; k++) {
        m[k][0] = ebpo_difference_of(ebpo_two_difference(b[k], a[k]));
        m[k][1] = ebpo_difference_of(ebpo_two_difference(c[k], a[k]));
    }
    double det[16];
    int n = ebpo_expansion_minor(det, m[0][0], m[1][1], m[1][0], m[0][1]);
    return ebpo_expansion_sign(det, n);
}

/* --- orient3d: integers of 128 bits, then expansions --- */

#ifdef EBPO_HAVE_INT128
__extension__ typedef __int128 wide;

/* Returns the greatest power of two that is at most x. x is normal and positive. */
static double power_below(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    bits &= 0x7ff0000000000000;
    memcpy(&x, &bits, sizeof bits);
    return x;
}

/* Multiplies a row by a power of two, so that its values become integers below 2^41. Returns false
 * if a value has more bits. */
static bool row_to_integers(int64_t out[3], const ebpo_pair row[3])
{
    double largest = fmax(fabs(row[0].head), fmax(fabs(row[1].head), fabs(row[2].head)));
    double scale = largest == 0 ? 1 : 0x1p40 / power_below(largest);
    bool exact = true;
    for (int i = 0; i < 3; i++) {
        double x = row[i].head * scale;
        /* Adding 1.5 * 2^52 rounds to an integer. A cast to an integer and back is not used,
         * because GCC 12 removes such pairs of casts when it vectorises. */
        exact &= (x + 0x1.8p52) - 0x1.8p52 == x;
        out[i] = (int64_t)x;
    }
    return exact;
}

/* Computes the sign of the determinant of differences that are exact and have few bits, such as
 * differences of floats or of small integers. As scaled integers, the differences are below 2^41,
 * so that minors are below 2^83 and the determinant below 2^126. Returns false for other
 * differences. */
static bool integer_determinant(int *sign, ebpo_pair m[3][3])
{
    int64_t z[3][3];
    for (int k = 0; k < 3; k++)
        if (!row_to_integers(z[k], m[k]))
            return false;
    wide det = 0;
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        det += ((wide)z[u][0] * z[v][1] - (wide)z[v][0] * z[u][1]) * z[k][2];
    }
    *sign = (det > 0) - (det < 0);
    return true;
}

#else
/* Without 128-bit integers, expansions make all decisions. */
static bool integer_determinant(int *sign, ebpo_pair m[3][3])
{
    (void)sign, (void)m;
    return false;
}
#endif

/* Computes out = the determinant. `out` has capacity for 192 components. Returns the number of
 * components. */
static int expand_determinant(double *out, ebpo_difference m[3][3])
{
    double minor[16], term[3][64], two[128];
    int term_n[3];
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        int n = ebpo_expansion_minor(minor, m[u][0], m[v][1], m[v][0], m[u][1]);
        term_n[k] = ebpo_expansion_times(term[k], minor, n, m[k][2].x, m[k][2].n);
    }
    int two_n = ebpo_expansion_sum(two, term[0], term_n[0], term[1], term_n[1]);
    return ebpo_expansion_sum(out, two, two_n, term[2], term_n[2]);
}

/* Returns a bound of the difference between the determinant of the heads and the exact determinant.
 */
static double error_of_heads(ebpo_pair m[3][3])
{
    double permanent = 0;
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        permanent += (fabs(m[u][0].head * m[v][1].head) + fabs(m[v][0].head * m[u][1].head)) *
                     fabs(m[k][2].head);
    }
    return heads_error * permanent;
}

/* Returns a lower bound of the absolute value of the expansion e, for n <= 24. (The determinant of
 * the heads has at most 24 components.) Components do not overlap, so the sum of their absolute
 * values is below twice the absolute value of the last component. The rounding error of `sum` is
 * less than n * 2^-53 times this sum of absolute values. */
static double expansion_size(const double *e, int n)
{
    double sum = 0;
    for (int i = 0; i < n; i++)
        sum += e[i];
    return n == 0 ? 0 : fabs(sum) - 64 * 0x1p-53 * fabs(e[n - 1]);
}

/* Returns the sign of the determinant of exact differences. Computes with the heads first. If the
 * tails could change the sign, computes again with heads and tails. */
static int expansion_determinant_sign(ebpo_pair m[3][3], bool heads_exact)
{
    ebpo_difference d[3][3];
    double det[192];
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++)
            d[k][i] = ebpo_difference_of((ebpo_pair){ m[k][i].head, 0 });
    int n = expand_determinant(det, d);
    if (heads_exact || expansion_size(det, n) > error_of_heads(m))
        return ebpo_expansion_sign(det, n);
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3; i++)
            d[k][i] = ebpo_difference_of(m[k][i]);
    n = expand_determinant(det, d);
    return ebpo_expansion_sign(det, n);
}

int ebpo_determinant_expansion(ebpo_pair m[3][3])
{
    bool heads_exact = true;
    for (int k = 0; k < 3; k++)
        heads_exact &= (m[k][0].tail == 0) & (m[k][1].tail == 0) & (m[k][2].tail == 0);
    int sign;
    if (heads_exact && integer_determinant(&sign, m))
        return sign;
    return expansion_determinant_sign(m, heads_exact);
}

int ebpo_orient3d_expansion(const double a[3], const double b[3], const double c[3],
                            const double d[3])
{
    if (!coordinates_in_range(a, 3) || !coordinates_in_range(b, 3) || !coordinates_in_range(c, 3) ||
        !coordinates_in_range(d, 3))
        return EBPO_SIGN_UNKNOWN;
    ebpo_pair m[3][3];
    for (int k = 0; k < 3; k++) {
        m[k][0] = ebpo_two_difference(b[k], a[k]);
        m[k][1] = ebpo_two_difference(c[k], a[k]);
        m[k][2] = ebpo_two_difference(d[k], a[k]);
    }
    return ebpo_determinant_expansion(m);
}

/* --- sums of products --- */

int ebpo_sign_of_products_expansion(const double *factor, int n)
{
    /* In this range, factors are multiples of 2^-500, so products and their rounding errors are
     * multiples of 2^-1000 and do not underflow. */
    if (n > 8 || !in_range(factor, 2 * n, 0x1p-447, 0x1p480))
        return EBPO_SIGN_UNKNOWN;
    double sum[2][16], product[2];
    int length = 0, now = 0;
    for (int i = 0; i < n; i++) {
        int product_n =
            ebpo_expansion_of_pair(product, ebpo_two_product(factor[2 * i], factor[2 * i + 1]));
        length = ebpo_expansion_sum(sum[!now], sum[now], length, product, product_n);
        now = !now;
    }
    return ebpo_expansion_sign(sum[now], length);
}

/* --- predicates: a filter, then the exact stages --- */

/* An error bound is a factor times eps times the computed permanent, plus a term with `slack`. The
 * factor is large enough to cover the rounding errors of the permanent too. The term with `slack`
 * covers underflow in the products. An overflow makes the bound infinite or NaN; then no comparison
 * with this bound succeeds. */
static const double eps = 0x1p-53;
/* This number is much larger than the sum of all underflow errors (2^-1075 each). It is not a
 * denormal, because arithmetic on denormals is slow. */
static const double slack = 0x1p-960;

static inline int sign_of(double x) { return (x > 0) - (x < 0); }

static inline int filter_sign(double value, double bound)
{
    if (value > bound)
        return 1;
    if (value < -bound)
        return -1;
    return EBPO_SIGN_UNKNOWN;
}

int ebpo_orient2d(const double a[2], const double b[2], const double c[2])
{
    double ux = b[0] - a[0], uy = b[1] - a[1];
    double vx = c[0] - a[0], vy = c[1] - a[1];
    /* Signs of differences are always correct, also after overflow. */
    int left_sign = sign_of(ux) * sign_of(vy), right_sign = sign_of(uy) * sign_of(vx);
    if (left_sign != right_sign)
        return left_sign > right_sign ? 1 : -1;
    if (left_sign == 0)
        return 0;
    double left = ux * vy, right = uy * vx;
    int sign = filter_sign(left - right, 4 * eps * (fabs(left) + fabs(right)) + slack);
    if (sign == EBPO_SIGN_UNKNOWN)
        sign = ebpo_orient2d_expansion(a, b, c);
    return sign != EBPO_SIGN_UNKNOWN ? sign : ebpo_orient2d_exact(a, b, c);
}

/* Computes the determinant of the columns b - a, c - a, d - a in floating point. m[k] is the row of
 * axis k. Returns its sign, or EBPO_SIGN_UNKNOWN if the sign is not certain. */
static int orient3d_filter(double m[3][3])
{
    double det = 0, permanent = 0, third = 0;
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        double p = m[u][0] * m[v][1], q = m[v][0] * m[u][1];
        det += (p - q) * m[k][2];
        permanent += (fabs(p) + fabs(q)) * fabs(m[k][2]);
        third += fabs(m[k][2]);
    }
    return filter_sign(det, 8 * eps * permanent + slack * (1 + third));
}

static inline bool same_point(const double p[3], const double q[3])
{
    return p[0] == q[0] && p[1] == q[1] && p[2] == q[2];
}

int ebpo_orient3d(const double a[3], const double b[3], const double c[3], const double d[3])
{
    double m[3][3];
    for (int k = 0; k < 3; k++) {
        m[k][0] = b[k] - a[k];
        m[k][1] = c[k] - a[k];
        m[k][2] = d[k] - a[k];
    }
    int sign = orient3d_filter(m);
    if (sign != EBPO_SIGN_UNKNOWN)
        return sign;
    /* The most frequent case of 0: all points are in one axis-parallel plane. */
    for (int k = 0; k < 3; k++)
        if (m[k][0] == 0 && m[k][1] == 0 && m[k][2] == 0)
            return 0;
    /* The next case: two points are equal, for example if faces share a corner. */
    if (same_point(a, b) || same_point(a, c) || same_point(a, d) || same_point(b, c) ||
        same_point(b, d) || same_point(c, d))
        return 0;
    sign = ebpo_orient3d_expansion(a, b, c, d);
    return sign != EBPO_SIGN_UNKNOWN ? sign : ebpo_orient3d_exact(a, b, c, d);
}

int ebpo_sign_of_products(const double *factor, int n)
{
    double sum = 0, permanent = 0;
    for (int i = 0; i < n; i++) {
        double product = factor[2 * i] * factor[2 * i + 1];
        sum += product;
        permanent += fabs(product);
    }
    int sign = filter_sign(sum, (n + 2) * eps * permanent + slack);
    if (sign == EBPO_SIGN_UNKNOWN)
        sign = ebpo_sign_of_products_expansion(factor, n);
    return sign != EBPO_SIGN_UNKNOWN ? sign : ebpo_sign_of_products_exact(factor, n);
}
