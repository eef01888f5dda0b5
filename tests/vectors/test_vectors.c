/* Tests the files of format-spec/vectors: argument 1 is that folder, argument 2 the program
 * make_vectors. */
#include <dirent.h>
#include <stdlib.h>
#include <unistd.h>
#include <hdf5.h>
#include <zlib.h>
#include <zstd.h>

#include "attributes_json.h"
#include "check_main.h"
#include "scratch.h"
#include "tree_json.h"
#include "vector_read.h"

static const char *vectors, *maker;

static char *slurp(const char *path, size_t *size)
{
    FILE *in = fopen(path, "rb");
    ck_assert_msg(in != NULL, "%s is missing", path);
    fseek(in, 0, SEEK_END);
    *size = (size_t)ftell(in);
    rewind(in);
    char *text = calloc(1, *size + 1);
    ck_assert_uint_eq(fread(text, 1, *size, in), *size);
    fclose(in);
    return text;
}

/* Calls `check` for every .ebpo.h5 in a folder with its path and the path of its companion. */
static unsigned each(const char *part, const char *companion,
                     void (*check)(const char *path, const char *expected))
{
    char path[1024], other[1024];
    snprintf(path, sizeof path, "%s/%s", vectors, part);
    DIR *directory = opendir(path);
    ck_assert_msg(directory != NULL, "%s is missing", path);
    unsigned count = 0;
    for (struct dirent *entry; (entry = readdir(directory)) != NULL;) {
        const char *end = strstr(entry->d_name, ".ebpo.h5");
        if (!end)
            continue;
        snprintf(path, sizeof path, "%s/%s/%s", vectors, part, entry->d_name);
        snprintf(other, sizeof other, "%s/%s/%.*s%s", vectors, part, (int)(end - entry->d_name),
                 entry->d_name, companion);
        check(path, other);
        count++;
    }
    closedir(directory);
    return count;
}

static void check_attributes(const char *path, const ebpo_attributes *attributes)
{
    char other[1024], *json = NULL;
    size_t json_size = 0, size;
    snprintf(other, sizeof other, "%.*s.attributes.json", (int)(strlen(path) - strlen(".ebpo.h5")),
             path);
    FILE *out = open_memstream(&json, &json_size);
    attributes_json(out, attributes);
    fclose(out);
    char *expected = slurp(other, &size);
    ck_assert_str_eq(json, expected);
    free(json);
    free(expected);
}

static void check_passed(const char *path, const char *expected_path)
{
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(vector_read(path, &tree, &error) == EBPO_OK, "%s", error.message);
    char *json = NULL;
    size_t json_size = 0, size;
    FILE *out = open_memstream(&json, &json_size);
    tree_json(out, &tree);
    fclose(out);
    char *expected = slurp(expected_path, &size);
    ck_assert_str_eq(json, expected);
    free(json);
    free(expected);
    if (tree.mesh.attributes)
        check_attributes(path, tree.mesh.attributes);
    ebpo_tree_free(&tree);
}

static void check_failed(const char *path, const char *expected_path)
{
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    char text[1024];
    size_t size;
    if (strstr(path, "/unverified_")) {
        ck_assert_msg(vector_read(path, &tree, &error) == EBPO_OK, "%s", error.message);
        ebpo_tree_free(&tree);
        ck_assert_msg(vector_violation(path, text, sizeof text), "%s verifies", path);
    } else {
        ck_assert_msg(vector_read(path, &tree, &error) != EBPO_OK, "%s is read without an error",
                      path);
        vector_outcome(path, &error, text, sizeof text);
    }
    char *expected = slurp(expected_path, &size), *rule = strstr(expected, "Breaks R");
    ck_assert_msg(rule != NULL, "%s does not state the rule", expected_path);
    *rule = 0;
    ck_assert_str_eq(text, expected);
    free(expected);
}

START_TEST(test_valid_vectors_match_json)
{
    ck_assert_uint_ge(each("passed", ".json", check_passed), 32);
}
END_TEST

START_TEST(test_invalid_vectors_are_refused)
{
    ck_assert_uint_ge(each("failed", ".txt", check_failed), 80);
}
END_TEST

/* Compressors may give other bytes elsewhere: the texts are equal, and the files made are read as
 * the texts say. */
static void check_made(const char *folder)
{
    const char *committed = vectors;
    vectors = folder;
    ck_assert_uint_ge(each("passed", ".json", check_passed), 32);
    ck_assert_uint_ge(each("failed", ".txt", check_failed), 80);
    vectors = committed;
}

/* Files that were written before format 1.1 had its final names. */
START_TEST(test_former_names_are_read)
{
    ck_assert_uint_ge(each("former", ".json", check_passed), 1);
}
END_TEST

/* Compressors may change their output from version to version, and the output of zstd differs on
 * big-endian machines or with 32-bit addresses: bytes are compared only where the vectors were
 * made. */
START_TEST(test_vectors_match_generator_output)
{
    unsigned major, minor, release;
    H5get_libversion(&major, &minor, &release);
    if (ZSTD_versionNumber() != 10504 || strcmp(zlibVersion(), "1.2.13") != 0 || major != 1 ||
        minor != 10 || release != 8)
        return;
    bool here = __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__ && sizeof(size_t) == 8;
    const char *how = here ? "-r -x '20_version_1_0.*'" : "-r -x '20_version_1_0.*' -x '*.ebpo.h5'",
               *folder = scratch(NULL);
    char command[4096];
    snprintf(command, sizeof command,
             "'%s' %s 2>/dev/null && diff %s %s/passed '%s/passed' && diff %s %s/failed "
             "'%s/failed'",
             maker, folder, how, folder, vectors, how, folder, vectors);
    ck_assert_int_eq(system(command), 0);
    if (!here)
        check_made(folder);
}
END_TEST

Suite *test_suite(void)
{
    vectors = test_arguments[0];
    maker = test_arguments[1];
    Suite *suite = suite_create("vectors");
    TCase *tests = tcase_create("vectors");
    tcase_set_timeout(tests, 300);
    tcase_add_test(tests, test_valid_vectors_match_json);
    tcase_add_test(tests, test_invalid_vectors_are_refused);
    tcase_add_test(tests, test_former_names_are_read);
    tcase_add_test(tests, test_vectors_match_generator_output);
    suite_add_tcase(suite, tests);
    return suite;
}
