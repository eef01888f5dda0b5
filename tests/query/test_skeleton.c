/* Tests skeletons, which are kept for subtrees that are not in memory. Their bounds hold exactly
 * for every face, they take the stated memory, and they save loading without changing a result. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "geometry/distance.h"
#include "query/nearest.h"
#include "query/query_model.h"
#include "query_support.h"

/* --- bounds --- */

/* Data of all faces of a subtree. */
typedef struct slots {
    uint64_t count;
    uint32_t *list;
} slots;

static void add_slots(slots *all, const ebpo_accel *s, uint32_t child)
{
    for (int i = 0; !(child & EBPO_IS_BLOCK) && i < s->bound[child].count; i++)
        add_slots(all, s, s->bound[child].child[i]);
    for (uint32_t i = 0; child & EBPO_IS_BLOCK && i < EBPO_BLOCK; i++) {
        uint32_t slot = (child & ~EBPO_IS_BLOCK) * EBPO_BLOCK + i;
        if (ebpo_accel_slot_face(s, slot) == EBPO_NO_SLOT)
            return;
        all->list = realloc(all->list, (all->count + 1) * sizeof *all->list);
        ck_assert_ptr_nonnull(all->list);
        all->list[all->count++] = slot;
    }
}

static slots slots_of(const ebpo_accel *s)
{
    slots all = { 0, NULL };
    if (s->bound_count)
        add_slots(&all, s, s->root_bound);
    return all;
}

/* Counts faces that are nearer to p than the bounds. */
static uint64_t count_nearer(const ebpo_accel *s, const slots *all, const double p[3],
                             ebpo_skeleton_bounds bounds)
{
    uint64_t nearer = 0;
    for (uint64_t i = 0; i < all->count; i++) {
        uint32_t slot = all->list[i], local = ebpo_accel_slot_face(s, slot);
        double t[3][3], lower = local < s->shared_count ? bounds.shared : bounds.owned;
        ebpo_distance_bounds b;
        ebpo_accel_triangle(s, slot, t);
        ebpo_triangle_distance_bounds(p, (const double(*)[3])t, &b);
        nearer +=
            b.lo < lower && ebpo_triangle_distance_compare_to(p, (const double(*)[3])t, lower) < 0;
    }
    return nearer;
}

/* Checks bounds with a limit. Distances beyond the limit may be reported as infinite. */
static void check_limit(const ebpo_skeleton *k, const double p[3], ebpo_skeleton_bounds all)
{
    double limit[] = { all.owned * (1 - 0x1p-30), all.owned, all.shared,
                       all.owned / 2 + all.shared / 2 };
    for (int i = 0; i < 4; i++) {
        if (!isfinite(limit[i]))
            continue;
        ebpo_skeleton_bounds b = ebpo_skeleton_lower_bounds(k, p, limit[i]);
        ck_assert(b.owned == all.owned || (b.owned == INFINITY && all.owned > limit[i]));
        ck_assert(b.shared == all.shared || (b.shared == INFINITY && all.shared > limit[i]));
    }
}

static bool take(void *user, uint64_t bytes)
{
    uint64_t *left = user;
    if (bytes > *left)
        return false;
    *left -= bytes;
    return true;
}

/* Checks bounds for several amounts of memory. More nodes improve the bounds. */
static void check_bounds(const ebpo_accel *s, const double *points, uint64_t count)
{
    uint64_t space = 3 * (ebpo_skeleton_bytes(8) - ebpo_skeleton_bytes(0));
    ebpo_skeleton *few[] = { ebpo_skeleton_make(s, 1), ebpo_skeleton_make(s, 4),
                             ebpo_skeleton_make(s, 8), ebpo_skeleton_make(s, 8) };
    slots all = slots_of(s);
    for (uint64_t i = 0; i < count && few[3]; i++) {
        const double *p = points + 3 * i;
        ebpo_skeleton_bounds b[4];
        ebpo_skeleton_grow(few[3], s, p, INFINITY, take, &space);
        for (int n = 0; n < 4; n++) {
            b[n] = ebpo_skeleton_lower_bounds(few[n], p, INFINITY);
            ck_assert_double_ge(b[n].owned, n ? b[n - 1].owned : 0);
            ck_assert_double_ge(b[n].shared, n ? b[n - 1].shared : 0);
            check_limit(few[n], p, b[n]);
        }
        ck_assert_uint_eq(count_nearer(s, &all, p, b[2]), 0);
        ck_assert_uint_eq(count_nearer(s, &all, p, b[3]), 0);
    }
    free(all.list);
    for (int i = 0; i < 4; i++)
        ebpo_skeleton_free(few[i]);
}

static bool holds(const ebpo_faces_box *box, const double t[3][3])
{
    bool in = true;
    for (int i = 0; i < 9; i++)
        in = in && box->low[i % 3] <= t[i / 3][i % 3] && t[i / 3][i % 3] <= box->high[i % 3];
    return in;
}

/* Checks exactly that every shared face within the limit is in some box. */
static void check_shared_boxes(const ebpo_accel *s, const double p[3], double limit)
{
    ebpo_faces_box box[EBPO_SHARED_BOXES];
    ebpo_skeleton *k = s->shared_count ? ebpo_skeleton_make(s, 8) : NULL;
    unsigned count = k ? ebpo_skeleton_shared_boxes(k, p, limit, box) : 0;
    slots all = slots_of(s);
    for (uint64_t n = 0; k && n < all.count; n++) {
        uint32_t slot = all.list[n];
        double t[3][3];
        if (ebpo_accel_slot_face(s, slot) >= s->shared_count)
            continue;
        ebpo_accel_triangle(s, slot, t);
        bool found = ebpo_triangle_distance_compare_to(p, (const double(*)[3])t, limit) > 0;
        for (unsigned i = 0; i < count; i++)
            found = found || holds(&box[i], (const double(*)[3])t);
        ck_assert(found);
    }
    free(all.list);
    ebpo_skeleton_free(k);
}

START_TEST(test_skeleton_bound_is_below_face_distance)
{
    query_model m;
    query_model_make(&m, query_solid_name(_i), query_solid_make(_i),
                     &query_variants[_i % query_variant_count]);
    uint64_t count = query_scaled(40 + 20000 / m.mesh.face_count);
    double *points = query_alloc(count, 3 * sizeof *points);
    query_make_points(&m, count, (uint64_t)_i, points);
    check_bounds(m.model->whole, points, count);
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model *model;
    ebpo_context *context;
    how.cut_level = 2;
    ASSERT_OK(ebpo_model_new(m.file, &how, &model, error));
    ASSERT_OK(ebpo_context_new(model, &context, error));
    for (uint32_t below = 0; below < model->top->below_count; below++) {
        ebpo_accel *s;
        ASSERT_OK(ebpo_context_subtree(context, below, &s, error));
        check_bounds(s, points, count);
        check_shared_boxes(s, points, INFINITY);
        check_shared_boxes(s, points, m.size / 4);
        check_shared_boxes(s, points + 3, m.size / 16);
    }
    ebpo_context_free(context);
    ebpo_model_free(model);
    free(points);
    query_model_free(&m);
}
END_TEST

/* --- use --- */

typedef struct fixture {
    query_model m;
    ebpo_model *model;
    ebpo_context *context;
    uint64_t count;
    double *points;
    query_truth *truth;
    ebpo_distance_result *got;
} fixture;

static void begin(fixture *s, int solid, int variant, const ebpo_model_options *how, uint64_t count)
{
    query_model_make(&s->m, query_solid_name(solid), query_solid_make(solid),
                     &query_variants[variant]);
    ASSERT_OK(ebpo_model_new(s->m.file, how, &s->model, error));
    ASSERT_OK(ebpo_context_new(s->model, &s->context, error));
    s->count = count ? count : query_scaled(100 + 100000 / s->m.mesh.face_count);
    s->points = query_alloc(s->count, 3 * sizeof *s->points);
    s->truth = query_alloc(s->count, sizeof *s->truth);
    s->got = query_alloc(s->count, sizeof *s->got);
    query_make_points(&s->m, s->count, 7, s->points);
    query_find_truths(&s->m, s->points, s->count, s->truth);
}

static void end(fixture *s)
{
    ebpo_context_free(s->context);
    ebpo_model_free(s->model);
    query_model_free(&s->m);
    free(s->points);
    free(s->truth);
    free(s->got);
}

/* Returns the number of subtrees searched, with none in memory at the beginning. */
static uint64_t subtrees_searched(fixture *s)
{
    ebpo_model_stats before = EBPO_MODEL_STATS_INIT, after = EBPO_MODEL_STATS_INIT;
    ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
    options.unsigned_distance = true;
    ebpo_cache_clear(s->model->cache);
    ebpo_model_get_stats(s->model, &before);
    ASSERT_OK(ebpo_distance_many(s->context, s->points, s->count, &options, s->got, error));
    ebpo_model_get_stats(s->model, &after);
    ck_assert_uint_eq(query_wrong_distance(&s->m, s->points, s->truth, s->count, true, s->got), 0);
    ck_assert_uint_eq(after.distances - before.distances, s->count);
    ck_assert_uint_eq(after.distance_loads - before.distance_loads, after.loads - before.loads);
    return after.distance_subtrees - before.distance_subtrees;
}

/* Uses skeletons of no subtree, of some, of nearly all, or of as many as fit a small budget; with
 * or without the levels below the cut. */
START_TEST(test_results_do_not_depend_on_skeletons)
{
    fixture s;
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    how.cut_level = 1 + _i % 3;
    how.memory = _i & 1 ? (UINT64_C(9) << 19) + (uint64_t)_i % 4 * 30000 : 0;
    begin(&s, _i / 2, _i / 2 % query_variant_count, &how, 0);
    if (_i / 2 % 2)
        ebpo_deep_bounds_make(s.model);
    ck_assert(!s.model->deep || s.model->deep->cut_level > how.cut_level);
    uint64_t all = s.count;
    s.count = all / 8;
    subtrees_searched(&s);
    s.count = all;
    for (int round = 0; round < 3; round++)
        subtrees_searched(&s);
    ebpo_model_get_stats(s.model, &stats);
    ck_assert(!how.memory || stats.memory_peak <= how.memory);
    ck_assert(!how.memory || stats.skeleton_bytes <= how.memory / 4);
    end(&s);
}
END_TEST

static int find_solid(const char *name)
{
    int i = 0;
    while (strcmp(query_solid_name(i), name) != 0)
        i++;
    return i;
}

START_TEST(test_skeleton_avoids_subtree_searches)
{
    fixture s;
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    how.cut_level = 2;
    begin(&s, find_solid("sphere"), 5, &how, 300);
    subtrees_searched(&s);
    uint64_t with = subtrees_searched(&s);
    ebpo_skeletons *all = s.model->skeletons;
    s.model->skeletons = NULL;
    uint64_t without = subtrees_searched(&s);
    s.model->skeletons = all;
    ck_assert_uint_ge(with, s.count); /* at least one for each point */
    ck_assert_msg(with * 3 < without * 2, "%d, %d without", (int)with, (int)without);
    end(&s);
}
END_TEST

/* Returns the number of subtrees searched for the first points, with a new model that has no
 * skeletons yet. */
static uint64_t searched_at_first(int solid, int cut_level, bool deep)
{
    fixture s;
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    how.cut_level = cut_level;
    begin(&s, solid, 5, &how, 20);
    uint64_t before = ebpo_skeletons_bytes(s.model->skeletons);
    if (deep) {
        ebpo_deep_bounds_make(s.model);
        ck_assert_ptr_nonnull(s.model->deep);
        ck_assert_uint_eq(ebpo_skeletons_bytes(s.model->skeletons), before + s.model->deep->bytes);
        ck_assert_uint_le(s.model->deep->bytes,
                          ebpo_top_envelopes_estimate(s.model->info, s.model->deep->cut_level));
    }
    uint64_t searched = subtrees_searched(&s);
    end(&s);
    return searched;
}

START_TEST(test_levels_below_cut_bound_unvisited)
{
    int sphere = find_solid("sphere");
    uint64_t with = searched_at_first(sphere, 3, true),
             without = searched_at_first(sphere, 3, false);
    ck_assert_msg(with * 10 < without * 9, "%d, %d without", (int)with, (int)without);
}
END_TEST

/* Returns the number of subtrees that a query searches in a new model. */
static uint64_t searched_in_new(const query_model *m, const double p[3], bool deep)
{
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    ebpo_distance_result whole, parts;
    ebpo_model *model;
    ebpo_context *context;
    how.cut_level = 3;
    ASSERT_OK(ebpo_model_new(m->file, &how, &model, error));
    ASSERT_OK(ebpo_context_new(model, &context, error));
    if (deep)
        ebpo_deep_bounds_make(model);
    ASSERT_OK(ebpo_distance(context, p, NULL, &parts, error));
    ASSERT_OK(ebpo_distance(m->context, p, NULL, &whole, error));
    ck_assert_mem_eq(&parts, &whole, sizeof parts);
    uint64_t searched = context->searched;
    ebpo_context_free(context);
    ebpo_model_free(model);
    return searched;
}

/* All half-spaces of an envelope together bound its distance, without or with deep bounds. */
START_TEST(test_envelopes_bound_unvisited)
{
    query_model m;
    uint64_t state = 5, searched = 0;
    query_model_make(&m, "torus", query_solid_by_name("torus"), &query_variants[2]);
    for (int i = 0; i < 100; i++) {
        double p[3];
        for (int k = 0; k < 3; k++)
            p[k] = m.info.box_origin[k] + m.info.box_size[k] * ebpo_test_random_unit(&state);
        searched += searched_in_new(&m, p, _i);
    }
    /* 606 and 527; without the half-spaces of the nodes above 745 and 666, and with one half-space
     * at a time 887 and 785 */
    ck_assert_msg(searched < (_i ? 580 : 660), "%d", (int)searched);
    query_model_free(&m);
}
END_TEST

/* Levels below the cut are read when queries visit many new subtrees, and not when queries visit
 * few. */
START_TEST(test_levels_below_cut_load_on_demand)
{
    fixture s;
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    how.cut_level = 2;
    begin(&s, find_solid("sphere"), 5, &how, 1);
    for (int i = 0; i < 1000; i++)
        ebpo_deep_bounds_report(s.model, 4);
    ck_assert_ptr_null(s.model->deep);
    for (int i = 0; i < 1000; i++)
        ebpo_deep_bounds_report(s.model, 5);
    ck_assert_ptr_nonnull(s.model->deep);
    end(&s);
}
END_TEST

static bool add_distance(void *user, const ebpo_near_face *face)
{
    *(double *)user += face->distance;
    return true;
}

/* Returns the number of subtrees loaded for all faces within a radius, with none in memory at the
 * beginning; *sum: sum of the distances of these faces, in order. */
static uint64_t loaded_within(fixture *s, double *sum)
{
    ebpo_within_options how = EBPO_WITHIN_OPTIONS_INIT;
    uint64_t loads = s->context->loaded;
    how.radius = s->m.size / 50;
    *sum = 0;
    for (uint64_t i = 0; i < s->count; i++) {
        ebpo_cache_clear(s->model->cache);
        ASSERT_OK(
            ebpo_distance_within(s->context, s->points + 3 * i, &how, add_distance, sum, error));
    }
    return s->context->loaded - loads;
}

START_TEST(test_skeleton_limits_radius_search)
{
    fixture s;
    double sums[3];
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    how.cut_level = 3;
    begin(&s, find_solid("sphere"), 5, &how, 100);
    uint64_t first = loaded_within(&s, &sums[0]), with = loaded_within(&s, &sums[1]);
    ebpo_skeletons *all = s.model->skeletons;
    s.model->skeletons = NULL;
    uint64_t without = loaded_within(&s, &sums[2]);
    s.model->skeletons = all;
    ck_assert(sums[0] == sums[1] && sums[1] == sums[2]);
    ck_assert_uint_le(with, first);
    ck_assert_msg(with < without, "%d, %d without", (int)with, (int)without);
    end(&s);
}
END_TEST

/* --- memory --- */

START_TEST(test_skeleton_memory_limit_is_kept)
{
    fixture s;
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    how.cut_level = 2;
    begin(&s, find_solid("sphere"), 5, &how, 300);
    uint64_t most = ebpo_skeletons_capacity(8, UINT64_MAX), one = ebpo_skeleton_bytes(1);
    ck_assert_uint_eq(ebpo_skeletons_capacity(8, one), 0);
    for (uint64_t space = most; space > one + 500; space -= 1 + space / 16) {
        if (!ebpo_skeletons_capacity(8, space))
            continue;
        ebpo_skeletons *all = ebpo_skeletons_make(8, space, NULL);
        uint64_t empty = ebpo_skeletons_bytes(all), known = 0;
        ck_assert_ptr_null(ebpo_skeletons_find(all, 3));
        for (int twice = 0; twice < 2; twice++)
            for (uint64_t i = 0; i < 8; i++)
                ebpo_skeletons_keep(all, i, s.m.model->whole);
        for (uint64_t i = 0; i < 8; i++)
            known += ebpo_skeletons_find(all, i) != NULL;
        ck_assert_uint_ge(known, space == most ? 8 : 1);
        ck_assert_uint_le(ebpo_skeletons_bytes(all), space);
        ck_assert_uint_ge(ebpo_skeletons_bytes(all),
                          empty + known * (one - ebpo_skeleton_bytes(0)));
        ebpo_skeletons_free(all);
    }
    end(&s);
}
END_TEST

/* Checks the plan of a budget. Returns true when a model fits the budget. */
static bool check_plan(const query_model *m, uint64_t budget, uint64_t *least)
{
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model_plan plan = EBPO_MODEL_PLAN_INIT;
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    ebpo_error reported = EBPO_ERROR_INIT, error = EBPO_ERROR_INIT;
    ebpo_model *model;
    how.memory = budget;
    ebpo_status status = ebpo_model_memory(m->file, &how, &plan, &reported);
    ck_assert_int_eq(ebpo_model_new(m->file, &how, &model, &error), status);
    ck_assert_str_eq(reported.message, error.message);
    if (status != EBPO_OK)
        return false;
    ebpo_model_get_stats(model, &stats);
    ck_assert(plan.resident == stats.resident && plan.cut_level == stats.cut_level);
    ck_assert_uint_eq(plan.budget, budget);
    ck_assert(plan.resident == (budget == 0 || budget >= plan.whole));
    ck_assert_uint_le(stats.memory, stats.resident ? plan.whole : plan.top + plan.skeletons);
    ck_assert_uint_le(plan.subtrees_held, plan.subtrees);
    *least = plan.least;
    ebpo_model_free(model);
    return true;
}

/* Checks a plan with a given cut level, made from counts. */
static void check_cut_plan(const query_model *m, int cut_level)
{
    ebpo_model_options how = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model_plan plan = EBPO_MODEL_PLAN_INIT, tight = EBPO_MODEL_PLAN_INIT;
    ebpo_model *model;
    how.cut_level = cut_level;
    ASSERT_OK(ebpo_model_memory(m->file, &how, &plan, error));
    ASSERT_OK(ebpo_model_new(m->file, &how, &model, error));
    ck_assert(!plan.resident && plan.cut_level == model->top->cut_level);
    ck_assert_uint_eq(plan.subtrees, model->top->below_count);
    ck_assert_uint_eq(plan.subtrees_held, plan.subtrees);
    ck_assert_uint_le(model->top->bytes, plan.top);
    how.memory = 6 << 20;
    ASSERT_OK(ebpo_model_memory(m->file, &how, &tight, error));
    ck_assert(tight.cut_level == plan.cut_level && tight.subtrees == plan.subtrees);
    ck_assert_uint_le(tight.skeletons, how.memory / 4);
    ck_assert_uint_le(tight.subtrees_held * tight.subtree_bytes, how.memory);
    ebpo_model_free(model);
}

START_TEST(test_budget_plan_matches_estimate)
{
    query_model m;
    uint64_t least = 0, parts = 0;
    query_model_make(&m, query_solid_name(_i), query_solid_make(_i),
                     &query_variants[_i % query_variant_count]);
    ck_assert(check_plan(&m, 0, &least));
    for (uint64_t budget = 4096; budget < 64 << 20; budget += budget / 4)
        parts += check_plan(&m, budget, &least);
    ck_assert_uint_ge(parts, 1);
    ck_assert(check_plan(&m, least, &least));
    for (int cut_level = 0; cut_level < 4; cut_level++)
        check_cut_plan(&m, cut_level);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(skeleton)
{
    Suite *suite = suite_create("skeleton");
    TCase *tests = tcase_create("skeleton");
    tcase_set_timeout(tests, 600);
    tcase_add_loop_test(tests, test_skeleton_bound_is_below_face_distance, 0, query_solid_count());
    tcase_add_loop_test(tests, test_results_do_not_depend_on_skeletons, 0, 2 * query_solid_count());
    tcase_add_test(tests, test_skeleton_avoids_subtree_searches);
    tcase_add_test(tests, test_levels_below_cut_bound_unvisited);
    tcase_add_loop_test(tests, test_envelopes_bound_unvisited, 0, 2);
    tcase_add_test(tests, test_levels_below_cut_load_on_demand);
    tcase_add_test(tests, test_skeleton_limits_radius_search);
    tcase_add_test(tests, test_skeleton_memory_limit_is_kept);
    tcase_add_loop_test(tests, test_budget_plan_matches_estimate, 0, query_solid_count());
    suite_add_tcase(suite, tests);
    return suite;
}
