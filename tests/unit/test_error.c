/* Tests the members of an error besides its message. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "check_main.h"
#include "query_support.h"

static void assert_begins(const ebpo_error *error)
{
    char begin[400];
    snprintf(begin, sizeof begin, "%s: %s%s", error->file, error->object,
             *error->object ? ": " : "");
    ck_assert_msg(strncmp(error->message, begin, strlen(begin)) == 0, "'%s' and '%s'",
                  error->message, begin);
}

START_TEST(test_error_of_missing_file)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file;
    ck_assert_int_eq(ebpo_open("/no/such/file.ebpo.h5", &file, &error), EBPO_E_IO);
    ck_assert_int_eq(error.status, EBPO_E_IO);
    ck_assert_str_eq(error.file, "/no/such/file.ebpo.h5");
    ck_assert_str_eq(error.object, "");
    ck_assert_int_eq(error.offset, -1);
    ck_assert_int_eq(error.system_error, ENOENT);
    assert_begins(&error);
}
END_TEST

START_TEST(test_error_of_ply_has_byte_offset)
{
    static const char text[] = "ply\nformat binary_little_endian 1.0\nelement vertex 2\n"
                               "property float x\nproperty float y\nproperty float z\n"
                               "end_header\n0123456789";
    ebpo_error error = EBPO_ERROR_INIT;
    double *xyz;
    uint64_t count;
    ck_assert_int_eq(ebpo_points_parse_ply(text, sizeof text - 1, "points.ply", &xyz, &count,
                                           &error),
                     EBPO_E_FORMAT);
    ck_assert_str_eq(error.file, "points.ply");
    ck_assert_int_ge(error.offset, (int64_t)(strstr(text, "0123") - text));
    assert_begins(&error);
}
END_TEST

/* Flips bits of the arrays only, because libhdf5 checks the header. */
START_TEST(test_error_of_damaged_array)
{
    static const query_variant standard = { "default", 4, 4, EBPO_RULE_NONZERO, 0 };
    static uint8_t bytes[1 << 20];
    query_model m;
    query_model_make(&m, "sphere", ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 1), &standard);
    FILE *f = fopen(m.path, "rb");
    size_t size = fread(bytes, 1, sizeof bytes, f);
    fclose(f);
    int objects = 0;
    for (size_t i = (size_t)ebpo_file_info(m.file)->head_bytes; i < size; i += 7) {
        ebpo_error error = EBPO_ERROR_INIT;
        ebpo_file *file = NULL;
        bytes[i] ^= 1;
        if (ebpo_open_memory(bytes, size, "damaged", &file, &error) == EBPO_OK &&
            ebpo_file_check_content(file, NULL, &error) == EBPO_E_FORMAT) {
            ck_assert_str_eq(error.file, "damaged");
            ck_assert(!*error.object || *error.object == '/');
            objects += *error.object == '/';
            assert_begins(&error);
        }
        ebpo_close(file);
        bytes[i] ^= 1;
    }
    ck_assert_int_gt(objects, 0);
    query_model_free(&m);
}
END_TEST

/* Data of an earlier error is removed. */
START_TEST(test_error_replaces_earlier_error)
{
    static const query_variant standard = { "default", 4, 4, EBPO_RULE_NONZERO, 0 };
    query_model m;
    ebpo_error error = { EBPO_E_IO, "old", "old", "old", 5, ENOENT, { 0 } };
    query_model_make(&m, "sphere", ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 1), &standard);
    ck_assert_int_eq(ebpo_lod_level(m.file, 99, NULL, NULL, NULL, &error), EBPO_E_ARGUMENT);
    ck_assert_str_eq(error.file, "");
    ck_assert_str_eq(error.object, "");
    ck_assert_int_eq(error.offset, -1);
    ck_assert_int_eq(error.system_error, 0);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(error)
{
    Suite *suite = suite_create("error");
    TCase *tests = tcase_create("error");
    tcase_set_timeout(tests, 120);
    tcase_add_test(tests, test_error_of_missing_file);
    tcase_add_test(tests, test_error_of_ply_has_byte_offset);
    tcase_add_test(tests, test_error_of_damaged_array);
    tcase_add_test(tests, test_error_replaces_earlier_error);
    suite_add_tcase(suite, tests);
    return suite;
}
