/* Writes the results of a shard, one of N parts of the input (--shard I/N). The note is a file
 * beside the results. It contains facts of the inputs: model, points and options. */
#include "cli/commands/query_shard.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/json.h"
#include "cli/points_format.h"
#include "cli/words.h"
#include "cli/commands/query_catalogue.h"

enum { SHARDS_MAX = 1000000000 };

/* --- options --- */

static bool read_number(const char **at, uint64_t *out)
{
    char *end;
    if (**at < '0' || **at > '9')
        return false;
    errno = 0;
    *out = strtoull(*at, &end, 10);
    *at = end;
    return errno == 0 && *out <= SHARDS_MAX;
}

static bool read_shard(query_shard *s, const char *text)
{
    const char *at = text;
    if (read_number(&at, &s->number) && *at == '/' && (at++, read_number(&at, &s->shards)) &&
        !*at && s->shards > 0 && s->number < s->shards)
        return true;
    s->shards = 0;
    command_usage(s->command,
                  "--shard: '%s' is not I/N, shard I of N; the first is 0, the last is N - 1",
                  text);
    return false;
}

/* Returns true, with a report on stderr, if `path` leads to the model or to the file of the points.
 * The points may be named FILE.h5:/path. */
static bool overwrites_input(const query_shard *s, const char *path)
{
    struct stat in, out;
    const char *dataset;
    if (command_overwrites(s->command, s->model, path))
        return true;
    if (!s->points || !points_file(s->points, &in, &dataset) || stat(path, &out) != 0 ||
        in.st_dev != out.st_dev || in.st_ino != out.st_ino)
        return false;
    fprintf(stderr, "ebpo %s: %s: is both input and output; choose another output\n", s->command,
            path);
    return true;
}

bool query_shard_fits(query_shard *s, const query_job *job, const char *model,
                      const char *points_path)
{
    const query_values *v = job->values;
    *s = (query_shard){
        .command = job->command, .v = v, .model = model, .points = points_path, .saved_stdout = -1
    };
    if (v->shard && !read_shard(s, v->shard))
        return false;
    if (v->shard && !v->out)
        command_usage(s->command, "--shard writes to a file; name it with -o");
    else if (v->force && !v->shard)
        command_usage(s->command, "--force has no effect without --shard; omit it");
    else if (v->shard && (!points_path || strcmp(points_path, "-") == 0))
        command_usage(s->command, "--shard needs a file of points, not standard input");
    else if (v->shard && v->npy)
        command_usage(s->command, "--npy has no effect with --shard; outputs of --raw can be "
                                  "joined by cat");
    else if (v->shard && v->deadline)
        command_usage(s->command, "--deadline has no effect with --shard, whose results do not "
                                  "depend on time; omit one of them");
    else if (v->out && strcmp(v->out, "-") == 0)
        command_usage(s->command, "without -o, results go to standard output; omit -o");
    else
        return !v->out || !overwrites_input(s, v->out);
    return false;
}

/* --- facts of the inputs and options --- */

static void report_query(json *j, const query_job *job)
{
    const query_values *v = job->values;
    json_int(j, "form", (int)job->form);
    json_bool(j, "raw", v->raw);
    json_bool(j, "header", v->header);
    json_text(j, "attribute", v->attribute ? v->attribute : "");
    json_int(j, "level", v->level);
    json_int(j, "distance_mode", v->distance_mode);
    json_bool(j, "unsigned", v->unsigned_distance);
    json_real(j, "max_distance", v->max_distance);
    json_int(j, "nearest", v->nearest);
    json_real(j, "within", v->within);
    json_int(j, "ray_sides", v->ray_sides);
    json_real(j, "tmax", v->tmax);
    json_bool(j, "all", v->all);
    json_bool(j, "any", v->any);
    json_real(j, "threshold", v->threshold);
}

static void report_file(json *j, const char *key, const struct stat *st)
{
    char time[48];
    snprintf(time, sizeof time, "%" PRId64 ".%09ld", (int64_t)st->st_mtim.tv_sec,
             (long)st->st_mtim.tv_nsec);
    json_object(j, key);
    json_uint(j, "bytes", (uint64_t)st->st_size);
    json_text(j, "modified", time);
}

static int report_model(json *j, const query_shard *s)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    char hex[65];
    if (query_catalogue_named(s->model))
        return query_catalogue_facts(j, s->command, s->model);
    if (remote_open(&file, s->model, &s->v->remote, &error) != EBPO_OK)
        return command_failed(s->command, &error);
    words_hex(ebpo_file_info(file)->content_sha256, hex);
    json_object(j, "model");
    json_text(j, "content_sha256", hex);
    json_uint(j, "bytes", ebpo_file_info(file)->file_bytes);
    json_end(j);
    ebpo_close(file);
    return EXIT_OK;
}

/* Sets *facts to the facts of the inputs, as JSON. Memory and threads do not change results, and
 * are not included. Returns an exit code. */
static int report_facts(const query_shard *s, const query_job *job, const struct stat *st,
                        const char *dataset, char **facts)
{
    char *text = NULL;
    size_t size;
    FILE *out = open_memstream(&text, &size);
    if (!out)
        return command_no_memory(s->command);
    json j;
    json_begin(&j, out);
    json_object(&j, NULL);
    json_text(&j, "format", "ebpo-shard");
    json_uint(&j, "version", 1);
    json_text(&j, "ebpo", ebpo_version());
    json_text(&j, "command", s->command);
    json_uint(&j, "shard", s->number);
    json_uint(&j, "of", s->shards);
    int code = report_model(&j, s);
    report_file(&j, "points", st);
    json_text(&j, "dataset", dataset);
    json_end(&j);
    json_object(&j, "question");
    report_query(&j, job);
    json_finish(&j);
    if (fclose(out) != 0 && code == EXIT_OK)
        code = command_no_memory(s->command);
    if (code == EXIT_OK)
        *facts = text;
    else
        free(text);
    return code;
}

/* Reads the current header of the model, and the current size and time of the file of points. */
static int inspect_inputs(const query_shard *s, const query_job *job, char **facts)
{
    struct stat st;
    const char *dataset;
    if (!query_catalogue_named(s->model) && !command_requires_hdf5(s->command, s->model))
        return EXIT_FAILED;
    if (!points_file(s->points, &st, &dataset)) {
        fprintf(stderr, "ebpo %s: %s: cannot be opened: %s\n", s->command, s->points,
                strerror(errno));
        return EXIT_FAILED;
    }
    return report_facts(s, job, &st, dataset, facts);
}

/* --- the note --- */

/* Returns the text of the note: the facts, and the length and time of the file of results. With
 * length and time, the note does not match results that another command has written. NULL: there is
 * not enough memory. */
static char *note_text(const char *facts, const struct stat *results)
{
    char *text = NULL;
    return asprintf(&text, "%sresults: %" PRIu64 " bytes, of %" PRId64 ".%09ld\n", facts,
                    (uint64_t)results->st_size, (int64_t)results->st_mtim.tv_sec,
                    (long)results->st_mtim.tv_nsec) < 0
               ? NULL
               : text;
}

static bool file_equals(const char *path, const char *text)
{
    size_t size = strlen(text);
    char *contents = malloc(size + 1);
    FILE *in = contents ? fopen(path, "re") : NULL;
    bool equal =
        in && fread(contents, 1, size + 1, in) == size && memcmp(contents, text, size) == 0;
    if (in)
        fclose(in);
    free(contents);
    return equal;
}

/* Returns false, with a report on standard error, if a file that is not a note has the name of the
 * note. */
static bool check_note(const query_shard *s)
{
    static const char beginning[] = "{\n  \"format\": \"ebpo-shard\",\n";
    struct stat st;
    char contents[sizeof beginning - 1];
    if (lstat(s->note, &st) != 0)
        return true; /* writing the results, in the same folder, will report other errors */
    FILE *in = S_ISREG(st.st_mode) ? fopen(s->note, "re") : NULL;
    bool is_note = in && fread(contents, 1, sizeof contents, in) == sizeof contents &&
                   memcmp(contents, beginning, sizeof contents) == 0;
    if (in)
        fclose(in);
    if (!is_note)
        fprintf(stderr,
                "ebpo %s: %s: exists, and is not the file of facts that --shard writes beside its "
                "output; choose another output\n",
                s->command, s->note);
    return is_note;
}

/* Returns true if the results of these inputs exist. Reports why the command does nothing, or why
 * it replaces existing results. */
static bool results_exist(const query_shard *s)
{
    struct stat st, note;
    bool out = stat(s->v->out, &st) == 0 && S_ISREG(st.st_mode);
    char *text = out ? note_text(s->facts, &st) : NULL;
    bool exist = text && file_equals(s->note, text);
    free(text);
    if (exist)
        fprintf(stderr,
                "ebpo %s: %s: exists, from the same model, points and options; nothing to do "
                "(--force writes it again)\n",
                s->command, s->v->out);
    else if (out && stat(s->note, &note) == 0)
        fprintf(stderr,
                "ebpo %s: %s: is from another model, other points or options, or was changed, "
                "according to %s; writing it again\n",
                s->command, s->v->out, s->note);
    return exist;
}

bool query_shard_done(query_shard *s, const query_job *job, int *code)
{
    *code = EXIT_OK;
    if (!s->shards)
        return false;
    *code = inspect_inputs(s, job, &s->facts);
    if (*code == EXIT_OK && asprintf(&s->note, "%s.shard", s->v->out) < 0) {
        s->note = NULL;
        *code = command_no_memory(s->command);
    }
    if (*code == EXIT_OK && overwrites_input(s, s->note))
        *code = EXIT_USAGE;
    if (*code == EXIT_OK && !check_note(s))
        *code = EXIT_FAILED;
    return *code != EXIT_OK || (!s->v->force && results_exist(s));
}

/* --- results --- */

int query_shard_begin(query_shard *s)
{
    ebpo_error error = EBPO_ERROR_INIT;
    int file;
    if (!s->v->out)
        return EXIT_OK;
    if (ebpo_output_begin(s->v->out, &s->out, &file, &error) != EBPO_OK)
        return command_failed(s->command, &error);
    fflush(stdout);
    s->saved_stdout = fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 3);
    if (s->saved_stdout >= 0 && dup2(file, STDOUT_FILENO) >= 0)
        return EXIT_OK;
    fprintf(stderr, "ebpo %s: standard output: %s\n", s->command, strerror(errno));
    return EXIT_FAILED;
}

/* Checks that the inputs have not changed since the first check. */
static int check_unchanged(const query_shard *s, const query_job *job)
{
    char *new_facts = NULL;
    int code = inspect_inputs(s, job, &new_facts);
    if (code == EXIT_OK && strcmp(new_facts, s->facts) != 0) {
        fprintf(stderr,
                "ebpo %s: the model or the points were changed while they were read; nothing was "
                "written, start again\n",
                s->command);
        code = EXIT_FAILED;
    }
    free(new_facts);
    return code;
}

static int fail_results(const query_shard *s)
{
    fprintf(stderr, "ebpo %s: %s: %s\n", s->command, s->v->out, strerror(errno));
    return EXIT_FAILED;
}

static int write_note(const query_shard *s, const struct stat *results)
{
    ebpo_error error = EBPO_ERROR_INIT;
    char *text = note_text(s->facts, results);
    if (!text)
        return command_no_memory(s->command);
    ebpo_status status = ebpo_write_file(s->note, text, strlen(text), &error);
    free(text);
    return status == EBPO_OK ? EXIT_OK : command_failed(s->command, &error);
}

/* Gives the file of results its final name. Removes the old note before and writes the new note
 * afterwards. So a note is never beside results of other inputs, even if the process is killed.
 * results: descriptor of the written file; at the path, another command may replace the file.
 * Returns an exit code. */
static int put_in_place(query_shard *s, int results)
{
    struct stat st;
    ebpo_error error = EBPO_ERROR_INIT;
    if (s->shards && unlink(s->note) != 0 && errno != ENOENT) {
        fprintf(stderr, "ebpo %s: %s: %s\n", s->command, s->note, strerror(errno));
        return EXIT_FAILED;
    }
    ebpo_status status = ebpo_output_end(s->out, &error);
    s->out = NULL;
    if (status != EBPO_OK)
        return command_failed(s->command, &error);
    if (!s->shards)
        return EXIT_OK;
    return fstat(results, &st) == 0 ? write_note(s, &st) : fail_results(s);
}

int query_shard_end(query_shard *s, const query_job *job, int code)
{
    if (s->saved_stdout < 0)
        return code;
    int results = code == EXIT_OK ? fcntl(STDOUT_FILENO, F_DUPFD_CLOEXEC, 3) : -1;
    if (code == EXIT_OK && results < 0)
        code = fail_results(s);
    dup2(s->saved_stdout, STDOUT_FILENO);
    close(s->saved_stdout);
    s->saved_stdout = -1;
    if (code == EXIT_OK && s->shards)
        code = check_unchanged(s, job);
    if (code == EXIT_OK)
        code = put_in_place(s, results);
    if (results >= 0)
        close(results);
    return code;
}

void query_shard_free(query_shard *s)
{
    if (s->saved_stdout >= 0)
        close(s->saved_stdout);
    ebpo_output_abandon(s->out);
    free(s->facts);
    free(s->note);
    *s = (query_shard){ .saved_stdout = -1 };
}
