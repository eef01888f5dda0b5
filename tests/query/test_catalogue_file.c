/* Tests catalogue files: written files can be read; errors in a file or an entry are detected; the
 * tree of boxes finds the same models as a test of all boxes. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/catalogue.h>

#include "catalogue/catalogue_boxes.h"
#include "check_main.h"
#include "npy_numbers.h"
#include "query_support.h"

/* A box from 0 to 1 on each axis. */
static query_model model;
static ebpo_catalogue_entry entry;

static void make_model(void)
{
    const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    query_model_make(&model, "catalogue", ebpo_test_box(low, high, 5), &query_variants[0]);
    ebpo_catalogue_entry_of(model.file, model.path, &entry);
}

static void free_model(void) { query_model_free(&model); }

static char *text_of(const char *path)
{
    FILE *in = fopen(path, "rb");
    ck_assert_ptr_nonnull(in);
    char *text = query_alloc(1 << 16, 1);
    size_t size = fread(text, 1, (1 << 16) - 1, in);
    text[size] = 0;
    fclose(in);
    return text;
}

START_TEST(test_catalogue_file_round_trip)
{
    ebpo_catalogue_entry some[3] = { entry, entry, entry };
    ebpo_catalogue_options o = EBPO_CATALOGUE_OPTIONS_INIT;
    ebpo_catalogue *made, *read;
    ebpo_catalogue_facts facts = EBPO_CATALOGUE_FACTS_INIT;
    char *path = strdup(scratch("c.json"));
    some[0].min[0] = -0.1;
    some[0].min[1] = 5e-324 - 1;
    some[0].max[0] = 1.2345678901234568e17;
    some[0].max[1] = 1.7976931348623157e308;
    some[1].path = "sub/quote\" \\ \n.h5";
    some[1].only_caps = true;
    some[2].surface = "other.h5";
    some[2].numbers = "/n.npy";
    some[2].file_bytes = 0;
    o.parts = true;
    o.rule = EBPO_RULE_EVENODD;
    o.folder = scratch(NULL);
    ASSERT_OK(ebpo_catalogue_new(some, 3, &o, &made, error));
    ASSERT_OK(ebpo_catalogue_save(made, path, error));
    ASSERT_OK(ebpo_catalogue_open(path, NULL, &read, error));
    ck_assert_int_eq(ebpo_catalogue_get_facts(read, &facts), EBPO_OK);
    ck_assert(facts.count == 3 && facts.parts && facts.rule == EBPO_RULE_EVENODD);
    ck_assert_str_eq(facts.path, path);
    for (uint64_t i = 0; i < 3; i++) {
        const ebpo_catalogue_entry *a = ebpo_catalogue_get_entry(made, i),
                                   *b = ebpo_catalogue_get_entry(read, i);
        ck_assert_str_eq(a->path, b->path);
        ck_assert(memcmp(a->min, b->min, sizeof a->min) == 0 &&
                  memcmp(a->max, b->max, sizeof a->max) == 0 &&
                  memcmp(a->digest, b->digest, sizeof a->digest) == 0);
        ck_assert(a->solid == b->solid && a->only_caps == b->only_caps && a->rule == b->rule);
        ck_assert(!a->surface == !b->surface && (!a->surface || !strcmp(a->surface, b->surface)));
        ck_assert(!a->numbers == !b->numbers && (!a->numbers || !strcmp(a->numbers, b->numbers)));
        ck_assert(i == 2 || a->face_count == b->face_count);
    }
    ck_assert_ptr_null(ebpo_catalogue_get_entry(read, 3));
    char *text = text_of(path);
    ck_assert_ptr_nonnull(strstr(text, "\"path\": \"sub/quote\\\" \\\\ \\u000a.h5\""));
    ck_assert_ptr_nonnull(strstr(text, "\"surface\": \"other.h5\""));
    ck_assert_ptr_nonnull(strstr(text, "[-0.1, -1, "));
    ck_assert_ptr_nonnull(strstr(text, "[1.2345678901234568e+17, 1.7976931348623157e+308, "));
    free(text);
    ebpo_catalogue_free(made);
    ebpo_catalogue_free(read);
    free(path);
}
END_TEST

START_TEST(test_catalogue_invalid_entries_are_refused)
{
    ebpo_error reported = EBPO_ERROR_INIT;
    ebpo_catalogue *made;
    ck_assert_int_eq(ebpo_catalogue_new(&entry, 0, NULL, &made, &reported), EBPO_E_ARGUMENT);
    for (int i = 0; i < 5; i++) {
        ebpo_catalogue_entry e = entry;
        e.path = i == 0 ? NULL : i == 1 ? "" : e.path;
        e.min[1] = i == 2 ? NAN : i == 3 ? 1e9 : e.min[1];
        e.surface = i == 4 ? "" : NULL;
        ck_assert_int_eq(ebpo_catalogue_new(&e, 1, NULL, &made, &reported), EBPO_E_ARGUMENT);
    }
    ebpo_catalogue_entry e = entry;
    e.path = "\xff.h5";
    ASSERT_OK(ebpo_catalogue_new(&e, 1, NULL, &made, error));
    ck_assert_int_eq(ebpo_catalogue_save(made, scratch("no.json"), &reported), EBPO_E_ARGUMENT);
    ebpo_catalogue_free(made);
}
END_TEST

/* Opens a catalogue whose text has `from` replaced by `to`, and queries its middle. */
static ebpo_status query_changed(const char *text, const char *from, const char *to,
                                 ebpo_error *error)
{
    const char *path = scratch("changed.json"), *at = strstr(text, from);
    const double middle[3] = { 0.5, 0.5, 0.5 };
    ebpo_catalogue *c;
    ebpo_catalogue_models *models = NULL;
    ebpo_distance_result out;
    uint64_t number;
    ck_assert_msg(at != NULL, "no %s", from);
    FILE *file = fopen(path, "wb");
    fprintf(file, "%.*s%s%s", (int)(at - text), text, to, at + strlen(from));
    fclose(file);
    ebpo_status status = ebpo_catalogue_open(path, NULL, &c, error);
    if (status == EBPO_OK)
        status = ebpo_catalogue_models_new(NULL, &models, error);
    if (status == EBPO_OK)
        status = ebpo_catalogue_distance(c, models, middle, 1, NULL, &out, &number, error);
    ebpo_catalogue_models_free(models);
    ebpo_catalogue_free(c);
    return status;
}

static const struct {
    const char *from, *to;
    ebpo_status status;
    const char *says;
} hostile[] = {
    { "ebpo-catalogue", "ebpo-catalogue", EBPO_OK, "" },
    { "ebpo-catalogue", "catalogue", EBPO_E_FORMAT, "\"ebpo-catalogue\" is missing" },
    { "\"version\": 1", "\"version\": 2", EBPO_E_VERSION, "version 2" },
    { "\"version\": 1", "\"version\": true", EBPO_E_VERSION, "version 0" },
    { "\"version\": 1", "\"version\": 1, \"parts\": 1", EBPO_E_FORMAT,
      "parts is not true or false" },
    { "\"version\": 1", "\"version\": 1, \"rule\": \"no\"", EBPO_E_FORMAT, "rule is" },
    { "\"version\": 1", "\"version\": 1, \"more\": [{}]", EBPO_OK, "" },
    { "\"models\"", "\"others\"", EBPO_E_FORMAT, "at least one model" },
    { "\"path\"", "\"paths\"", EBPO_E_FORMAT, "models[0]: has no path" },
    { "\"path\": \"", "\"path\": \"\\ud800", EBPO_E_FORMAT, "line 6" },
    { "\"path\": \"", "\"path\": \"\\u0000", EBPO_E_FORMAT, "line 6" },
    { "\"path\": \"", "\"path\": \"nowhere", EBPO_E_IO, "nowhere" },
    { "\"path\": \"", "\"path\": 1, \"was\": \"", EBPO_E_FORMAT, "path is not a string" },
    { "\"content_sha256\": \"", "\"content_sha256\": \"X", EBPO_E_FORMAT, "is not a digest" },
    { "\"solid\": true", "\"solid\": 1", EBPO_E_FORMAT, "solid is not true or false" },
    { "\"box_min\": [0,", "\"box_min\": [false,", EBPO_E_FORMAT, "two corners" },
    { "\"box_min\": [0,", "\"box_min\": [0, 0,", EBPO_E_FORMAT, "two corners" },
    { "\"box_min\": [0,", "\"box_min\": [NaN,", EBPO_E_FORMAT, "line" },
    { "\"box_min\": [0,", "\"box_min\": [1e999,", EBPO_E_FORMAT, "overflow" },
    { "\"box_min\": [0,", "\"box_min\": [9,", EBPO_E_FORMAT, "box_min is above box_max" },
    { "\"box_min\": [0,", "\"box_min\": [0.25,", EBPO_E_FORMAT, "not within the box" },
    { "\"pruned\": false", "\"numbers\": \"none.npy\"", EBPO_E_FORMAT, "none.npy" },
    { "\"pruned\": false", "\"numbers\": \"few.npy\"", EBPO_E_FORMAT, "3 indices for 300 faces" },
    { "\"pruned\": false", "\"numbers\": \"low.npy\"", EBPO_E_FORMAT, "negative" },
    { "\"pruned\": false", "\"surface\": \"x\"", EBPO_E_FORMAT, "surface_sha256 is not a digest" },
    { "\"pruned\": false", "\"surface\": null", EBPO_E_ABSENT, "caps only" },
};

START_TEST(test_catalogue_wrong_metadata_is_detected)
{
    ebpo_error reported = EBPO_ERROR_INIT;
    const char *path = scratch("stored.json");
    ebpo_catalogue *made;
    ASSERT_OK(ebpo_catalogue_new(&entry, 1, NULL, &made, error));
    ASSERT_OK(ebpo_catalogue_save(made, path, error));
    ebpo_catalogue_free(made);
    write_numbers(scratch("few.npy"), 3, 0);
    write_numbers(scratch("low.npy"), model.mesh.face_count, -99999);
    char *text = text_of(path);
    for (size_t i = 0; i < sizeof hostile / sizeof hostile[0]; i++) {
        ebpo_status status = query_changed(text, hostile[i].from, hostile[i].to, &reported);
        ck_assert_msg(status == hostile[i].status && strstr(reported.message, hostile[i].says),
                      "%s: %d, %s", hostile[i].to, (int)status, reported.message);
        reported = (ebpo_error)EBPO_ERROR_INIT;
    }
    /* a wrong digest in a valid form */
    char *digest = strstr(text, "sha256\": \"") + 10;
    *digest = *digest == '0' ? '1' : '0';
    ck_assert_int_eq(query_changed(text, "\"version\": 1", "\"version\": 1", &reported),
                     EBPO_E_FORMAT);
    ck_assert_ptr_nonnull(strstr(reported.message, "does not match the content_sha256"));
    char deep[5000];
    memset(deep, '[', sizeof deep - 1);
    deep[sizeof deep - 1] = 0;
    ck_assert_int_eq(query_changed(deep, "[", "[", &reported), EBPO_E_FORMAT);
    free(text);
}
END_TEST

/* --- boxes --- */

enum { BOXES = 300 };

static double least_distance(const ebpo_catalogue_box *b, const double p[3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        double d = fmax(fmax(b->min[k] - p[k], p[k] - b->max[k]), 0);
        sum += d * d;
    }
    return sqrt(sum);
}

static double max_distance(const ebpo_catalogue_box *b, const double p[3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        double d = fmax(b->max[k] - p[k], p[k] - b->min[k]);
        sum += d * d;
    }
    return sqrt(sum);
}

static bool is_named(const ebpo_catalogue_pairs *pairs, uint32_t box)
{
    for (uint64_t i = 0; i < pairs->count; i++)
        if (pairs->pair[i].box == box)
            return true;
    return false;
}

START_TEST(test_catalogue_box_search_omits_no_box)
{
    ebpo_catalogue_box boxes[BOXES];
    uint32_t number[BOXES];
    ebpo_catalogue_boxes tree;
    ebpo_catalogue_pairs pairs = { NULL, 0, 0 };
    uint64_t seed = 1, named = 0, needed = 0;
    for (uint32_t i = 0; i < BOXES; i++) {
        number[i] = i;
        for (int k = 0; k < 3; k++) {
            double size = ebpo_test_random_unit(&seed);
            boxes[i].min[k] = 2 * ebpo_test_random_unit(&seed) - 1;
            boxes[i].max[k] = boxes[i].min[k] + 0.1 * size * size;
        }
    }
    ck_assert(ebpo_catalogue_boxes_make(&tree, boxes, number, BOXES));
    for (int turn = 0; turn < 500; turn++) {
        double p[3], reach = INFINITY;
        for (int k = 0; k < 3; k++)
            p[k] = turn % 2 ? boxes[turn % BOXES].min[k] : 2.4 * ebpo_test_random_unit(&seed) - 1.2;
        pairs.count = 0;
        ck_assert(ebpo_catalogue_boxes_holding(&tree, p, 0, &pairs));
        for (uint32_t i = 0; i < BOXES; i++) {
            ck_assert_int_eq(is_named(&pairs, i), least_distance(&boxes[i], p) == 0);
            reach = fmin(reach, max_distance(&boxes[i], p));
        }
        pairs.count = 0;
        ck_assert(ebpo_catalogue_boxes_near(&tree, p, INFINITY, 0, &pairs));
        for (uint32_t i = 0; i < BOXES; i++) {
            bool near = least_distance(&boxes[i], p) <= reach;
            ck_assert(!near || is_named(&pairs, i));
            needed += near;
        }
        named += pairs.count;
    }
    ck_assert_uint_lt(10 * named, 11 * needed);
    free(pairs.pair);
    ebpo_catalogue_boxes_free(&tree);
}
END_TEST

TEST_SUITE(catalogue_file)
{
    Suite *suite = suite_create("catalogue_file");
    TCase *all = tcase_create("catalogue_file");
    tcase_set_timeout(all, 600);
    tcase_add_unchecked_fixture(all, make_model, free_model);
    tcase_add_checked_fixture(all, scratch_enter, scratch_leave);
    tcase_add_test(all, test_catalogue_file_round_trip);
    tcase_add_test(all, test_catalogue_invalid_entries_are_refused);
    tcase_add_test(all, test_catalogue_wrong_metadata_is_detected);
    tcase_add_test(all, test_catalogue_box_search_omits_no_box);
    suite_add_tcase(suite, all);
    return suite;
}
