/* The command line: `ebpo COMMAND ...`. One table of commands, one cmd_*.c for each. */
#include <errno.h>
#include <fenv.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "command.h"
#include "signals.h"
#include "words.h"

static const command *const commands[] = { &command_convert, &command_check,    &command_info,
                                           &command_levels,  &command_view,     &command_extract,
                                           &command_export,  &command_subset,   &command_fetch,
                                           &command_measure, &command_render,   &command_verify,
                                           &command_inside,  &command_distance, &command_ray,
                                           &command_box,     &command_bench,    &command_report };
enum { COMMANDS = sizeof commands / sizeof *commands };

int command_failed(const char *name, const ebpo_error *error)
{
    fprintf(stderr, "ebpo %s: %s\n", name,
            error->message[0] ? error->message : ebpo_status_name(error->status));
    if (error->status == EBPO_E_ARGUMENT)
        return EXIT_USAGE;
    return error->status == EBPO_E_NOT_SOLID ? EXIT_NOT_SOLID : EXIT_FAILED;
}

bool command_same_file(const char *a, const char *b)
{
    struct stat sa, sb;
    return !ebpo_is_url(a) && stat(a, &sa) == 0 && stat(b, &sb) == 0 && sa.st_dev == sb.st_dev &&
           sa.st_ino == sb.st_ino;
}

int command_is_hdf5(const char *name, const char *path)
{
    if (ebpo_is_url(path))
        return 1; /* opening it will tell */
    static const char signature[8] = "\211HDF\r\n\032\n";
    char head[8] = "";
    struct stat st;
    FILE *f =
        stat(path, &st) == 0 && S_ISDIR(st.st_mode) ? (errno = EISDIR, NULL) : fopen(path, "rb");
    if (!f) {
        fprintf(stderr, "ebpo %s: %s: cannot be opened: %s\n", name, path, strerror(errno));
        return -1;
    }
    size_t got = fread(head, 1, sizeof head, f);
    fclose(f);
    return got == sizeof head && memcmp(head, signature, sizeof head) == 0;
}

bool command_wants_hdf5(const char *name, const char *path)
{
    int is_hdf5 = command_is_hdf5(name, path);
    if (is_hdf5 == 0)
        fprintf(stderr,
                "ebpo %s: %s: is not an .ebpo.h5 file; make one of a mesh with 'ebpo convert'\n",
                name, path);
    return is_hdf5 > 0;
}

bool command_has_level(const char *name, const ebpo_info *info, int64_t level)
{
    if (level < info->level_count)
        return true;
    fprintf(stderr, "ebpo %s: there is no level %d; this file has levels 0 to %d\n", name,
            (int)level, info->level_count - 1);
    return false;
}

bool command_flush(const char *name)
{
    static bool said;
    errno = 0;
    if (fflush(stdout) == 0 && !ferror(stdout))
        return true;
    if (!said)
        fprintf(stderr, "ebpo%s%s: standard output: %s\n", name ? " " : "", name ? name : "",
                errno ? strerror(errno) : "could not be written");
    said = true;
    return false;
}

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
                 "as trees of convex "
                 "envelopes.\n\n"
                 "commands:\n");
    for (int i = 0; i < COMMANDS; i++)
        fprintf(out, "  %-10s %s\n", commands[i]->spec->command, commands[i]->spec->summary);
    fprintf(out, "  %-10s %s\n", "help", "what a command does and its options: ebpo help COMMAND");
    fprintf(out, "\n  --version  the version, and end\n"
                 "\nexit codes: 0 fine, 1 data or input/output, 2 usage, 3 not a solid where one "
                 "is required\n");
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
                "ebpo help: '%s' is one operand too many; expected: [COMMAND]; try 'ebpo help'\n",
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

static int dispatch(int argc, char **argv)
{
    if (argc < 2) {
        usage(stderr);
        return EXIT_USAGE;
    }
    const char *name = argv[1];
    if (strcmp(name, "--version") == 0 || strcmp(name, "-V") == 0) {
        char format[32];
        printf("ebpo %s, format %s\n", ebpo_version(),
               words_format(format, sizeof format, EBPO_FORMAT_MAJOR, EBPO_FORMAT_MINOR));
        return EXIT_FINE;
    }
    if (strcmp(name, "help") == 0 || strcmp(name, "--help") == 0 || strcmp(name, "-h") == 0)
        return help(argc, argv);
    const command *c = find(name);
    return c ? c->run(argc - 1, argv + 1) : unknown_command(name);
}

int main(int argc, char **argv)
{
    /* whatever a preloaded library has set: numbers are parsed and printed here, too */
    fesetenv(FE_DFL_ENV);
    signals_install();
    int code = dispatch(argc, argv);
    const command *c = argc > 1 ? find(argv[1]) : NULL;
    if (!command_flush(c ? c->spec->command : NULL) && code == EXIT_FINE)
        code = EXIT_FAILED;
    /* libhdf5 1.10 crashes in its exit handler after a file that could not be written; nothing is
     * left for it to do. */
    if (code == EXIT_FAILED)
        _exit(code);
    return code;
}
