#include "check_main.h"

#include "known_leaks.h"
#include "scratch.h"

char **test_arguments;

int main(int argc, char **argv)
{
    (void)argc;
    test_arguments = argv + 1;
    SRunner *runner = srunner_create(test_suite());
    scratch_enter(); /* in the parent process, which knows the folder to remove */
    srunner_run_all(runner, CK_ENV);
    int failed = srunner_ntests_failed(runner);
    srunner_free(runner);
    scratch_end();
    return failed ? 1 : 0;
}
