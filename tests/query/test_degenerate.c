/* Each degenerate or ill-conditioned case keeps its limits: degenerate_cases.c. `test_degenerate
 * TEXT` runs the cases whose name contains the text. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "degenerate.h"

/* Returns the number of queries; few for large meshes, as the oracle tests every face for every
 * query. */
static uint64_t queries_for(const degenerate_case *c)
{
    ebpo_mesh mesh = c->make(c);
    uint64_t count = query_scaled(mesh.face_count < 500      ? 600
                                  : mesh.face_count < 7000   ? 120
                                  : mesh.face_count < 15000  ? 24
                                  : mesh.face_count < 150000 ? 12
                                                             : 4);
    ebpo_mesh_free(&mesh);
    return count < 4 ? 4 : count;
}

static const char *wanted = "";

static bool is_any_wanted(void)
{
    for (int i = 0; i < degenerate_case_count; i++)
        if (strstr(degenerate_cases[i].name, wanted))
            return true;
    return false;
}

START_TEST(test_degenerate_models_convert_and_query)
{
    if (!ebpo_test_wanted(_i))
        return;
    const degenerate_case *c = &degenerate_cases[_i];
    degenerate_result r;
    if (!strstr(c->name, wanted))
        return;
    degenerate_run(c, queries_for(c), &r);
    ck_assert_msg(r.fault[0] == 0, "%s: %s", c->name, r.fault);
}
END_TEST

TEST_SUITE(degenerate)
{
    if (test_arguments[0])
        wanted = test_arguments[0];
    if (!is_any_wanted()) {
        fprintf(stderr, "test_degenerate: no case has '%s' in its name\n", wanted);
        exit(2);
    }
    Suite *suite = suite_create("degenerate");
    TCase *tests = tcase_create("cases");
    tcase_set_timeout(tests, 600);
    tcase_add_loop_test(tests, test_degenerate_models_convert_and_query, 0, degenerate_case_count);
    suite_add_tcase(suite, tests);
    return suite;
}
