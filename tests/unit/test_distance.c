/* Tests the distance of a point and a triangle against its definition in rational arithmetic
 * (mpq): the minimum of the distance from the plane, if the projection of the point is inside, and
 * of the distances from the three edges. */
#include <float.h>
#include <gmp.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "geometry/double_double_kernels.h"

typedef struct point {
    mpq_t x[3];
} point;

static uint64_t state = 1;

static double random_unit(void)
{
    state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return (double)(state >> 11) * 0x1p-53;
}

static void init(point *p)
{
    for (int k = 0; k < 3; k++)
        mpq_init(p->x[k]);
}

static void clear(point *p)
{
    for (int k = 0; k < 3; k++)
        mpq_clear(p->x[k]);
}

static void set_difference(point *out, const double a[3], const double b[3])
{
    mpq_t y;
    mpq_init(y);
    for (int k = 0; k < 3; k++) {
        mpq_set_d(out->x[k], a[k]);
        mpq_set_d(y, b[k]);
        mpq_sub(out->x[k], out->x[k], y);
    }
    mpq_clear(y);
}

static void dot(mpq_t out, const point *a, const point *b)
{
    mpq_t y;
    mpq_init(y);
    mpq_set_ui(out, 0, 1);
    for (int k = 0; k < 3; k++) {
        mpq_mul(y, a->x[k], b->x[k]);
        mpq_add(out, out, y);
    }
    mpq_clear(y);
}

static void cross(point *out, const point *a, const point *b)
{
    mpq_t y;
    mpq_init(y);
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        mpq_mul(out->x[k], a->x[u], b->x[v]);
        mpq_mul(y, a->x[v], b->x[u]);
        mpq_sub(out->x[k], out->x[k], y);
    }
    mpq_clear(y);
}

static void segment_square(mpq_t out, const double p[3], const double a[3], const double b[3])
{
    point d, e;
    mpq_t t, length2, y;
    init(&d);
    init(&e);
    mpq_inits(t, length2, y, NULL);
    set_difference(&d, p, a);
    set_difference(&e, b, a);
    dot(t, &d, &e);
    dot(length2, &e, &e);
    if (mpq_sgn(t) <= 0 || mpq_sgn(length2) == 0)
        mpq_set_ui(t, 0, 1);
    else if (mpq_cmp(t, length2) >= 0)
        mpq_set_ui(t, 1, 1);
    else
        mpq_div(t, t, length2);
    for (int k = 0; k < 3; k++) {
        mpq_mul(y, t, e.x[k]);
        mpq_sub(d.x[k], d.x[k], y);
    }
    dot(out, &d, &d);
    mpq_clears(t, length2, y, NULL);
    clear(&d);
    clear(&e);
}

static void exact_square(mpq_t out, const double p[3], const double t[3][3])
{
    point e[3], n, d, w;
    mpq_t y;
    bool inside = true;
    mpq_init(y);
    init(&n);
    init(&d);
    init(&w);
    for (int i = 0; i < 3; i++) {
        init(&e[i]);
        set_difference(&e[i], t[(i + 1) % 3], t[i]);
        segment_square(y, p, t[i], t[(i + 1) % 3]);
        if (i == 0 || mpq_cmp(y, out) < 0)
            mpq_set(out, y);
    }
    cross(&n, &e[0], &e[1]);
    for (int i = 0; i < 3; i++) {
        set_difference(&d, p, t[i]);
        cross(&w, &e[i], &d);
        dot(y, &w, &n);
        inside = inside && mpq_sgn(y) >= 0;
    }
    mpq_t nn;
    mpq_init(nn);
    dot(nn, &n, &n);
    if (inside && mpq_sgn(nn) > 0) {
        dot(y, &n, &d);
        mpq_mul(y, y, y);
        mpq_div(y, y, nn);
        if (mpq_cmp(y, out) < 0)
            mpq_set(out, y);
    }
    mpq_clears(y, nn, NULL);
    for (int i = 0; i < 3; i++)
        clear(&e[i]);
    clear(&n);
    clear(&d);
    clear(&w);
}

/* Returns the sign of d^2 - square, where d is a double or the middle between two neighbouring
 * doubles. */
static int compare_square(double d, double next, const mpq_t square)
{
    mpq_t x, y;
    mpq_inits(x, y, NULL);
    mpq_set_d(x, d);
    mpq_set_d(y, next);
    mpq_add(x, x, y);
    mpq_div_2exp(x, x, 1);
    mpq_mul(x, x, x);
    int sign = mpq_cmp(x, square);
    mpq_clears(x, y, NULL);
    return sign;
}

static bool rounded_correctly(double d, const mpq_t square)
{
    if (d == 0)
        return mpq_sgn(square) == 0 || compare_square(0, DBL_TRUE_MIN, square) >= 0;
    return compare_square(d, nextafter(d, 0), square) <= 0 &&
           compare_square(d, nextafter(d, INFINITY), square) >= 0;
}

/* Makes a point that is far away on some axes, up to the range of doubles, and among the
 * coordinates of the triangle on others. */
static void make_far_case(int kind, double p[3], double t[3][3])
{
    double scale = kind == 13 ? 0x1p-1070 : 1;
    for (int i = 0; i < 9; i++)
        t[i / 3][i % 3] = kind == 14 ? random_unit() : floor(random_unit() * 4) * scale;
    for (int k = 0; k < 3; k++) {
        p[k] = kind == 14 ? random_unit() : floor(random_unit() * 8) / 2 * scale;
        if (random_unit() < 0.6)
            p[k] = ldexp(random_unit() - 0.5, (int)(random_unit() * 1020));
    }
    if (random_unit() < 0.3) /* in a plane across an axis */
        t[0][1] = t[1][1] = t[2][1] = scale;
}

/* Fifteen kinds of difficult cases. */
enum { KINDS = 15 };
static void make_case(int kind, double p[3], double t[3][3])
{
    if (kind >= 12) {
        make_far_case(kind, p, t);
        return;
    }
    double scale = kind == 9 ? 0x1p990 : kind == 10 ? 0x1p-1000 : 1;
    for (int i = 0; i < 12; i++) {
        double r = random_unit();
        double x = kind < 3     ? floor(r * 4) * (kind == 1 && i > 8 ? 0.5 : 1)
                   : kind == 3  ? (double)(float)r
                   : kind == 11 ? 1e7 + 1e-3 * r
                                : (2 * r - 1) * scale;
        if (i < 9)
            t[i / 3][i % 3] = x;
        else
            p[i - 9] = kind == 8 ? x * 1e15 : kind > 2 && kind < 11 ? 3 * x : x;
    }
    double s = random_unit(), r = random_unit() * (1 - s);
    for (int k = 0; k < 3; k++) {
        if (kind == 5 || kind == 6)
            t[2][k] = t[0][k] + s * (t[1][k] - t[0][k]) + (kind == 5 ? 1e-9 * random_unit() : 0);
        if (kind == 4)
            p[k] = t[0][k] * s + t[1][k] * r + t[2][k] * (1 - s - r);
        if (kind == 7)
            p[k] = nextafter(t[0][k], random_unit() < 0.5 ? -INFINITY : INFINITY);
    }
}

enum { CASES = 24000 };

START_TEST(test_distance_rounding_and_bounds)
{
    mpq_t square;
    mpq_init(square);
    state = 77;
    for (int i = 0; i < CASES; i++) {
        double p[3], t[3][3];
        make_case(i % KINDS, p, t);
        exact_square(square, p, (const double(*)[3])t);
        ebpo_triangle_nearest n;
        ebpo_distance_bounds b;
        double normal[3], alone[3];
        ebpo_triangle_nearest_exact(p, (const double(*)[3])t, NULL, normal, &n);
        ebpo_triangle_unit_normal((const double(*)[3])t, alone);
        ck_assert_msg(memcmp(normal, alone, sizeof normal) == 0, "case %d: the normal differs", i);
        ebpo_triangle_distance_bounds(p, (const double(*)[3])t, &b);
        ck_assert_msg(rounded_correctly(n.distance, square), "case %d: %a is not the distance", i,
                      n.distance);
        ck_assert_msg(compare_square(b.lo, b.lo, square) <= 0,
                      "case %d: lower bound %a is above %a", i, b.lo, n.distance);
        ck_assert_msg(isinf(b.hi) || compare_square(b.hi, b.hi, square) >= 0,
                      "case %d: upper bound %a is below %a", i, b.hi, n.distance);
        ck_assert_msg(b.feature == EBPO_NEAR_UNKNOWN || b.feature == n.feature,
                      "case %d: feature %d, it is %d", i, b.feature, n.feature);
        int sign = ebpo_triangle_distance_compare_to(p, (const double(*)[3])t, n.distance);
        ck_assert_int_eq(sign, -compare_square(n.distance, n.distance, square));
    }
    mpq_clear(square);
}
END_TEST

START_TEST(test_distance_comparisons_are_exact)
{
    mpq_t x, y;
    mpq_inits(x, y, NULL);
    state = 78;
    int ties = 0;
    for (int i = 0; i < CASES; i++) {
        double p[3], q[3], a[3][3], b[3][3];
        make_case(i % KINDS, p, a);
        make_case(i % KINDS, q, b);
        if (i / KINDS % 2) /* neighbours share an edge, or a corner */
            memcpy(b, a, (size_t)(1 + i / KINDS % 4 / 2) * sizeof a[0]);
        exact_square(x, p, (const double(*)[3])a);
        exact_square(y, p, (const double(*)[3])b);
        int right = mpq_cmp(x, y);
        right = (right > 0) - (right < 0);
        ties += right == 0;
        ck_assert_int_eq(ebpo_triangle_distance_compare(p, (const double(*)[3])a,
                                                        (const double(*)[3])b),
                         right);
    }
    ck_assert_int_gt(ties, CASES / 20);
    mpq_clears(x, y, NULL);
}
END_TEST

/* The square of each component is within 3 ulp of n_k^2 / n . n, and its sign is correct. */
START_TEST(test_unit_normals_of_slivers)
{
    mpq_t nn, y;
    mpq_inits(nn, y, NULL);
    state = 79;
    for (int i = 0; i < CASES; i++) {
        double p[3], t[3][3], normal[3];
        point e, f, n;
        make_case(i % KINDS, p, t);
        ebpo_triangle_unit_normal((const double(*)[3])t, normal);
        init(&e);
        init(&f);
        init(&n);
        set_difference(&e, t[1], t[0]);
        set_difference(&f, t[2], t[0]);
        cross(&n, &e, &f);
        dot(nn, &n, &n);
        for (int k = 0; k < 3; k++) {
            if (mpq_sgn(n.x[k]) == 0) {
                ck_assert_double_eq(normal[k], 0);
                continue;
            }
            mpq_mul(y, n.x[k], n.x[k]);
            mpq_div(y, y, nn);
            double size = fabs(normal[k]), ulp = nextafter(size, INFINITY) - size;
            ck_assert_msg((normal[k] < 0) == (mpq_sgn(n.x[k]) < 0) &&
                              compare_square(fmax(size - 3 * ulp, 0), fmax(size - 3 * ulp, 0), y) <=
                                  0 &&
                              compare_square(size + 3 * ulp, size + 3 * ulp, y) >= 0,
                          "case %d, axis %d: %a", i, k, normal[k]);
        }
        clear(&e);
        clear(&f);
        clear(&n);
    }
    mpq_clears(nn, y, NULL);
}
END_TEST

#if defined(__x86_64__)
/* Returns true when no product of four differences of coordinates exceeds the range of doubles.
 * Callers ensure this precondition. */
static bool in_range(const double *x, int n)
{
    for (int i = 0; i < n; i++)
        if (x[i] != 0 && (fabs(x[i]) > 0x1p100 || fabs(x[i]) < 0x1p-60))
            return false;
    return true;
}

START_TEST(test_distance_same_with_fma)
{
    if (!__builtin_cpu_supports("fma"))
        return;
    int measured = 0, normals = 0;
    state = 80;
    for (int i = 0; i < 4 * CASES; i++) {
        double p[3], t[3][3], n[3] = { 0, 0, 0 }, m[3] = { 0, 0, 0 };
        make_case(i % KINDS, p, t);
        ebpo_distance_bounds b;
        ebpo_triangle_distance_bounds(p, (const double(*)[3])t, &b);
        bool base = ebpo_distance_pairs_base.unit_normal((const double(*)[3])t, n);
        ck_assert_int_eq(base, ebpo_distance_pairs_v3.unit_normal((const double(*)[3])t, m));
        ck_assert_msg(!base || memcmp(n, m, sizeof n) == 0, "case %d: normals differ", i);
        normals += base;
        if (b.feature == EBPO_NEAR_UNKNOWN || !in_range(p, 3) || !in_range(t[0], 9))
            continue;
        ebpo_measured x, y;
        ebpo_distance_pairs_base.measure(p, (const double(*)[3])t, b.feature, n, &x);
        ebpo_distance_pairs_v3.measure(p, (const double(*)[3])t, b.feature, m, &y);
        ck_assert_msg(memcmp(&x, &y, sizeof x) == 0, "case %d: %a and %a", i, x.distance.head,
                      y.distance.head);
        measured++;
    }
    ck_assert_int_gt(measured, CASES);
    ck_assert_int_gt(normals, CASES);
}
END_TEST
#endif

TEST_SUITE(distance)
{
    Suite *suite = suite_create("distance");
    TCase *exact = tcase_create("exact");
    tcase_set_timeout(exact, 600);
    tcase_add_test(exact, test_distance_rounding_and_bounds);
    tcase_add_test(exact, test_distance_comparisons_are_exact);
    tcase_add_test(exact, test_unit_normals_of_slivers);
#if defined(__x86_64__)
    tcase_add_test(exact, test_distance_same_with_fma);
#endif
    suite_add_tcase(suite, exact);
    return suite;
}
