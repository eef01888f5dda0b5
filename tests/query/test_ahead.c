/* Prefetching of subtrees: the subtrees needed by queries nearby are among the prefetched ones.
 * Also what a load does not decode. */
#include <math.h>
#include <stdlib.h>

#include "check_main.h"
#include "query/load_ahead.h"
#include "query_support.h"

static const struct {
    const char *name;
    int variant;
} cases[] = { { "sphere", 5 },
              { "boxes_in_walls", 0 },
              { "blob", 2 },
              { "touching_shells", 5 },
              { "giant_and_dust", 0 } };
enum { CASES = sizeof cases / sizeof *cases };

static void load(ebpo_model *model, const uint64_t *below, unsigned count)
{
    for (unsigned i = 0; i < count; i++) {
        void *item;
        uint64_t key = ebpo_subtree_key(below[i], EBPO_ACCEL_NODES);
        ASSERT_OK(ebpo_cache_get(model->cache, key, &item, NULL, error));
        ebpo_cache_unpin(model->cache, key);
    }
}

static double distance_and_sign(ebpo_model *model, const double p[3])
{
    ebpo_context *context;
    ebpo_distance_result distance;
    ebpo_inside_result inside;
    ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
    ASSERT_OK(ebpo_context_new(model, &context, error));
    /* these rules need the cell that contains p at any distance from its envelope, because
     * envelopes do not decide then */
    options.unsigned_distance = model->info->rule != EBPO_RULE_NONZERO;
    ASSERT_OK(ebpo_distance(context, p, &options, &distance, error));
    if (!options.unsigned_distance)
        ASSERT_OK(ebpo_inside(context, p, NULL, &inside, error));
    ebpo_context_free(context);
    return fabs(distance.distance);
}

/* Runs a query for a point at p + away when only the subtrees listed for p are loaded. Returns
 * true when the query loads no other subtree. */
static bool loads_nothing_more(ebpo_model *model, const double p[3], const double away[3])
{
    double distance_moved =
               sqrt(away[0] * away[0] + away[1] * away[1] + away[2] * away[2]) * (1 + 0x1p-40),
           q[3] = { p[0] + away[0], p[1] + away[1], p[2] + away[2] };
    uint64_t keys[EBPO_CACHE_AHEAD];
    unsigned count =
        ebpo_subtrees_near(model, p, distance_and_sign(model, p) + 2 * distance_moved, keys);
    if (count == EBPO_CACHE_AHEAD)
        return false; /* more subtrees are needed than the list can hold */
    ebpo_cache_stats before, after;
    ebpo_cache_clear(model->cache);
    load(model, keys, count);
    ebpo_cache_get_stats(model->cache, &before);
    distance_and_sign(model, q);
    ebpo_cache_get_stats(model->cache, &after);
    ck_assert_uint_eq(after.loads, before.loads);
    return count > 0;
}

START_TEST(test_prefetch_covers_nearby_queries)
{
    query_model m;
    uint64_t count = query_scaled(200), looked = 0;
    double *points = query_alloc(2 * count, 3 * sizeof *points);
    query_model_make(&m, cases[_i].name, query_solid_by_name(cases[_i].name),
                     &query_variants[cases[_i].variant]);
    query_make_points(&m, 2 * count, (uint64_t)_i + 77, points);
    for (int cut = 1; cut < 4 && cut < m.info.level_count; cut++) {
        ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
        ebpo_model *model;
        how.memory = UINT64_C(1) << 40;
        how.cut_level = cut;
        ASSERT_OK(ebpo_model_new(m.file, &how, &model, error));
        for (uint64_t i = 0; i < count && !model->whole; i++) {
            const double *p = points + 6 * i;
            double away[3];
            for (int k = 0; k < 3; k++)
                away[k] = (p[k + 3] - p[k]) / (double)(4 << i % 8);
            looked += loads_nothing_more(model, p, away);
        }
        ebpo_model_free(model);
    }
    ck_assert_uint_gt(looked, 0);
    query_model_free(&m);
    free(points);
}
END_TEST

START_TEST(test_prefetch_orders_nearest_first)
{
    query_model m;
    uint64_t count = query_scaled(100);
    double *points = query_alloc(count, 3 * sizeof *points);
    query_model_make(&m, cases[_i].name, query_solid_by_name(cases[_i].name),
                     &query_variants[cases[_i].variant]);
    query_make_points(&m, count, (uint64_t)_i + 78, points);
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model *model;
    how.memory = UINT64_C(1) << 40;
    how.cut_level = 2;
    ASSERT_OK(ebpo_model_new(m.file, &how, &model, error));
    for (uint64_t i = 0; i < count && model->top; i++) {
        uint64_t all[EBPO_CACHE_AHEAD], some[EBPO_CACHE_AHEAD];
        unsigned most = ebpo_subtrees_near(model, points + 3 * i, INFINITY, all);
        ck_assert_uint_eq(most, model->top->below_count < EBPO_CACHE_AHEAD ? model->top->below_count
                                                                           : EBPO_CACHE_AHEAD);
        for (double limit = m.size / 64; limit < m.size; limit *= 2) {
            unsigned fewer = ebpo_subtrees_near(model, points + 3 * i, limit, some);
            ck_assert_uint_le(fewer, most);
            for (unsigned k = 0; k < fewer; k++)
                ck_assert_uint_eq(some[k], all[k]);
        }
    }
    ebpo_model_free(model);
    query_model_free(&m);
    free(points);
}
END_TEST

/* Returns the number of chunks of source indices that are not decoded. */
static unsigned missing_sources(const ebpo_model *model, ebpo_chunk_keys *keys)
{
    ebpo_chunk_keys_begin(keys);
    (void)ebpo_chunks_missing(model->chunks, EBPO_A_FACE_SOURCE, 0, 0, model->info->face_count,
                              keys);
    return keys->count;
}

START_TEST(test_loads_decode_no_source_indices)
{
    query_model m;
    ebpo_model *model;
    ebpo_context *context;
    ebpo_ray_hit hit;
    bool found = false;
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
    ebpo_distance_result distance;
    ebpo_chunk_keys *keys = query_alloc(1, sizeof *keys);
    query_model_make(&m, "sphere", query_solid_by_name("sphere"), &query_variants[5]);
    how.memory = UINT64_C(1) << 40;
    how.cut_level = 2;
    ASSERT_OK(ebpo_model_new(m.file, &how, &model, error));
    unsigned all = missing_sources(model, keys);
    for (uint64_t i = 0; i < model->top->below_count; i++)
        load(model, &i, 1);
    ck_assert_uint_gt(all, 0);
    ck_assert_uint_eq(missing_sources(model, keys), all);
    double p[3], direction[3] = { 1, 0.25, 0.125 };
    for (int k = 0; k < 3; k++)
        p[k] = m.info.box_origin[k] + m.info.box_size[k] / 2;
    ASSERT_OK(ebpo_context_new(model, &context, error));
    ASSERT_OK(ebpo_distance(context, p, &options, &distance, error));
    ck_assert_uint_eq(missing_sources(model, keys), all - 1);
    ASSERT_OK(ebpo_ray_first(context, p, direction, INFINITY, &hit, &found, error));
    ck_assert(found);
    ck_assert_uint_ge(missing_sources(model, keys) + 2, all);
    ebpo_context_free(context);
    ebpo_model_free(model);
    query_model_free(&m);
    free(keys);
}
END_TEST

TEST_SUITE(ahead)
{
    Suite *suite = suite_create("ahead");
    TCase *tests = tcase_create("ahead");
    tcase_set_timeout(tests, 1000);
    tcase_add_loop_test(tests, test_prefetch_covers_nearby_queries, 0, CASES);
    tcase_add_loop_test(tests, test_prefetch_orders_nearest_first, 0, CASES);
    tcase_add_test(tests, test_loads_decode_no_source_indices);
    suite_add_tcase(suite, tests);
    return suite;
}
