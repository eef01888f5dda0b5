/* Tests queries in all modes. Results are the same for all loading modes, budgets, orders and
 * threads. With limits they are certain. */
#include <inttypes.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "query_support.h"

/* Deep trees with all kinds of leaves (solid, variant). */
static const struct {
    const char *name;
    int variant;
} cases[] = {
    { "sphere", 5 },         { "boxes_in_walls", 0 },     { "nested_windings", 1 },
    { "blob", 2 },           { "touching_shells", 5 },    { "tetrahedra_at_random", 3 },
    { "giant_and_dust", 0 }, { "cube_in_cell_walls", 1 }, { "far_away_float", 0 },
    { "tetrahedron", 0 },
};
enum { CASES = sizeof cases / sizeof *cases };

/* A model, points, and the exact results for them. */
typedef struct fixture {
    query_model m;
    uint64_t count;
    double *points;
    query_truth *truth;
    ebpo_inside_result *inside;
    ebpo_distance_result *distance;
} fixture;

static void reserve_space(fixture *a, uint64_t count)
{
    a->count = count;
    a->points = query_alloc(count, 3 * sizeof *a->points);
    a->truth = query_alloc(count, sizeof *a->truth);
    a->inside = query_alloc(count, sizeof *a->inside);
    a->distance = query_alloc(count, sizeof *a->distance);
}

static void begin(fixture *a, int i, uint64_t count)
{
    query_model_make(&a->m, cases[i].name, query_solid_by_name(cases[i].name),
                     &query_variants[cases[i].variant]);
    reserve_space(a, query_scaled(count / 3));
    query_make_points(&a->m, a->count, (uint64_t)i + 1000, a->points);
    query_find_truths(&a->m, a->points, a->count, a->truth);
}

static void end(fixture *a)
{
    query_model_free(&a->m);
    free(a->points);
    free(a->truth);
    free(a->inside);
    free(a->distance);
}

static void query_exactly(fixture *a, ebpo_context *context, const ebpo_inside_options *inside,
                          const ebpo_distance_options *options)
{
    ASSERT_OK(ebpo_inside_many(context, a->points, a->count, inside, a->inside, error));
    ck_assert_uint_eq(query_wrong_inside(&a->m, a->points, a->truth, a->count, a->inside), 0);
    ASSERT_OK(ebpo_distance_many(context, a->points, a->count, options, a->distance, error));
    ck_assert_uint_eq(query_wrong_distance(&a->m, a->points, a->truth, a->count,
                                           options && options->unsigned_distance, a->distance),
                      0);
}

/* --- loading and memory --- */

static void query_loaded(fixture *a, const ebpo_model_options *how)
{
    ebpo_model *model;
    ebpo_context *context;
    ASSERT_OK(ebpo_model_new(a->m.file, how, &model, error));
    ASSERT_OK(ebpo_context_new(model, &context, error));
    for (int envelopes = 0; envelopes < 3; envelopes++) {
        ebpo_inside_options inside = EBPO_INSIDE_OPTIONS_INIT;
        inside.envelopes = (ebpo_envelopes)envelopes;
        query_exactly(a, context, &inside, NULL);
    }
    ebpo_context_free(context);
    ebpo_model_free(model);
}

/* With EBPO_TEST_SCALE below 1 each test runs other cases than the test before, so that together
 * they run all cases. */

START_TEST(test_results_same_in_all_load_modes)
{
    if (!ebpo_test_wanted(_i + 1))
        return;
    fixture a;
    begin(&a, _i, 300);
    for (int loading = 0; loading < 3; loading++)
        for (int cut = -1; cut < 5; cut++) {
            ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
            how.loading = (ebpo_loading)loading;
            how.cut_level = cut;
            how.prefetch = loading == EBPO_LOAD_CACHE && cut % 2 == 0;
            if (cut < a.m.info.level_count)
                query_loaded(&a, &how);
        }
    end(&a);
}
END_TEST

/* Returns true when the budget allowed a model and a context. */
static bool query_within(fixture *a, uint64_t budget, bool *resident)
{
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model *model = NULL;
    ebpo_context *context = NULL;
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    how.memory = budget;
    ebpo_status status = ebpo_model_new(a->m.file, &how, &model, &error);
    if (status == EBPO_OK)
        status = ebpo_context_new(model, &context, &error);
    ck_assert_msg(status == EBPO_OK || status == EBPO_E_LIMIT, "%s", error.message);
    if (status == EBPO_E_LIMIT)
        ck_assert_int_ne(error.message[0], 0);
    else
        query_exactly(a, context, NULL, NULL);
    if (model) {
        ebpo_model_get_stats(model, &stats);
        ck_assert_uint_eq(stats.budget, budget);
        ck_assert_uint_le(stats.memory_peak, budget);
        ck_assert_uint_le(stats.memory, stats.memory_peak);
        *resident = stats.resident;
    }
    ebpo_context_free(context);
    ebpo_model_free(model);
    return status == EBPO_OK;
}

START_TEST(test_results_same_for_any_budget)
{
    if (!ebpo_test_wanted(_i + 2))
        return;
    fixture a;
    begin(&a, _i, 300);
    bool resident = false, fits = false;
    ck_assert(!query_within(&a, 1, &resident));
    for (uint64_t budget = 4096; !resident; budget += budget / 2) {
        bool fitted = query_within(&a, budget, &resident);
        ck_assert(fitted || !fits); /* a model that fits a budget also fits a greater one */
        fits = fitted;
        ck_assert_uint_lt(budget, UINT64_C(1) << 32);
    }
    end(&a);
}
END_TEST

/* Queries each point with another context, so that each context keeps a subtree, until the budget
 * is used up. Returns false if the budget is too small for a query, or if all points have results.
 */
static bool use_up(const fixture *a, ebpo_model *model, ebpo_error *why)
{
    ebpo_context **context = query_alloc(a->count, sizeof(ebpo_context *));
    ebpo_distance_result result;
    uint64_t count = 0;
    ebpo_status status = EBPO_OK;
    memset(context, 0, a->count * sizeof(ebpo_context *));
    ASSERT_OK(ebpo_context_new(model, &context[0], error));
    for (uint64_t i = 0; i < a->count && status == EBPO_OK; i++)
        status = ebpo_distance(context[0], a->points + 3 * i, NULL, &result, why);
    bool suffices = status == EBPO_OK;
    while (status == EBPO_OK && ++count < a->count) {
        ASSERT_OK(ebpo_context_new(model, &context[count], error));
        status = ebpo_distance(context[count], a->points + 3 * count, NULL, &result, why);
    }
    for (uint64_t i = 0; i < a->count; i++)
        ebpo_context_free(context[i]);
    free(context);
    return suffices && status == EBPO_E_LIMIT;
}

/* The budget is large enough for each subtree, so a message that it is not would be wrong. */
START_TEST(test_limit_of_subtrees_in_use_has_its_message)
{
    fixture a;
    bool used_up = false, resident = false;
    query_model_make(&a.m, cases[0].name, query_solid_by_name(cases[0].name),
                     &query_variants[cases[0].variant]);
    reserve_space(&a, 100);
    query_make_points(&a.m, a.count, 1, a.points);
    for (uint64_t budget = 4096; !used_up && !resident; budget += budget / 16) {
        ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
        ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
        ebpo_error why = EBPO_ERROR_INIT;
        ebpo_model *model = NULL;
        how.memory = budget;
        how.cut_level = 1;
        if (ebpo_model_new(a.m.file, &how, &model, &why) != EBPO_OK)
            continue;
        ebpo_model_get_stats(model, &stats);
        resident = stats.resident;
        used_up = use_up(&a, model, &why);
        ck_assert_msg(!used_up || strstr(why.message, "are in use, and one subtree more"), "%s",
                      why.message);
        ebpo_model_free(model);
    }
    ck_assert(used_up);
    end(&a);
}
END_TEST

/* --- forms of queries --- */

START_TEST(test_batches_match_single_queries)
{
    if (!ebpo_test_wanted(_i + 3))
        return;
    fixture a;
    begin(&a, _i, 1000);
    query_exactly(&a, a.m.context, NULL, NULL);
    for (uint64_t i = 0; i < a.count; i++) {
        ebpo_inside_result inside;
        ebpo_distance_result distance;
        ASSERT_OK(ebpo_inside(a.m.context, a.points + 3 * i, NULL, &inside, error));
        ASSERT_OK(ebpo_distance(a.m.context, a.points + 3 * i, NULL, &distance, error));
        ck_assert_mem_eq(&inside, &a.inside[i], sizeof inside);
        ck_assert_mem_eq(&distance, &a.distance[i], sizeof distance);
    }
    end(&a);
}
END_TEST

START_TEST(test_results_ignore_warm_start_and_sign)
{
    if (!ebpo_test_wanted(_i + 4))
        return;
    fixture a;
    begin(&a, _i, 600);
    for (int form = 0; form < 4; form++) {
        ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
        options.warm = form & 1;
        options.unsigned_distance = form & 2;
        query_exactly(&a, a.m.context, NULL, &options);
    }
    /* points along a path, where the previous result is close to the next one */
    for (uint64_t i = 1; i < a.count; i++)
        for (uint64_t k = 0; k < 3; k++)
            a.points[3 * i + k] =
                a.points[k] + (a.points[3 + k] - a.points[k]) * (double)i / (double)a.count;
    query_find_truths(&a.m, a.points, a.count, a.truth);
    for (int warm = 0; warm < 2; warm++) {
        ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
        options.warm = warm;
        query_exactly(&a, a.m.context, NULL, &options);
    }
    end(&a);
}
END_TEST

START_TEST(test_results_beyond_max_distance_are_omitted)
{
    if (!ebpo_test_wanted(_i + 5))
        return;
    fixture a;
    begin(&a, _i, 500);
    for (uint64_t i = 0; i < a.count; i++) {
        double d = a.truth[i].distance;
        const double limits[] = {
            d, nextafter(d, INFINITY), d > 0 ? nextafter(d, 0) : 0, d / 2, 2 * d, 0, INFINITY
        };
        oracle_nearest near;
        oracle_find_nearest(a.m.judge, a.points + 3 * i, &near);
        for (size_t l = 0; l < sizeof limits / sizeof *limits; l++) {
            ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
            ebpo_distance_result got;
            options.max_distance = limits[l];
            options.warm = i & 1;
            ASSERT_OK(ebpo_distance(a.m.context, a.points + 3 * i, &options, &got, error));
            if (oracle_distance_compare(a.m.judge, limits[l]) <= 0) {
                ck_assert_uint_eq(query_wrong_distance(&a.m, a.points + 3 * i, a.truth + i, 1,
                                                       false, &got),
                                  0);
            } else {
                ck_assert_msg(isinf(got.distance), "point (%a, %a, %a), max_distance %a: %a",
                              a.points[3 * i], a.points[3 * i + 1], a.points[3 * i + 2], limits[l],
                              got.distance);
                ck_assert(got.face == EBPO_NO_FACE);
                ck_assert_double_le(got.lo, d);
                ck_assert_double_ge(got.hi, d);
            }
        }
    }
    end(&a);
}
END_TEST

/* --- limits --- */

static void query_limited(fixture *a, ebpo_context *context, ebpo_envelopes envelopes,
                          const ebpo_distance_options *options)
{
    ebpo_inside_options inside = query_inside_like(options);
    inside.envelopes = envelopes;
    ASSERT_OK(ebpo_inside_many(context, a->points, a->count, &inside, a->inside, error));
    ck_assert_uint_eq(query_wrong_limited_inside(&a->m, a->points, a->truth, a->count, a->inside),
                      0);
    ASSERT_OK(ebpo_distance_many(context, a->points, a->count, options, a->distance, error));
    ck_assert_uint_eq(query_wrong_limited_distance(&a->m, a->points, a->truth, a->count,
                                                   a->distance),
                      0);
}

START_TEST(test_level_limited_results_are_certain)
{
    if (!ebpo_test_wanted(_i + 6))
        return;
    fixture a;
    begin(&a, _i, 600);
    for (int level = 0; level < a.m.info.level_count; level++)
        for (int envelopes = 0; envelopes < 3; envelopes++) {
            ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
            options.level = level;
            query_limited(&a, a.m.context, (ebpo_envelopes)envelopes, &options);
        }
    end(&a);
}
END_TEST

START_TEST(test_level_limited_results_ignore_loaded_data)
{
    if (!ebpo_test_wanted(_i + 7))
        return;
    fixture a;
    begin(&a, _i, 300);
    ebpo_distance_result *first = query_alloc(a.count, sizeof *first);
    ebpo_inside_result *where = query_alloc(a.count, sizeof *where);
    for (int level = 0; level < a.m.info.level_count; level += 2) {
        ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
        options.level = level;
        query_limited(&a, a.m.context, EBPO_ENVELOPES_AUTO, &options);
        memcpy(first, a.distance, a.count * sizeof *first);
        memcpy(where, a.inside, a.count * sizeof *where);
        for (int cut = 0; cut < 4 && cut < a.m.info.level_count; cut++) {
            ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
            ebpo_model *model;
            ebpo_context *context;
            how.cut_level = cut;
            ASSERT_OK(ebpo_model_new(a.m.file, &how, &model, error));
            ASSERT_OK(ebpo_context_new(model, &context, error));
            query_limited(&a, context, EBPO_ENVELOPES_AUTO, &options);
            ebpo_context_free(context);
            ebpo_model_free(model);
        }
    }
    free(first);
    free(where);
    end(&a);
}
END_TEST

START_TEST(test_deadline_limited_results_are_certain)
{
    if (!ebpo_test_wanted(_i + 8))
        return;
    static const uint64_t deadlines[] = { 1, 100, 1000, 10000, 100000, 1000000 };
    fixture a;
    begin(&a, _i, 300);
    for (size_t d = 0; d < sizeof deadlines / sizeof *deadlines; d++)
        for (int cut = -1; cut < 2 && cut < a.m.info.level_count; cut++) {
            ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
            ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
            ebpo_model *model;
            ebpo_context *context;
            how.cut_level = cut;
            options.deadline_ns = deadlines[d];
            ASSERT_OK(ebpo_model_new(a.m.file, &how, &model, error));
            ASSERT_OK(ebpo_context_new(model, &context, error));
            query_limited(&a, context, EBPO_ENVELOPES_AUTO, &options);
            for (uint64_t i = 0; i < a.count;
                 /* a bound is known even after the shortest time, because some face is in the root
                  * cell; distances beyond the largest double are not known */
                 i++)
                ck_assert(isfinite(a.distance[i].hi) || isinf(a.truth[i].distance) ||
                          fabs(a.points[3 * i]) + fabs(a.points[3 * i + 1]) +
                                  fabs(a.points[3 * i + 2]) >
                              1e300);
            ebpo_context_free(context);
            ebpo_model_free(model);
        }
    end(&a);
}
END_TEST

START_TEST(test_thesis_mode_bounds_hold)
{
    if (!ebpo_test_wanted(_i + 9))
        return;
    fixture a;
    begin(&a, _i, 600);
    for (int mode = EBPO_DISTANCE_RECURSIVE; mode <= EBPO_DISTANCE_ENVELOPE; mode++) {
        ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
        options.mode = (ebpo_distance_mode)mode;
        ASSERT_OK(ebpo_distance_many(a.m.context, a.points, a.count, &options, a.distance, error));
        for (uint64_t i = 0; i < a.count; i++) {
            const ebpo_distance_result *got = a.distance + i;
            double d = a.truth[i].distance;
            ck_assert_msg(got->lo <= d && d <= got->hi,
                          "mode %d, point (%a, %a, %a): [%a, %a], it is %a", mode, a.points[3 * i],
                          a.points[3 * i + 1], a.points[3 * i + 2], got->lo, got->hi, d);
            if (mode != EBPO_DISTANCE_ENVELOPE &&
                isfinite(got->distance)) { /* the distance must be that of some face */
                ck_assert_double_ge(fabs(got->distance), d);
                ck_assert(got->face != EBPO_NO_FACE);
            }
        }
    }
    end(&a);
}
END_TEST

/* A context caches envelopes for its next queries. A new context has none. */
START_TEST(test_cached_envelopes_match_fresh_ones)
{
    if (!ebpo_test_wanted(_i + 11))
        return;
    fixture a;
    begin(&a, _i, 300);
    ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
    options.mode = EBPO_DISTANCE_ENVELOPE;
    for (uint64_t i = 0; i < a.count; i++) {
        ebpo_context *fresh;
        ebpo_distance_result kept, cut;
        options.level = (int)(i % (uint64_t)a.m.info.level_count);
        ASSERT_OK(ebpo_context_new(a.m.model, &fresh, error));
        ASSERT_OK(ebpo_distance(a.m.context, a.points + 3 * i, &options, &kept, error));
        ASSERT_OK(ebpo_distance(fresh, a.points + 3 * i, &options, &cut, error));
        ck_assert_msg(memcmp(&kept.distance, &cut.distance, sizeof kept.distance) == 0 &&
                          memcmp(kept.normal, cut.normal, sizeof kept.normal) == 0,
                      "level %d, point (%a, %a, %a): %a, computed anew %a", options.level,
                      a.points[3 * i], a.points[3 * i + 1], a.points[3 * i + 2], kept.distance,
                      cut.distance);
        ebpo_context_free(fresh);
    }
    end(&a);
}
END_TEST

/* The data of a leaf or a node depends only on the file, not on other nodes in memory. */
START_TEST(test_thesis_modes_ignore_loaded_data)
{
    if (!ebpo_test_wanted(_i + 10))
        return;
    fixture a;
    begin(&a, _i, 300);
    ebpo_distance_result *resident = calloc(a.count, sizeof *resident);
    for (int mode = EBPO_DISTANCE_RECURSIVE; mode <= EBPO_DISTANCE_ENVELOPE; mode++) {
        ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
        options.mode = (ebpo_distance_mode)mode;
        ASSERT_OK(ebpo_distance_many(a.m.context, a.points, a.count, &options, resident, error));
        for (int cut = 1; cut < a.m.info.level_count; cut++) {
            ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
            ebpo_model *model;
            ebpo_context *context;
            how.cut_level = cut;
            ASSERT_OK(ebpo_model_new(a.m.file, &how, &model, error));
            ASSERT_OK(ebpo_context_new(model, &context, error));
            ASSERT_OK(ebpo_distance_many(context, a.points, a.count, &options, a.distance, error));
            for (uint64_t i = 0; i < a.count; i++) {
                const ebpo_distance_result *got = a.distance + i, *want = resident + i;
                ck_assert_msg(got->face == want->face && memcmp(&got->distance, &want->distance,
                                                                sizeof got->distance) == 0,
                              "mode %d, cut level %d, point (%a, %a, %a): %a of face %" PRIu64
                              ", resident %a of face %" PRIu64,
                              mode, cut, a.points[3 * i], a.points[3 * i + 1], a.points[3 * i + 2],
                              got->distance, got->face, want->distance, want->face);
            }
            ebpo_context_free(context);
            ebpo_model_free(model);
        }
    }
    free(resident);
    end(&a);
}
END_TEST

/* --- a file without mesh --- */

START_TEST(test_file_without_mesh_allows_level_queries)
{
    if (!ebpo_test_wanted(_i + 11))
        return;
    static const query_variant bare = { "planes only", 4, -1, EBPO_RULE_NONZERO, EBPO_PART_PLANES };
    fixture a;
    begin(&a, _i, 500);
    query_model m;
    query_model_make(&m, cases[_i].name, query_solid_by_name(cases[_i].name), &bare);
    ebpo_inside_result inside;
    ebpo_distance_result distance;
    const ebpo_ray_hit *hits;
    const uint64_t *faces;
    uint64_t count;
    bool hit;
    ebpo_ray_hit one;
    const double *p = a.points;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_int_eq(ebpo_inside(m.context, p, NULL, &inside, &error), EBPO_E_ABSENT);
    ck_assert_int_ne(error.message[0], 0);
    ck_assert_int_eq(ebpo_distance(m.context, p, NULL, &distance, &error), EBPO_E_ABSENT);
    ck_assert_int_eq(ebpo_ray_first(m.context, p, (double[3]){ 1, 0, 0 }, INFINITY, &one, &hit,
                                    &error),
                     EBPO_E_ABSENT);
    ck_assert_int_eq(ebpo_ray_all(m.context, p, (double[3]){ 1, 0, 0 }, INFINITY, &hits, &count,
                                  &error),
                     EBPO_E_ABSENT);
    ck_assert_int_eq(ebpo_faces_in_box(m.context, p, p, &faces, &count, &error), EBPO_E_ABSENT);
    if (query_variants[cases[_i].variant].rule == EBPO_RULE_NONZERO)
        for (int level = 0; level < m.info.level_count; level++) {
            ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
            options.level = level;
            query_limited(&a, m.context, EBPO_ENVELOPES_AUTO, &options);
        }
    query_model_free(&m);
    end(&a);
}
END_TEST

/* --- threads --- */

typedef struct thread_job {
    fixture *a;
    ebpo_model *model;
    unsigned number;
    ebpo_status status;
    uint64_t different;
} thread_job;

/* Each thread begins with a different point. Results must equal those of one thread, bit for bit.
 */
static void *query_in_thread(void *user)
{
    thread_job *job = user;
    fixture *a = job->a;
    ebpo_context *context;
    job->status = ebpo_context_new(job->model, &context, NULL);
    for (uint64_t i = 0; i < a->count && job->status == EBPO_OK; i++) {
        uint64_t at = (i + job->number * a->count / 4) % a->count;
        ebpo_inside_result inside;
        ebpo_distance_result distance;
        job->status = ebpo_inside(context, a->points + 3 * at, NULL, &inside, NULL);
        if (job->status == EBPO_OK)
            job->status = ebpo_distance(context, a->points + 3 * at, NULL, &distance, NULL);
        if (job->status == EBPO_OK)
            job->different += memcmp(&inside, &a->inside[at], sizeof inside) != 0 ||
                              memcmp(&distance, &a->distance[at], sizeof distance) != 0;
    }
    ebpo_context_free(context);
    return NULL;
}

static void in_threads(fixture *a, const ebpo_model_options *how, void *(*run_query)(void *job),
                       ebpo_model_stats *stats)
{
    enum { THREADS = 4 };
    pthread_t thread[THREADS];
    thread_job job[THREADS];
    ebpo_model *model;
    ASSERT_OK(ebpo_model_new(a->m.file, how, &model, error));
    for (unsigned i = 0; i < THREADS; i++) {
        job[i] = (thread_job){ .a = a, .model = model, .number = i };
        ck_assert_int_eq(pthread_create(&thread[i], NULL, run_query, &job[i]), 0);
    }
    for (int i = 0; i < THREADS; i++)
        ck_assert_int_eq(pthread_join(thread[i], NULL), 0);
    for (int i = 0; i < THREADS; i++) {
        ck_assert_int_eq(job[i].status, EBPO_OK);
        ck_assert_uint_eq(job[i].different, 0);
    }
    ebpo_model_get_stats(model, stats);
    ebpo_model_free(model);
}

static void query_in_threads(fixture *a, const ebpo_model_options *how)
{
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    in_threads(a, how, query_in_thread, &stats);
}

/* These tests detect data races with ThreadSanitizer: meson setup build-tsan -Db_sanitize=thread;
 * CK_RUN_CASE=threads build-tsan/tests/query/test_query_modes */
START_TEST(test_four_threads_match_single_thread)
{
    if (!ebpo_test_wanted(_i + 12))
        return;
    fixture a;
    begin(&a, _i, 400);
    query_exactly(&a, a.m.context, NULL, NULL);
    for (int loading = 0; loading < 3; loading++)
        for (int cut = -1; cut < 3 && cut < a.m.info.level_count; cut++)
            for (int prefetch = 0; prefetch < 2; prefetch++) {
                ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
                how.loading = (ebpo_loading)loading;
                how.cut_level = cut;
                how.prefetch = prefetch;
                query_in_threads(&a, &how);
            }
    end(&a);
}
END_TEST

/* Uses the smallest budgets for four contexts. Subtrees are loaded and evicted all the time. */
START_TEST(test_four_threads_share_small_budget)
{
    if (!ebpo_test_wanted(_i + 13))
        return;
    fixture a;
    begin(&a, _i, 400);
    query_exactly(&a, a.m.context, NULL, NULL);
    int runs = 0;
    for (uint64_t budget = 16384; runs < 4; budget += budget / 3) {
        ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
        ebpo_model *model;
        ebpo_context *context[4] = { NULL };
        how.memory = budget;
        how.prefetch = true;
        ebpo_status status = ebpo_model_new(a.m.file, &how, &model, NULL);
        for (int i = 0; i < 4 && status == EBPO_OK; i++)
            status = ebpo_context_new(model, &context[i], NULL);
        for (int i = 0; i < 4; i++)
            ebpo_context_free(context[i]);
        ebpo_model_free(model);
        if (status == EBPO_OK) {
            query_in_threads(&a, &how);
            runs++;
        }
    }
    end(&a);
}
END_TEST

/* The first query of a leaf computes its cell faces, and the 128th its planes, while other queries
 * run. */
enum { REPEATED_POINTS = 12, OFTEN = 200 };

static void *query_often(void *user)
{
    thread_job *job = user;
    fixture *a = job->a;
    ebpo_context *context;
    job->status = ebpo_context_new(job->model, &context, NULL);
    for (uint64_t i = 0; i < OFTEN * a->count && job->status == EBPO_OK; i++) {
        uint64_t at = (i + job->number) % a->count;
        ebpo_inside_result inside;
        job->status = ebpo_inside(context, a->points + 3 * at, NULL, &inside, NULL);
        job->different += memcmp(&inside, &a->inside[at], sizeof inside) != 0;
    }
    ebpo_context_free(context);
    return NULL;
}

/* Makes points close to faces, on either side, so that they are in leaves. */
static void begin_in_leaves(fixture *a, int number)
{
    query_model_make(&a->m, cases[number].name, query_solid_by_name(cases[number].name),
                     &query_variants[cases[number].variant]);
    reserve_space(a, REPEATED_POINTS);
    const ebpo_mesh *mesh = &a->m.mesh;
    for (uint64_t i = 0; i < a->count; i++) {
        const uint32_t *corner = mesh->faces + 3 * (i * mesh->face_count / a->count);
        for (uint64_t k = 0; k < 3; k++) {
            double sum = 0;
            for (int c = 0; c < 3; c++)
                sum += mesh->xyz64 ? mesh->xyz64[3 * (uint64_t)corner[c] + k]
                                   : (double)mesh->xyz32[3 * (uint64_t)corner[c] + k];
            a->points[3 * i + k] = sum / 3 + (i % 3 == k ? a->m.size / 300 : 0) * (i % 2 ? 1 : -1);
        }
    }
    query_find_truths(&a->m, a->points, a->count, a->truth);
}

START_TEST(test_leaves_classified_concurrently)
{
    fixture a;
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    uint64_t found = 0;
    begin_in_leaves(&a, _i);
    query_exactly(&a, a.m.context, NULL, NULL);
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    how.cut_level = _i % 2 ? 1 : -1;
    in_threads(&a, &how, query_often, &stats);
    for (int k = 0; k < 5; k++)
        found += stats.leaves_of_kind[k];
    ck_assert_uint_ge(found, 1);
    end(&a);
}
END_TEST

TEST_SUITE(query_modes)
{
    Suite *suite = suite_create("query_modes");
    TCase *tests = tcase_create("modes"), *threads = tcase_create("threads");
    tcase_set_timeout(tests, 1000);
    tcase_set_timeout(threads, 1000);
    tcase_add_loop_test(tests, test_results_same_in_all_load_modes, 0, CASES);
    tcase_add_loop_test(tests, test_results_same_for_any_budget, 0, CASES);
    tcase_add_test(tests, test_limit_of_subtrees_in_use_has_its_message);
    tcase_add_loop_test(tests, test_batches_match_single_queries, 0, CASES);
    tcase_add_loop_test(tests, test_results_ignore_warm_start_and_sign, 0, CASES);
    tcase_add_loop_test(tests, test_results_beyond_max_distance_are_omitted, 0, CASES);
    tcase_add_loop_test(tests, test_level_limited_results_are_certain, 0, CASES);
    tcase_add_loop_test(tests, test_level_limited_results_ignore_loaded_data, 0, CASES);
    tcase_add_loop_test(tests, test_deadline_limited_results_are_certain, 0, CASES);
    tcase_add_loop_test(tests, test_thesis_mode_bounds_hold, 0, CASES);
    tcase_add_loop_test(tests, test_cached_envelopes_match_fresh_ones, 0, CASES);
    tcase_add_loop_test(tests, test_thesis_modes_ignore_loaded_data, 0, CASES);
    tcase_add_loop_test(tests, test_file_without_mesh_allows_level_queries, 0, CASES);
    tcase_add_loop_test(threads, test_four_threads_match_single_thread, 0, CASES);
    tcase_add_loop_test(threads, test_four_threads_share_small_budget, 0, CASES);
    tcase_add_loop_test(threads, test_leaves_classified_concurrently, 0, CASES);
    suite_add_tcase(suite, tests);
    suite_add_tcase(suite, threads);
    return suite;
}
