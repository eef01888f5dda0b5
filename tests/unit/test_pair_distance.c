/* Tests distances of faces against the minimum over all pairs of features, in rational arithmetic.
 */
#include <math.h>
#include <string.h>

#include "check_main.h"
#include "exact_reference.h"
#include "extras/collide/face_pairs.h"
#include "geometry/triangle_pair.h"
#include "pair_reference.h"
#include "solids.h"

enum { CASES = 400 };

#define CORNERS(face) ((const double(*)[3])(face))

/* Checks that the exact distance is within half a unit in the last place of d. */
static void check_rounded(const double a[3][3], const double b[3][3], double d, const char *name)
{
    if (d == 0) {
        ck_assert_msg(reference_pair_distance_compare(a, b, 0x1p-1074) < 0, "%s", name);
        return;
    }
    double below = nextafter(d, 0), above = nextafter(d, INFINITY);
    ck_assert_msg(reference_pair_distance_compare(a, b, below) > 0, "%s: %g is too large", name, d);
    ck_assert_msg(isinf(above) || reference_pair_distance_compare(a, b, above) < 0,
                  "%s: %g is too small", name, d);
}

/* Returns the size of coordinates relative to the first corner of A. */
static double reach_of(const double a[3][3], const double b[3][3])
{
    double reach = 0;
    for (int i = 0; i < 9; i++) {
        reach = fmax(reach, fabs(a[i / 3][i % 3] - a[0][i % 3]));
        reach = fmax(reach, fabs(b[i / 3][i % 3] - a[0][i % 3]));
    }
    return reach;
}

START_TEST(test_pair_distance_matches_brute_force)
{
    uint64_t state = (uint64_t)_i + 7;
    for (int i = 0; i < (int)ebpo_test_scaled(CASES); i++) {
        double a[3][3], b[3][3];
        reference_pair_case(a, b, _i, &state);
        double d = ebpo_triangles_distance(CORNERS(a), CORNERS(b));
        check_rounded(CORNERS(a), CORNERS(b), d, reference_pair_name(_i));
        ck_assert(ebpo_triangles_distance(CORNERS(b), CORNERS(a)) == d);
        ebpo_pair_distance_bounds bounds;
        ebpo_triangles_distance_bounds(CORNERS(a), CORNERS(b), &bounds);
        ck_assert_int_ge(reference_pair_distance_compare(CORNERS(a), CORNERS(b), bounds.lo), 0);
        if (!isinf(bounds.hi))
            ck_assert_int_le(reference_pair_distance_compare(CORNERS(a), CORNERS(b), bounds.hi), 0);
        ck_assert(_i > 1 || d == 0 ||
                  bounds.hi - bounds.lo <= 0x1p-42 * reach_of(CORNERS(a), CORNERS(b)));
    }
}
END_TEST

START_TEST(test_pair_distance_comparisons_are_exact)
{
    uint64_t state = (uint64_t)_i + 57;
    for (int i = 0; i < (int)ebpo_test_scaled(CASES); i++) {
        double a[3][3], b[3][3], c[3][3], e[3][3];
        reference_pair_case(a, b, _i, &state);
        double d = ebpo_triangles_distance(CORNERS(a), CORNERS(b)), more = nextafter(d, INFINITY);
        ck_assert_int_eq(ebpo_triangles_distance_compare_to(CORNERS(a), CORNERS(b), d),
                         reference_pair_distance_compare(CORNERS(a), CORNERS(b), d));
        ck_assert_int_lt(ebpo_triangles_distance_compare_to(CORNERS(a), CORNERS(b), more), 0);
        /* The same faces rotated in space: axes exchanged, signs changed. */
        for (int k = 0; k < 9; k++) {
            c[k / 3][k % 3] = -b[k / 3][(k + 1) % 3];
            e[k / 3][k % 3] = -a[k / 3][(k + 1) % 3];
        }
        ck_assert_int_eq(ebpo_triangles_distance_compare(CORNERS(a), CORNERS(b), CORNERS(c),
                                                         CORNERS(e)),
                         0);
        reference_pair_case(c, e, _i, &state);
        double other = ebpo_triangles_distance(CORNERS(c), CORNERS(e));
        int order = ebpo_triangles_distance_compare(CORNERS(a), CORNERS(b), CORNERS(c), CORNERS(e));
        ck_assert(d == other || order == (d > other ? 1 : -1));
    }
}
END_TEST

/* Makes a face across axis k at `level`, with corners on a grid of 4. */
static void level_face(double t[3][3], int k, double level, uint64_t *state)
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            t[i][j] = j == k ? level : (double)(reference_random(state) % 4);
}

/* Tests equal distances of pairs of faces on two parallel sides, where other pairs on these sides
 * may be farther apart. */
START_TEST(test_pair_distance_equality_is_exact)
{
    uint64_t state = 5, equal = 0;
    for (int i = 0; i < (int)ebpo_test_scaled(CASES); i++) {
        double face[2][2][3][3];
        ebpo_pair_distance_bounds bounds[2];
        for (int p = 0; p < 2; p++) {
            int k = (int)(reference_random(&state) % 3);
            double level = (double)(reference_random(&state) % 2) * 0.1;
            level_face(face[p][0], k, level, &state);
            level_face(face[p][1], k, 0.7 + level * (double)(i % 2), &state);
            ebpo_triangles_distance_bounds(CORNERS(face[p][0]), CORNERS(face[p][1]), &bounds[p]);
        }
        if (!ebpo_same_distance(CORNERS(face[0][0]), CORNERS(face[0][1]), &bounds[0],
                                CORNERS(face[1][0]), CORNERS(face[1][1]), &bounds[1]))
            continue;
        equal++;
        ck_assert_int_eq(ebpo_triangles_distance_compare(CORNERS(face[0][0]), CORNERS(face[0][1]),
                                                         CORNERS(face[1][0]), CORNERS(face[1][1])),
                         0);
    }
    ck_assert_uint_gt(equal, 0);
}
END_TEST

TEST_SUITE(pair_distance)
{
    TCase *tests = tcase_create("pair_distance");
    tcase_set_timeout(tests, 1000);
    tcase_add_loop_test(tests, test_pair_distance_matches_brute_force, 0, REFERENCE_PAIR_KINDS);
    tcase_add_loop_test(tests, test_pair_distance_comparisons_are_exact, 0, REFERENCE_PAIR_KINDS);
    tcase_add_test(tests, test_pair_distance_equality_is_exact);
    Suite *suite = suite_create("pair_distance");
    suite_add_tcase(suite, tests);
    return suite;
}
