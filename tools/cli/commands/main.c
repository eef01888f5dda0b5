/* The command line: `ebpo COMMAND ...`. Each command is in a file cmd_NAME.c. */
#include <fenv.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "cli/command.h"
#include "cli/process_memory.h"
#include "cli/renamed.h"
#include "cli/signals.h"
#include "cli/standard_files.h"
#include "cli/words.h"
#include "cli/commands/commands.h"
#include "cli/commands/version_facts.h"
#include "ebpo_config.h"

/* The commands of one part of `ebpo help`. Builds without extras lack some of the commands. */
typedef struct command_group {
    const char *title;
    const command *const *commands; /* NULL after the last command; or NULL, if there are none */
    const char *extras; /* names of commands that this build lacks, separated by blanks; or NULL */
} command_group;

#define COMMAND_GROUP(title, list) { title, (const command *const[]){ list NULL }, NULL },
#define ABSENT_GROUP(title, names) { title, NULL, names },
#define COMMAND(name)              &command_##name,
static const command_group groups[] = { COMMAND_TABLE };
enum { GROUPS = sizeof groups / sizeof *groups };

static const command *find_command(const char *name)
{
    for (int g = 0; g < GROUPS; g++)
        for (const command *const *c = groups[g].commands; c && *c; c++)
            if (strcmp((*c)->spec->command, name) == 0)
                return *c;
    return NULL;
}

static void print_commands(FILE *out)
{
    for (int g = 0; g < GROUPS; g++) {
        if (!groups[g].commands)
            continue;
        fprintf(out, "\n%s\n", groups[g].title);
        for (const command *const *c = groups[g].commands; *c; c++)
            fprintf(out, "  %-10s %s\n", (*c)->spec->command, (*c)->spec->summary);
    }
}

static void print_usage(FILE *out)
{
    fprintf(out, "usage: ebpo COMMAND [options] ...\n\nEBP-Octree in HDF5: closed triangle meshes "
                 "as trees of convex envelopes.\n");
    print_commands(out);
    fprintf(out, "\n  %-10s %s\n", "help", "describe a command and its options: ebpo help COMMAND");
    fprintf(out, "  %-10s %s\n", "", "describe the options for URLs: ebpo help remote");
    fputs("  --version  print the version and exit; with --verbose, also the paths of the\n"
          "             program, its library and the HDF5 plugin\n\n"
          "exit codes\n"
          "  0  success\n"
          "  1  bad data, or an input or output error\n"
          "  2  wrong usage\n"
          "  3  not a solid where one is required\n"
          "  4  repack: the content would differ; recover: the content differs; paint: the\n"
          "     paint belongs to another model; catalogue: files were omitted\n"
          "  5  boolean: the result is empty\n",
          out);
}

/* Returns true if `name` is one of the words of `names`. */
static bool is_among(const char *names, const char *name)
{
    size_t length = strlen(name);
    for (; *names; names += strcspn(names, " "), names += strspn(names, " "))
        if (strcspn(names, " ") == length && strncmp(names, name, length) == 0)
            return true;
    return false;
}

static int unknown_command(const char *name)
{
    const char *new_name = renamed_command(name);
    if (new_name) {
        fprintf(stderr, "ebpo: the command '%s' is now '%s'; try 'ebpo help %s'\n", name, new_name,
                new_name);
        return EXIT_USAGE;
    }
    for (int g = 0; g < GROUPS; g++)
        if (groups[g].extras && is_among(groups[g].extras, name)) {
            fprintf(stderr,
                    "ebpo: this program was built without '%s' (-Dextras=disabled); build it with "
                    "-Dextras=enabled\n",
                    name);
            return EXIT_USAGE;
        }
    fprintf(stderr, "ebpo: unknown command '%s'; try 'ebpo help'\n", name);
    return EXIT_USAGE;
}

/* Prints the options for URLs, which all commands that read files share. */
static void print_remote(void)
{
    printf("A command that reads an .ebpo.h5 file also accepts its URL, http:// or https://.\n"
           "Options for URLs:\n\n");
    args_help_page(command_info.spec, "remote");
    printf("\nSee also ebpo-remote(7).\n");
}

static int print_help(int argc, char **argv)
{
    if (argc > 3) {
        fprintf(stderr,
                "ebpo help: unexpected argument '%s'; expected: [COMMAND]; try 'ebpo help'\n",
                argv[3]);
        return EXIT_USAGE;
    }
    if (argc < 3) {
        print_usage(stdout);
        return EXIT_OK;
    }
    if (strcmp(argv[2], "remote") == 0) {
        print_remote();
        return EXIT_OK;
    }
    const command *c = find_command(argv[2]);
    if (!c)
        return unknown_command(argv[2]);
    args_help(c->spec);
    return EXIT_OK;
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

/* Runs the command; on another thread if RLIMIT_STACK gives the main thread a stack smaller than
 * COMMAND_STACK. Returns the exit code. */
static int run_with_stack(command_call *call)
{
    struct rlimit stack;
    pthread_t thread;
    bool has_small_stack = getrlimit(RLIMIT_STACK, &stack) == 0 && stack.rlim_cur < COMMAND_STACK;
    if (has_small_stack && command_thread(&thread, run_command, call) == 0)
        pthread_join(thread, NULL);
    else
        run_command(call);
    return call->code;
}

static int run_parsed(const command *c, int argc, char **argv)
{
    const char *operand[ARGS_OPERANDS_MAX + 1];
    void *values = malloc(c->size);
    if (!values)
        return command_no_memory(c->spec->command);
    memcpy(values, c->standard, c->size);
    arg_result parsed = args_parse(c->spec, argc, argv, values, operand);
    int code = parsed == ARGS_WRONG ? EXIT_USAGE : EXIT_OK;
    if (parsed == ARGS_RUN && (code = standard_files_begin(c->spec, operand)) == EXIT_OK)
        code =
            standard_files_end(c->spec, run_with_stack(&(command_call){ c, values, operand, 0 }));
    free(values);
    return code;
}

static int dispatch_command(int argc, char **argv)
{
    if (argc < 2) {
        print_usage(stderr);
        return EXIT_USAGE;
    }
    const char *name = argv[1];
    if (strcmp(name, "--version") == 0 || strcmp(name, "-V") == 0)
        return version_report(argv[2]);
    if (strcmp(name, "help") == 0 || strcmp(name, "--help") == 0 || strcmp(name, "-h") == 0)
        return print_help(argc, argv);
    const command *c = find_command(name);
    return c ? run_parsed(c, argc - 1, argv + 1) : unknown_command(name);
}

int main(int argc, char **argv)
{
    if (!standard_files_occupy())
        return EXIT_FAILED;
    /* A preloaded library may have changed the floating-point environment, in which this program
     * parses and prints numbers. */
    fesetenv(FE_DFL_ENV);
    signals_install();
    words_init();
    process_memory_default();
    int code = dispatch_command(argc, argv);
    const command *c = argc > 1 ? find_command(argv[1]) : NULL;
    if (!command_flush(c ? c->spec->command : NULL) && code == EXIT_OK)
        code = EXIT_FAILED;
    return code;
}
