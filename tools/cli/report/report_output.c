#include "cli/report/report_output.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/signals.h"
#include "cli/words.h"

static char temporary_folder[4096]; /* for the signal handler */

static int fail_output(int code, const char *path, const char *what)
{
    fprintf(stderr, "ebpo report: %s: %s\n", path, what);
    return code;
}

static bool is_named(const char *name, const char *const *names)
{
    for (; *names; names++)
        if (strcmp(name, *names) == 0)
            return true;
    return false;
}

static bool is_dot(const char *name) { return strcmp(name, ".") == 0 || strcmp(name, "..") == 0; }

/* Files of a report besides SELECTION.ebpo.h5 for each selection. */
static const char *const fixed_names[] = { "report.csv", "report.json", "report.html", NULL };
#define MODEL_ENDING ".ebpo.h5"

/* Returns true for names such as "inherit.ebpo.h5", "kmedoids-10%.ebpo.h5" and
 * "kmedoids-K0.5%.ebpo.h5". */
static bool is_selection_file(const char *name)
{
    size_t length = strlen(name), ending = strlen(MODEL_ENDING);
    if (length < ending || strcmp(name + length - ending, MODEL_ENDING) != 0)
        return false;
    for (int i = 0; selection_words[i]; i++) {
        size_t word = strlen(selection_words[i]), rest = length - ending;
        if (strncmp(name, selection_words[i], word) == 0 &&
            (word == rest ||
             (name[word] == '-' && word + 1 + strspn(name + word + 1, "K0123456789.e+-%") >= rest)))
            return true;
    }
    return false;
}

/* Returns true for the file names of a report; other files belong to the user. */
static bool is_report_file(const char *folder, const char *name)
{
    char path[8192];
    struct stat st;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return (is_named(name, fixed_names) || is_selection_file(name)) && lstat(path, &st) == 0 &&
           S_ISREG(st.st_mode);
}

static bool is_operand(const char *folder, const char *name, const char *const *operand)
{
    char path[8192];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    for (; *operand; operand++)
        if (command_same_file(path, *operand))
            return true;
    return false;
}

/* Checks the existing folder, which would be deleted: it must be a report, and no operand may be in
 * it. */
static int check_folder(const char *place, DIR *folder, const char *const *operand)
{
    char text[600];
    bool empty = true, report = false;
    for (struct dirent *entry; (entry = readdir(folder));) {
        const char *name = entry->d_name;
        if (is_dot(name))
            continue;
        empty = false;
        report = report || strcmp(name, "report.json") == 0;
        if (is_operand(place, name, operand)) {
            snprintf(text, sizeof text,
                     "is a folder with an input in it, '%.255s', and would be replaced; give "
                     "another folder with -o",
                     name);
            return fail_output(EXIT_USAGE, place, text);
        }
        if (!is_report_file(place, name)) {
            snprintf(text, sizeof text,
                     "is a folder with a file that is not of a report, '%.255s'; give another "
                     "folder with -o",
                     name);
            return fail_output(EXIT_FAILED, place, text);
        }
    }
    if (!empty && !report)
        return fail_output(
            EXIT_FAILED, place,
            "is a folder without report.json, so it may not be a report; give another folder with "
            "-o");
    return EXIT_OK;
}

static int check_place(const char *place, const char *const *operand)
{
    struct stat st;
    if (lstat(place, &st) != 0)
        return errno == ENOENT ? EXIT_OK : fail_output(EXIT_FAILED, place, strerror(errno));
    DIR *folder = S_ISDIR(st.st_mode) ? opendir(place) : NULL;
    if (!folder)
        return fail_output(EXIT_FAILED, place,
                           "exists and is not a folder; give another name with -o");
    int code = check_folder(place, folder, operand);
    closedir(folder);
    return code;
}

/* Removes the files, and the folder if it is then empty. */
static bool remove_folder(const char *folder, bool report_files_only)
{
    char path[8192];
    DIR *d = opendir(folder);
    if (!d)
        return false;
    for (struct dirent *entry; (entry = readdir(d));)
        if (!is_dot(entry->d_name) &&
            (!report_files_only || is_report_file(folder, entry->d_name))) {
            snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
            unlink(path);
        }
    closedir(d);
    return rmdir(folder) == 0;
}

/* Removes a file of the temporary folder. Called in a signal handler, so it uses only
 * async-signal-safe calls, and does not list the folder. */
static void abandon_file(const char *stem, const char *ending)
{
    size_t length = strlen(temporary_folder);
    temporary_folder[length] = '/';
    strcpy(temporary_folder + length + 1, stem);
    strcat(temporary_folder, ending);
    unlink(temporary_folder);
    temporary_folder[length] = 0;
}

static void abandon_files(void)
{
    if (!temporary_folder[0])
        return;
    for (int i = 0; fixed_names[i]; i++)
        abandon_file(fixed_names[i], "");
    for (int i = 0; selection_words[i]; i++)
        abandon_file(selection_words[i], MODEL_ENDING);
    abandon_file("target", MODEL_ENDING); /* a trial of report_targets.c */
    rmdir(temporary_folder);
}

/* If there is not enough memory to list the folder, removes the files of a report by their names.
 */
void output_remove(const char *folder)
{
    if (folder[0] && !remove_folder(folder, false))
        abandon_files();
    temporary_folder[0] = 0;
}

/* Makes a folder with a hidden name: the library refuses the name of an existing report. */
static bool make_folder(const char *place, size_t length, char *folder, size_t capacity)
{
    char *making, hidden[4200];
    size_t name = length;
    ebpo_error error = EBPO_ERROR_INIT;
    while (name && place[name - 1] != '/')
        name--;
    snprintf(hidden, sizeof hidden, "%.*s.%.*s.new", (int)name, place, (int)(length - name),
             place + name);
    if (ebpo_folder_begin(hidden, &making, &error) != EBPO_OK) {
        const char *cause = strncmp(error.message, hidden, strlen(hidden)) == 0
                                ? error.message + strlen(hidden) + 2 /* and ": " */
                                : error.message;
        return fail_output(EXIT_FAILED, access(hidden, F_OK) == 0 ? hidden : place, cause) ==
               EXIT_OK;
    }
    bool fits = strlen(making) < capacity && strlen(making) < sizeof temporary_folder - 300;
    if (fits)
        memcpy(folder, making, strlen(making) + 1);
    else
        rmdir(making);
    free(making);
    return fits || fail_output(EXIT_USAGE, place, "the name is too long") == EXIT_OK;
}

int output_begin(const char *place, const char *const *operand, char *folder, size_t capacity)
{
    size_t length = strlen(place);
    while (length > 1 && place[length - 1] == '/')
        length--;
    folder[0] = 0;
    if (length + 80 > capacity || length + 400 > sizeof temporary_folder)
        return fail_output(EXIT_USAGE, place, "the name is too long");
    int code = check_place(place, operand);
    if (code != EXIT_OK)
        return code;
    if (!make_folder(place, length, folder, capacity))
        return EXIT_FAILED;
    chmod(folder, 0755);
    memcpy(temporary_folder, folder, strlen(folder) + 1);
    signals_also(abandon_files);
    return EXIT_OK;
}

/* Removes the replaced report, and reports files that the user has added to it since it was
 * checked. */
static bool report_other_files(const char *older)
{
    if (!remove_folder(older, true))
        fprintf(stderr, "ebpo report: warning: other files of the replaced report are now in %s\n",
                older);
    return true;
}

bool output_commit(const char *place, const char *folder)
{
    char older[8192], target[4200];
    bool moved = false;
    size_t length = strlen(place);
    while (length > 1 && place[length - 1] == '/')
        length--;
    snprintf(target, sizeof target, "%.*s", (int)length, place);
    /* Replaces atomically, so that a report always exists; some file systems cannot. */
    errno = 0;
#ifdef EBPO_HAVE_RENAMEAT2
    if (renameat2(AT_FDCWD, folder, AT_FDCWD, target, RENAME_EXCHANGE) == 0) {
        temporary_folder[0] = 0;
        return report_other_files(folder);
    }
#endif
    snprintf(older, sizeof older, "%s.old", folder);
    moved = errno != ENOENT && rename(target, older) == 0;
    if (rename(folder, target) != 0) {
        fail_output(EXIT_FAILED, place, strerror(errno));
        if (moved && rename(older, target) != 0)
            fprintf(stderr, "ebpo report: the replaced report is now %s\n", older);
        return false;
    }
    temporary_folder[0] = 0;
    return !moved || report_other_files(older);
}
