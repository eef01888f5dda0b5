/* Runs the programs named on the command line, each the predicates built with other compiler flags:
 * all must print the same hash. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int read_hash(const char *program, char hash[32])
{
    char command[4096];
    if (snprintf(command, sizeof command, "'%s'", program) >= (int)sizeof command)
        return -1;
    FILE *pipe = popen(command, "r");
    if (!pipe)
        return -1;
    char *line = fgets(hash, 32, pipe);
    return pclose(pipe) == 0 && line ? 0 : -1;
}

int main(int argc, char **argv)
{
    char first[32], hash[32];
    if (argc < 3 || read_hash(argv[1], first) != 0) {
        fprintf(stderr, "usage: test_predicates_flags PROGRAM PROGRAM ...; the first must run\n");
        return EXIT_FAILURE;
    }
    for (int i = 2; i < argc; i++)
        if (read_hash(argv[i], hash) != 0 || strcmp(hash, first) != 0) {
            fprintf(stderr, "predicates_give_equal_results_for_all_flags: %s differs from %s\n",
                    argv[i], argv[1]);
            return EXIT_FAILURE;
        }
    printf("%d builds, hash %s", argc - 1, first);
    return EXIT_SUCCESS;
}
