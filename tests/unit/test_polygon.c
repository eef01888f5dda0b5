/* Polygons become triangles that cover them: same area, all turning the polygon's way. */
#include <math.h>
#include <stdlib.h>

#include "check_main.h"
#include "geom/polygon.h"
#include "geom/predicates.h"

enum { MOST = 4000 };

typedef struct shape {
    uint32_t n;
    double at[MOST][2];
    uint32_t triangle[MOST][3];
} shape;
static shape s;

static void shape_of(const double (*at)[2], uint32_t n)
{
    s.n = n;
    for (uint32_t i = 0; i < n; i++) {
        s.at[i][0] = at[i][0];
        s.at[i][1] = at[i][1];
    }
}

static double twice_area(const double a[2], const double b[2], const double c[2])
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/* Placed in the plane across `axis`, from behind when `mirrored`. */
static ebpo_polygon_kind cut(int axis, bool mirrored)
{
    static double corner[MOST][3];
    for (uint32_t i = 0; i < s.n; i++) {
        uint32_t from = mirrored ? s.n - 1 - i : i;
        corner[i][axis] = 0.25 * s.at[from][0] + 7;
        corner[i][(axis + 1) % 3] = s.at[from][0];
        corner[i][(axis + 2) % 3] = s.at[from][1];
    }
    void *scratch = malloc(ebpo_polygon_scratch_bytes(s.n));
    ebpo_polygon_kind kind =
        ebpo_polygon_triangulate(s.triangle, (const double(*)[3])corner, s.n, scratch);
    free(scratch);
    for (uint32_t i = 0; mirrored && i + 2 < s.n;
         i++) /* back to the numbers of the shape, as it turns */
        for (int k = 0; k < 3; k++)
            s.triangle[i][k] = s.n - 1 - s.triangle[i][k];
    return kind;
}

static void check_cover(bool mirrored)
{
    double sum = 0, expected = 0;
    for (uint32_t i = 1; i + 1 < s.n; i++)
        expected += twice_area(s.at[0], s.at[i], s.at[i + 1]);
    for (uint32_t i = 0; i + 2 < s.n; i++) {
        const double *a = s.at[s.triangle[i][0]], *b = s.at[s.triangle[i][1]],
                     *c = s.at[s.triangle[i][2]];
        ck_assert_int_eq(ebpo_orient2d(a, b, c), mirrored ? -1 : 1);
        sum += fabs(twice_area(a, b, c));
    }
    ck_assert_msg(fabs(sum - expected) <= 1e-9 * expected, "triangles cover %g of %g", sum,
                  expected);
}

static void check_shape(ebpo_polygon_kind kind)
{
    for (int axis = 0; axis < 3; axis++)
        for (int mirrored = 0; mirrored < 2; mirrored++) {
            ck_assert_int_eq(cut(axis, mirrored), kind);
            check_cover(mirrored);
        }
}

START_TEST(convex_polygon_becomes_a_fan)
{
    s.n = 11;
    for (uint32_t i = 0; i < s.n; i++) {
        s.at[i][0] = cos(2 * M_PI * i / s.n);
        s.at[i][1] = sin(2 * M_PI * i / s.n);
    }
    check_shape(EBPO_POLYGON_CONVEX);
    ck_assert(cut(2, false) == EBPO_POLYGON_CONVEX);
    for (uint32_t i = 0; i < s.n - 2; i++)
        ck_assert(s.triangle[i][0] == 0 && s.triangle[i][1] == i + 1 && s.triangle[i][2] == i + 2);
}
END_TEST

START_TEST(straight_corners_make_no_triangle_without_area)
{
    static const double at[][2] = { { 0, 0 }, { 1, 0 }, { 2, 0 }, { 3, 0 },
                                    { 3, 1 }, { 3, 2 }, { 0, 2 }, { 0, 1 } };
    shape_of(at, 8);
    check_shape(EBPO_POLYGON_FLAT);
}
END_TEST

START_TEST(concave_shapes_are_covered)
{
    static const double arrow[][2] = { { 0, 0 }, { 2, 0 }, { 0.5, 0.5 }, { 0, 2 } };
    static const double comb[][2] = { { 0, 0 }, { 7, 0 }, { 7, 3 }, { 6, 3 }, { 6, 1 }, { 5, 1 },
                                      { 5, 3 }, { 4, 3 }, { 4, 1 }, { 3, 1 }, { 3, 3 }, { 2, 3 },
                                      { 2, 1 }, { 1, 1 }, { 1, 3 }, { 0, 3 } };
    /* a square with a hole */
    static const double slit[][2] = { { 0, 0 }, { 4, 0 }, { 4, 4 }, { 0, 4 }, { 0, 0 },
                                      { 1, 1 }, { 1, 3 }, { 3, 3 }, { 3, 1 }, { 1, 1 } };
    shape_of(arrow, 4);
    check_shape(EBPO_POLYGON_CONCAVE);
    shape_of(comb, 16);
    check_shape(EBPO_POLYGON_CONCAVE);
    shape_of(slit, 10);
    check_shape(EBPO_POLYGON_CONCAVE);
}
END_TEST

START_TEST(random_star_shapes_are_covered)
{
    uint64_t state = 99 + (uint64_t)_i;
    s.n = 4 + (uint32_t)(_i * _i);
    for (uint32_t i = 0; i < s.n; i++) {
        state = state * UINT64_C(6364136223846793005) + 1442695040888963407u;
        double r = 0.2 + (double)(state >> 40) / (1 << 24);
        s.at[i][0] = r * cos(2 * M_PI * i / s.n);
        s.at[i][1] = r * sin(2 * M_PI * i / s.n);
    }
    ebpo_polygon_kind kind = cut(_i % 3, _i % 2);
    ck_assert(kind == EBPO_POLYGON_CONCAVE || (s.n < 10 && kind == EBPO_POLYGON_CONVEX));
    check_cover(_i % 2);
}
END_TEST

static void check_fan(const double (*at)[2], uint32_t n)
{
    shape_of(at, n);
    ck_assert_int_eq(cut(2, false), EBPO_POLYGON_DEGENERATE);
    for (uint32_t i = 0; i < n - 2; i++)
        ck_assert(s.triangle[i][0] == 0 && s.triangle[i][1] == i + 1 && s.triangle[i][2] == i + 2);
}

START_TEST(polygons_without_an_answer_become_fans)
{
    static const double line[][2] = { { 0, 0 }, { 1, 1 }, { 2, 2 }, { 3, 3 } },
                        point[][2] = { { 1, 1 }, { 1, 1 }, { 1, 1 }, { 1, 1 } };
    static const double infinite[][2] = { { 0, 0 }, { 1, 0 }, { INFINITY, 1 }, { 0, NAN } };
    static const double pentagram[][2] = { { 0, 3 }, { -2, -3 }, { 3, 1 }, { -3, 1 }, { 2, -3 } };
    check_fan(line, 4);
    check_fan(point, 4);
    check_fan(infinite, 4);
    check_fan(pentagram, 5);
}
END_TEST

Suite *test_suite(void)
{
    TCase *tests = tcase_create("polygon");
    tcase_set_timeout(tests, 120);
    tcase_add_test(tests, convex_polygon_becomes_a_fan);
    tcase_add_test(tests, straight_corners_make_no_triangle_without_area);
    tcase_add_test(tests, concave_shapes_are_covered);
    tcase_add_loop_test(tests, random_star_shapes_are_covered, 0, 60);
    tcase_add_test(tests, polygons_without_an_answer_become_fans);
    Suite *suite = suite_create("polygon");
    suite_add_tcase(suite, tests);
    return suite;
}
