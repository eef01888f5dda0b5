/* ebpo fetch: fetches a file, or a part of it, from a web server. If the command is interrupted, it
 * keeps the fetched data in the folder OUT.part, and the next run resumes. */
#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/progress.h"
#include "cli/words.h"
#include "cli/commands/commands.h"
#include "cli/commands/subset_run.h"

#include "cli/options/fetch.inc"

/* --- the folder OUT.part: blocks as in the cache of the library (--http-cache) --- */

static const char BLOCK[] = ".ebpo-block", TEMPORARY[] = ".ebpo-part-";

static bool is_fetched_data(const char *name)
{
    size_t length = strlen(name), end = sizeof BLOCK - 1;
    return (length > end && strcmp(name + length - end, BLOCK) == 0) ||
           strncmp(name, TEMPORARY, sizeof TEMPORARY - 1) == 0;
}

/* Removes the fetched data, and then the folder if it is empty. */
static void remove_part(const char *folder)
{
    DIR *d = opendir(folder);
    if (!d)
        return;
    for (struct dirent *f; (f = readdir(d)) != NULL;)
        if (is_fetched_data(f->d_name))
            unlinkat(dirfd(d), f->d_name, 0);
    closedir(d);
    rmdir(folder);
}

/* --- progress: drawn by the thread of transfers, while the main thread waits --- */

typedef struct ticker {
    _Atomic bool active;       /* the line may be drawn */
    _Atomic bool shown;        /* the thread of transfers has drawn the line */
    _Atomic(ebpo_file *) file; /* NULL while the file is being opened */
    double last;               /* when the line was drawn last */
} ticker;

/* Prints the number of fetched bytes, at most five times a second. Called ten times a second during
 * transfers; returns false, so that transfers continue. */
static bool show_bytes(void *user)
{
    ticker *t = user;
    ebpo_http_stats s = EBPO_HTTP_STATS_INIT;
    ebpo_file *file = atomic_load(&t->file);
    double now = progress_now();
    char bytes[32], before[32];
    if (!t->active || now - t->last < 0.2 ||
        (file && ebpo_file_get_http_stats(file, &s) != EBPO_OK))
        return false;
    t->last = now;
    if (!file)
        fputs("\r\033[Kfetch: opening", stderr);
    else
        fprintf(stderr, "\r\033[Kfetch: %s in %" PRIu64 " requests",
                words_bytes(bytes, sizeof bytes, s.bytes), s.requests);
    if (s.cache_bytes)
        fprintf(stderr, ", %s fetched earlier", words_bytes(before, sizeof before, s.cache_bytes));
    fflush(stderr);
    t->shown = true;
    return false;
}

static void wipe_ticker(ticker *t)
{
    t->active = false;
    if (t->shown)
        fputs("\r\033[K", stderr);
    t->shown = false;
}

/* --- work --- */

/* Reports the data that was in the folder `part` when the file was opened. Returns true if some of
 * this data is usable. */
static bool report_resuming(const subset_values *v, ebpo_file *file, const char *url,
                            const char *part)
{
    ebpo_http_stats s = EBPO_HTTP_STATS_INIT;
    char bytes[32];
    if (ebpo_file_get_http_stats(file, &s) != EBPO_OK)
        return false;
    if (s.cache_others && !s.cache_held)
        fprintf(stderr,
                "ebpo fetch: %s: cannot resume: the file has changed on the server, or %s has data "
                "of another file, or of a run %s --box; fetching it from the beginning\n",
                remote_shown(url), part, v->box ? "without" : "with");
    else if (s.cache_held && !v->quiet)
        fprintf(stderr, "ebpo fetch: %s: resuming with %s from %s\n", remote_shown(url),
                words_bytes(bytes, sizeof bytes, s.cache_held), part);
    return s.cache_held > 0;
}

enum { BOX_BLOCK = 8192 }; /* bytes of a fetched block with --box, which needs many short ranges */

static int fetch_subset(subset_values *v, const char *url, const char *out, const char *part,
                        ebpo_subset_options *subset)
{
    double begun = progress_now();
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    ticker t = { .last = 0 };
    atomic_init(&t.active, !v->quiet && isatty(STDERR_FILENO));
    atomic_init(&t.file, NULL);
    v->remote.stop = show_bytes;
    v->remote.stop_user = &t;
    if (part) {
        v->remote.cache = part;
        v->remote.cache_size = "1048576T"; /* no limit */
        v->remote.cache_block = v->box ? BOX_BLOCK : 0;
    }
    ebpo_status status = remote_open(&file, url, &v->remote, &error);
    if (t.shown)
        fputs("\r\033[K", stderr);
    bool has_fetched_data = status == EBPO_OK && part && report_resuming(v, file, url, part);
    atomic_store(&t.file, file);
    if (status == EBPO_OK)
        status = subset_set_parts(v, ebpo_file_info(file), remote_shown(url), subset, &error);
    if (status == EBPO_OK)
        status = ebpo_subset(file, out, subset, &error);
    bool has_wrong_option = status == EBPO_E_ARGUMENT;
    wipe_ticker(&t);
    if (status == EBPO_OK) {
        traffic transfers = traffic_of(file);
        status =
            subset_report(v, out, ebpo_file_info(file), &transfers, progress_now() - begun, &error);
        if (status == EBPO_OK && !v->json)
            remote_report(&transfers, &v->remote, false);
    }
    ebpo_close(file);
    /* The fetched data may be damaged. If it were kept, the next run would fail, too. */
    if (part && status == EBPO_E_FORMAT && access(part, F_OK) == 0) {
        remove_part(part);
        int code = command_failed("fetch", &error);
        fprintf(stderr, "ebpo fetch: the fetched data was removed, as it may have been damaged "
                        "in transit; run the same command to start again\n");
        return code;
    }
    /* After an error in an option, removes only data that this run has fetched; data of earlier
     * runs is kept. */
    if (part && (status == EBPO_OK || (has_wrong_option && !has_fetched_data)))
        remove_part(part);
    /* rmdir removes an empty folder, and fails if the folder contains data. */
    if (part && status != EBPO_OK && !has_wrong_option && access(part, F_OK) == 0 &&
        rmdir(part) != 0) {
        int code = command_failed("fetch", &error);
        fprintf(stderr,
                "ebpo fetch: the fetched data is kept in %s; run the same command to resume\n",
                part);
        return code;
    }
    return status == EBPO_OK ? EXIT_OK : command_failed("fetch", &error);
}

/* Checks, before data is fetched, that the output is not a folder, and that `part` is a folder or
 * does not exist. Returns false after a report on standard error. */
static bool out_fits(const char *out, const char *part)
{
    struct stat s;
    if (stat(out, &s) == 0 && S_ISDIR(s.st_mode)) {
        fprintf(stderr, "ebpo fetch: %s: is a folder; name a file in it\n", out);
        return false;
    }
    if (part && lstat(part, &s) == 0 && !S_ISDIR(s.st_mode)) {
        fprintf(stderr,
                "ebpo fetch: %s: is not a folder, but fetched data is kept in a folder of this "
                "name; move it away\n",
                part);
        return false;
    }
    return true;
}

static const subset_values standard = SUBSET_VALUES_INIT;

static int run_fetch(void *given, const char **operand)
{
    subset_values *v = given;
    ebpo_subset_options subset;
    int code = subset_options("fetch", v, operand[0], operand[1], &subset);
    if (code != EXIT_OK)
        return code;
    if (!command_requires_hdf5("fetch", operand[0]))
        return EXIT_FAILED;
    /* NULL with --http-cache, whose folder keeps the data instead of OUT.part */
    char *part = NULL;
    if (ebpo_is_url(operand[0]) && !v->remote.cache && asprintf(&part, "%s.part", operand[1]) < 0)
        return command_no_memory("fetch");
    code = out_fits(operand[1], part) ? fetch_subset(v, operand[0], operand[1], part, &subset)
                                      : EXIT_FAILED;
    free(part);
    return code;
}

const command command_fetch = { &spec, sizeof standard, &standard, run_fetch };
