/* Two models at poses: contacts and distance against brute force in rational arithmetic
 * (tests/support/models_reference.h). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/collide.h>

#include "check_main.h"
#include "models_reference.h"
#include "extras/collide/face_pairs.h"
#include "solids.h"

static const char *const names[] = { "cube",           "torus",      "touching_shells",
                                     "sheet",          "cube_twice", "zero_area_face",
                                     "far_away_float", "blob",       "nested_windings" };
enum { NAMES = sizeof names / sizeof *names };
/* Greatest product of the numbers of faces. The reference implementation takes seconds for larger
 * products. */
enum { MAX_PAIRS = 100000 };

typedef struct two_models {
    query_model model[2];
    ebpo_collider *collider, *swapped;
} two_models;

static ebpo_collide_distance_result run_query(ebpo_collider *c, const ebpo_pose *a,
                                              const ebpo_pose *b, double tolerance, double at_least,
                                              bool warm)
{
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collide_distance_options how = EBPO_COLLIDE_DISTANCE_OPTIONS_INIT;
    ebpo_collide_distance_result out;
    options.pose_a = *a;
    options.pose_b = *b;
    how.tolerance = tolerance;
    how.at_least = at_least;
    how.warm = warm;
    ASSERT_OK(ebpo_collide_distance(c, &options, &how, &out, error));
    return out;
}

/* --- results --- */

static void check_pair(const reference_faces *f, const ebpo_collide_distance_result *got,
                       const char *what)
{
    reference_found *intersected;
    uint64_t count = reference_pairs(&f[0], &f[1], &intersected), i = 0;
    ck_assert_msg((got->pair.kind != EBPO_PAIR_APART) == (count > 0), "%s: kind %d of %llu pairs",
                  what, got->pair.kind, (unsigned long long)count);
    while (i < count &&
           !(intersected[i].a == got->pair.file_face_a &&
             intersected[i].b == got->pair.file_face_b && intersected[i].kind == got->pair.kind))
        i++;
    ck_assert_msg(count == 0 || i < count, "%s: the reported pair has another kind", what);
    ck_assert_msg((got->distance.hi == 0) == (count > 0), "%s: %g", what, got->distance.hi);
    free(intersected);
    if (count)
        return;
    const char *wrong = reference_models_distance(&f[0], &f[1], got->distance.hi,
                                                  got->pair.file_face_a, got->pair.file_face_b);
    ck_assert_msg(!wrong, "%s: %.17g: %s", what, got->distance.hi, wrong);
}

static void check_points(const ebpo_collide_distance_result *got, double size, const char *what)
{
    double square = 0, most = 0;
    for (int k = 0; k < 3; k++) {
        square += pow(got->point_a[k] - got->point_b[k], 2);
        most = fmax(most, fmax(fabs(got->point_a[k]), fabs(got->point_b[k])));
    }
    ck_assert_msg(fabs(sqrt(square) - got->distance.hi) <= 1e-13 * (size + most),
                  "%s: points are %.17g apart, not %.17g", what, sqrt(square), got->distance.hi);
}

static ebpo_collide_distance_result turned(ebpo_collide_distance_result c)
{
    ebpo_collide_distance_result out = c;
    out.pair = (ebpo_face_pair){ c.pair.face_b,      c.pair.face_a, c.pair.file_face_b,
                                 c.pair.file_face_a, c.pair.kind,   0 };
    memcpy(out.point_a, c.point_b, sizeof out.point_a);
    memcpy(out.point_b, c.point_a, sizeof out.point_b);
    return out;
}

/* --- other options --- */

static void check_intervals(const two_models *t, const ebpo_pose *a, const ebpo_pose *b,
                            double distance, double size, const char *what)
{
    const double tolerance[] = { 1e-12, 1e-3, 0.5 };
    for (int i = 0; i < 3; i++) {
        ebpo_value_bounds d =
            run_query(t->collider, a, b, tolerance[i] * size, -1, i == 1).distance;
        ck_assert_msg(d.lo <= distance && distance <= d.hi, "%s: %.17g is not in %.17g .. %.17g",
                      what, distance, d.lo, d.hi);
        ck_assert_msg(d.hi - d.lo <= (tolerance[i] + 1e-12) * size + 1e-9 * distance,
                      "%s: %g is wider than %g", what, d.hi - d.lo, tolerance[i] * size);
    }
}

static void check_at_least(const two_models *t, const ebpo_pose *a, const ebpo_pose *b,
                           double distance, const char *what)
{
    const double thresholds[] = { 0, distance / 2, nextafter(distance, 0),
                                  nextafter(distance, INFINITY), 2 * distance + 1 };
    for (int i = 0; i < 5; i++) {
        ebpo_collide_distance_result c = run_query(t->collider, a, b, 0, thresholds[i], false);
        int want = thresholds[i] <= distance;
        ck_assert_msg(c.at_least == want, "%s: at least %.17g: %d", what, thresholds[i],
                      c.at_least);
        ck_assert(c.distance.lo <= distance && distance <= c.distance.hi);
        if (!want)
            ck_assert(c.pair.face_a != EBPO_NO_FACE && c.distance.lo <= thresholds[i]);
    }
}

static void check_late(const two_models *t, const ebpo_pose *a, const ebpo_pose *b, double distance,
                       const char *what)
{
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collide_distance_result out;
    options.pose_a = *a;
    options.pose_b = *b;
    options.deadline_ns = 1;
    ASSERT_OK(ebpo_collide_distance(t->collider, &options, NULL, &out, error));
    ck_assert_msg(out.distance.lo <= distance && distance <= out.distance.hi, "%s: late", what);
}

/* --- one case --- */

static void check_case(two_models *t, int kind, uint64_t *state)
{
    ebpo_pose a, b;
    reference_faces f[2];
    char what[128];
    double size = t->model[0].size > 0 ? t->model[0].size : 1;
    snprintf(what, sizeof what, "%s, %s, %s", t->model[0].name, t->model[1].name,
             reference_pose_name(kind));
    reference_pose(kind, size, state, &a, &b);
    reference_faces_make(&f[0], &t->model[0], &a);
    reference_faces_make(&f[1], &t->model[1], &b);
    ebpo_collide_distance_result got = run_query(t->collider, &a, &b, 0, -1, false),
                                 other = turned(run_query(t->swapped, &b, &a, 0, -1, false)),
                                 warm = run_query(t->collider, &a, &b, 0, -1, true);
    ck_assert_msg(memcmp(&got, &other, sizeof got) == 0, "%s: swapped", what);
    ck_assert_msg(memcmp(&got.distance, &warm.distance, sizeof got.distance) == 0, "%s: warm",
                  what);
    ck_assert_int_eq(got.distance.kind, EBPO_VALUE_EXACT);
    check_pair(f, &got, what);
    check_points(&got, size, what);
    check_intervals(t, &a, &b, got.distance.hi, size, what);
    check_at_least(t, &a, &b, got.distance.hi, what);
    check_late(t, &a, &b, got.distance.hi, what);
    reference_faces_free(&f[0]);
    reference_faces_free(&f[1]);
}

static void make_two(two_models *t, const char *name_a, const char *name_b, int variant)
{
    query_model_make(&t->model[0], name_a, query_solid_by_name(name_a), &query_variants[variant]);
    query_model_make(&t->model[1], name_b, query_solid_by_name(name_b),
                     &query_variants[(variant + 1) % query_variant_count]);
    ASSERT_OK(ebpo_collider_new(t->model[0].model, t->model[1].model, NULL, &t->collider, error));
    ASSERT_OK(ebpo_collider_new(t->model[1].model, t->model[0].model, NULL, &t->swapped, error));
}

static void free_two(two_models *t)
{
    ebpo_collider_free(t->collider);
    ebpo_collider_free(t->swapped);
    query_model_free(&t->model[0]);
    query_model_free(&t->model[1]);
}

START_TEST(test_collide_distance_matches_brute_force)
{
    two_models t;
    uint64_t state = (uint64_t)_i + 1;
    if (!ebpo_test_wanted(_i))
        return;
    make_two(&t, names[_i / NAMES], names[_i % NAMES], _i % query_variant_count);
    bool few = t.model[0].mesh.face_count * t.model[1].mesh.face_count > MAX_PAIRS;
    for (int kind = 0; kind < REFERENCE_POSES; kind++)
        if (!few || kind % 5 == _i % 5)
            check_case(&t, kind, &state);
    free_two(&t);
}
END_TEST

/* --- deep hierarchies --- */

static double box_gap(const double a[3][3], const double b[3][3])
{
    double square = 0;
    for (int k = 0; k < 3; k++) {
        double low = fmin(fmin(a[0][k], a[1][k]), a[2][k]) - fmax(fmax(b[0][k], b[1][k]), b[2][k]),
               high = fmin(fmin(b[0][k], b[1][k]), b[2][k]) - fmax(fmax(a[0][k], a[1][k]), a[2][k]),
               gap = fmax(fmax(low, high), 0);
        square += gap * gap;
    }
    return sqrt(square);
}

/* Computes the least bounds over all pairs of faces. The distance is in *lo .. *hi. */
static void distance_of_all(const reference_faces *a, const reference_faces *b, double *lo,
                            double *hi)
{
    *lo = *hi = INFINITY;
    for (uint64_t i = 0; i < a->count; i++)
        for (uint64_t j = 0; j < b->count; j++) {
            const double(*p)[3] = (const double(*)[3])a->corner[i],
                  (*q)[3] = (const double(*)[3])b->corner[j];
            ebpo_pair_distance_bounds d;
            if (box_gap(p, q) > *hi * (1 + 1e-9))
                continue;
            ebpo_triangles_distance_bounds(p, q, &d);
            *lo = fmin(*lo, d.lo);
            *hi = fmin(*hi, d.hi);
        }
}

/* Moves b until it is close to a. */
static void approach(two_models *t, const ebpo_pose *a, ebpo_pose *b, double left)
{
    for (int i = 0; i < 3; i++) {
        ebpo_collide_distance_result c = run_query(t->collider, a, b, 0, -1, false);
        for (int k = 0; k < 3; k++)
            b->translation[k] += (1 - left) * (c.point_a[k] - c.point_b[k]);
    }
}

/* Rotated models use bounds that small models at axis-aligned poses hardly use. */
START_TEST(test_collide_distance_in_deep_hierarchies)
{
    two_models t;
    uint64_t state = (uint64_t)_i + 77;
    if (!ebpo_test_wanted(_i))
        return;
    ebpo_pose a, b;
    reference_faces f[2];
    double lo, hi;
    for (int i = 0; i < 2; i++)
        query_model_make(&t.model[i], "fine torus", ebpo_test_torus(2, 0.7, 64, 32),
                         &query_variants[0]);
    ASSERT_OK(ebpo_collider_new(t.model[0].model, t.model[1].model, NULL, &t.collider, error));
    ASSERT_OK(ebpo_collider_new(t.model[1].model, t.model[0].model, NULL, &t.swapped, error));
    reference_pose(REFERENCE_TURNED_APART, t.model[0].size, &state, &a, &b);
    approach(&t, &a, &b, 0.1 * (1 + _i));
    reference_faces_make(&f[0], &t.model[0], &a);
    reference_faces_make(&f[1], &t.model[1], &b);
    distance_of_all(&f[0], &f[1], &lo, &hi);
    double got = run_query(t.collider, &a, &b, 0, -1, false).distance.hi;
    ck_assert_msg(lo > 0 && lo <= got && got <= hi, "%d: %.17g is not in %.17g .. %.17g", _i, got,
                  lo, hi);
    for (int i = 0; i < 2; i++)
        reference_faces_free(&f[i]);
    free_two(&t);
}
END_TEST

/* A common translation without rounding does not change the result. */
START_TEST(test_collide_distance_common_translation)
{
    two_models t;
    ebpo_pose a = EBPO_POSE_INIT, b = EBPO_POSE_INIT;
    make_two(&t, "cube", "cube", 0);
    double size = t.model[0].size;
    b.translation[0] = 1.25 * size;
    ebpo_collide_distance_result here = run_query(t.collider, &a, &b, 0, -1, false);
    for (int k = 0; k < 3; k++) {
        a.translation[k] += 64 * size;
        b.translation[k] += 64 * size;
    }
    ebpo_collide_distance_result there = run_query(t.collider, &a, &b, 0, -1, false);
    ck_assert_double_eq(here.distance.hi, 0.25 * size);
    ck_assert_double_eq(there.distance.hi, here.distance.hi);
    ck_assert(there.pair.file_face_a == here.pair.file_face_a &&
              there.pair.file_face_b == here.pair.file_face_b);
    free_two(&t);
}
END_TEST

START_TEST(test_collide_distance_bad_options_are_refused)
{
    two_models t;
    ebpo_collide_distance_result out;
    ebpo_error refusal = EBPO_ERROR_INIT;
    make_two(&t, "cube", "torus", 0);
    ebpo_collide_distance_options how = EBPO_COLLIDE_DISTANCE_OPTIONS_INIT;
    how.tolerance = -1;
    ck_assert_int_eq(ebpo_collide_distance(t.collider, NULL, &how, &out, &refusal),
                     EBPO_E_ARGUMENT);
    how.tolerance = 0;
    how.at_least = NAN;
    ck_assert_int_eq(ebpo_collide_distance(t.collider, NULL, &how, &out, &refusal),
                     EBPO_E_ARGUMENT);
    free_two(&t);
}
END_TEST

TEST_SUITE(collide_distance)
{
    TCase *tests = tcase_create("collide_distance");
    tcase_set_timeout(tests, 900);
    tcase_add_loop_test(tests, test_collide_distance_matches_brute_force, 0, NAMES * NAMES);
    tcase_add_loop_test(tests, test_collide_distance_in_deep_hierarchies, 0, 6);
    tcase_add_test(tests, test_collide_distance_common_translation);
    tcase_add_test(tests, test_collide_distance_bad_options_are_refused);
    Suite *suite = suite_create("collide_distance");
    suite_add_tcase(suite, tests);
    return suite;
}
