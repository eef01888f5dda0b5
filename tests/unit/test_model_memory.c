/* What a whole model takes, counted at every allocation, against what was foretold. */
#include <malloc.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "accel/accel.h"
#include "check_main.h"
#include "query/query_model.h"
#include "query_kit.h"

/* --- what the linker calls in place of the allocator --- */

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
    int64_t now = held += (int64_t)malloc_usable_size(block), before = most;
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
    uint64_t keep, whole; /* foretold */
    uint64_t kept, peak;  /* counted */
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
                        double times_most)
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
    ck_assert_msg((double)t.whole <= times_most * (double)t.kept, "%s: %llu for %llu", name,
                  (unsigned long long)t.whole, (unsigned long long)t.kept);
    t = open_within(&m, t.whole);
    ck_assert(t.resident);
    query_model_free(&m);
}

static const query_variant usual = { "usual", 16, 8, EBPO_RULE_NONZERO, 0 };

static ebpo_mesh in_floats(ebpo_mesh mesh)
{
    mesh.xyz32 = malloc(3 * mesh.vertex_count * sizeof *mesh.xyz32);
    for (uint64_t i = 0; i < 3 * mesh.vertex_count; i++)
        mesh.xyz32[i] = (float)mesh.xyz64[i];
    free(mesh.xyz64);
    mesh.xyz64 = NULL;
    return mesh;
}

START_TEST(estimates_of_ordinary_models_are_near)
{
    ebpo_mesh sphere = ebpo_test_sphere((double[3]){ 0.1, 0.2, 0.3 }, 1, 6),
              torus = ebpo_test_torus(2, 0.5, 300, 150);
    if (_i) {
        sphere = in_floats(sphere);
        torus = in_floats(torus);
    }
    check_model("sphere", sphere, &usual, 2.5);
    check_model("torus", torus, &usual, 2.5);
}
END_TEST

START_TEST(models_take_at_most_what_was_foretold)
{
    for (int v = 0; v < query_variant_count; v++)
        check_model(query_solid_name(_i), query_solid_make(_i), &query_variants[v], 1e9);
}
END_TEST

START_TEST(random_models_take_at_most_what_was_foretold)
{
    for (uint64_t i = 0; i < query_scaled(100); i++)
        check_model("random", query_random_solid(7 * i + 1, i % 2),
                    &query_variants[i % (uint64_t)query_variant_count], 1e9);
}
END_TEST

/* Triangles that share nothing, of doubles: six of them take as much as eight. */
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

START_TEST(models_that_take_more_than_was_foretold_are_read_in_parts)
{
    static const query_variant coarse = { "coarse", 36, 12, EBPO_RULE_NONZERO, 0 };
    query_model m;
    query_model_make(&m, "soup", soup(200000, 1e-5), &coarse);
    taken all = open_within(&m, 0), t = open_within(&m, all.whole);
    ck_assert_uint_gt(all.peak, all.whole);
    ck_assert(all.resident && !t.resident);
    ck_assert_uint_le(t.peak, all.whole);
    query_model_free(&m);
}
END_TEST

Suite *test_suite(void)
{
    Suite *suite = suite_create("model_memory");
    TCase *models = tcase_create("models");
    tcase_set_timeout(models, 600);
    tcase_add_loop_test(models, estimates_of_ordinary_models_are_near, 0, 2);
    tcase_add_loop_test(models, models_take_at_most_what_was_foretold, 0, query_solid_count());
    tcase_add_test(models, random_models_take_at_most_what_was_foretold);
    tcase_add_test(models, models_that_take_more_than_was_foretold_are_read_in_parts);
    suite_add_tcase(suite, models);
    return suite;
}
