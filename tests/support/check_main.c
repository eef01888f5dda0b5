#include "check_main.h"

#include "known_leaks.h"
#include "scratch.h"

char **test_arguments;

int main(int argc, char **argv)
{
    (void)argc;
    test_arguments = argv + 1;
    SRunner *runner = srunner_create(test_suite());
    scratch_enter(); /* here, not in a child process, so that the folder to remove is known */
    srunner_run_all(runner, CK_ENV);
    int failed = srunner_ntests_failed(runner);
    srunner_free(runner);
    scratch_end();
    return failed ? 1 : 0;
}
