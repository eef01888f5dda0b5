/* Tests exact predicates against rational reference implementations, for inputs where rounding
 * would decide. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "exact_reference.h"
#include "geometry/predicates.h"
#include "solids.h"

enum { CASES_2D = 20000, CASES_3D = 15000, CASES_PRODUCTS = 60000 };

START_TEST(test_orient2d_matches_rational)
{
    uint64_t state = (uint64_t)_i + 1;
    for (int i = 0; i < (int)ebpo_test_scaled(CASES_2D); i++) {
        double p[6];
        reference_points(p, 2, _i, &state);
        int expected = reference_orient2d(p);
        ck_assert_msg(ebpo_orient2d(p, p + 2, p + 4) == expected, "%s, case %d",
                      reference_kind_name(_i), i);
        ck_assert_int_eq(ebpo_orient2d_exact(p, p + 2, p + 4), expected);
        int stage = ebpo_orient2d_expansion(p, p + 2, p + 4);
        ck_assert(stage == expected || stage == EBPO_SIGN_UNKNOWN);
    }
}
END_TEST

START_TEST(test_orient3d_matches_rational)
{
    uint64_t state = (uint64_t)_i + 1;
    for (int i = 0; i < (int)ebpo_test_scaled(CASES_3D); i++) {
        double p[12];
        reference_points(p, 3, _i, &state);
        int expected = reference_orient3d(p);
        ck_assert_msg(ebpo_orient3d(p, p + 3, p + 6, p + 9) == expected, "%s, case %d",
                      reference_kind_name(_i), i);
        ck_assert_int_eq(ebpo_orient3d_exact(p, p + 3, p + 6, p + 9), expected);
        int stage = ebpo_orient3d_expansion(p, p + 3, p + 6, p + 9);
        ck_assert(stage == expected || stage == EBPO_SIGN_UNKNOWN);
    }
}
END_TEST

START_TEST(test_expansion_stage_decides_common_inputs)
{
    static const int kinds[] = { 0, 1, 2, 3, 8, 9, 11, 12, 13 };
    uint64_t state = 5;
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++)
        for (int i = 0; i < 1000; i++) {
            double p[12];
            reference_points(p, 3, kinds[k], &state);
            ck_assert_int_ne(ebpo_orient3d_expansion(p, p + 3, p + 6, p + 9), EBPO_SIGN_UNKNOWN);
        }
}
END_TEST

/* Tests millions of calls without a reference implementation. Swapping two points changes the
 * sign; rotating three points keeps it. */
START_TEST(test_orientation_sign_changes_with_swap)
{
    uint64_t state = (uint64_t)_i + 77;
    for (int i = 0; i < (int)ebpo_test_scaled(20000); i++) {
        double p[12];
        const double *a = p, *b = p + 3, *c = p + 6, *d = p + 9;
        reference_points(p, 3, _i, &state);
        int sign = ebpo_orient3d(a, b, c, d);
        ck_assert_int_eq(ebpo_orient3d(b, a, c, d), -sign);
        ck_assert_int_eq(ebpo_orient3d(a, b, d, c), -sign);
        ck_assert_int_eq(ebpo_orient3d(d, b, c, a), -sign);
        ck_assert_int_eq(ebpo_orient3d(b, c, a, d), sign);
        reference_points(p, 2, _i, &state);
        sign = ebpo_orient2d(p, p + 2, p + 4);
        ck_assert_int_eq(ebpo_orient2d(p + 2, p, p + 4), -sign);
        ck_assert_int_eq(ebpo_orient2d(p + 4, p, p + 2), sign);
    }
}
END_TEST

START_TEST(test_orientation_signs_match_documentation)
{
    const double o[3] = { 0, 0, 0 }, x[3] = { 1, 0, 0 }, y[3] = { 0, 1, 0 }, z[3] = { 0, 0, 1 };
    ck_assert_int_eq(ebpo_orient2d(o, x, y), 1);
    ck_assert_int_eq(ebpo_orient3d(o, x, y, z), 1);
    ck_assert_int_eq(ebpo_orient3d(o, y, x, z), -1);
    const double tiny[3] = { 0, 0, 0x1p-1074 };
    ck_assert_int_eq(ebpo_orient3d(o, x, y, tiny), 1);
}
END_TEST

START_TEST(test_zero_area_finds_collinear_points)
{
    uint64_t state = 9;
    int zero = 0;
    for (int i = 0; i < 100000; i++) {
        double p[9];
        for (int k = 0; k < 9; k++)
            p[k] = ldexp((double)reference_integer(&state, -1, 1), i % 2 ? -1074 : 0);
        bool expected = true;
        for (int k = 0; k < 3; k++) {
            int u = (k + 1) % 3, v = (k + 2) % 3;
            expected &= reference_orient2d(
                            (double[]){ p[u], p[v], p[3 + u], p[3 + v], p[6 + u], p[6 + v] }) == 0;
        }
        zero += expected;
        ck_assert_int_eq(ebpo_zero_area(p, p + 3, p + 6), expected);
    }
    ck_assert_int_gt(zero, 1000);
}
END_TEST

/* Makes sums that cancel. Later products repeat earlier ones with the opposite sign, some of them
 * changed by one ulp. */
static int cancelling_factors(double *f, int kind, uint64_t *state)
{
    double p[12];
    int n = (int)reference_integer(state, 0, 8);
    for (int i = 0; i < 2 * n; i += 12) {
        reference_points(p, 3, kind, state);
        memcpy(f + i, p, sizeof *p * (size_t)(2 * n - i < 12 ? 2 * n - i : 12));
    }
    for (int i = 0; i + 1 < n; i += 2) {
        f[2 * i + 2] = -f[2 * i + 1];
        f[2 * i + 3] = reference_random(state) % 4 ? f[2 * i] : nextafter(f[2 * i], 0);
    }
    return n;
}

START_TEST(test_sign_of_products_matches_rational)
{
    uint64_t state = 21;
    for (int i = 0; i < CASES_PRODUCTS; i++) {
        double f[16];
        int kind = i % REFERENCE_KINDS, n = cancelling_factors(f, kind, &state);
        int expected = reference_sign_of_products(f, n);
        ck_assert_msg(ebpo_sign_of_products(f, n) == expected, "%s, case %d",
                      reference_kind_name(kind), i);
        ck_assert_int_eq(ebpo_sign_of_products_exact(f, n), expected);
        int stage = ebpo_sign_of_products_expansion(f, n);
        ck_assert(stage == expected || stage == EBPO_SIGN_UNKNOWN);
    }
}
END_TEST

TEST_SUITE(predicates)
{
    TCase *tests = tcase_create("predicates");
    tcase_set_timeout(tests, 300);
    tcase_add_loop_test(tests, test_orient2d_matches_rational, 0, REFERENCE_KINDS);
    tcase_add_loop_test(tests, test_orient3d_matches_rational, 0, REFERENCE_KINDS);
    tcase_add_test(tests, test_expansion_stage_decides_common_inputs);
    tcase_add_loop_test(tests, test_orientation_sign_changes_with_swap, 0, REFERENCE_KINDS);
    tcase_add_test(tests, test_orientation_signs_match_documentation);
    tcase_add_test(tests, test_zero_area_finds_collinear_points);
    tcase_add_test(tests, test_sign_of_products_matches_rational);
    Suite *suite = suite_create("predicates");
    suite_add_tcase(suite, tests);
    return suite;
}
