/* Tests the nearest faces in order against all faces, ordered by exact arithmetic: for any radius,
 * number, loading mode and budget. */
#include <ebpo/subset.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "check_main.h"
#include "query_support.h"

static const struct {
    const char *name;
    int variant;
} cases[] = {
    { "sphere", 5 },          { "boxes_in_walls", 0 },
    { "nested_windings", 1 }, { "blob", 2 },
    { "cube_twice", 4 },      { "tetrahedra_at_random", 3 },
    { "giant_and_dust", 0 },  { "cube_in_cell_walls", 1 },
    { "far_away_float", 0 },  { "touching_shells", 5 },
    { "gap_of_one_ulp", 0 },  { "flat", 0 },
    { "tetrahedron", 0 },
};
enum { CASES = sizeof cases / sizeof *cases };

/* Faces received, at most `stop`. */
typedef struct stream {
    ebpo_near_face *face;
    uint64_t count, space, stop;
} stream;

static bool keep(void *user, const ebpo_near_face *face)
{
    stream *s = user;
    ck_assert_uint_lt(s->count, s->stop);
    if (s->count == s->space) {
        s->space = 2 * s->space + 64;
        s->face = realloc(s->face, s->space * sizeof *s->face);
        ck_assert_ptr_nonnull(s->face);
    }
    s->face[s->count++] = *face;
    return s->count < s->stop;
}

typedef struct within_query {
    const query_model *m;
    ebpo_context *context;
    const double *p;
    double radius;
    uint64_t most, stop;
} within_query;

static stream run_query(const within_query *q, ebpo_status *status, ebpo_error *error)
{
    stream s = { .stop = q->stop };
    ebpo_within_options o = EBPO_WITHIN_OPTIONS_INIT;
    o.radius = q->radius;
    o.most = q->most;
    *status = ebpo_distance_within(q->context, q->p, &o, keep, &s, error);
    return s;
}

static void judge(const within_query *q, const stream *s, const oracle_near *truth)
{
    for (uint64_t i = 0; i < s->count; i++) {
        const ebpo_near_face *f = &s->face[i];
        const double *normal = q->m->normal[truth[i].face];
        ck_assert_msg(f->file_face == truth[i].face && f->distance == truth[i].distance,
                      "%s: point (%a, %a, %a), radius %a, most %d: number %d is face %d at %a, not "
                      "%d at %a",
                      q->m->name, q->p[0], q->p[1], q->p[2], q->radius, (int)q->most, (int)i,
                      (int)f->file_face, f->distance, (int)truth[i].face, truth[i].distance);
        ck_assert_uint_eq(f->face, query_reported(q->m, truth[i].face));
        for (int k = 0; k < 3; k++)
            ck_assert_double_le(fabs(f->normal[k] - normal[k]), 1e-15);
    }
}

/* `truth`: all faces within the radius. */
static void check_with(const within_query *q, const oracle_near *truth, uint64_t count)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status;
    stream s = run_query(q, &status, &error);
    ck_assert_msg(status == EBPO_OK, "%s", error.message);
    count = q->most && q->most < count ? q->most : count;
    count = q->stop < count ? q->stop : count;
    ck_assert_uint_le(s.count, count);
    judge(q, &s, truth);
    ck_assert_uint_eq(s.count, count);
    free(s.face);
}

static void check(const within_query *q)
{
    uint32_t count;
    oracle_near *truth = oracle_order(q->m->judge, q->p, q->radius, &count);
    check_with(q, truth, count);
    free(truth);
}

/* Checks that the first face is the nearest one; its point is equal bit by bit. */
static void compare_first(const within_query *q)
{
    ebpo_distance_options o = EBPO_DISTANCE_OPTIONS_INIT;
    ebpo_distance_result nearest;
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_status status;
    within_query first = *q;
    o.unsigned_distance = true;
    first.most = 1;
    first.radius = INFINITY;
    ASSERT_OK(ebpo_distance(q->context, q->p, &o, &nearest, error));
    stream s = run_query(&first, &status, &why);
    ck_assert_int_eq(status, EBPO_OK);
    ck_assert_uint_eq(s.count, 1);
    ck_assert_uint_eq(s.face->face, nearest.face);
    ck_assert_mem_eq(&s.face->distance, &nearest.distance, sizeof nearest.distance);
    ck_assert_mem_eq(s.face->point, nearest.point, sizeof nearest.point);
    ck_assert_mem_eq(s.face->normal, nearest.normal, sizeof nearest.normal);
    free(s.face);
}

/* Checks a point, with radii at which a face is just within or just outside, and counts near the
 * number of all faces. */
static void check_point(const query_model *m, ebpo_context *context, const double *p,
                        uint64_t *state)
{
    uint32_t count;
    oracle_near *all = oracle_order(m->judge, p, INFINITY, &count);
    double d = all[ebpo_test_random(state) % count].distance;
    const double radii[] = { d, isinf(d) ? d : nextafter(d, INFINITY), d > 0 ? nextafter(d, 0) : 0,
                             0, d / 2 };
    const uint64_t most[] = { 0, 1, 7, count, count + (uint64_t)10 };
    within_query q = { m, context, p, INFINITY, 0, UINT64_MAX };
    compare_first(&q);
    /* only one query for large models, because far away everything needs slow exact arithmetic */
    for (uint64_t i = 0; i < (m->mesh.face_count > 500 ? 1 : 3); i++) {
        uint64_t kind = ebpo_test_random(state) % 4;
        q.radius = kind < 2 ? radii[ebpo_test_random(state) % 5] : INFINITY;
        q.most = kind % 2 ? most[ebpo_test_random(state) % 5] : 0;
        q.stop = kind == 2 ? 1 + ebpo_test_random(state) % count : UINT64_MAX;
        if (kind < 2)
            check(&q);
        else
            check_with(&q, all, count);
    }
    free(all);
}

static void check_points(const query_model *m, ebpo_context *context, uint64_t count, uint64_t seed)
{
    double *points = query_alloc(count, 3 * sizeof *points);
    query_make_points(m, count, seed, points);
    for (uint64_t i = 0; i < count; i++)
        check_point(m, context, points + 3 * i, &seed);
    /* the middle of symmetric models, and a vertex */
    for (int k = 0; k < 3; k++)
        points[k] = m->info.box_origin[k] + m->info.box_size[k] / 2;
    check_point(m, context, points, &seed);
    ebpo_test_point(&m->mesh, m->mesh.faces[0], points);
    within_query q = { m, context, points, 0, 0, UINT64_MAX };
    check(&q);
    free(points);
}

START_TEST(test_within_stream_is_sorted_exactly)
{
    query_model m;
    query_model_make(&m, cases[_i].name, query_solid_by_name(cases[_i].name),
                     &query_variants[cases[_i].variant]);
    check_points(&m, m.context, query_scaled(m.mesh.face_count > 500 ? 60 : 200),
                 (uint64_t)_i + 70);
    query_model_free(&m);
}
END_TEST

/* --- partly loaded --- */

START_TEST(test_within_stream_ignores_load_mode)
{
    query_model m;
    query_model_make(&m, cases[_i].name, query_solid_by_name(cases[_i].name),
                     &query_variants[cases[_i].variant]);
    for (int loading = 0; loading < 3; loading++)
        /* modes without a cache load much data for a list of all faces */
        for (int cut = 0; cut < (loading ? 2 : 4) && cut < m.info.level_count; cut++) {
            ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
            ebpo_model *model;
            ebpo_context *context;
            how.loading = (ebpo_loading)loading;
            how.cut_level = cut;
            ASSERT_OK(ebpo_model_new(m.file, &how, &model, error));
            ASSERT_OK(ebpo_context_new(model, &context, error));
            check_points(&m, context, query_scaled(m.mesh.face_count > 500 ? 8 : 60),
                         (uint64_t)_i + 7);
            ebpo_context_free(context);
            ebpo_model_free(model);
        }
    query_model_free(&m);
}
END_TEST

START_TEST(test_within_minimum_budget_is_kept)
{
    query_model m;
    ebpo_model *model = NULL;
    ebpo_context *context;
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    ebpo_error why = EBPO_ERROR_INIT;
    query_model_make(&m, "sphere", query_solid_by_name("sphere"), &query_variants[0]);
    for (how.memory = 1 << 16; !model; how.memory += how.memory / 8)
        if (ebpo_model_new(m.file, &how, &model, &why) != EBPO_OK)
            model = NULL;
    ASSERT_OK(ebpo_context_new(model, &context, error));
    check_points(&m, context, query_scaled(20), 3);
    ebpo_model_get_stats(model, &stats);
    ck_assert_uint_le(stats.memory_peak, stats.budget);
    ebpo_context_free(context);
    ebpo_model_free(model);
    query_model_free(&m);
}
END_TEST

/* Returns the number of loads of a query, with a model that keeps one subtree or all subtrees. */
static uint64_t loads_for(const query_model *m, ebpo_loading loading, double radius, uint64_t most)
{
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    ebpo_model *model;
    ebpo_context *context;
    double p[3];
    how.loading = loading;
    how.cut_level = 2;
    ASSERT_OK(ebpo_model_new(m->file, &how, &model, error));
    ASSERT_OK(ebpo_context_new(model, &context, error));
    ebpo_test_point(&m->mesh, 5, p);
    within_query q = { m, context, p, radius, most, UINT64_MAX };
    check(&q);
    ebpo_model_get_stats(model, &stats);
    ebpo_context_free(context);
    ebpo_model_free(model);
    return stats.loads;
}

START_TEST(test_within_loads_needed_subtrees_once)
{
    query_model m;
    query_model_make(&m, "sphere", query_solid_by_name("sphere"), &query_variants[0]);
    uint64_t all = loads_for(&m, EBPO_LOAD_CACHE, INFINITY, m.mesh.face_count),
             few = loads_for(&m, EBPO_LOAD_CACHE, INFINITY, 6);
    ck_assert_uint_eq(loads_for(&m, EBPO_LOAD_SUBTREE, INFINITY, m.mesh.face_count), all);
    ck_assert_uint_eq(loads_for(&m, EBPO_LOAD_SUBTREE, INFINITY, 6), few);
    ck_assert_uint_eq(loads_for(&m, EBPO_LOAD_CACHE, INFINITY, 0), all);
    ck_assert_uint_gt(few, 0);
    ck_assert_uint_lt(4 * few, all);
    ck_assert_uint_lt(4 * loads_for(&m, EBPO_LOAD_CACHE, m.size / 50, 0), all);
    query_model_free(&m);
}
END_TEST

/* --- subsets --- */

/* Checks that faces are correct, and complete when no omitted part is near. */
static bool query_part(const within_query *q)
{
    uint32_t count;
    oracle_near *truth = oracle_order(q->m->judge, q->p, q->radius, &count);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status;
    stream s = run_query(q, &status, &error);
    ck_assert_msg(status == EBPO_OK || status == EBPO_E_ABSENT, "%s", error.message);
    ck_assert_uint_le(s.count, count);
    for (uint64_t i = 0; i < s.count; i++) {
        ck_assert_uint_eq(s.face[i].face, query_reported(q->m, truth[i].face));
        ck_assert(s.face[i].distance == truth[i].distance);
    }
    if (status == EBPO_OK)
        ck_assert_uint_eq(s.count, q->most && q->most < count ? q->most : count);
    free(truth);
    free(s.face);
    return status == EBPO_OK;
}

START_TEST(test_within_subset_refuses_missing_region)
{
    query_model m;
    ebpo_subset_options o = EBPO_SUBSET_OPTIONS_INIT;
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    ebpo_file *part;
    ebpo_model *model;
    ebpo_context *context;
    char path[SCRATCH_LENGTH + 16];
    uint64_t answered = 0, refused = 0, state = 4;
    query_model_make(&m, "sphere", query_solid_by_name("sphere"), &query_variants[0]);
    snprintf(path, sizeof path, "%s/part.ebpo.h5", m.folder);
    o.boxed = true;
    for (int k = 0; k < 3; k++) {
        o.min[k] = m.info.box_origin[k];
        o.max[k] = m.info.box_origin[k] + m.info.box_size[k] * (k ? 1 : 0.7);
    }
    ASSERT_OK(ebpo_subset(m.file, path, &o, error));
    ASSERT_OK(ebpo_open(path, &part, error));
    how.cut_level = _i ? 2 : -1;
    ASSERT_OK(ebpo_model_new(part, &how, &model, error));
    ASSERT_OK(ebpo_context_new(model, &context, error));
    for (uint64_t i = 0; i < query_scaled(100); i++) {
        double p[3];
        ebpo_test_point(&m.mesh, ebpo_test_random(&state) % m.mesh.vertex_count, p);
        within_query q = { &m,
                           context,
                           p,
                           i % 3 ? m.size / (double)(i % 16 + 2) : INFINITY,
                           i % 3 == 2 ? 0 : i,
                           UINT64_MAX };
        bool fine = query_part(&q);
        answered += fine;
        refused += !fine;
    }
    ck_assert_uint_gt(refused, 0);
    ck_assert(answered > 0 || ebpo_test_scale() < 0.2);
    ebpo_context_free(context);
    ebpo_model_free(model);
    ebpo_close(part);
    unlink(path);
    query_model_free(&m);
}
END_TEST

/* --- invalid arguments --- */

static bool never(void *user, const ebpo_near_face *face)
{
    (void)user, (void)face;
    ck_abort_msg("an invalid query returned a face");
    return false;
}

START_TEST(test_within_invalid_query_is_refused)
{
    static const double bad_radius[] = { -1, NAN, -INFINITY };
    query_model m;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_within_options o = EBPO_WITHIN_OPTIONS_INIT;
    double p[3] = { 0, 0, 0 };
    query_model_make(&m, "cube", query_solid_by_name("cube"), &query_variants[0]);
    for (int i = 0; i < 3; i++) {
        o.radius = bad_radius[i];
        ck_assert_int_eq(ebpo_distance_within(m.context, p, &o, never, NULL, &error),
                         EBPO_E_ARGUMENT);
    }
    o.radius = 1;
    o.struct_size = 0;
    ck_assert_int_eq(ebpo_distance_within(m.context, p, &o, never, NULL, &error), EBPO_E_ARGUMENT);
    p[1] = NAN;
    ck_assert_int_eq(ebpo_distance_within(m.context, p, NULL, never, NULL, &error),
                     EBPO_E_ARGUMENT);
    query_model_free(&m);
}
END_TEST

static bool has_no_normal(void *user, const ebpo_near_face *face)
{
    *(uint64_t *)user += isnan(face->normal[0]) && isnan(face->normal[1]) && isnan(face->normal[2]);
    return true;
}

START_TEST(test_within_normals_can_be_omitted)
{
    query_model m;
    ebpo_within_options o = EBPO_WITHIN_OPTIONS_INIT;
    const double p[3] = { 0.5, 0.25, 9 };
    uint64_t count = 0;
    query_model_make(&m, "cube", query_solid_by_name("cube"), &query_variants[0]);
    o.normals = false;
    ASSERT_OK(ebpo_distance_within(m.context, p, &o, has_no_normal, &count, error));
    ck_assert_uint_eq(count, m.mesh.face_count);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(query_within)
{
    Suite *s = suite_create("query_within");
    TCase *t = tcase_create("within");
    tcase_set_timeout(t, 1200);
    tcase_add_loop_test(t, test_within_stream_is_sorted_exactly, 0, CASES);
    tcase_add_loop_test(t, test_within_stream_ignores_load_mode, 0, CASES);
    tcase_add_test(t, test_within_minimum_budget_is_kept);
    tcase_add_test(t, test_within_loads_needed_subtrees_once);
    tcase_add_loop_test(t, test_within_subset_refuses_missing_region, 0, 2);
    tcase_add_test(t, test_within_invalid_query_is_refused);
    tcase_add_test(t, test_within_normals_can_be_omitted);
    suite_add_tcase(s, t);
    return s;
}
