/* ebpo catalogue: lists the models below a folder, with their boxes. Reads headers only. */
#include <errno.h>
#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/command.h"
#include "cli/json.h"
#include "cli/progress.h"
#include "cli/remote_args.h"
#include "cli/words.h"
#include "cli/commands/commands.h"
#include "cli/commands/folder_files.h"

typedef struct values {
    const char *out;
    bool json, quiet;
    int64_t threads, max_expansion;
} values;

#include "cli/options/catalogue.inc"

static const values standard = { .out = NULL };

/* A file below the folder. */
typedef struct entry {
    bool listed;                   /* the catalogue lists the file */
    char *reason;                  /* if not `listed`: the reason, for messages */
    char *path;                    /* path to write to the catalogue */
    char *shown_path;              /* relative to the folder, for messages */
    ebpo_catalogue_entry reported; /* if `listed`: facts from the file's header */
} entry;

typedef struct catalogue {
    const values *v;
    const char *folder;
    char *path_prefix; /* prefix of paths in the catalogue: "" or "north/" */
    char *out;
    folder_files files;
    entry *entry; /* [files.count] */
    progress_line *progress;
    pthread_mutex_t lock; /* protects `progress`, `next` and `done` */
    size_t next;          /* the next file to read */
    size_t done;          /* number of read headers */
    atomic_bool no_memory;
    /* totals of all listed models */
    uint64_t models, solids, faces, bytes;
    double min[3], max[3];
} catalogue;

enum { THREADS_MAX = 64 };

/* --- headers --- */

static bool has_box(const ebpo_catalogue_entry *e)
{
    for (int k = 0; k < 3; k++)
        if (!isfinite(e->min[k]) || !isfinite(e->max[k]) || e->min[k] > e->max[k])
            return false;
    return true;
}

static bool is_utf8(const char *text)
{
    for (int length; *text; text += length)
        if ((length = json_utf8_length(text)) == 0)
            return false;
    return true;
}

static void omit_entry(catalogue *c, entry *e, const char *reason)
{
    e->listed = false;
    e->reason = strdup(reason);
    if (!e->reason)
        c->no_memory = true;
}

static void read_entry(catalogue *c, size_t number)
{
    entry *e = &c->entry[number];
    const char *path = c->files.path[number];
    remote_values remote = REMOTE_VALUES_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    char *name = NULL;
    remote.max_expansion = c->v->max_expansion;
    if (asprintf(&name, "%s/%s", c->folder, path) < 0)
        name = NULL;
    if (asprintf(&e->path, "%s%s", c->path_prefix, path) < 0)
        e->path = NULL;
    e->shown_path = folder_files_shown(path);
    if (!name || !e->path || !e->shown_path) {
        c->no_memory = true;
    } else if (!is_utf8(e->path)) {
        omit_entry(c, e, "its name is not UTF-8; rename the file");
    } else if (remote_open(&file, name, &remote, &error) == EBPO_OK) {
        ebpo_catalogue_entry_of(file, e->path, &e->reported);
        e->listed = true;
        if (!has_box(&e->reported))
            omit_entry(c, e, "has no box, as it has no faces");
    } else {
        omit_entry(c, e, error.message[0] ? error.message : ebpo_status_name(error.status));
    }
    ebpo_close(file);
    free(name);
}

static void *read_entries(void *user)
{
    catalogue *c = user;
    pthread_mutex_lock(&c->lock);
    while (c->next < c->files.count) {
        size_t number = c->next++;
        pthread_mutex_unlock(&c->lock);
        read_entry(c, number);
        pthread_mutex_lock(&c->lock);
        progress_report(c->progress, "headers", ++c->done, c->files.count);
    }
    pthread_mutex_unlock(&c->lock);
    return NULL;
}

static size_t threads_for(const catalogue *c)
{
    size_t count = c->v->threads ? (size_t)c->v->threads : command_cores();
    count = count < THREADS_MAX ? count : THREADS_MAX;
    return count < c->files.count ? count : c->files.count;
}

/* Reads all headers in several threads. Returns false if there is not enough memory. */
static bool read_all(catalogue *c)
{
    pthread_t thread[THREADS_MAX];
    size_t count = threads_for(c), started = 0;
    c->entry = calloc(c->files.count, sizeof *c->entry);
    if (!c->entry)
        return false;
    pthread_mutex_init(&c->lock, NULL);
    while (started + 1 < count && command_thread(&thread[started], read_entries, c) == 0)
        started++;
    read_entries(c);
    while (started > 0)
        pthread_join(thread[--started], NULL);
    pthread_mutex_destroy(&c->lock);
    progress_wipe(c->progress);
    return !c->no_memory;
}

static void sum_models(catalogue *c)
{
    for (int k = 0; k < 3; k++) {
        c->min[k] = DBL_MAX;
        c->max[k] = -DBL_MAX;
    }
    for (size_t i = 0; i < c->files.count; i++) {
        const ebpo_catalogue_entry *e = &c->entry[i].reported;
        if (!c->entry[i].listed)
            continue;
        c->models++;
        c->solids += e->solid;
        c->faces += e->face_count;
        c->bytes += e->file_bytes;
        for (int k = 0; k < 3; k++) {
            c->min[k] = fmin(c->min[k], e->min[k]);
            c->max[k] = fmax(c->max[k], e->max[k]);
        }
    }
}

/* --- paths --- */

/* Returns the folder of a file that may not exist, with links resolved; or NULL. */
static char *real_folder(const char *path)
{
    const char *name = words_file_name(path);
    char *folder = name > path ? strndup(path, (size_t)(name - path)) : strdup(".");
    char *real = folder ? realpath(folder, NULL) : NULL;
    free(folder);
    return real;
}

/* Returns the relative path from folder `a` to files in folder `b`, such as "", "x/" or "../x/";
 * NULL: there is not enough memory. Both folders must be absolute paths without links. */
static char *relative_path(const char *a, const char *b)
{
    size_t common = 0, at = 0; /* common: length of the common parent folder's path */
    for (;; at++) {
        bool ends_a = !a[at] || a[at] == '/', ends_b = !b[at] || b[at] == '/';
        if (ends_a && ends_b)
            common = at;
        if (a[at] != b[at] || !a[at])
            break;
    }
    size_t ups = 0;
    for (const char *s = a + common; *s; s++)
        ups += *s == '/' && s[1];
    const char *below = b + common + (b[common] == '/'); /* `b` relative to the common folder */
    char *path = malloc(3 * ups + strlen(below) + 2), *end = path;
    for (size_t i = 0; path && i < ups; i++)
        end = stpcpy(end, "../");
    if (path) {
        end = stpcpy(end, below);
        strcpy(end, *below ? "/" : "");
    }
    return path;
}

/* Sets the prefix of paths in the catalogue. Returns the exit code. */
static int find_relative_path(catalogue *c)
{
    char *a = real_folder(c->out), *b = a ? realpath(c->folder, NULL) : NULL;
    bool resolved = b || errno == ENOMEM;
    if (!resolved)
        fprintf(stderr, "ebpo catalogue: %s: %s\n", a ? c->folder : c->out, strerror(errno));
    c->path_prefix = b ? relative_path(a, b) : NULL;
    int code = c->path_prefix ? EXIT_OK : resolved ? command_no_memory("catalogue") : EXIT_FAILED;
    free(a);
    free(b);
    return code;
}

/* --- the file --- */

/* Writes the catalogue. Paths of entries are relative to the catalogue's folder. Returns the exit
 * code. */
static int write_all(const catalogue *c)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_catalogue_options catalogue_options = EBPO_CATALOGUE_OPTIONS_INIT;
    ebpo_catalogue *made = NULL;
    char *folder = strndup(c->out, (size_t)(words_file_name(c->out) - c->out));
    ebpo_catalogue_entry *entries = calloc(c->models, sizeof *entries);
    uint64_t count = 0;
    if (!folder || !entries) {
        free(folder);
        free(entries);
        return command_no_memory("catalogue");
    }
    for (size_t i = 0; i < c->files.count; i++)
        if (c->entry[i].listed)
            entries[count++] = c->entry[i].reported;
    catalogue_options.folder = folder;
    ebpo_status status = ebpo_catalogue_new(entries, count, &catalogue_options, &made, &error);
    if (status == EBPO_OK)
        status = ebpo_catalogue_save(made, c->out, &error);
    ebpo_catalogue_free(made);
    free(entries);
    free(folder);
    return status == EBPO_OK ? EXIT_OK : command_failed("catalogue", &error);
}

/* --- output --- */

static uint64_t count_omitted(const catalogue *c)
{
    return (uint64_t)(c->files.count - c->models) + c->files.unread;
}

static void report_omitted(const catalogue *c)
{
    for (size_t i = 0; i < c->files.count; i++) {
        const entry *e = &c->entry[i];
        if (e->listed)
            continue;
        bool named = strstr(e->reason, e->shown_path) != NULL;
        fprintf(stderr, "ebpo catalogue: omitted: %s%s%s\n", named ? "" : e->shown_path,
                named ? "" : ": ", e->reason);
    }
}

static void print_json(const catalogue *c)
{
    json j;
    json_begin(&j, stdout);
    json_object(&j, NULL);
    json_text(&j, "catalogue", c->out);
    json_uint(&j, "models", c->models);
    json_uint(&j, "solids", c->solids);
    json_uint(&j, "faces", c->faces);
    json_uint(&j, "bytes", c->bytes);
    json_reals(&j, "box_min", c->min, 3);
    json_reals(&j, "box_max", c->max, 3);
    json_uint(&j, "folders_unread", c->files.unread);
    json_array(&j, "omitted");
    for (size_t i = 0; i < c->files.count; i++)
        if (!c->entry[i].listed) {
            json_object(&j, NULL);
            json_text(&j, "path", c->files.path[i]);
            json_text(&j, "why", c->entry[i].reason);
            json_end(&j);
        }
    json_end(&j);
    json_finish(&j);
}

static void print_words(const catalogue *c)
{
    char models[40], faces[24], bytes[32], omitted[40];
    words_plural(models, sizeof models, c->models, "model", "models");
    words_count(faces, sizeof faces, (double)c->faces);
    const char *word = c->faces == 1 ? "face" : "faces";
    words_bytes(bytes, sizeof bytes, c->bytes);
    words_plural(omitted, sizeof omitted, count_omitted(c), "was omitted", "were omitted");
    printf("%s: %s, %" PRIu64 " of them solid, %s %s, %s", c->out, models, c->solids, faces, word,
           bytes);
    printf(count_omitted(c) ? "; %s\n" : "\n", omitted);
}

/* --- command --- */

/* Returns true, with a report on standard error, if the catalogue would overwrite a file below the
 * folder, or if there is not enough memory. Then *code is the exit code. */
static bool overwrites_model(const catalogue *c, int *code)
{
    for (size_t i = 0; i < c->files.count; i++) {
        char *path = NULL;
        if (asprintf(&path, "%s/%s", c->folder, c->files.path[i]) < 0) {
            *code = command_no_memory("catalogue");
            return true;
        }
        bool overwrites = command_overwrites("catalogue", path, c->out);
        free(path);
        if (overwrites) {
            *code = EXIT_USAGE;
            return true;
        }
    }
    return false;
}

static int make_catalogue(catalogue *c)
{
    ebpo_error error = EBPO_ERROR_INIT;
    if (!folder_files_find(&c->files, "catalogue", c->folder))
        return c->files.no_memory ? command_no_memory("catalogue") : EXIT_FAILED;
    if (ebpo_check_output(c->out, &error) != EBPO_OK)
        return command_failed("catalogue", &error);
    int code = find_relative_path(c);
    if (code != EXIT_OK || overwrites_model(c, &code))
        return code;
    if (!read_all(c))
        return command_no_memory("catalogue");
    sum_models(c);
    report_omitted(c);
    if (!c->models) {
        fprintf(stderr,
                "ebpo catalogue: %s: has no models; nothing was written (ebpo convert makes "
                "models)\n",
                c->folder);
        return EXIT_FAILED;
    }
    code = write_all(c);
    if (code != EXIT_OK)
        return code;
    if (c->v->json)
        print_json(c);
    else if (!c->v->quiet)
        print_words(c);
    return count_omitted(c) ? EXIT_DIFFERS : EXIT_OK;
}

static int run_catalogue(void *given, const char **operand)
{
    const values *v = given;
    progress_line line;
    if (v->out && strcmp(v->out, "-") == 0)
        return command_usage("catalogue", "--output: '-': a file name is needed here; paths are "
                                          "relative to its folder");
    char *folder = strdup(operand[0]);
    catalogue c = { .v = v, .folder = folder, .progress = &line };
    for (size_t end = folder ? strlen(folder) : 0; end > 1 && folder[end - 1] == '/';)
        folder[--end] = 0;
    (void)progress_start(&line, "catalogue", v->quiet);
    if (folder && v->out)
        c.out = strdup(v->out);
    else if (!folder || asprintf(&c.out, "%s/catalogue.json", folder) < 0)
        c.out = NULL;
    int code = c.out ? make_catalogue(&c) : command_no_memory("catalogue");
    for (size_t i = 0; c.entry && i < c.files.count; i++) {
        free(c.entry[i].reason);
        free(c.entry[i].path);
        free(c.entry[i].shown_path);
    }
    free(c.entry);
    free(c.path_prefix);
    free(c.out);
    free(folder);
    folder_files_free(&c.files);
    return code;
}

const command command_catalogue = { &spec, sizeof standard, &standard, run_catalogue };
