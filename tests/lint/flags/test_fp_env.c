/* A caller's rounding mode, flushing of denormals and traps change no result, and are as they were
 * after each call. */
#include <fenv.h>
#include <stdlib.h>

#include "check_main.h"
#include "fp_hash.h"

static const fp_setting usual = { FE_TONEAREST, 0 };
static const fp_setting settings[] = {
    { FE_UPWARD, 0 },         { FE_DOWNWARD, 0 }, { FE_TOWARDZERO, 0 },
#if defined(__SSE2__)
    { FE_TONEAREST, 0x8040 }, /* flush to zero, denormals are zero */
    { FE_UPWARD, 0x8040 },
#endif
};
enum { SETTINGS = sizeof settings / sizeof *settings };

START_TEST(the_callers_environment_changes_no_result_and_stays)
{
    if (!ebpo_test_wanted(_i))
        return;
    const stiff_case *c = &stiff_cases[_i];
    fp_hashes plain, other;
    uint64_t questions = query_scaled(60);
    if (!fp_hash_takes(c))
        return;
    fp_hash_case(c, &usual, questions, &plain);
    ck_assert_msg(plain.kept, "%s: the default environment did not stay", c->name);
    for (int i = _i % SETTINGS; i < SETTINGS;
         i += SETTINGS) { /* each case in one environment: there are enough */
        fp_hash_case(c, &settings[i], questions, &other);
        ck_assert_msg(other.kept, "%s: environment %d did not stay", c->name, i);
        ck_assert_msg(plain.status == other.status, "%s: environment %d changes the status",
                      c->name, i);
        ck_assert_msg(plain.content == other.content, "%s: environment %d changes the content",
                      c->name, i);
        ck_assert_msg(plain.answers == other.answers, "%s: environment %d changes answers", c->name,
                      i);
    }
}
END_TEST

START_TEST(traps_of_the_caller_are_not_sprung)
{
#if defined(__GLIBC__) && defined(__SSE2__)
    fp_hashes plain, other;
    const stiff_case *c = &stiff_cases[_i];
    if (!fp_hash_takes(c))
        return;
    fp_hash_case(c, &usual, 10, &plain);
    /* The test's own arithmetic between the calls runs with them too: only invalid operations and
     * divisions by zero, which it does not make. */
    feclearexcept(FE_ALL_EXCEPT);
    feenableexcept(FE_INVALID | FE_DIVBYZERO);
    fp_hash_case(c, &usual, 10, &other);
    fedisableexcept(FE_ALL_EXCEPT);
    ck_assert(plain.answers == other.answers && plain.content == other.content);
#endif
}
END_TEST

Suite *test_suite(void)
{
    Suite *suite = suite_create("fp_env");
    TCase *tests = tcase_create("environments");
    tcase_set_timeout(tests, 600);
    tcase_add_loop_test(tests, the_callers_environment_changes_no_result_and_stays, 0,
                        stiff_case_count);
    tcase_add_loop_test(tests, traps_of_the_caller_are_not_sprung, 0, 12);
    suite_add_tcase(suite, tests);
    return suite;
}
