/* Queries small random solids and compares with brute force: boxes and tetrahedra in contact,
 * nested, overlapping and repeated. A failure prints the seed of the solid. EBPO_TEST_SEED=<seed>
 * tests only that solid; EBPO_TEST_SCALE scales the number of solids. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "check_main.h"
#include "query_support.h"

enum { POINTS = 400, RAYS = 60, BOXES = 20 };

static void query_rays(query_model *m, uint64_t *state)
{
    for (int i = 0; i < RAYS; i++) {
        double origin[3], direction[3], t_max;
        const oracle_hit *expected;
        const ebpo_ray_hit *hits;
        uint32_t n;
        uint64_t count;
        query_make_ray(m, state, origin, direction, &t_max);
        oracle_ray(m->judge, origin, direction, t_max, &expected, &n);
        ck_assert_int_eq(ebpo_ray_all(m->context, origin, direction, t_max, &hits, &count, NULL),
                         EBPO_OK);
        bool same = count == n;
        for (uint32_t h = 0; h < n && same; h++)
            same = hits[h].side == expected[h].side &&
                   hits[h].face ==
                       (m->face_source ? m->face_source[expected[h].face] : expected[h].face);
        ck_assert_msg(
            same,
            "%s: ray (%a, %a, %a) + t (%a, %a, %a), t <= %a: %llu hits, %u expected, or others",
            m->name, origin[0], origin[1], origin[2], direction[0], direction[1], direction[2],
            t_max, (unsigned long long)count, n);
    }
}

static void query_boxes(query_model *m, uint64_t *state)
{
    double corner[2 * BOXES][3];
    query_make_points(m, 2 * BOXES, ebpo_test_random(state), corner[0]);
    for (int i = 0; i < BOXES; i++) {
        double low[3], high[3];
        const uint32_t *expected;
        const uint64_t *faces;
        uint32_t n;
        uint64_t count;
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(corner[2 * i][k], corner[2 * i + 1][k]);
            high[k] = fmax(corner[2 * i][k], corner[2 * i + 1][k]);
        }
        oracle_box(m->judge, low, high, &expected, &n);
        ck_assert_int_eq(ebpo_faces_in_box(m->context, low, high, &faces, &count, NULL), EBPO_OK);
        bool same = count == n;
        for (uint32_t f = 0; f < n && same; f++)
            same = faces[f] == (m->face_source ? m->face_source[expected[f]] : expected[f]);
        ck_assert_msg(same,
                      "%s: box (%a, %a, %a) .. (%a, %a, %a): %llu faces, %u expected, or others",
                      m->name, low[0], low[1], low[2], high[0], high[1], high[2],
                      (unsigned long long)count, n);
    }
}

static void query_solid(uint64_t seed)
{
    query_model m;
    char name[64];
    uint64_t state = seed;
    snprintf(name, sizeof name, "EBPO_TEST_SEED=%llu", (unsigned long long)seed);
    query_model_make(&m, name, query_random_solid(seed, seed % 4 != 3),
                     &query_variants[seed % (uint64_t)query_variant_count]);
    query_check_points(&m, POINTS, seed);
    query_rays(&m, &state);
    query_boxes(&m, &state);
    query_model_free(&m);
}

START_TEST(test_random_solids_match_brute_force)
{
    const char *seed = getenv("EBPO_TEST_SEED");
    uint64_t count = query_scaled(80);
    if (seed) {
        if (_i == 0)
            query_solid(strtoull(seed, NULL, 0));
        return;
    }
    for (uint64_t i = 0; i < count; i++)
        query_solid((uint64_t)_i * 1000000 + i);
}
END_TEST

TEST_SUITE(query_random)
{
    Suite *suite = suite_create("query_random");
    TCase *tests = tcase_create("random");
    tcase_set_timeout(tests, 1000);
    tcase_add_loop_test(tests, test_random_solids_match_brute_force, 0, 8);
    suite_add_tcase(suite, tests);
    return suite;
}
