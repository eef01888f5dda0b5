/* A caller's rounding mode, flushing of denormals and traps change no result, and are as they were
 * after each call. */
#include <fenv.h>
#include <stdlib.h>

#include "check_main.h"
#include "fp_hash.h"

static const fp_setting standard = { FE_TONEAREST, 0 };
static const fp_setting settings[] = {
    { FE_UPWARD, 0 },         { FE_DOWNWARD, 0 }, { FE_TOWARDZERO, 0 },
#if defined(__SSE2__)
    { FE_TONEAREST, 0x8040 }, /* flush to zero, denormals are zero */
    { FE_UPWARD, 0x8040 },
#endif
};
enum { SETTINGS = sizeof settings / sizeof *settings };

START_TEST(test_caller_fp_environment_is_kept)
{
    if (!ebpo_test_wanted(_i))
        return;
    const degenerate_case *c = &degenerate_cases[_i];
    fp_hashes plain, other;
    uint64_t queries = query_scaled(60);
    if (!fp_hash_takes(c))
        return;
    fp_hash_case(c, &standard, queries, &plain);
    ck_assert_msg(plain.kept, "%s: the default environment did not stay", c->name);
    for (int i = _i % SETTINGS; i < SETTINGS;
         i += SETTINGS) { /* each case in one environment: there are enough */
        fp_hash_case(c, &settings[i], queries, &other);
        ck_assert_msg(other.kept, "%s: environment %d did not stay", c->name, i);
        ck_assert_msg(plain.status == other.status, "%s: environment %d changes the status",
                      c->name, i);
        ck_assert_msg(plain.content == other.content, "%s: environment %d changes the content",
                      c->name, i);
        ck_assert_msg(plain.results == other.results, "%s: environment %d changes answers", c->name,
                      i);
    }
}
END_TEST

START_TEST(test_caller_fp_traps_are_not_raised)
{
#if defined(__GLIBC__) && defined(__SSE2__)
    fp_hashes plain, other;
    const degenerate_case *c = &degenerate_cases[_i];
    if (!fp_hash_takes(c))
        return;
    fp_hash_case(c, &standard, 10, &plain);
    /* The test's own arithmetic between the calls runs with them too: only invalid operations and
     * divisions by zero, which it does not make. */
    feclearexcept(FE_ALL_EXCEPT);
    feenableexcept(FE_INVALID | FE_DIVBYZERO);
    fp_hash_case(c, &standard, 10, &other);
    fedisableexcept(FE_ALL_EXCEPT);
    ck_assert(plain.results == other.results && plain.content == other.content);
#endif
}
END_TEST

Suite *test_suite(void)
{
    Suite *suite = suite_create("fp_env");
    TCase *tests = tcase_create("environments");
    tcase_set_timeout(tests, 600);
    tcase_add_loop_test(tests, test_caller_fp_environment_is_kept, 0, degenerate_case_count);
    tcase_add_loop_test(tests, test_caller_fp_traps_are_not_raised, 0, 12);
    suite_add_tcase(suite, tests);
    return suite;
}
