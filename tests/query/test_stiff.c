/* Each stiff case keeps its limits: stiff_cases.c. `test_stiff TEXT` runs those whose name holds
 * the text. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "stiff.h"

/* The oracle looks at every face for every question. */
static uint64_t questions_for(const stiff_case *c)
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
    for (int i = 0; i < stiff_case_count; i++)
        if (strstr(stiff_cases[i].name, wanted))
            return true;
    return false;
}

START_TEST(stiff_cases_convert_verify_and_answer_exactly_or_are_refused_clearly)
{
    if (!ebpo_test_wanted(_i))
        return;
    const stiff_case *c = &stiff_cases[_i];
    stiff_result r;
    if (!strstr(c->name, wanted))
        return;
    stiff_run(c, questions_for(c), &r);
    ck_assert_msg(r.fault[0] == 0, "%s: %s", c->name, r.fault);
}
END_TEST

TEST_SUITE(stiff)
{
    if (test_arguments[0])
        wanted = test_arguments[0];
    if (!is_any_wanted()) {
        fprintf(stderr, "test_stiff: no case's name holds '%s'\n", wanted);
        exit(2);
    }
    Suite *suite = suite_create("stiff");
    TCase *tests = tcase_create("cases");
    tcase_set_timeout(tests, 600);
    tcase_add_loop_test(tests, stiff_cases_convert_verify_and_answer_exactly_or_are_refused_clearly,
                        0, stiff_case_count);
    suite_add_tcase(suite, tests);
    return suite;
}
