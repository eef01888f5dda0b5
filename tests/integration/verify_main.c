/* verify_main FILE...: verifies every file. Needs only the reading library, so it also runs on
 * systems for which the command cannot be linked (docs/develop/portability.md). */
#include <ebpo/ebpo.h>
#include <stdio.h>

int main(int argc, char **argv)
{
    int bad = 0;
    for (int i = 1; i < argc; i++) {
        ebpo_error error = EBPO_ERROR_INIT;
        ebpo_file *file = NULL;
        ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
        if (ebpo_open(argv[i], &file, &error) != EBPO_OK ||
            ebpo_verify(file, NULL, &report, &error) != EBPO_OK) {
            printf("%s\n", error.message);
            bad++;
        } else if (report.violations) {
            printf("%s: violations: %llu\n", argv[i], (unsigned long long)report.violations);
            bad++;
        }
        ebpo_close(file);
    }
    printf("%d files, %d of them bad\n", argc - 1, bad);
    return bad != 0;
}
