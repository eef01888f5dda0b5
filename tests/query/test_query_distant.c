/* Queries points far from a model, in all directions and up to the range of doubles, and compares
 * with brute force in rational arithmetic. Results are the same exact values for all loading
 * modes. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "query_support.h"

/* Counts calls of frexp, which only far points need; the linker passes calls to __wrap_. */
static uint64_t exponents;
double __real_frexp(double x, int *exponent);
double __wrap_frexp(double x, int *exponent);
double __wrap_frexp(double x, int *exponent)
{
    exponents++;
    return __real_frexp(x, exponent);
}

/* The models: curved models; flat sides with many faces, seen from far points; repeated faces; and
 * the smallest and greatest doubles as coordinates. */
static const struct {
    const char *name;
    int variant;
} cases[] = {
    { "sphere", 5 },
    { "torus", 0 },
    { "boxes_in_walls", 0 },
    { "blob", 2 },
    { "giant_and_dust", 0 },
    { "tiny", 0 },
    { "denormal", 0 },
    { "least", 0 },
    { "huge", 0 },
    { "small", 3 },
    { "far_away_float", 0 },
    { "nested_windings", 1 },
    { "tetrahedra_at_random", 3 },
};
enum { CASES = sizeof cases / sizeof *cases, KINDS = 7, POINTS = 200 };

/* Returns a distance from 1.6 box sizes, which the search for near points still handles, to the
 * greatest doubles. */
static double magnitude(const query_model *m, uint64_t *state)
{
    double least = log2(m->size) + 1, most = 1022;
    if (ebpo_test_random(state) % 4 == 0) /* near the limit of the search for near points */
        most = fmin(least + 8, most);
    least = fmin(least, 1021);
    return exp2(least + (most - least) * ebpo_test_random_unit(state));
}

static double either(uint64_t *state) { return 2 * ebpo_test_random_unit(state) - 1; }

static void middle_of(const query_model *m, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = m->info.box_origin[k] + m->info.box_size[k] / 2;
}

static void far_point(const query_model *m, uint64_t *state, double p[3])
{
    uint64_t face = ebpo_test_random(state) % m->mesh.face_count;
    double away = magnitude(m, state), to[3] = { 0, 0, 0 };
    int axis = (int)(ebpo_test_random(state) % 3);
    middle_of(m, p);
    switch (ebpo_test_random(state) % KINDS) {
    case 0: /* along an axis, above some point of the box */
        to[axis] = either(state) < 0 ? -1 : 1;
        for (int k = 0; k < 3; k++)
            p[k] += k == axis ? 0 : m->info.box_size[k] * either(state) / 2;
        break;
    case 1: /* along an axis, above a vertex */
        to[axis] = either(state) < 0 ? -1 : 1;
        ebpo_test_point(&m->mesh, m->mesh.faces[3 * face], p);
        break;
    case 2: /* along a face's normal */
        memcpy(to, m->normal[face], sizeof to);
        ebpo_test_point(&m->mesh, m->mesh.faces[3 * face], p);
        break;
    case 3: /* along a diagonal of the box or of a side */
        for (int k = 0; k < 3; k++)
            to[k] = (double)(ebpo_test_random(state) % 3) - 1;
        break;
    case 4: /* random coordinates of all sizes */
        for (int k = 0; k < 3; k++)
            to[k] = either(state) * magnitude(m, state) / away;
        break;
    default:
        for (int k = 0; k < 3; k++)
            to[k] = either(state);
    }
    for (int k = 0; k < 3; k++) {
        p[k] += to[k] * away;
        p[k] = p[k] > 0x1p1023 ? 0x1p1023 : p[k] < -0x1p1023 ? -0x1p1023 : p[k];
    }
}

typedef struct fixture {
    query_model m;
    uint64_t count;
    double *points;
    query_truth *truth;
    ebpo_distance_result *got;
} fixture;

static void begin(fixture *a, int i)
{
    uint64_t state = (uint64_t)i + 7;
    query_model_make(&a->m, cases[i].name, query_solid_by_name(cases[i].name),
                     &query_variants[cases[i].variant]);
    a->count = query_scaled(POINTS);
    a->points = query_alloc(a->count, 3 * sizeof *a->points);
    a->truth = query_alloc(a->count, sizeof *a->truth);
    a->got = query_alloc(a->count, sizeof *a->got);
    for (uint64_t k = 0; k < a->count; k++)
        far_point(&a->m, &state, a->points + 3 * k);
    query_find_truths(&a->m, a->points, a->count, a->truth);
}

static void end(fixture *a)
{
    query_model_free(&a->m);
    free(a->points);
    free(a->truth);
    free(a->got);
}

static void run_query(fixture *a, ebpo_context *c, const char *how)
{
    ASSERT_OK(ebpo_distance_many(c, a->points, a->count, NULL, a->got, error));
    ck_assert_msg(query_wrong_distance(&a->m, a->points, a->truth, a->count, false, a->got) == 0,
                  "%s, %s", a->m.name, how);
}

START_TEST(test_distant_points_ignore_load_mode)
{
    fixture a;
    begin(&a, _i);
    run_query(&a, a.m.context, "whole");
    for (int cut = 0; cut < 3 && cut < a.m.info.level_count; cut++) {
        ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
        ebpo_model *model = NULL;
        ebpo_context *context = NULL;
        how.loading = cut % 2 ? EBPO_LOAD_NODES : EBPO_LOAD_CACHE;
        how.cut_level = cut;
        ASSERT_OK(ebpo_model_new(a.m.file, &how, &model, error));
        ASSERT_OK(ebpo_context_new(model, &context, error));
        run_query(&a, context, "in parts");
        run_query(&a, context, "in parts, once more"); /* uses cached data of subtrees */
        ebpo_context_free(context);
        ebpo_model_free(model);
    }
    end(&a);
}
END_TEST

START_TEST(test_distant_point_limits_are_exact)
{
    fixture a;
    begin(&a, _i);
    for (uint64_t k = 0; k < a.count; k++) {
        const double *p = a.points + 3 * k;
        double d = a.truth[k].distance;
        ebpo_distance_options o = EBPO_DISTANCE_OPTIONS_INIT;
        ebpo_distance_result got;
        if (isinf(d) || d == 0)
            continue;
        o.max_distance = nextafter(d, INFINITY);
        ASSERT_OK(ebpo_distance(a.m.context, p, &o, &got, error));
        ck_assert_msg(fabs(got.distance) == d, "%s: %a of %a", a.m.name, got.distance, d);
        o.max_distance = nextafter(d, 0);
        ASSERT_OK(ebpo_distance(a.m.context, p, &o, &got, error));
        ck_assert_msg(isinf(got.distance), "%s: %a, beyond %a", a.m.name, got.distance,
                      o.max_distance);
    }
    end(&a);
}
END_TEST

START_TEST(test_distant_point_levels_and_deadlines)
{
    fixture a;
    begin(&a, _i);
    for (int level = -1; level < a.m.info.level_count; level += 2) {
        ebpo_distance_options o = EBPO_DISTANCE_OPTIONS_INIT;
        o.level = level;
        o.deadline_ns = level < 0 ? 1 : 0;
        ASSERT_OK(ebpo_distance_many(a.m.context, a.points, a.count, &o, a.got, error));
        ck_assert_msg(query_wrong_limited_distance(&a.m, a.points, a.truth, a.count, a.got) == 0,
                      "%s, level %d", a.m.name, level);
    }
    end(&a);
}
END_TEST

/* Returns the number of calls of frexp for the distance of a point. */
static uint64_t exponents_at(const query_model *m, const double p[3])
{
    ebpo_distance_result got;
    exponents = 0;
    ASSERT_OK(ebpo_distance(m->context, p, NULL, &got, error));
    return exponents;
}

START_TEST(test_near_points_need_no_exponents)
{
    query_model m;
    double middle[3];
    uint64_t state = 1;
    query_model_make(&m, "sphere", query_solid_by_name("sphere"), &query_variants[0]);
    middle_of(&m, middle);
    for (int i = 0; i < 100; i++) {
        double p[3], far[3];
        for (int k = 0; k < 3; k++) {
            p[k] = middle[k] + 3 * either(&state) * m.info.box_size[k];
            far[k] = middle[k] + (k == i % 3 ? 20 * m.info.box_size[k] : 0);
        }
        ck_assert_uint_eq(exponents_at(&m, p), 0);
        ck_assert_uint_ge(exponents_at(&m, far), 2);
    }
    query_model_free(&m);
}
END_TEST

TEST_SUITE(query_distant)
{
    Suite *suite = suite_create("query_distant");
    TCase *tests = tcase_create("far");
    tcase_set_timeout(tests, 600);
    tcase_add_loop_test(tests, test_distant_points_ignore_load_mode, 0, CASES);
    tcase_add_loop_test(tests, test_distant_point_limits_are_exact, 0, CASES);
    tcase_add_loop_test(tests, test_distant_point_levels_and_deadlines, 0, CASES);
    tcase_add_test(tests, test_near_points_need_no_exponents);
    suite_add_tcase(suite, tests);
    return suite;
}
