/* Computes half solid angles of triangles.
 *
 * The half angle is the argument of a complex number (solid_angle.h). Its imaginary part is the
 * determinant of A, B and C, the corners minus p; its real part is a sum of four terms.
 *
 * Error in doubles, with u = 2^-53 and M = |A||B||C|. Each component of A, B, C has a relative
 * error of at most u. The determinant is a sum of 6 products whose absolute values sum up to at
 * most sqrt(3) M. Each product has 3 rounded factors, 2 rounded multiplications and at most 3
 * rounded additions. So the error of the determinant is at most 8 u sqrt(3) M < 14 u M, to first
 * order. A dot product has an error of at most 5 u times the product of the lengths, and a length
 * has a relative error of at most 4 u. So each of the four terms of the real part has an error of
 * at most 13 u M. Each of the three additions has an error of at most 4 u M. Together this is 64 u
 * M. The errors of both parts are together below 80 u M. The code uses E = 2^-46 M, which is 1.6
 * times as much, for terms of second order and the rounding of M. Let H > 2 E be the absolute value
 * of the computed number. Its argument differs from the exact argument by at most asin(E / H) < 1.1
 * E / H, and is computed within 2^-48. The code uses 2 E / H + 2^-48.
 *
 * Near the negative real axis the sign of the imaginary part decides between pi and -pi. If this
 * sign is uncertain, the exact orientation of the shifted point (predicates.h) decides, and the
 * bounds are limited to pi or -pi.
 *
 * In 512 bits, A, B and C have relative errors of at most 2^-510. The same computation of errors
 * gives at most 80 * 2^-509 M; the code uses 2^-500 M.
 *
 * At a point p on the edge from a to b, let e = b - a, h = c - p, and d the direction of the shift.
 * There, the complex number is the limit for a small shift: -(|e|^2 (d.h) - (d.e)(h.e)) + i |e|
 * (e.(d x h)), divided by its absolute value. The argument is the angle around the edge from -d to
 * h. */
#include "core/strict_fp.h"

#include "geometry/solid_angle.h"

#include <math.h>

#include "geometry/predicates.h"
#include "geometry/vec3.h"

/* --- doubles --- */

/* Returns atan(t) for t in [0, 1]. Reduces the argument to an absolute value of at most 1/8. The
 * series has terms up to t^17; the next term is below 2^-61. */
static double small_argument(double t)
{
    static const double angle[5] = { 0, 0x1.f5b75f92c80ddp-3, 0x1.dac670561bb4fp-2,
                                     0x1.4978fa3269ee1p-1, 0x1.921fb54442d18p-1 };
    int quarter = (int)(4 * t + 0.5);
    double from = 0.25 * quarter, x = (t - from) / (1 + t * from), square = x * x, sum = 0;
    for (int k = 17; k >= 1; k -= 2)
        sum = (k % 4 == 1 ? 1.0 : -1.0) / k + square * sum;
    return angle[quarter] + x * sum;
}

double ebpo_argument(double y, double x)
{
    double ay = fabs(y), ax = fabs(x);
    if (!(ay > 0 || ax > 0) || !(ay < INFINITY && ax < INFINITY))
        return 0;
    double out = ay <= ax ? small_argument(ay / ax) : EBPO_PI_LOW / 2 - small_argument(ax / ay);
    if (x < 0)
        out = EBPO_PI_LOW - out;
    return y < 0 ? -out : out;
}

/* Returns the sign of the half angle's sine for the shifted point. Returns 0 for a triangle without
 * area. */
static int shifted_sign(const double p[3], const double a[3], const double b[3], const double c[3])
{
    int sign = ebpo_orient3d(a, b, c, p);
    for (int k = 0; k < 3 && sign == 0; k++)
        sign = ebpo_normal_sign(k, a, b, c);
    return -sign;
}

/* Returns the interval from |angle| - error to pi, multiplied by `sign`, the exact sign of the
 * argument. */
static ebpo_bounded cut_at_pi(double angle, double error, int sign)
{
    double low = fabs(angle) - error;
    if (sign == 0) /* no area */
        return (ebpo_bounded){ 0, 0 };
    return (ebpo_bounded){ sign * (low + EBPO_PI_HIGH) / 2, (EBPO_PI_HIGH - low) / 2 + 0x1p-50 };
}

ebpo_bounded ebpo_half_angle(const double p[3], const double a[3], const double b[3],
                             const double c[3])
{
    const ebpo_bounded unknown = { 0, EBPO_PI_HIGH };
    double A[3], B[3], C[3], n[3];
    ebpo_vec3_subtract(a, p, A);
    ebpo_vec3_subtract(b, p, B);
    ebpo_vec3_subtract(c, p, C);
    ebpo_vec3_cross(B, C, n);
    double la = ebpo_vec3_length(A), lb = ebpo_vec3_length(B), lc = ebpo_vec3_length(C);
    double all = la * lb * lc, margin = 0x1p-46 * all;
    double sine = ebpo_vec3_dot(A, n);
    double cosine =
        all + ebpo_vec3_dot(A, B) * lc + ebpo_vec3_dot(B, C) * la + ebpo_vec3_dot(C, A) * lb;
    double length = sqrt(sine * sine + cosine * cosine);
    /* in this range no product overflows, and underflow is far below the margin */
    bool good = la > 0x1p-100 && lb > 0x1p-100 && lc > 0x1p-100 && la < 0x1p100 && lb < 0x1p100 &&
                lc < 0x1p100 && length > 2 * margin;
    if (!good)
        return unknown;
    double angle = ebpo_argument(sine, cosine), error = 2 * margin / length + 0x1p-48;
    if (cosine < 0 && fabs(sine) <= margin)
        return cut_at_pi(angle, error, shifted_sign(p, a, b, c));
    return (ebpo_bounded){ angle, error };
}

/* --- 512 bits --- */

typedef struct big_vector {
    ebpo_big x[3];
} big_vector;

static big_vector big_difference(const double from[3], const double to[3])
{
    big_vector out;
    for (int k = 0; k < 3; k++) {
        ebpo_big a = ebpo_big_of(from[k]), b = ebpo_big_of(to[k]);
        out.x[k] = ebpo_big_subtract(&b, &a);
    }
    return out;
}

static ebpo_big big_dot(const big_vector *a, const big_vector *b)
{
    ebpo_big sum = ebpo_big_multiply(&a->x[0], &b->x[0]);
    for (int k = 1; k < 3; k++) {
        ebpo_big product = ebpo_big_multiply(&a->x[k], &b->x[k]);
        sum = ebpo_big_add(&sum, &product);
    }
    return sum;
}

static ebpo_big big_determinant(const big_vector *a, const big_vector *b, const big_vector *c)
{
    big_vector n;
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        ebpo_big plus = ebpo_big_multiply(&b->x[u], &c->x[v]),
                 minus = ebpo_big_multiply(&b->x[v], &c->x[u]);
        n.x[k] = ebpo_big_subtract(&plus, &minus);
    }
    return big_dot(a, &n);
}

static ebpo_big big_length(const big_vector *a)
{
    ebpo_big square = big_dot(a, a);
    return ebpo_big_root(&square);
}

/* Sets out->error and out->angle. `sign`: exact sign of the imaginary part for the shifted point.
 * `all`: bound of each term of the real and of the imaginary part. Returns false if 512 bits do not
 * suffice. */
static bool finish_exact(ebpo_exact_angle *out, int sign, const ebpo_big *all)
{
    const ebpo_big *x = &out->turn.real, *y = &out->turn.imaginary;
    if ((x->sign == 0 && y->sign == 0) || all->sign == 0)
        return false;
    /* in this common unit the greater part is in [1/2, 1) */
    int64_t unit =
        x->sign == 0 || (y->sign != 0 && y->exponent > x->exponent) ? y->exponent : x->exponent;
    out->error = ldexp(ebpo_big_double(all, unit), -498);
    if (!(out->error <= 0x1p-300))
        return false;
    double real = ebpo_big_double(x, unit), angle = ebpo_argument(ebpo_big_double(y, unit), real);
    out->angle = real < 0 ? sign * fabs(angle) : angle;
    return true;
}

/* Computes the half angle at a point p on the edge from a to b, as the limit for a small shift. */
static bool angle_on_edge(const double p[3], const double a[3], const double b[3],
                          const double c[3], ebpo_exact_angle *out)
{
    big_vector e = big_difference(a, b), h = big_difference(p, c);
    ebpo_big square = big_dot(&e, &e), length = big_length(&e), along = big_dot(&h, &e);
    int first = a[1] == b[1] && a[2] == b[2]; /* the first axis that is not parallel to the edge */
    big_vector d = { { ebpo_big_of(first == 0), ebpo_big_of(first == 1), ebpo_big_of(0) } };
    ebpo_big across = ebpo_big_multiply(&square, &h.x[first]),
             part = ebpo_big_multiply(&e.x[first], &along), sine = big_determinant(&e, &d, &h),
             distance = big_length(&h);
    ebpo_big all = ebpo_big_multiply(&square, &distance);
    out->turn.real = ebpo_big_subtract(&part, &across);
    out->turn.imaginary =
        ebpo_normal_sign(first, a, b, c) == 0 ? ebpo_big_of(0) : ebpo_big_multiply(&length, &sine);
    return finish_exact(out, shifted_sign(p, a, b, c), &all);
}

/* Returns true if p is on the line through a and b, between them. */
static bool is_between(const double p[3], const double a[3], const double b[3])
{
    for (int k = 0; k < 3; k++)
        if ((p[k] < a[k] && p[k] < b[k]) || (p[k] > a[k] && p[k] > b[k]))
            return false;
    return ebpo_zero_area(p, a, b);
}

static bool same_point(const double p[3], const double q[3])
{
    return p[0] == q[0] && p[1] == q[1] && p[2] == q[2];
}

bool ebpo_half_angle_exact(const double p[3], const double a[3], const double b[3],
                           const double c[3], ebpo_exact_angle *out)
{
    const double *corner[3] = { a, b, c };
    int sign = ebpo_orient3d(a, b, c, p);
    if (ebpo_zero_area(a, b, c)) {
        *out = (ebpo_exact_angle){ { ebpo_big_of(1), ebpo_big_of(0) }, 0, 0 };
        return true;
    }
    for (int i = 0; i < 3 && sign == 0; i++)
        if (same_point(p, corner[i]))
            return false;
    for (int i = 0; i < 3 && sign == 0; i++)
        if (is_between(p, corner[i], corner[(i + 1) % 3]))
            return angle_on_edge(p, corner[i], corner[(i + 1) % 3], corner[(i + 2) % 3], out);
    big_vector v[3];
    ebpo_big length[3], all;
    for (int i = 0; i < 3; i++) {
        v[i] = big_difference(p, corner[i]);
        length[i] = big_length(&v[i]);
    }
    all = ebpo_big_multiply(&length[0], &length[1]);
    all = ebpo_big_multiply(&all, &length[2]);
    out->turn.real = all;
    for (int i = 0; i < 3; i++) {
        ebpo_big dot = big_dot(&v[i], &v[(i + 1) % 3]),
                 term = ebpo_big_multiply(&dot, &length[(i + 2) % 3]);
        out->turn.real = ebpo_big_add(&out->turn.real, &term);
    }
    out->turn.imaginary = sign == 0 ? ebpo_big_of(0) : big_determinant(&v[0], &v[1], &v[2]);
    return finish_exact(out, shifted_sign(p, a, b, c), &all);
}
