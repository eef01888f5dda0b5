/* Writes a report to a temporary folder. The complete folder replaces `place`, the folder of the
 * report. An existing folder is replaced only if all its files have names of files of a report. */
#include "cli/report/report_output.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/signals.h"
#include "cli/words.h"

/* Data for the signal handler: the temporary folder ("": none), and the names of the model files
 * that may be in this folder. */
static char temporary_folder[4096];
static char model_names[OUTPUT_MODELS_MAX][OUTPUT_NAME_MAX];
static volatile sig_atomic_t model_count;

/* Reports "PATH: WHAT". Returns `code`. */
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
        size_t word = strlen(selection_words[i]), stem = length - ending;
        if (strncmp(name, selection_words[i], word) == 0 &&
            (word == stem ||
             (name[word] == '-' && word + 1 + strspn(name + word + 1, "K0123456789.e+-%") >= stem)))
            return true;
    }
    return false;
}

/* Returns true for a regular file with a name of a report. Other files belong to the user. */
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

/* Checks the existing folder `place`, which the new report will replace. All its files must have
 * names of a report, one of them must be report.json, and no operand may be in the folder. */
static int check_folder(const char *place, DIR *folder, const char *const *operand)
{
    char text[600];
    bool empty = true, has_report = false;
    for (struct dirent *entry; (entry = readdir(folder));) {
        const char *name = entry->d_name;
        if (is_dot(name))
            continue;
        empty = false;
        has_report = has_report || strcmp(name, "report.json") == 0;
        if (is_operand(place, name, operand)) {
            snprintf(text, sizeof text,
                     "is a folder with an input in it, '%.255s', and would be replaced; give "
                     "another folder with -o",
                     name);
            return fail_output(EXIT_USAGE, place, text);
        }
        if (!is_report_file(place, name)) {
            snprintf(text, sizeof text,
                     "is a folder with a file that does not belong to a report, '%.255s'; give "
                     "another folder with -o",
                     name);
            return fail_output(EXIT_FAILED, place, text);
        }
    }
    if (!empty && !has_report)
        return fail_output(
            EXIT_FAILED, place,
            "is a folder without report.json, so it may not be a report; give another folder with "
            "-o");
    return EXIT_OK;
}

/* Checks that `place` does not exist, or is a report that may be replaced. Returns an exit code. */
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

/* Removes the files of the folder; if `report_files_only`, only files with names of a report. Then
 * removes the folder if it is empty. Returns true if the folder was removed. */
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
static void abandon_file(const char *name)
{
    size_t length = strlen(temporary_folder);
    temporary_folder[length] = '/';
    strcpy(temporary_folder + length + 1, name);
    unlink(temporary_folder);
    temporary_folder[length] = 0;
}

/* Removes the temporary folder and its files. Called in a signal handler. */
static void abandon_files(void)
{
    if (!temporary_folder[0])
        return;
    for (int i = 0; fixed_names[i]; i++)
        abandon_file(fixed_names[i]);
    for (int i = 0; i < model_count; i++)
        abandon_file(model_names[i]);
    rmdir(temporary_folder);
}

void output_add_model(const char *folder, const char *stem, char *path, size_t capacity)
{
    char name[OUTPUT_NAME_MAX];
    snprintf(name, sizeof name, "%s" MODEL_ENDING, stem);
    snprintf(path, capacity, "%s/%s", folder, name);
    for (int i = 0; i < model_count; i++)
        if (strcmp(model_names[i], name) == 0)
            return;
    if (model_count < OUTPUT_MODELS_MAX) {
        memcpy(model_names[model_count], name, strlen(name) + 1);
        model_count++;
    }
}

/* Removes the folder with all its files. If there is not enough memory to list the folder, removes
 * the files with known names. */
void output_remove(const char *folder)
{
    if (folder[0] && !remove_folder(folder, false))
        abandon_files();
    temporary_folder[0] = 0;
}

/* Makes the temporary folder, and writes its path to `folder`. `place` (with `length` bytes) may be
 * an existing report, but ebpo_folder_begin fails if its argument exists. So the argument is a
 * hidden name beside `place`, .NAME.new. Returns false after a report on standard error. */
static bool make_folder(const char *place, size_t length, char *folder, size_t capacity)
{
    char *made, hidden[4200];
    size_t name = length;
    ebpo_error error = EBPO_ERROR_INIT;
    while (name && place[name - 1] != '/')
        name--;
    snprintf(hidden, sizeof hidden, "%.*s.%.*s.new", (int)name, place, (int)(length - name),
             place + name);
    if (ebpo_folder_begin(hidden, &made, &error) != EBPO_OK) {
        const char *cause = strncmp(error.message, hidden, strlen(hidden)) == 0
                                ? error.message + strlen(hidden) + 2 /* and ": " */
                                : error.message;
        return fail_output(EXIT_FAILED, access(hidden, F_OK) == 0 ? hidden : place, cause) ==
               EXIT_OK;
    }
    bool fits = strlen(made) < capacity && strlen(made) < sizeof temporary_folder - 300;
    if (fits)
        memcpy(folder, made, strlen(made) + 1);
    else
        rmdir(made);
    free(made);
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
    signals_set_cleanup(abandon_files);
    return EXIT_OK;
}

/* Removes the folder of the replaced report. Files that the user has added since check_folder are
 * kept, with a warning. Returns true. */
static bool remove_replaced(const char *replaced)
{
    if (!remove_folder(replaced, true))
        fprintf(stderr, "ebpo report: warning: other files of the replaced report are now in %s\n",
                replaced);
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
    /* Exchanges the folders atomically, so that a report always exists under this name. Some file
     * systems cannot exchange folders; then the old folder is renamed first, and the new one after
     * it. */
    errno = 0;
#ifdef EBPO_HAVE_RENAMEAT2
    if (renameat2(AT_FDCWD, folder, AT_FDCWD, target, RENAME_EXCHANGE) == 0) {
        temporary_folder[0] = 0;
        return remove_replaced(folder);
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
    return !moved || remove_replaced(older);
}
