/* Each predicate goes through stages, cheapest first: signs of factors, a floating-point filter,
 * exact arithmetic on doubles (expansions) where exponents leave room for it, integers of any size.
 *
 * Error bounds: eps = 2^-53. Each bound holds for the computed permanent (the sum of absolute
 * values); the slack term covers underflow in the products, and an overflow makes the bound
 * infinite or not a number, so that no comparison succeeds. */
#include "core/strict_fp.h"

#include "geometry/predicates.h"

#include <math.h>

#include "geometry/predicates_exact.h"
#include "geometry/predicates_expansion.h"

static const double eps = 0x1p-53;
/* Far above every underflow error (2^-1075 each), and normal: arithmetic on denormals is slow. */
static const double slack = 0x1p-960;

static inline int sign_of(double x) { return (x > 0) - (x < 0); }

static inline int filtered(double value, double bound)
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
    /* Signs of differences are always right, also after overflow. */
    int left_sign = sign_of(ux) * sign_of(vy), right_sign = sign_of(uy) * sign_of(vx);
    if (left_sign != right_sign)
        return left_sign > right_sign ? 1 : -1;
    if (left_sign == 0)
        return 0;
    double left = ux * vy, right = uy * vx;
    int sign = filtered(left - right, 4 * eps * (fabs(left) + fabs(right)) + slack);
    if (sign == EBPO_SIGN_UNKNOWN)
        sign = ebpo_orient2d_expansion(a, b, c);
    return sign != EBPO_SIGN_UNKNOWN ? sign : ebpo_orient2d_exact(a, b, c);
}

/* The differences of b, c, d to a, one row for each axis. */
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
    return filtered(det, 8 * eps * permanent + slack * (1 + third));
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
    /* Everything in one axis-parallel plane: the commonest zero there is. */
    for (int k = 0; k < 3; k++)
        if (m[k][0] == 0 && m[k][1] == 0 && m[k][2] == 0)
            return 0;
    /* Faces that share a corner. */
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
    int sign = filtered(sum, (n + 2) * eps * permanent + slack);
    if (sign == EBPO_SIGN_UNKNOWN)
        sign = ebpo_sign_of_products_expansion(factor, n);
    return sign != EBPO_SIGN_UNKNOWN ? sign : ebpo_sign_of_products_exact(factor, n);
}
