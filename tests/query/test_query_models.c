/* Queries real models in the folder EBPO_MODELS at difficult points, and compares with brute
 * force. */
#include <stdio.h>
#include <stdlib.h>

#include "check_main.h"
#include "query_support.h"

static const char *const names[] = { "cheese_g133", "fertility", "selfint_A", "cad_adis16480" };

START_TEST(test_real_models_match_brute_force)
{
    const char *folder = getenv("EBPO_MODELS");
    char path[1024];
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    if (!folder)
        return;
    snprintf(path, sizeof path, "%s/%s.ply", folder, names[_i]);
    ck_assert_msg(ebpo_mesh_read(path, NULL, &mesh, &error) == EBPO_OK, "%s", error.message);
    query_model m;
    query_model_make(&m, names[_i], mesh, &query_variants[0]);
    query_check_points(&m, query_scaled(2000), (uint64_t)_i + 31);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(query_models)
{
    Suite *suite = suite_create("query_models");
    TCase *tests = tcase_create("models");
    tcase_set_timeout(tests, 1000);
    tcase_add_loop_test(tests, test_real_models_match_brute_force, 0, sizeof names / sizeof *names);
    suite_add_tcase(suite, tests);
    return suite;
}
