/* Queries small models of every kind with a million difficult points, and compares with the
 * oracle. EBPO_TEST_SCALE scales the number of points; below 1, each solid has a third of the
 * variants, and each variant a third of the solids. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "query_support.h"

/* Returns the number of points. It is small when brute force is slow: with many faces, and with
 * coordinates of two thousand bits. */
static uint64_t points_for(const char *name, uint64_t faces)
{
    uint64_t n = UINT64_C(1200000) / (faces + 40);
    if (strcmp(name, "all_scales") == 0 || strcmp(name, "cone_slivers") == 0)
        return 200;
    return n > 7000 ? 7000 : n;
}

START_TEST(test_difficult_points_match_brute_force)
{
    int solid = _i / query_variant_count, variant = _i % query_variant_count;
    query_model m;
    if (ebpo_test_scale() < 1 && (solid + variant) % 3)
        return;
    query_model_make(&m, query_solid_name(solid), query_solid_make(solid),
                     &query_variants[variant]);
    query_check_points(&m, query_scaled(points_for(m.name, m.mesh.face_count)), (uint64_t)_i);
    query_model_free(&m);
}
END_TEST

START_TEST(test_query_million_points)
{
    uint64_t sum = 0;
    for (int i = 0; i < query_solid_count(); i++) {
        ebpo_mesh mesh = query_solid_make(i);
        sum += points_for(query_solid_name(i), mesh.face_count) * (uint64_t)query_variant_count;
        ebpo_mesh_free(&mesh);
    }
    ck_assert_uint_ge(sum, 1000000);
}
END_TEST

/* Two boxes have a side at x = 0 in common, and the thin box ends at x = 1. In a cell around both
 * planes the winding numbers of the two outer parts differ, so the planes alone do not decide. */
START_TEST(test_planes_do_not_decide_between_two_outsides)
{
    static const double boxes[3][2][3] = { { { 0, 0, 0 }, { 8, 8, 8 } },
                                           { { 0, 0, 0 }, { 1, 8, 8 } },
                                           { { -3, 0, 0 }, { -2, 1, 1 } } };
    static const query_variant variant = { "cells of 2.75", 0, 2, EBPO_RULE_NONZERO, 0 };
    enum { POINTS = 100, TURNS = 3 }; /* a leaf is classified after 128 queries */
    ebpo_mesh mesh = ebpo_test_box(boxes[0][0], boxes[0][1], 1);
    for (int i = 1; i < 3; i++) {
        ebpo_mesh box = ebpo_test_box(boxes[i][0], boxes[i][1], 1);
        ebpo_test_append(&mesh, &box);
        ebpo_mesh_free(&box);
    }
    query_model m;
    query_model_make(&m, "two outsides", mesh, &variant);
    for (int i = 0; i < TURNS * POINTS; i++) {
        double p[3] = { -0.2 + 2.6 * (i % POINTS) / POINTS, 3, 3.5 };
        int winding = p[0] < 0 ? 0 : p[0] < 1 ? 2 : 1;
        ebpo_inside_result inside;
        ebpo_error error = EBPO_ERROR_INIT;
        ck_assert_int_eq(ebpo_inside(m.context, p, NULL, &inside, &error), EBPO_OK);
        ck_assert_msg(inside.where == EBPO_ON || inside.winding == winding,
                      "x = %g: winding number %d instead of %d", p[0], inside.winding, winding);
    }
    query_model_free(&m);
}
END_TEST

/* --- errors --- */

START_TEST(test_non_finite_points_refused_by_index)
{
    static const double odd[] = { NAN, INFINITY, -INFINITY };
    query_model m;
    query_model_make(&m, "cube", query_solid_by_name("cube"), &query_variants[0]);
    for (int i = 0; i < 9; i++) {
        double points[6][3] = { { 0 } };
        ebpo_inside_result inside[6];
        ebpo_distance_result distance[6];
        ebpo_error error = EBPO_ERROR_INIT;
        points[4][i % 3] = odd[i / 3];
        ck_assert_int_eq(ebpo_inside(m.context, points[4], NULL, inside, &error), EBPO_E_ARGUMENT);
        ck_assert_int_eq(ebpo_distance(m.context, points[4], NULL, distance, &error),
                         EBPO_E_ARGUMENT);
        ck_assert_int_eq(ebpo_inside_many(m.context, points[0], 6, NULL, inside, &error),
                         EBPO_E_ARGUMENT);
        ck_assert_msg(strchr(error.message, '4') != NULL, "%s", error.message);
        ck_assert_int_eq(ebpo_distance_many(m.context, points[0], 6, NULL, distance, &error),
                         EBPO_E_ARGUMENT);
        ck_assert_msg(strchr(error.message, '4') != NULL, "%s", error.message);
        ck_assert_int_eq(ebpo_inside_many(m.context, points[0], 4, NULL, inside, &error), EBPO_OK);
    }
    query_model_free(&m);
}
END_TEST

START_TEST(test_zero_points_are_accepted)
{
    query_model m;
    query_model_make(&m, "cube", query_solid_by_name("cube"), &query_variants[0]);
    ck_assert_int_eq(ebpo_inside_many(m.context, NULL, 0, NULL, NULL, NULL), EBPO_OK);
    ck_assert_int_eq(ebpo_distance_many(m.context, NULL, 0, NULL, NULL, NULL), EBPO_OK);
    query_model_free(&m);
}
END_TEST

START_TEST(test_surface_has_distance_with_sign)
{
    static const char *const names[] = { "open_box", "flipped_face_cube", "mobius", "band",
                                         "sheet" };
    const char *name = names[_i];
    query_model m;
    query_model_make(&m, name, query_solid_by_name(name), &query_variants[0]);
    ck_assert(!m.info.solid);
    uint64_t count = query_scaled(3000);
    double *points = query_alloc(count, 3 * sizeof *points);
    query_truth *truth = query_alloc(count, sizeof *truth);
    ebpo_distance_result *distance = query_alloc(count, sizeof *distance);
    ebpo_inside_result *inside = query_alloc(count, sizeof *inside);
    ebpo_error error = EBPO_ERROR_INIT;
    query_make_points(&m, count, 3, points);
    query_find_truths(&m, points, count, truth);
    ck_assert_int_eq(ebpo_inside_many(m.context, points, count, NULL, inside, &error), EBPO_OK);
    for (int is_unsigned = 0; is_unsigned < 2; is_unsigned++) {
        ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
        options.unsigned_distance = is_unsigned;
        ck_assert_int_eq(ebpo_distance_many(m.context, points, count, &options, distance, &error),
                         EBPO_OK);
        for (uint64_t i = 0; i < count; i++) {
            bool negative = !is_unsigned && inside[i].where == EBPO_IN;
            ck_assert_int_eq(signbit(distance[i].distance) != 0, negative);
            distance[i].distance = fabs(distance[i].distance);
        }
        ck_assert_uint_eq(query_wrong_distance(&m, points, truth, count, is_unsigned, distance), 0);
    }
    free(points);
    free(inside);
    free(truth);
    free(distance);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(query)
{
    Suite *suite = suite_create("query");
    TCase *points = tcase_create("points"), *refusals = tcase_create("refusals");
    tcase_set_timeout(points, 600);
    tcase_set_timeout(refusals, 600);
    tcase_add_loop_test(points, test_difficult_points_match_brute_force, 0,
                        query_solid_count() * query_variant_count);
    tcase_add_test(points, test_query_million_points);
    tcase_add_test(points, test_planes_do_not_decide_between_two_outsides);
    tcase_add_test(refusals, test_non_finite_points_refused_by_index);
    tcase_add_test(refusals, test_zero_points_are_accepted);
    tcase_add_loop_test(refusals, test_surface_has_distance_with_sign, 0, 5);
    suite_add_tcase(suite, points);
    suite_add_tcase(suite, refusals);
    return suite;
}
