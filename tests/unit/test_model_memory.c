/* Compares the memory of whole models and subtrees, counted at every allocation, with the
 * estimates. */
#include <malloc.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "query/accel.h"
#include "check_main.h"
#include "query/query_model.h"
#include "query_support.h"

/* --- replacements of the allocator, by the linker --- */

static _Atomic int64_t held, most;

void *__real_malloc(size_t bytes);
void *__real_calloc(size_t n, size_t bytes);
void *__real_realloc(void *block, size_t bytes);
void *__real_aligned_alloc(size_t alignment, size_t bytes);
void __real_free(void *block);

void *__wrap_malloc(size_t bytes);
void *__wrap_calloc(size_t n, size_t bytes);
void *__wrap_realloc(void *block, size_t bytes);
void *__wrap_aligned_alloc(size_t alignment, size_t bytes);
void __wrap_free(void *block);

static void *count(void *block)
{
    int64_t size = (int64_t)malloc_usable_size(block);
    int64_t now = atomic_fetch_add(&held, size) + size, before = most;
    while (now > before && !atomic_compare_exchange_weak(&most, &before, now))
        ;
    return block;
}

void *__wrap_malloc(size_t bytes) { return count(__real_malloc(bytes)); }
void *__wrap_calloc(size_t n, size_t bytes) { return count(__real_calloc(n, bytes)); }

void *__wrap_realloc(void *block, size_t bytes)
{
    int64_t before = (int64_t)malloc_usable_size(block);
    void *grown = __real_realloc(block, bytes);
    held -= grown ? before : 0;
    return grown ? count(grown) : NULL;
}

void *__wrap_aligned_alloc(size_t alignment, size_t bytes)
{
    return count(__real_aligned_alloc(alignment, bytes));
}

void __wrap_free(void *block)
{
    held -= (int64_t)malloc_usable_size(block);
    __real_free(block);
}

/* --- models --- */

typedef struct taken {
    uint64_t keep, whole; /* estimated bytes */
    uint64_t kept, peak;  /* counted bytes */
    bool resident;
} taken;

static taken open_within(const query_model *m, uint64_t memory)
{
    taken t;
    ebpo_model *model;
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    options.threads = 1;
    options.memory = memory;
    ebpo_accel_estimate_whole(&m->info, &t.keep, &t.whole);
    int64_t before = held;
    most = before;
    ASSERT_OK(ebpo_model_new(m->file, &options, &model, error));
    t.peak = (uint64_t)(most - before);
    ck_assert_int_eq(ebpo_model_get_stats(model, &stats), EBPO_OK);
    t.kept = stats.memory;
    t.resident = stats.resident;
    ebpo_model_free(model);
    return t;
}

static void check_model(const char *name, ebpo_mesh mesh, const query_variant *variant,
                        double times_max)
{
    query_model m;
    query_model_make(&m, name, mesh, variant);
    taken t = open_within(&m, 0);
    if (getenv("EBPO_TEST_SHOW"))
        printf("%s %s: keep %llu of %llu, peak %llu of %llu\n", name, variant->name,
               (unsigned long long)t.kept, (unsigned long long)t.keep, (unsigned long long)t.peak,
               (unsigned long long)t.whole);
    ck_assert_msg(t.kept <= t.keep && t.peak <= t.whole,
                  "%s %s: %llu of %llu kept, %llu of %llu taken", name, variant->name,
                  (unsigned long long)t.kept, (unsigned long long)t.keep,
                  (unsigned long long)t.peak, (unsigned long long)t.whole);
    ck_assert_msg((double)t.whole <= times_max * (double)t.kept, "%s: %llu for %llu", name,
                  (unsigned long long)t.whole, (unsigned long long)t.kept);
    t = open_within(&m, t.whole);
    ck_assert(t.resident);
    query_model_free(&m);
}

static const query_variant standard = { "default", 16, 8, EBPO_RULE_NONZERO, 0 };

static ebpo_mesh in_floats(ebpo_mesh mesh)
{
    mesh.xyz32 = malloc(3 * mesh.vertex_count * sizeof *mesh.xyz32);
    for (uint64_t i = 0; i < 3 * mesh.vertex_count; i++)
        mesh.xyz32[i] = (float)mesh.xyz64[i];
    free(mesh.xyz64);
    mesh.xyz64 = NULL;
    return mesh;
}

START_TEST(test_model_memory_estimate_is_close)
{
    ebpo_mesh sphere = ebpo_test_sphere((double[3]){ 0.1, 0.2, 0.3 }, 1, 6),
              torus = ebpo_test_torus(2, 0.5, 300, 150);
    if (_i) {
        sphere = in_floats(sphere);
        torus = in_floats(torus);
    }
    check_model("sphere", sphere, &standard, 2.5);
    check_model("torus", torus, &standard, 2.5);
}
END_TEST

/* With EBPO_TEST_SCALE below 1, each solid has every second variant. */
static bool wants_variant(int solid, int variant)
{
    return ebpo_test_scale() >= 1 || (solid + variant) % 2 == 0;
}

START_TEST(test_model_memory_stays_below_estimate)
{
    for (int v = 0; v < query_variant_count; v++)
        if (wants_variant(_i, v))
            check_model(query_solid_name(_i), query_solid_make(_i), &query_variants[v], 1e9);
}
END_TEST

START_TEST(test_random_model_memory_stays_below_estimate)
{
    for (uint64_t i = 0; i < query_scaled(100); i++)
        check_model("random", query_random_solid(7 * i + 1, i % 2),
                    &query_variants[i % (uint64_t)query_variant_count], 1e9);
}
END_TEST

/* Makes triangles of doubles without shared vertices: a block of six takes as much memory as a
 * block of eight. */
static ebpo_mesh soup(uint32_t faces, double size)
{
    uint64_t state = 5;
    ebpo_mesh mesh = { .vertex_count = 3 * (uint64_t)faces, .face_count = faces };
    mesh.xyz64 = malloc(9 * (size_t)faces * sizeof *mesh.xyz64);
    mesh.faces = malloc(3 * (size_t)faces * sizeof *mesh.faces);
    for (uint32_t i = 0; i < 3 * faces; i++) {
        mesh.faces[i] = i;
        for (uint32_t k = 0; k < 3; k++) {
            double x = (double)(ebpo_test_random(&state) >> 11) * 0x1p-53;
            mesh.xyz64[3 * i + k] = i % 3 ? mesh.xyz64[3 * (i - i % 3) + k] + x * size : x;
        }
    }
    return mesh;
}

START_TEST(test_models_beyond_estimate_load_in_parts)
{
    /* Without the border of 600,000 edges, whose caps do not load in parts. */
    static const query_variant coarse = { "coarse", 36, 12, EBPO_RULE_NONZERO,
                                          EBPO_PART_PLANES | EBPO_PART_MESH };
    query_model m;
    query_model_make(&m, "soup", soup(200000, 1e-5), &coarse);
    taken all = open_within(&m, 0), t = open_within(&m, all.whole);
    ck_assert_uint_gt(all.peak, all.whole);
    ck_assert(all.resident && !t.resident);
    ck_assert_uint_le(t.peak, all.whole);
    query_model_free(&m);
}
END_TEST

/* --- subtrees --- */

/* Limit of rounding by the allocator, summed over arrays. */
enum { ROUNDING = 1 << 14 };

typedef struct reading {
    const query_model *m;
    ebpo_top *top;
    ebpo_chunks *chunks;
    uint64_t kept, refused, beyond;
    uint64_t joined; /* number of subtrees whose arrays are in one allocation */
} reading;

static ebpo_accel *read_within(const reading *r, const ebpo_node *node, ebpo_quota *space)
{
    ebpo_slice slice;
    ebpo_accel *subtree = NULL;
    ebpo_status status = ebpo_slice_read_within(&slice, r->chunks, node,
                                                ebpo_subtree_needs(EBPO_ACCEL_PLANES), space, NULL);
    if (status == EBPO_OK)
        status = ebpo_accel_make_within(&subtree, &slice, &r->m->info, space, EBPO_ACCEL_PLANES, 1,
                                        NULL);
    ck_assert(status == EBPO_OK || (status == EBPO_E_LIMIT && space->needed > space->most));
    return subtree;
}

/* Decoded chunks are already in memory. */
static void check_subtree(reading *r, const ebpo_node *node)
{
    ebpo_slice_size size;
    ebpo_quota space = { .most = UINT64_MAX };
    ebpo_accel *subtree = read_within(r, node, &space);
    ebpo_accel_free(subtree);
    uint64_t keep, needs = ebpo_subtree_needs(EBPO_ACCEL_PLANES);
    ASSERT_OK(
        ebpo_slice_measure_nodes(r->chunks, node, (uint32_t)needs, EBPO_SLICE_ALL, &size, error));
    space = (ebpo_quota){ 0 };
    ebpo_accel_estimate_subtree(&size, &r->m->info, &keep, &space.most);
    for (bool done = false; !done; r->refused += !done) {
        int64_t before = held;
        most = before;
        subtree = read_within(r, node, &space);
        ck_assert_msg((uint64_t)(most - before) <= space.most + ROUNDING,
                      "%s %s: %lld taken, %llu allowed", r->m->name, r->m->variant,
                      (long long)(most - before), (unsigned long long)space.most);
        done = subtree != NULL;
        if (!done)
            space = (ebpo_quota){ .most = space.needed };
    }
    ck_assert_uint_le(subtree->bytes, space.most);
    r->kept += subtree->bytes;
    r->joined += subtree->arrays != NULL;
    r->beyond += subtree->bytes > keep;
    ebpo_accel_free(subtree);
}

static reading check_subtrees(const query_model *m, int cut_level)
{
    reading r = { .m = m };
    ASSERT_OK(ebpo_top_read(&r.top, m->file, cut_level, 1, error));
    ASSERT_OK(ebpo_chunks_make(&r.chunks, m->file, 0, error));
    for (uint64_t i = 0; i < r.top->below_count; i++)
        if (!r.top->below[i].pruned)
            check_subtree(&r, &r.top->below[i]);
    ebpo_chunks_free(r.chunks);
    return r;
}

START_TEST(test_subtree_memory_stays_below_quota)
{
    for (int v = 0; v < query_variant_count; v++) {
        query_model m;
        if (!wants_variant(_i, v))
            continue;
        query_model_make(&m, query_solid_name(_i), query_solid_make(_i), &query_variants[v]);
        for (int cut_level = 1; cut_level < 4 && cut_level < m.info.level_count; cut_level++)
            ebpo_top_free(check_subtrees(&m, cut_level).top);
        query_model_free(&m);
    }
}
END_TEST

static void check_near(const char *name, ebpo_mesh mesh)
{
    query_model m;
    query_model_make(&m, name, mesh, &standard);
    for (int cut_level = 1; cut_level < 5; cut_level++) {
        ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
        ebpo_model_plan plan = EBPO_MODEL_PLAN_INIT;
        options.cut_level = cut_level;
        ASSERT_OK(ebpo_model_memory(m.file, &options, &plan, error));
        reading r = check_subtrees(&m, cut_level);
        double mean = (double)r.kept / (double)r.top->below_count;
        if (getenv("EBPO_TEST_SHOW"))
            printf("%s %d: %.0f of %llu, %llu refused, %llu of %llu joined\n", name, cut_level,
                   mean, (unsigned long long)plan.subtree_bytes, (unsigned long long)r.refused,
                   (unsigned long long)r.joined, (unsigned long long)r.top->below_count);
        ck_assert_uint_eq(plan.subtrees, r.top->below_count);
        ck_assert_msg((double)plan.subtree_bytes >= mean &&
                          (double)plan.subtree_bytes <= 1.5 * mean,
                      "%s %d: %.0f, %llu predicted", name, cut_level, mean,
                      (unsigned long long)plan.subtree_bytes);
        ck_assert_uint_eq(r.beyond, 0);
        ck_assert_uint_le(r.refused, r.top->below_count / 50);
        ck_assert_uint_ge(r.joined, r.top->below_count / 10 * 9);
        ebpo_top_free(r.top);
    }
    query_model_free(&m);
}

START_TEST(test_subtree_memory_estimate_is_close)
{
    ebpo_mesh sphere = ebpo_test_sphere((double[3]){ 0.1, 0.2, 0.3 }, 1, 6),
              torus = ebpo_test_torus(2, 0.5, 300, 150);
    check_near("sphere", _i ? in_floats(sphere) : sphere);
    check_near("torus", _i ? in_floats(torus) : torus);
}
END_TEST

/* Limit of memory outside the budget: decoding of chunks, a context, tables of the caches. */
enum { BESIDE = 768 << 10 };

/* Returns the number of results. */
static int check_results(const query_model *m, uint64_t memory)
{
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    ebpo_model *model;
    ebpo_context *context;
    uint64_t state = 3;
    int results = 0;
    options.memory = memory;
    options.threads = 1;
    int64_t before = held;
    most = before;
    ASSERT_OK(ebpo_model_new(m->file, &options, &model, error));
    ASSERT_OK(ebpo_context_new(model, &context, error));
    for (int i = 0; i < 20; i++) {
        double p[3];
        ebpo_distance_result whole, parts;
        for (int k = 0; k < 3; k++)
            p[k] = (double)(ebpo_test_random(&state) >> 11) * 0x1p-52 - 0.5;
        ASSERT_OK(ebpo_distance(m->context, p, NULL, &whole, error));
        ebpo_status status = ebpo_distance(context, p, NULL, &parts, NULL);
        ck_assert(status == EBPO_OK || status == EBPO_E_LIMIT);
        results += status == EBPO_OK;
        if (status == EBPO_OK)
            ck_assert(parts.lo == whole.lo && parts.hi == whole.hi);
    }
    ck_assert_int_eq(ebpo_model_get_stats(model, &stats), EBPO_OK);
    ck_assert_uint_le(stats.memory_peak, memory);
    ck_assert_msg((uint64_t)(most - before) <= memory + BESIDE, "%lld taken, %llu allowed",
                  (long long)(most - before), (unsigned long long)memory);
    ebpo_context_free(context);
    ebpo_model_free(model);
    return results;
}

/* Uses large triangles. Each is in many subtrees, and many cross borders of subtrees. Without the
 * part border, as the caps of 9,000 edges take minutes to find, and subtrees do not hold them. */
START_TEST(test_budget_holds_for_unusual_subtrees)
{
    static const query_variant fine = { "fine", 16, 6, EBPO_RULE_NONZERO,
                                        EBPO_PART_PLANES | EBPO_PART_MESH };
    query_model m;
    query_model_make(&m, "soup", soup(_i ? 6000 : 3000, _i ? 0.2 : 1), &fine);
    uint64_t refused = 0, results = 0;
    for (int cut_level = 1; cut_level < 4; cut_level++) {
        reading r = check_subtrees(&m, cut_level);
        refused += r.refused;
        ebpo_top_free(r.top);
    }
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model_plan plan = EBPO_MODEL_PLAN_INIT;
    ASSERT_OK(ebpo_model_memory(m.file, &options, &plan, error));
    for (uint64_t memory = plan.least; memory < plan.whole; memory += memory / 2)
        results += (uint64_t)check_results(&m, memory);
    ck_assert_uint_gt(refused, 0);
    if (getenv("EBPO_TEST_SHOW"))
        printf("soup: least %llu, whole %llu, %d refused, %d results\n",
               (unsigned long long)plan.least, (unsigned long long)plan.whole, (int)refused,
               (int)results);
    ck_assert(results > 0 || plan.least == plan.whole);
    query_model_free(&m);
}
END_TEST

Suite *test_suite(void)
{
    Suite *suite = suite_create("model_memory");
    TCase *models = tcase_create("models");
    tcase_set_timeout(models, 600);
    tcase_add_loop_test(models, test_model_memory_estimate_is_close, 0, 2);
    tcase_add_loop_test(models, test_model_memory_stays_below_estimate, 0, query_solid_count());
    tcase_add_test(models, test_random_model_memory_stays_below_estimate);
    tcase_add_test(models, test_models_beyond_estimate_load_in_parts);
    tcase_add_loop_test(models, test_subtree_memory_stays_below_quota, 0, query_solid_count());
    tcase_add_loop_test(models, test_subtree_memory_estimate_is_close, 0, 2);
    tcase_add_loop_test(models, test_budget_holds_for_unusual_subtrees, 0, 2);
    suite_add_tcase(suite, models);
    return suite;
}
