/* The command line: `ebpo COMMAND ...`. One table of commands, one cmd_*.c for each. */
#include <fenv.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "cli/command.h"
#include "cli/process_memory.h"
#include "cli/signals.h"
#include "cli/standard_files.h"
#include "cli/words.h"
#include "cli/commands/commands.h"
#include "cli/commands/version_facts.h"

static const command *const commands[] = {
    &command_convert,  &command_check,    &command_info,    &command_levels, &command_view,
    &command_extract,  &command_export,   &command_subset,  &command_repack, &command_repair,
    &command_fetch,    &command_measure,  &command_render,  &command_verify, &command_inside,
    &command_distance, &command_ray,      &command_box,     &command_bench,  &command_report,
    &command_scene,    &command_boolean,  &command_collide, &command_map,    &command_touch,
    &command_paint,    &command_catalogue
};
enum { COMMANDS = sizeof commands / sizeof *commands };

static const command *find(const char *name)
{
    for (int i = 0; i < COMMANDS; i++)
        if (strcmp(commands[i]->spec->command, name) == 0)
            return commands[i];
    return NULL;
}

static void usage(FILE *out)
{
    fprintf(out, "usage: ebpo COMMAND [options] ...\n\nEBP-Octree in HDF5: closed triangle meshes "
                 "as trees of convex envelopes.\n\ncommands:\n");
    for (int i = 0; i < COMMANDS; i++)
        fprintf(out, "  %-10s %s\n", commands[i]->spec->command, commands[i]->spec->summary);
    fprintf(out, "  %-10s %s\n", "help", "describe a command and its options: ebpo help COMMAND");
    fprintf(out,
            "\n  --version  print the version and exit; with --verbose, where the program, its "
            "library and the HDF5 plugin are\n\nexit codes: 0 success, 1 bad data "
            "or input/output, 2 wrong usage, 3 not a solid where one is required, 4 (repack) "
            "the content "
            "would differ, (repair) it does, (paint) the model is another one, (catalogue) files "
            "were left out\n");
}

static int unknown_command(const char *name)
{
    fprintf(stderr, "ebpo: unknown command '%s'; try 'ebpo help'\n", name);
    return EXIT_USAGE;
}

static int help(int argc, char **argv)
{
    if (argc > 3) {
        fprintf(stderr,
                "ebpo help: unexpected argument '%s'; expected: [COMMAND]; try 'ebpo help'\n",
                argv[3]);
        return EXIT_USAGE;
    }
    if (argc < 3) {
        usage(stdout);
        return EXIT_FINE;
    }
    const command *c = find(argv[2]);
    if (!c)
        return unknown_command(argv[2]);
    args_help(c->spec);
    return EXIT_FINE;
}

typedef struct command_call {
    const command *c;
    void *values;
    const char **operand;
    int code;
} command_call;

static void *run_command(void *user)
{
    command_call *call = user;
    call->code = call->c->run(call->values, call->operand);
    return NULL;
}

/* Runs the command on a thread with enough stack, where RLIMIT_STACK gives the main thread less. */
static int run_with_stack(command_call *call)
{
    struct rlimit stack;
    pthread_t thread;
    bool little = getrlimit(RLIMIT_STACK, &stack) == 0 && stack.rlim_cur < COMMAND_STACK;
    if (little && command_thread(&thread, run_command, call) == 0)
        pthread_join(thread, NULL);
    else
        run_command(call);
    return call->code;
}

static int run(const command *c, int argc, char **argv)
{
    const char *operand[ARGS_OPERANDS_MAX];
    void *values = malloc(c->size);
    if (!values)
        return command_no_memory(c->spec->command);
    memcpy(values, c->usual, c->size);
    arg_result parsed = args_parse(c->spec, argc, argv, values, operand);
    int code = parsed == ARGS_WRONG ? EXIT_USAGE : EXIT_FINE;
    if (parsed == ARGS_RUN && (code = standard_files_begin(c->spec, operand)) == EXIT_FINE)
        code =
            standard_files_end(c->spec, run_with_stack(&(command_call){ c, values, operand, 0 }));
    free(values);
    return code;
}

static int dispatch(int argc, char **argv)
{
    if (argc < 2) {
        usage(stderr);
        return EXIT_USAGE;
    }
    const char *name = argv[1];
    if (strcmp(name, "--version") == 0 || strcmp(name, "-V") == 0)
        return version_tell(argv[2]);
    if (strcmp(name, "help") == 0 || strcmp(name, "--help") == 0 || strcmp(name, "-h") == 0)
        return help(argc, argv);
    const command *c = find(name);
    return c ? run(c, argc - 1, argv + 1) : unknown_command(name);
}

int main(int argc, char **argv)
{
    if (!standard_files_occupy())
        return EXIT_FAILED;
    /* whatever a preloaded library has set: numbers are parsed and printed here, too */
    fesetenv(FE_DFL_ENV);
    signals_install();
    words_init();
    process_memory_usual();
    int code = dispatch(argc, argv);
    const command *c = argc > 1 ? find(argv[1]) : NULL;
    if (!command_flush(c ? c->spec->command : NULL) && code == EXIT_FINE)
        code = EXIT_FAILED;
    return code;
}
