/* Replaces the operand "-" by a temporary file, which is copied from standard input or to standard
 * output. */
#include "cli/standard_files.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/signals.h"

enum { PATH_BYTES = 4096, BUFFER_BYTES = 1 << 16 };

/* Names of temporary files, which a signal handler also reads; "": the file does not exist. */
static char folder[PATH_BYTES], input[PATH_BYTES], output[PATH_BYTES];
static int saved_stdout = -1; /* copy of standard output while it is redirected */

/* Occupies those of the descriptors 0 to 2 that are closed. A file that is opened gets the lowest
 * free descriptor. So if descriptor 1 were free, a file could get it, and text for standard output
 * would go into this file. Descriptor 0 gets a file that cannot be read; descriptors 1 and 2 get
 * files that cannot be written. So the use of a descriptor fails as for a closed stream (EBADF). */
bool standard_files_occupy(void)
{
    for (int fd = STDIN_FILENO; fd <= STDERR_FILENO; fd++) {
        if (fcntl(fd, F_GETFD) >= 0)
            continue;
        int opened = open("/dev/null", fd == STDIN_FILENO ? O_WRONLY : O_RDONLY);
        if (opened < 0) /* there may be no /dev */
            opened = open("/", O_RDONLY | O_DIRECTORY);
        if (opened != fd)
            return false;
    }
    return true;
}

static void clean_up(void)
{
    if (*input)
        unlink(input);
    if (*output)
        unlink(output);
    if (*folder)
        rmdir(folder);
}

/* Reports an error: what failed, the reason from errno, and what to do (`remedy`; NULL: nothing).
 * Returns EXIT_FAILED. */
static int fail_stream(const char *command, const char *what, const char *remedy)
{
    fprintf(stderr, "ebpo %s: %s: %s%s%s\n", command, what, strerror(errno), remedy ? "; " : "",
            remedy ? remedy : "");
    return EXIT_FAILED;
}

static bool copy_stream(int from, int to)
{
    static char buffer[BUFFER_BYTES];
    for (;;) {
        ssize_t read_bytes = read(from, buffer, sizeof buffer);
        if (read_bytes == 0)
            return true;
        if (read_bytes < 0 && errno == EINTR)
            continue;
        for (ssize_t at = 0, put; read_bytes < 0 || at < read_bytes; at += put) {
            put = read_bytes < 0 ? -1 : write(to, buffer + at, (size_t)(read_bytes - at));
            if (put < 0 && (read_bytes < 0 || errno != EINTR))
                return false;
            put = put < 0 ? 0 : put;
        }
    }
}

static int make_folder(const char *command)
{
    const char *where = getenv("TMPDIR");
    if (*folder)
        return EXIT_OK;
    char made[PATH_BYTES - 32];
    int length =
        snprintf(made, sizeof made, "%s/ebpo-XXXXXX", where && *where ? where : "/var/tmp");
    if (length >= (int)sizeof made || !mkdtemp(made))
        return fail_stream(command, "cannot create a temporary folder",
                           "set TMPDIR to a writable folder");
    snprintf(folder, sizeof folder, "%s", made);
    signals_set_scratch_cleanup(clean_up);
    return EXIT_OK;
}

static int copy_input(const char *command, const char **operand)
{
    if (*input)
        return command_usage(command, "standard input can be read only once");
    int code = make_folder(command);
    if (code != EXIT_OK)
        return code;
    snprintf(input, sizeof input, "%.*s/standard-input", PATH_BYTES - 32, folder);
    int to = open(input, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    bool success = to >= 0 && copy_stream(STDIN_FILENO, to);
    if (to >= 0 && close(to) != 0)
        success = false;
    *operand = input;
    return success ? EXIT_OK
                   : fail_stream(command, "cannot copy standard input to a temporary file", NULL);
}

static int redirect_output(const char *command, const char **operand)
{
    if (isatty(STDOUT_FILENO))
        return command_usage(command, "standard output is a terminal; give a file name");
    int code = make_folder(command);
    if (code != EXIT_OK)
        return code;
    snprintf(output, sizeof output, "%.*s/standard-output", PATH_BYTES - 32, folder);
    fflush(stdout);
    saved_stdout = fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 3);
    if (saved_stdout < 0 || dup2(STDERR_FILENO, STDOUT_FILENO) < 0)
        return fail_stream(command, "standard output", NULL);
    *operand = output;
    return EXIT_OK;
}

/* Returns true for a pipe or device with a name, such as /dev/stdin or <(...) of a shell. Such a
 * file can be read only once. */
static bool is_pipe(const char *path)
{
    struct stat st;
    return stat(path, &st) == 0 && !S_ISREG(st.st_mode) && !S_ISDIR(st.st_mode);
}

int standard_files_begin(const arg_spec *spec, const char *operand[ARGS_OPERANDS_MAX])
{
    int code = EXIT_OK;
    for (int i = 0; i < ARGS_OPERANDS_MAX && operand[i] && code == EXIT_OK; i++) {
        char stream = args_dash(spec, i); /* "-" means: 'i' standard input, 'o' standard output */
        if ((stream == 'i' || stream == 'o') && is_pipe(operand[i])) {
            fprintf(stderr, "ebpo %s: %s: is a pipe or device; give '-' instead, and %s\n",
                    spec->command, operand[i],
                    stream == 'i' ? "redirect the mesh to standard input"
                                  : "redirect standard output");
            code = EXIT_FAILED;
        }
        if (strcmp(operand[i], "-") != 0)
            continue;
        if (stream == 'i')
            code = copy_input(spec->command, &operand[i]);
        else if (stream == 'o')
            code = redirect_output(spec->command, &operand[i]);
    }
    if (code != EXIT_OK)
        clean_up();
    return code;
}

const char *standard_files_shown(const char *path)
{
    return path == output ? "standard-output" : path == input ? "standard-input" : path;
}

int standard_files_end(const arg_spec *spec, int code)
{
    if (saved_stdout >= 0) {
        fflush(stdout);
        int from = code == EXIT_OK ? open(output, O_RDONLY | O_CLOEXEC) : -1;
        if (code == EXIT_OK && (from < 0 || !copy_stream(from, saved_stdout)))
            code = fail_stream(spec->command, "standard output", NULL);
        if (from >= 0)
            close(from);
        dup2(saved_stdout, STDOUT_FILENO);
        close(saved_stdout);
    }
    clean_up();
    return code;
}
