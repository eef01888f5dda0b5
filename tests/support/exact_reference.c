#include "exact_reference.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

uint64_t reference_random(uint64_t *state)
{
    uint64_t z = *state += 0x9e3779b97f4a7c15;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9;
    z = (z ^ z >> 27) * 0x94d049bb133111eb;
    return z ^ z >> 31;
}

int64_t reference_integer(uint64_t *state, int64_t low, int64_t high)
{
    return low + (int64_t)(reference_random(state) % (uint64_t)(high - low + 1));
}

double reference_uniform(uint64_t *state)
{
    return (double)(reference_random(state) >> 11) * 0x1p-52 - 1;
}

/* Computes the determinant by Leibniz over differences to the last point. */
static int rational_determinant_sign(const double *p, int n)
{
    static const int permutation[6][4] = { { 0, 1, 2, 1 },  { 1, 2, 0, 1 },  { 2, 0, 1, 1 },
                                           { 0, 2, 1, -1 }, { 2, 1, 0, -1 }, { 1, 0, 2, -1 } };
    mpq_t m[3][3], last, product, sum;
    mpq_inits(last, product, sum, NULL);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            mpq_init(m[i][k]);
            mpq_set_si(m[i][k], i == k, 1);
            if (i >= n || k >= n)
                continue;
            mpq_set_d(m[i][k], p[i * n + k]);
            mpq_set_d(last, p[n * n + k]);
            mpq_sub(m[i][k], m[i][k], last);
        }
    for (int t = 0; t < 6; t++) {
        mpq_mul(product, m[0][permutation[t][0]], m[1][permutation[t][1]]);
        mpq_mul(product, product, m[2][permutation[t][2]]);
        if (permutation[t][3] > 0)
            mpq_add(sum, sum, product);
        else
            mpq_sub(sum, sum, product);
    }
    int sign = mpq_sgn(sum);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            mpq_clear(m[i][k]);
    mpq_clears(last, product, sum, NULL);
    return sign;
}

int reference_orient2d(const double p[6]) { return rational_determinant_sign(p, 2); }

/* |a - d, b - d, c - d| is -(b - a) x (c - a) . (d - a). */
int reference_orient3d(const double p[12]) { return -rational_determinant_sign(p, 3); }

int reference_sign_of_products(const double *factor, int n)
{
    mpq_t x, y, sum;
    mpq_inits(x, y, sum, NULL);
    for (int i = 0; i < n; i++) {
        mpq_set_d(x, factor[2 * i]);
        mpq_set_d(y, factor[2 * i + 1]);
        mpq_mul(x, x, y);
        mpq_add(sum, sum, x);
    }
    int sign = mpq_sgn(sum);
    mpq_clears(x, y, sum, NULL);
    return sign;
}

/* --- cases --- */

const char *reference_kind_name(int kind)
{
    static const char *const names[REFERENCE_KINDS] = { "uniform",
                                                        "small integers",
                                                        "single precision",
                                                        "translated by 1e7",
                                                        "denormal",
                                                        "near 1e300",
                                                        "largest doubles",
                                                        "any exponent",
                                                        "nearly degenerate",
                                                        "nearly degenerate, translated",
                                                        "degenerate integers times a power of two",
                                                        "large integers",
                                                        "degenerate large integers",
                                                        "small integers with few odd ulps" };
    return names[kind];
}

static double one_coordinate(int kind, uint64_t *state)
{
    /* Drawn before use: the order of calls within an expression depends on the compiler. */
    double uniform = reference_uniform(state);
    int exponent = (int)reference_integer(state, -1080, 1020);
    switch (kind) {
    case 1: return (double)reference_integer(state, -2, 2);
    case 2: return (double)(float)uniform;
    case 3: return 1e7 + 1e-3 * uniform;
    case 4: return (double)reference_integer(state, -9, 9) * 0x1p-1074;
    case 5: return (double)reference_integer(state, -4, 4) * 1e300;
    case 6: return 0x1.fp1023 * uniform;
    case 7: return ldexp(uniform, exponent);
    case 11: return (double)reference_integer(state, -((int64_t)1 << 53), (int64_t)1 << 53);
    case 13:
        return (double)reference_integer(state, -2, 2) * (1 + (double)(exponent % 2) * 0x1p-52);
    default: return uniform;
    }
}

/* Makes the last point nearly an affine combination of the others, rounded to doubles and moved by
 * some ulps. */
static void nearly_degenerate(double *p, int n, double shift, uint64_t *state)
{
    double s[2];
    s[0] = 2 * reference_uniform(state);
    s[1] = 2 * reference_uniform(state);
    for (int i = 0; i < n * n; i++)
        p[i] = shift + reference_uniform(state);
    for (int k = 0; k < n; k++) {
        double x = p[k] + s[0] * (p[n + k] - p[k]);
        if (n == 3)
            x += s[1] * (p[2 * n + k] - p[k]);
        for (int64_t ulps = reference_integer(state, 0, 2); ulps > 0; ulps--)
            x = nextafter(x, reference_random(state) & 1 ? INFINITY : -INFINITY);
        p[n * n + k] = x;
    }
}

/* Makes the last point an integer affine combination of the others, so that the points are exactly
 * degenerate, except one time in four. */
static void degenerate_integers(double *p, int n, int64_t size, int exponent, uint64_t *state)
{
    int64_t s = reference_integer(state, -4, 4), t = n == 3 ? reference_integer(state, -4, 4) : 0;
    for (int i = 0; i < n * n; i++)
        p[i] = (double)reference_integer(state, -size, size);
    for (int k = 0; k < n; k++)
        p[n * n + k] =
            p[k] + (double)s * (p[n + k] - p[k]) + (n == 3 ? (double)t * (p[2 * n + k] - p[k]) : 0);
    if (reference_random(state) % 4 == 0)
        p[n * n]++;
    for (int i = 0; i < n * (n + 1); i++)
        p[i] = ldexp(p[i], exponent);
}

void reference_points(double *p, int dimension, int kind, uint64_t *state)
{
    if (kind == 8)
        nearly_degenerate(p, dimension, 0, state);
    else if (kind == 9)
        nearly_degenerate(p, dimension, 1e7, state);
    else if (kind == 10)
        degenerate_integers(p, dimension, 5, (int)reference_integer(state, -1074, 1000), state);
    else if (kind == 12)
        degenerate_integers(p, dimension, (int64_t)1 << reference_integer(state, 10, 47), 0, state);
    else
        for (int i = 0; i < dimension * (dimension + 1); i++)
            p[i] = one_coordinate(kind, state);
    /* repeats some coordinates and points, as in meshes */
    int64_t to = reference_integer(state, 0, dimension),
            from = reference_integer(state, 0, dimension * dimension);
    if (reference_random(state) % 4 == 0)
        p[to] = p[from];
    if (reference_random(state) % 8 == 0)
        memcpy(p, p + dimension, (size_t)dimension * sizeof *p);
}
