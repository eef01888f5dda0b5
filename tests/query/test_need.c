/* Tests subsets by need: they keep the requested error or size. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <ebpo/error_bound.h>
#include <ebpo/subset.h>
#include <ebpo/verify.h>

#include "check_main.h"
#include "read_by.h"
#include "query_support.h"
#include "derive/subset_parts.h"
#include "reference_error_bound.h"

static const query_variant stored = { "stored", 4, 6, EBPO_RULE_NONZERO,
                                      EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS |
                                          EBPO_PART_LEAF_PLANES };

static void fine(ebpo_status status, const ebpo_error *error)
{
    ck_assert_msg(status == EBPO_OK, "%s: %s", ebpo_status_name(status), error->message);
}

typedef struct result {
    char path[120];
    ebpo_file *file;
    const ebpo_info *info;
} result;

static void result_make(result *r, query_model *m, const char *name, const ebpo_subset_options *o)
{
    ebpo_error error = EBPO_ERROR_INIT;
    snprintf(r->path, sizeof r->path, "%s/%s.ebpo.h5", m->folder, name);
    fine(ebpo_subset(m->file, r->path, o, &error), &error);
    fine(ebpo_open(r->path, &r->file, &error), &error);
    r->info = ebpo_file_info(r->file);
}

static void result_free(result *r)
{
    ebpo_close(r->file);
    unlink(r->path);
}

static double reach(query_model *m, ebpo_file *file, int level)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_error_bound_options o = EBPO_ERROR_BOUND_OPTIONS_INIT;
    ebpo_error_bound d = EBPO_ERROR_BOUND_INIT;
    o.samples = 0;
    fine(ebpo_level_error_bound(m->model, file, level, &o, &d, &error), &error);
    return d.hi;
}

static void verify(const result *r)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_verify_options o = EBPO_VERIFY_OPTIONS_INIT;
    ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
    fine(ebpo_verify(r->file, &o, &report, &error), &error);
    ck_assert_msg(report.violations == 0, "%s %s %s %s %s %s", report.structure.first,
                  report.content.first, report.containment.first, report.nesting.first,
                  report.labels.first, report.lists.first);
}

/* Returns the number of gray nodes and leaves of the coarser file that are not gray nodes or leaves
 * in the finer file. */
static uint64_t missing(ebpo_file *coarse, ebpo_file *fine_file, uint64_t *nodes)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_tree a, b;
    uint64_t out = 0;
    fine(ebpo_file_read_tree(coarse, READ_BY(1), &a, &error), &error);
    fine(ebpo_file_read_tree(fine_file, READ_BY(1), &b, &error), &error);
    struct pair {
        uint64_t a, b;
    } *now = query_alloc(1, sizeof *now), *next;
    uint64_t count = 1;
    *now = (struct pair){ 0, 0 };
    for (int level = 0; level < a.info.level_count && count; level++) {
        const ebpo_level *x = &a.level[level], *y = &b.level[level];
        uint64_t *rank[2] = { query_alloc(x->group_count + 1, 8),
                              query_alloc(level < b.info.level_count ? y->group_count + 1 : 1, 8) };
        const ebpo_level *of[2] = { x, y };
        for (int f = 0; f < 2; f++) {
            uint64_t sum = 0;
            for (uint64_t i = 0; (f == 0 || level < b.info.level_count) && i < of[f]->group_count;
                 i++) {
                rank[f][i] = sum;
                for (int k = 0; k < 8; k++)
                    sum += (of[f]->types[i] >> 2 * k & 3) == EBPO_GRAY;
            }
        }
        next = query_alloc(8 * count, sizeof *next);
        uint64_t kept = 0;
        for (uint64_t i = 0; i < count; i++) {
            bool there = level < b.info.level_count && y->types[now[i].b] != 0;
            uint64_t ra = rank[0][now[i].a], rb = there ? rank[1][now[i].b] : 0;
            for (int k = 0; k < 8; k++) {
                int ta = x->types[now[i].a] >> 2 * k & 3,
                    tb = there ? y->types[now[i].b] >> 2 * k & 3 : EBPO_WHITE;
                if (ta >= EBPO_LEAF) {
                    *nodes += 1;
                    out += tb < EBPO_LEAF || (ta == EBPO_LEAF && tb == EBPO_GRAY);
                }
                if (ta == EBPO_GRAY && tb == EBPO_GRAY && level + 1 < a.info.level_count &&
                    a.level[level + 1].types[ra] != 0)
                    next[kept++] = (struct pair){ ra, rb };
                ra += ta == EBPO_GRAY;
                rb += tb == EBPO_GRAY;
            }
        }
        free(rank[0]);
        free(rank[1]);
        free(now);
        now = next;
        count = kept;
    }
    free(now);
    ebpo_tree_free(&a);
    ebpo_tree_free(&b);
    return out;
}

/* Checks that subsets keep the requested errors; leaves cannot be refined. */
static void check_requested_errors(query_model *m, uint32_t parts)
{
    ebpo_subset_options o = EBPO_SUBSET_OPTIONS_INIT;
    double leaves, coarsest = reach(m, m->file, 0);
    result whole, before = { "", NULL, NULL };
    bool first = true;
    o.parts = parts;
    result_make(&whole, m, "whole", &o);
    leaves = reach(m, whole.file, whole.info->level_count - 1);
    for (double e = 1.5 * coarsest; e > leaves * 1.01; e /= 3) {
        result r;
        o.max_error = e;
        result_make(&r, m, first ? "a" : e < coarsest / 4 ? "c" : "b", &o);
        verify(&r);
        double hi = reach(m, r.file, r.info->level_count - 1),
               reference = reference_max_distance(r.file, r.info->level_count - 1, &m->mesh,
                                                  m->info.solid, 300, 1);
        ck_assert_msg(hi <= e * 1.06 + 1e-5 * m->size, "%s: requested error %g, upper bound %g",
                      m->name, e, hi);
        ck_assert_msg(reference <= e + 1e-9 * m->size, "%s: requested error %g, reference %g",
                      m->name, e, reference);
        ck_assert(r.info->pruned ? r.info->kept_error == e : r.info->kept_error == 0);
        if (!first) {
            uint64_t nodes = 0;
            ck_assert_msg(before.info->file_bytes <= r.info->file_bytes,
                          "%s: a smaller error gives fewer bytes, %llu instead of %llu", m->name,
                          (unsigned long long)r.info->file_bytes,
                          (unsigned long long)before.info->file_bytes);
            ck_assert_uint_eq(missing(before.file, r.file, &nodes), 0);
            ck_assert(nodes > 0);
            ebpo_close(before.file);
        }
        before = r;
        first = false;
    }
    ck_assert(!first);
    ebpo_close(before.file);
    result_free(&whole);
    for (int i = 0; i < 3; i++) {
        char path[120];
        snprintf(path, sizeof path, "%s/%c.ebpo.h5", m->folder, 'a' + i);
        unlink(path);
    }
}

START_TEST(test_subset_keeps_error_limit)
{
    for (int i = query_scaled(4) < 4 ? 3 : 0; i < 5;
         i++) { /* other compilers and sanitizers test only the small models */
        query_model m;
        ebpo_mesh mesh = i == 0   ? ebpo_test_torus(3, 1, 48, 24)
                         : i == 1 ? ebpo_test_sphere((double[3]){ 1, 2, 3 }, 2, 3)
                         : i == 2 ? ebpo_test_blob(4, 40, 7)
                         : i == 3 ? ebpo_test_cone(1, 3, 40)
                                  : ebpo_test_sheet(4, 8);
        query_model_make(&m,
                         i == 0   ? "torus"
                         : i == 1 ? "sphere"
                         : i == 2 ? "blob"
                         : i == 3 ? "cone"
                                  : "sheet",
                         mesh, &stored);
        check_requested_errors(&m, ~0u);
        if (i < 2)
            check_requested_errors(&m, EBPO_PART_PLANES | EBPO_PART_LEAF_PLANES);
        if (i == 0)
            check_requested_errors(&m, EBPO_PART_MESH);
        query_model_free(&m);
    }
}
END_TEST

START_TEST(test_subset_error_limit_extremes)
{
    query_model m;
    result r;
    ebpo_subset_options o = EBPO_SUBSET_OPTIONS_INIT;
    query_model_make(&m, "torus", ebpo_test_torus(3, 1, 48, 24), &stored);
    o.max_error = 100;
    result_make(&r, &m, "root", &o);
    ck_assert(r.info->level_count == 1 && r.info->level[0].pruned_count == 1);
    verify(&r);
    result_free(&r);
    o.max_error = 1e-300;
    result_make(&r, &m, "all", &o);
    ck_assert(!r.info->pruned && r.info->kept_error == 0 &&
              memcmp(r.info->content_sha256, ebpo_file_info(m.file)->content_sha256, 32) == 0);
    result_free(&r);
    query_model_free(&m);
}
END_TEST

START_TEST(test_subset_size_limit_minimizes_error)
{
    query_model m;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_subset_options o = EBPO_SUBSET_OPTIONS_INIT;
    uint32_t n = query_scaled(4) < 4 ? 16 : 96;
    query_model_make(&m, "torus", ebpo_test_torus(3, 1, n, n / 2), &stored);
    uint64_t whole = ebpo_file_info(m.file)->file_bytes;
    for (int i = 0; i < 3; i++) {
        result r, finer;
        o.target_bytes = whole * (uint64_t)(i == 0 ? 90 : i == 1 ? 60 : 30) / 100;
        result_make(&r, &m, "fit", &o);
        ck_assert_msg(r.info->file_bytes <= o.target_bytes && r.info->kept_error > 0,
                      "%llu of %llu bytes", (unsigned long long)r.info->file_bytes,
                      (unsigned long long)o.target_bytes);
        verify(&r);
        ebpo_subset_options e = EBPO_SUBSET_OPTIONS_INIT;
        e.max_error = r.info->kept_error;
        result_make(&finer, &m, "same", &e);
        ck_assert(memcmp(finer.info->content_sha256, r.info->content_sha256, 32) == 0 &&
                  finer.info->file_bytes == r.info->file_bytes);
        result_free(&finer);
        e.max_error = r.info->kept_error / 1.02;
        result_make(&finer, &m, "finer", &e);
        /* Sizes vary slightly for nearly the same content, because of compression. */
        ck_assert_msg(finer.info->file_bytes > o.target_bytes * 99 / 100,
                      "a smaller error would fit: %llu of %llu bytes",
                      (unsigned long long)finer.info->file_bytes,
                      (unsigned long long)o.target_bytes);
        result_free(&finer);
        result_free(&r);
    }
    result r;
    o.target_bytes = whole + 1000;
    result_make(&r, &m, "fit", &o);
    ck_assert(!r.info->pruned && r.info->file_bytes <= o.target_bytes);
    result_free(&r);
    o.target_bytes = 1000;
    char path[120];
    snprintf(path, sizeof path, "%s/no.ebpo.h5", m.folder);
    ck_assert_int_eq(ebpo_subset(m.file, path, &o, &error), EBPO_E_ARGUMENT);
    const char *least = strstr(error.message, "the smallest one has ");
    ck_assert_msg(least != NULL && access(path, F_OK) != 0, "%s", error.message);
    o.target_bytes = strtoull(strpbrk(least, "0123456789"), NULL, 10);
    result_make(&r, &m, "fit", &o);
    ck_assert(r.info->file_bytes == o.target_bytes);
    result_free(&r);
    query_model_free(&m);
}
END_TEST

/* Envelopes of boxes on the lattice coincide with the solid: nodes are pruned at any error, and no
 * error keeps the whole file. */
START_TEST(test_subset_never_exceeds_size_limit)
{
    for (int i = 0; i < 3; i++) {
        query_model m;
        if (ebpo_test_scale() < 1 && i == 2)
            continue; /* test_subset_size_limit_minimizes_error has a torus */
        ebpo_mesh mesh = i == 0   ? ebpo_test_box((double[3]){ 0, 0, 0 }, (double[3]){ 8, 8, 8 }, 2)
                         : i == 1 ? ebpo_test_staircase(4)
                                  : ebpo_test_torus(3, 1, 12, 6);
        query_model_make(&m, i == 0 ? "box" : i == 1 ? "staircase" : "torus", mesh, &stored);
        uint64_t whole = ebpo_file_info(m.file)->file_bytes, last = 0, targets = query_scaled(8);
        for (uint64_t k = 1; k <= targets; k++) {
            ebpo_error error = EBPO_ERROR_INIT;
            ebpo_subset_options o = EBPO_SUBSET_OPTIONS_INIT, e = EBPO_SUBSET_OPTIONS_INIT;
            char path[120];
            o.target_bytes = whole * k / targets - (k == targets);
            snprintf(path, sizeof path, "%s/fit.ebpo.h5", m.folder);
            ebpo_status status = ebpo_subset(m.file, path, &o, &error);
            if (status == EBPO_E_ARGUMENT && !last)
                continue; /* a limit below the least size */
            fine(status, &error);
            unlink(path);
            result r, same;
            result_make(&r, &m, "fit", &o);
            ck_assert_msg(r.info->file_bytes <= o.target_bytes, "%s: %llu of %llu bytes", m.name,
                          (unsigned long long)r.info->file_bytes,
                          (unsigned long long)o.target_bytes);
            verify(&r);
            e.max_error = r.info->kept_error;
            result_make(&same, &m, "same", &e);
            ck_assert(memcmp(same.info->content_sha256, r.info->content_sha256, 32) == 0 &&
                      same.info->file_bytes == r.info->file_bytes);
            last = r.info->file_bytes;
            result_free(&same);
            result_free(&r);
        }
        ck_assert(last > 0);
        query_model_free(&m);
    }
}
END_TEST

START_TEST(test_subset_chooses_parts_by_size)
{
    query_model m;
    result r;
    ebpo_subset_options o = EBPO_SUBSET_OPTIONS_INIT;
    uint64_t bytes[3];
    uint32_t around = ebpo_test_scale() < 1 ? 24 : 96;
    query_model_make(&m, "torus", ebpo_test_torus(3, 1, around, around / 2), &stored);
    for (int i = 0; i < 3; i++) {
        static const ebpo_profile order[] = { EBPO_PROFILE_FULL, EBPO_PROFILE_COLLISION,
                                              EBPO_PROFILE_LOD };
        o.parts = ebpo_profile_parts(order[i]);
        result_make(&r, &m, "profile", &o);
        bytes[i] = r.info->file_bytes;
        result_free(&r);
    }
    ck_assert(bytes[0] > bytes[1] && bytes[1] > bytes[2]);
    o.choose_parts = true;
    for (int i = 0; i < 4; i++) {
        o.target_bytes = i < 3 ? bytes[i] : bytes[2] * 8 / 10;
        result_make(&r, &m, "chosen", &o);
        ck_assert_msg(r.info->file_bytes <= o.target_bytes, "%llu of %llu bytes",
                      (unsigned long long)r.info->file_bytes, (unsigned long long)o.target_bytes);
        ck_assert(i == 3 ? r.info->pruned && r.info->kept_error > 0
                         : r.info->file_bytes == bytes[i] && !r.info->pruned);
        result_free(&r);
    }
    query_model_free(&m);
}
END_TEST

START_TEST(test_subset_bytes_same_for_any_method)
{
    query_model m;
    ebpo_error error = EBPO_ERROR_INIT;
    uint32_t around = ebpo_test_scale() < 1 ? 12 : 48;
    query_model_make(&m, "torus", ebpo_test_torus(3, 1, around, around / 2), &stored);
    for (int i = 0; i < 2; i++) {
        char path[3][120];
        static uint8_t bytes[3][1 << 20];
        size_t size[3];
        ebpo_subset_options o = EBPO_SUBSET_OPTIONS_INIT;
        o.max_error = i ? 0 : 0.05;
        o.target_bytes = i ? ebpo_file_info(m.file)->file_bytes / 2 : 0;
        for (int variant = 0; variant < 3; variant++) {
            snprintf(path[variant], sizeof path[variant], "%s/%d.ebpo.h5", m.folder, variant);
            o.threads = variant == 1 ? 3 : 1;
            if (variant < 2) {
                fine(ebpo_subset(m.file, path[variant], &o, &error), &error);
            } else {
                ebpo_tree tree;
                fine(ebpo_file_read_tree(m.file, READ_BY(1), &tree, &error), &error);
                fine(ebpo_subset_of_tree(&tree, path[variant], &o, &error), &error);
            }
            FILE *f = fopen(path[variant], "rb");
            size[variant] = fread(bytes[variant], 1, sizeof bytes[variant], f);
            fclose(f);
            unlink(path[variant]);
            ck_assert(size[variant] == size[0] && memcmp(bytes[variant], bytes[0], size[0]) == 0);
        }
    }
    query_model_free(&m);
}
END_TEST

static void refused(ebpo_file *file, const char *folder, const ebpo_subset_options *o,
                    ebpo_status status, const char *says)
{
    ebpo_error error = EBPO_ERROR_INIT;
    char path[120];
    snprintf(path, sizeof path, "%s/no.ebpo.h5", folder);
    ck_assert_int_eq(ebpo_subset(file, path, o, &error), status);
    ck_assert_msg(strstr(error.message, says) != NULL && access(path, F_OK) != 0, "%s",
                  error.message);
}

START_TEST(test_subset_impossible_limits_are_refused)
{
    query_model m;
    result r;
    ebpo_subset_options o = EBPO_SUBSET_OPTIONS_INIT;
    query_model_make(&m, "torus", ebpo_test_torus(3, 1, 48, 24), &stored);
    o.max_error = NAN;
    refused(m.file, m.folder, &o, EBPO_E_ARGUMENT, "maximum error");
    o.max_error = -1;
    refused(m.file, m.folder, &o, EBPO_E_ARGUMENT, "maximum error");
    o.max_error = 1;
    o.target_bytes = 10000;
    refused(m.file, m.folder, &o, EBPO_E_ARGUMENT, "cannot be combined");
    o.max_error = 0.1;
    o.target_bytes = 0;
    result_make(&r, &m, "small", &o);
    refused(r.file, m.folder, &o, EBPO_E_ABSENT, "subset");
    result again;
    o.max_error = 0;
    o.last_level = 2;
    snprintf(again.path, sizeof again.path, "%s/again.ebpo.h5", m.folder);
    ebpo_error error = EBPO_ERROR_INIT;
    /* a subset of the subset keeps the value */
    fine(ebpo_subset(r.file, again.path, &o, &error), &error);
    fine(ebpo_open(again.path, &again.file, &error), &error);
    ck_assert(ebpo_file_info(again.file)->kept_error == 0.1);
    result_free(&again);
    result_free(&r);
    o = (ebpo_subset_options)EBPO_SUBSET_OPTIONS_INIT;
    o.parts = EBPO_PART_PLANES;
    result_make(&r, &m, "bare", &o);
    o.max_error = 0.1;
    refused(r.file, m.folder, &o, EBPO_E_ABSENT, "mesh");
    result_free(&r);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(need)
{
    Suite *suite = suite_create("need");
    TCase *tests = tcase_create("need");
    tcase_set_timeout(tests, 900);
    tcase_add_test(tests, test_subset_keeps_error_limit);
    tcase_add_test(tests, test_subset_error_limit_extremes);
    tcase_add_test(tests, test_subset_size_limit_minimizes_error);
    tcase_add_test(tests, test_subset_never_exceeds_size_limit);
    tcase_add_test(tests, test_subset_chooses_parts_by_size);
    tcase_add_test(tests, test_subset_bytes_same_for_any_method);
    tcase_add_test(tests, test_subset_impossible_limits_are_refused);
    suite_add_tcase(suite, tests);
    return suite;
}
