/* Distance to a triangle without rounding: coordinates as integers in a common power of two, the
 * squared distance as a fraction of integers. */
#include "geom/strict_fp.h"

#include <float.h>
#include <limits.h>
#include <math.h>
#include <string.h>

#include <gmp.h>

#include "geom/distance_parts.h"

typedef struct vector {
    mpz_t x[3];
} vector;

static void vector_init(vector *v)
{
    for (int k = 0; k < 3; k++)
        mpz_init(v->x[k]);
}

static void vector_clear(vector *v)
{
    for (int k = 0; k < 3; k++)
        mpz_clear(v->x[k]);
}

static void vector_subtract(vector *out, const vector *a, const vector *b)
{
    for (int k = 0; k < 3; k++)
        mpz_sub(out->x[k], a->x[k], b->x[k]);
}

static void vector_dot(mpz_t out, const vector *a, const vector *b)
{
    mpz_mul(out, a->x[0], b->x[0]);
    mpz_addmul(out, a->x[1], b->x[1]);
    mpz_addmul(out, a->x[2], b->x[2]);
}

static void vector_cross(vector *out, const vector *a, const vector *b)
{
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        mpz_mul(out->x[k], a->x[u], b->x[v]);
        mpz_submul(out->x[k], a->x[v], b->x[u]);
    }
}

/* Least exponent e such that all are multiples of 2^e. */
static int common_unit(const double *x, int n, int unit)
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

static void set_integer(mpz_t out, double x, int unit)
{
    int e;
    double fraction = frexp(x, &e);
    mpz_set_d(out, ldexp(fraction, 53));
    if (x != 0)
        mpz_mul_2exp(out, out, (mp_bitcnt_t)(e - 53 - unit));
}

/* The nearest point is p + numerator / denominator, the squared distance square / denominator2. */
typedef struct nearest {
    int unit;
    vector p, corner[3], edge[3], normal; /* corners relative to p */
    mpz_t square, denominator;            /* squared distance in squared units */
    vector offset;                        /* nearest point less p, times offset_denominator */
    mpz_t offset_denominator;
    ebpo_feature feature;
    mpz_t t, u;
    vector w;
} nearest;

static void nearest_init(nearest *n)
{
    vector *all[] = { &n->p,       &n->corner[0], &n->corner[1], &n->corner[2], &n->edge[0],
                      &n->edge[1], &n->edge[2],   &n->normal,    &n->offset,    &n->w };
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++)
        vector_init(all[i]);
    mpz_inits(n->square, n->denominator, n->offset_denominator, n->t, n->u, NULL);
}

static void nearest_clear(nearest *n)
{
    vector *all[] = { &n->p,       &n->corner[0], &n->corner[1], &n->corner[2], &n->edge[0],
                      &n->edge[1], &n->edge[2],   &n->normal,    &n->offset,    &n->w };
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++)
        vector_clear(all[i]);
    mpz_clears(n->square, n->denominator, n->offset_denominator, n->t, n->u, NULL);
}

static void set_points(nearest *n, const double p[3], const double triangle[3][3], int unit)
{
    n->unit = unit;
    for (int k = 0; k < 3; k++) {
        set_integer(n->p.x[k], p[k], unit);
        for (int i = 0; i < 3; i++) {
            set_integer(n->corner[i].x[k], triangle[i][k], unit);
            mpz_sub(n->corner[i].x[k], n->corner[i].x[k], n->p.x[k]);
        }
    }
    for (int i = 0; i < 3; i++)
        vector_subtract(&n->edge[i], &n->corner[(i + 1) % 3], &n->corner[i]);
    vector_cross(&n->normal, &n->edge[0], &n->edge[1]);
}

static bool try_interior(nearest *n)
{
    vector_dot(n->denominator, &n->normal, &n->normal);
    if (mpz_sgn(n->denominator) == 0)
        return false;
    for (int i = 0; i < 3; i++) {
        vector_cross(&n->w, &n->edge[i], &n->normal);
        vector_dot(n->t, &n->w, &n->corner[i]);
        if (mpz_sgn(n->t) <= 0)
            return false;
    }
    vector_dot(n->t, &n->normal, &n->corner[0]);
    mpz_mul(n->square, n->t, n->t);
    for (int k = 0; k < 3; k++)
        mpz_mul(n->offset.x[k], n->normal.x[k], n->t);
    mpz_set(n->offset_denominator, n->denominator);
    n->feature = EBPO_NEAR_INTERIOR;
    return true;
}

/* Takes corner or edge when it is nearer than what was found (of equal ones: the corner). */
static void offer(nearest *n, bool first, const mpz_t square, const mpz_t denominator,
                  ebpo_feature feature, bool *taken)
{
    int sign = -1;
    *taken = false;
    if (!first) {
        mpz_t left, right;
        mpz_inits(left, right, NULL);
        mpz_mul(left, square, n->denominator);
        mpz_mul(right, n->square, denominator);
        sign = mpz_cmp(left, right);
        mpz_clears(left, right, NULL);
    }
    if (sign > 0 || (sign == 0 && feature >= n->feature))
        return;
    mpz_set(n->square, square);
    mpz_set(n->denominator, denominator);
    n->feature = feature;
    *taken = true;
}

static void offer_edge(nearest *n, int i)
{
    mpz_t along, length2, square;
    bool taken;
    mpz_inits(along, length2, square, NULL);
    vector_dot(along, &n->corner[i], &n->edge[i]);
    mpz_neg(along, along); /* projection of p on the edge, times its length */
    vector_dot(length2, &n->edge[i], &n->edge[i]);
    if (mpz_sgn(along) > 0 && mpz_cmp(along, length2) < 0) {
        vector_dot(square, &n->corner[i], &n->corner[i]);
        mpz_mul(square, square, length2);
        mpz_submul(square, along, along);
        offer(n, false, square, length2, (ebpo_feature)(EBPO_NEAR_EDGE0 + i), &taken);
        if (taken) {
            for (int k = 0; k < 3; k++) {
                mpz_mul(n->offset.x[k], n->corner[i].x[k], length2);
                mpz_addmul(n->offset.x[k], n->edge[i].x[k], along);
            }
            mpz_set(n->offset_denominator, length2);
        }
    }
    mpz_clears(along, length2, square, NULL);
}

static void offer_corner(nearest *n, int i)
{
    mpz_t one, square;
    bool taken;
    mpz_inits(one, square, NULL);
    mpz_set_ui(one, 1);
    vector_dot(square, &n->corner[i], &n->corner[i]);
    offer(n, i == 0, square, one, (ebpo_feature)(EBPO_NEAR_CORNER0 + i), &taken);
    if (taken) {
        for (int k = 0; k < 3; k++)
            mpz_set(n->offset.x[k], n->corner[i].x[k]);
        mpz_set_ui(n->offset_denominator, 1);
    }
    mpz_clears(one, square, NULL);
}

static void find(nearest *n)
{
    if (try_interior(n))
        return;
    for (int i = 0; i < 3; i++)
        offer_corner(n, i);
    for (int i = 0; i < 3; i++)
        offer_edge(n, i);
}

/* The double nearest to m * 2^exponent, ties to even; the lowest bit of m may stand for whatever
 * lies below it. */
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

/* sqrt(square / denominator) * 2^unit, rounded correctly. */
static double root_of_fraction(const mpz_t square, const mpz_t denominator, int unit)
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

/* (numerator / denominator) * 2^unit, rounded. */
static double fraction_value(const mpz_t numerator, const mpz_t denominator, int unit)
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

void ebpo_triangle_nearest_gmp(const double p[3], const double triangle[3][3],
                               ebpo_triangle_nearest *out)
{
    nearest n;
    nearest_init(&n);
    set_points(&n, p, triangle, common_unit(&triangle[0][0], 9, common_unit(p, 3, INT_MAX - 64)));
    find(&n);
    out->feature = n.feature;
    out->distance = root_of_fraction(n.square, n.denominator, n.unit);
    for (int k = 0; k < 3; k++) {
        mpz_addmul(n.offset.x[k], n.p.x[k], n.offset_denominator);
        out->point[k] = fraction_value(n.offset.x[k], n.offset_denominator, n.unit);
    }
    if (n.feature <= EBPO_NEAR_CORNER2)
        memcpy(out->point, triangle[n.feature], sizeof out->point);
    nearest_clear(&n);
}

int ebpo_triangle_distance_compare_gmp(const double p[3], const double a[3][3],
                                       const double b[3][3])
{
    nearest n, m;
    nearest_init(&n);
    nearest_init(&m);
    int unit = common_unit(&b[0][0], 9, common_unit(&a[0][0], 9, common_unit(p, 3, INT_MAX - 64)));
    set_points(&n, p, a, unit);
    set_points(&m, p, b, unit);
    find(&n);
    find(&m);
    mpz_mul(n.t, n.square, m.denominator);
    mpz_mul(m.t, m.square, n.denominator);
    int sign = mpz_cmp(n.t, m.t);
    nearest_clear(&n);
    nearest_clear(&m);
    return (sign > 0) - (sign < 0);
}

int ebpo_triangle_distance_compare_to_gmp(const double p[3], const double triangle[3][3], double d)
{
    nearest n;
    nearest_init(&n);
    set_points(&n, p, triangle,
               common_unit(&triangle[0][0], 9,
                           common_unit(p, 3, common_unit(&d, 1, INT_MAX - 64))));
    find(&n);
    set_integer(n.t, d, n.unit);
    mpz_mul(n.t, n.t, n.t);
    mpz_mul(n.t, n.t, n.denominator);
    int sign = mpz_cmp(n.square, n.t);
    nearest_clear(&n);
    return (sign > 0) - (sign < 0);
}

void ebpo_triangle_unit_normal_gmp(const double triangle[3][3], double normal[3])
{
    static const double origin[3];
    nearest n;
    nearest_init(&n);
    set_points(&n, origin, triangle, common_unit(&triangle[0][0], 9, INT_MAX - 64));
    vector_dot(n.t, &n.normal, &n.normal);
    for (int k = 0; k < 3; k++) {
        mpz_mul(n.u, n.normal.x[k], n.normal.x[k]);
        double size = mpz_sgn(n.t) ? root_of_fraction(n.u, n.t, 0) : 0;
        normal[k] = mpz_sgn(n.normal.x[k]) < 0 ? -size : size;
    }
    nearest_clear(&n);
}
