/* Error bounds of levels: bounds hold, converge, and do not depend on scale, position or threads.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <ebpo/error_bound.h>
#include <ebpo/subset.h>

#include "check_main.h"
#include "query_support.h"
#include "reference_error_bound.h"

static const query_variant stored = { "stored", 4, 5, EBPO_RULE_NONZERO,
                                      EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS |
                                          EBPO_PART_LEAF_PLANES };
static const query_variant derived = { "derived", 8, 5, EBPO_RULE_NONZERO,
                                       EBPO_PART_PLANES | EBPO_PART_MESH };
static const query_variant cells = { "cells", 4, 4, EBPO_RULE_NONZERO,
                                     EBPO_PART_MESH | EBPO_PART_MAPS };

static ebpo_error_bound error_bound(query_model *m, int level, double tolerance, uint64_t samples,
                                    unsigned threads)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_error_bound_options o = EBPO_ERROR_BOUND_OPTIONS_INIT;
    ebpo_error_bound out = EBPO_ERROR_BOUND_INIT;
    o.tolerance = tolerance;
    o.samples = samples;
    o.threads = threads;
    ck_assert_msg(ebpo_level_error_bound(m->model, m->file, level, &o, &out, &error) == EBPO_OK,
                  "%s, level %d: %s", m->name, level, error.message);
    return out;
}

/* Checks the bounds of a level. hi may exceed the true error only by rounding: some 1e-5 of the
 * model. */
static void check_level(query_model *m, int level)
{
    ebpo_error_bound d = error_bound(m, level, 0.05, 500, 1);
    double reference = reference_max_distance(m->file, level, &m->mesh, m->info.solid, 400,
                                              (uint64_t)level),
           slack = 1e-9 * (m->size + m->largest);
    ck_assert_msg(reference <= d.hi + slack,
                  "%s, %s, level %d: %.17g found, at most %.17g certified", m->name, m->variant,
                  level, reference, d.hi);
    ck_assert_msg(d.hi <= 1.05 * d.lo + 1e-5 * m->size, "%s, %s, level %d: %.17g to %.17g", m->name,
                  m->variant, level, d.lo, d.hi);
    ck_assert(d.lo >= 0 && d.lo <= d.hi);
    if (d.lo > 0) {
        double there = reference_distance(&m->mesh, m->info.solid, d.location);
        ck_assert_msg(fabs(there - d.lo) <= slack,
                      "%s, %s, level %d: the farthest point is %.17g away, not %.17g", m->name,
                      m->variant, level, there, d.lo);
    }
    ck_assert(d.samples <= 500);
    if (d.samples)
        ck_assert(d.mean >= 0 && d.mean <= d.rms * (1 + 1e-12) && d.rms <= d.hi + slack);
    else
        ck_assert(isnan(d.mean) && isnan(d.rms));
}

START_TEST(test_error_bounds_enclose_and_converge)
{
    static const char *const names[] = { "torus",     "sphere", "blob",      "cone",
                                         "staircase", "sheet",  "tetrahedra" };
    /* with sanitizers, only three cases */
    for (int i = 0; i < 7; i += query_scaled(40) < 4 ? 3 : 1)
        for (int v = 0; v < 3; v += query_scaled(4) < 4 ? 2 : 1) {
            const query_variant *variants[] = { &stored, &derived, &cells };
            query_model m;
            double centre[3] = { 1, 2, 3 };
            ebpo_mesh mesh = i == 0   ? ebpo_test_torus(3, 1, 24, 12)
                             : i == 1 ? ebpo_test_sphere(centre, 2, 2)
                             : i == 2 ? ebpo_test_blob(4, 40, 7)
                             : i == 3 ? ebpo_test_cone(1, 3, 40)
                             : i == 4 ? ebpo_test_staircase(8)
                             : i == 5 ? ebpo_test_sheet(4, 6)
                                      : ebpo_test_tetrahedra(9);
            query_model_make(&m, names[i], mesh, variants[v]);
            for (int level = 0; level < m.info.level_count; level++)
                check_level(&m, level);
            query_model_free(&m);
        }
}
END_TEST

START_TEST(test_error_bounds_on_random_solids)
{
    for (uint64_t i = 0; i < query_scaled(8); i++) {
        query_model m;
        query_model_make(&m, "random", query_random_solid(i, i % 2), i % 3 ? &stored : &derived);
        for (int level = 0; level < m.info.level_count; level++)
            check_level(&m, level);
        query_model_free(&m);
    }
}
END_TEST

static ebpo_mesh hollow_box(void)
{
    ebpo_mesh mesh = ebpo_test_box((double[3]){ 0, 0, 0 }, (double[3]){ 8, 8, 8 }, 2),
              inner = ebpo_test_box((double[3]){ 1, 1, 1 }, (double[3]){ 7, 7, 7 }, 2);
    ebpo_test_reverse(&inner);
    ebpo_test_append(&mesh, &inner);
    ebpo_mesh_free(&inner);
    return mesh;
}

START_TEST(test_error_bound_includes_cavity)
{
    query_model m;
    query_model_make(&m, "hollow box", hollow_box(), &stored);
    ebpo_error_bound d = error_bound(&m, 0, 0.01, 0, 1);
    ck_assert_msg(d.lo > 2.95 && d.hi >= 3 && d.hi < 3.04,
                  "%.17g to %.17g, but the middle of the cavity is at distance 3", d.lo, d.hi);
    query_model_free(&m);
}
END_TEST

static uint32_t rings(void)
{
    return query_scaled(4) < 4 ? 16 : 60; /* a small model for other compilers and sanitizers */
}

START_TEST(test_error_bound_same_for_any_threads)
{
    query_model m;
    query_model_make(&m, "torus", ebpo_test_torus(3, 1, rings(), rings() / 2), &stored);
    for (int level = 0; level < m.info.level_count; level++) {
        ebpo_error_bound one = error_bound(&m, level, 0.02, 300, 1),
                         three = error_bound(&m, level, 0.02, 300, 3),
                         again = error_bound(&m, level, 0.02, 300, 1);
        ck_assert(memcmp(&one, &three, sizeof one) == 0 && memcmp(&one, &again, sizeof one) == 0);
    }
    query_model_free(&m);
}
END_TEST

START_TEST(test_error_bound_with_query_limit)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_error_bound_options o = EBPO_ERROR_BOUND_OPTIONS_INIT;
    ebpo_error_bound exact = EBPO_ERROR_BOUND_INIT, limited = EBPO_ERROR_BOUND_INIT;
    query_model m;
    query_model_make(&m, "torus", ebpo_test_torus(3, 1, rings(), rings() / 2), &stored);
    exact = error_bound(&m, 2, 0.001, 0, 1);
    o.tolerance = 0.001;
    o.queries = 10;
    o.samples = 0;
    ck_assert(ebpo_level_error_bound(m.model, m.file, 2, &o, &limited, &error) == EBPO_OK);
    ck_assert_msg(limited.lo <= exact.hi && limited.hi >= exact.lo &&
                      limited.queries < exact.queries,
                  "%g to %g, %g to %g", limited.lo, limited.hi, exact.lo, exact.hi);
    query_model_free(&m);
}
END_TEST

/* Makes a shell that is thinner than any cell. Every outer point is close to the inside, so that
 * bounds stay wide. */
static ebpo_mesh shell(void)
{
    ebpo_mesh mesh = ebpo_test_torus(3, 1, 24, 12), inner = ebpo_test_torus(3, 1 - 1e-9, 24, 12);
    ebpo_test_reverse(&inner);
    ebpo_test_append(&mesh, &inner);
    ebpo_mesh_free(&inner);
    return mesh;
}

static ebpo_error_bound hurried(query_model *m, int level, double at_most)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_error_bound_options o = EBPO_ERROR_BOUND_OPTIONS_INIT;
    ebpo_error_bound out = EBPO_ERROR_BOUND_INIT;
    o.samples = 0;
    o.queries = 400;
    o.at_most = at_most;
    ck_assert_msg(ebpo_level_error_bound(m->model, m->file, level, &o, &out, &error) == EBPO_OK,
                  "%s", error.message);
    ck_assert(out.lo <= out.hi);
    return out;
}

START_TEST(test_error_bound_shrinks_with_level)
{
    query_model m;
    double reported = 0, alone = INFINITY;
    query_model_make(&m, "shell", shell(), &stored);
    for (int level = 0; level < m.info.level_count; level++) {
        ebpo_error_bound with = hurried(&m, level, reported), without = hurried(&m, level, 0);
        ck_assert_msg(!level || with.hi <= reported, "level %d: %g, and %g before", level, with.hi,
                      reported);
        ck_assert_msg(without.hi <= alone, "level %d: %g, and %g before", level, without.hi, alone);
        reported = with.hi;
        alone = without.hi;
        ck_assert(reported >=
                  reference_max_distance(m.file, level, &m.mesh, true, 100, 1) - 1e-9 * m.size);
    }
    query_model_free(&m);
}
END_TEST

START_TEST(test_error_bound_scales_with_model)
{
    static const double scale[] = { 0x1p-1000, 0x1p-500, 0x1p-20, 0x1p20, 0x1p500, 0x1p900 };
    const uint32_t around = ebpo_test_scale() < 0.2 ? 12 : 24;
    query_model unit;
    query_model_make(&unit, "torus", ebpo_test_torus(3, 1, around, around / 2), &stored);
    for (int i = 0; i < 6; i++) {
        if (ebpo_test_scale() < 0.2 && i % 5)
            continue; /* tests only the minimum and the maximum */
        query_model m;
        double matrix[3][3] = { { scale[i], 0, 0 }, { 0, scale[i], 0 }, { 0, 0, scale[i] } },
               nowhere[3] = { 0, 0, 0 };
        ebpo_mesh mesh = ebpo_test_torus(3, 1, around, around / 2);
        ebpo_test_transform(&mesh, (const double(*)[3])matrix, nowhere);
        query_model_make(&m, "scaled torus", mesh, &stored);
        for (int level = 0; level < m.info.level_count; level++) {
            ebpo_error_bound a = error_bound(&unit, level, 0.05, 100, 1),
                             b = error_bound(&m, level, 0.05, 100, 1);
            ck_assert_msg(fabs(b.lo / scale[i] - a.lo) < 1e-9 &&
                              fabs(b.hi / scale[i] - a.hi) < 1e-9 &&
                              fabs(b.mean / scale[i] - a.mean) < 1e-9,
                          "scale %g, level %d: %g %g %g, %g %g %g", scale[i], level,
                          b.lo / scale[i], b.hi / scale[i], b.mean / scale[i], a.lo, a.hi, a.mean);
        }
        query_model_free(&m);
    }
    double identity[3][3] = { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } }, far[3] = { 1e7, -1e7, 1e7 };
    ebpo_mesh mesh = ebpo_test_torus(3, 1, around, around / 2);
    query_model m;
    ebpo_test_transform(&mesh, (const double(*)[3])identity, far);
    query_model_make(&m, "torus on the map", mesh, &stored);
    for (int level = 0; level < m.info.level_count; level++) {
        ebpo_error_bound d = error_bound(&m, level, 0.05, 0, 1);
        ck_assert_msg(d.hi <= 1.05 * d.lo + 1e-4, "level %d: %g to %g", level, d.lo, d.hi);
        ck_assert(d.hi + 1e-6 >= reference_max_distance(m.file, level, &m.mesh, true, 200, 1));
    }
    query_model_free(&m);
    query_model_free(&unit);
}
END_TEST

static void refused(ebpo_model *model, ebpo_file *file, int level, double tolerance,
                    ebpo_status status, const char *says)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_error_bound_options o = EBPO_ERROR_BOUND_OPTIONS_INIT;
    ebpo_error_bound out = EBPO_ERROR_BOUND_INIT;
    o.tolerance = tolerance;
    ck_assert_int_eq(ebpo_level_error_bound(model, file, level, &o, &out, &error), status);
    ck_assert_msg(strstr(error.message, says) != NULL, "%s", error.message);
}

static bool cancel(void *user, const char *stage, uint64_t done, uint64_t total)
{
    (void)user, (void)stage, (void)done, (void)total;
    return false;
}

START_TEST(test_error_bound_invalid_input_is_refused)
{
    ebpo_error error = EBPO_ERROR_INIT;
    query_model m, other;
    ebpo_subset_options o = EBPO_SUBSET_OPTIONS_INIT;
    ebpo_file *part;
    ebpo_model *part_model;
    char path[120];
    query_model_make(&m, "torus", ebpo_test_torus(3, 1, 24, 12), &stored);
    query_model_make(&other, "box", hollow_box(), &stored);
    refused(m.model, m.file, -1, 0.05, EBPO_E_ARGUMENT, "no level -1");
    refused(m.model, m.file, m.info.level_count, 0.05, EBPO_E_ARGUMENT, "no level");
    refused(m.model, m.file, 0, 0, EBPO_E_ARGUMENT, "tolerance");
    refused(m.model, m.file, 0, NAN, EBPO_E_ARGUMENT, "tolerance");
    refused(m.model, other.file, 0, 0.05, EBPO_E_ARGUMENT, "root cells differ");
    query_model_free(&other);
    query_model_make(&other, "torus in other leaves", ebpo_test_torus(3, 1, 24, 12), &derived);
    refused(m.model, other.file, 0, 0.05, EBPO_E_ARGUMENT, "build parameters differ");
    query_model_free(&other);
    query_model_make(&other, "box",
                     ebpo_test_box((double[3]){ 0, 0, 0 }, (double[3]){ 8, 8, 8 }, 2), &stored);
    query_model solid = other;
    query_model_make(&other, "hollow box", hollow_box(), &stored);
    refused(solid.model, other.file, 0, 0.05, EBPO_E_ARGUMENT, "sources differ");
    query_model_free(&solid);
    snprintf(path, sizeof path, "%s/part.ebpo.h5", m.folder);
    for (int i = 0; i < 2; i++) {
        o.parts = i ? EBPO_PART_PLANES : EBPO_PART_PLANES | EBPO_PART_MESH;
        o.last_level = i ? -1 : m.info.level_count - 2;
        ck_assert(ebpo_subset(m.file, path, &o, &error) == EBPO_OK &&
                  ebpo_open(path, &part, &error) == EBPO_OK &&
                  ebpo_model_new(part, NULL, &part_model, &error) == EBPO_OK);
        refused(part_model, part, 0, 0.05, EBPO_E_ABSENT, i ? "mesh" : "subset");
        ebpo_model_free(part_model);
        ebpo_close(part);
        unlink(path);
    }
    ebpo_error_bound_options canceled = EBPO_ERROR_BOUND_OPTIONS_INIT, below = canceled;
    ebpo_error_bound out = EBPO_ERROR_BOUND_INIT;
    below.at_most = -1;
    ck_assert_int_eq(ebpo_level_error_bound(m.model, m.file, 2, &below, &out, &error),
                     EBPO_E_ARGUMENT);
    canceled.progress.report = cancel;
    ck_assert_int_eq(ebpo_level_error_bound(m.model, m.file, 2, &canceled, &out, &error),
                     EBPO_E_CANCELLED);
    query_model_free(&other);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(error_bound)
{
    Suite *suite = suite_create("deviation");
    TCase *tests = tcase_create("deviation");
    tcase_set_timeout(tests, 900);
    tcase_add_test(tests, test_error_bounds_enclose_and_converge);
    tcase_add_test(tests, test_error_bounds_on_random_solids);
    tcase_add_test(tests, test_error_bound_includes_cavity);
    tcase_add_test(tests, test_error_bound_same_for_any_threads);
    tcase_add_test(tests, test_error_bound_with_query_limit);
    tcase_add_test(tests, test_error_bound_scales_with_model);
    tcase_add_test(tests, test_error_bound_invalid_input_is_refused);
    suite_add_tcase(suite, tests);
    TCase *levels = tcase_create("levels");
    tcase_set_timeout(levels, 900);
    tcase_add_test(levels, test_error_bound_shrinks_with_level);
    suite_add_tcase(suite, levels);
    return suite;
}
