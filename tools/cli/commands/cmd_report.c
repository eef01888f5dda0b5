/* ebpo report: compares the bytes, the error and the run time of methods, level by level. */
#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/command.h"
#include "cli/process_memory.h"
#include "cli/selection_args.h"
#include "cli/words.h"
#include "cli/commands/commands.h"
#include "cli/report/report_data.h"
#include "cli/report/report_output.h"

static const char *const up_words[] = { "x", "y", "z", NULL };
static const char *const coalesce_words[] = { "distinct", "sum", "mean", NULL };

#include "cli/options/report.inc"

static int refuse_value(const char *option, const char *value, const char *expected)
{
    return command_usage("report", "%s: '%s' is not %s", option, value, expected);
}

/* --- options --- */

/* Reads the next item of a comma-separated list. Returns false if the list has ended or the item is
 * too long. */
static bool next_word(const char **at, char *word, size_t capacity)
{
    size_t length = strcspn(*at, ",");
    if (!length || length >= capacity)
        return false;
    memcpy(word, *at, length);
    word[length] = 0;
    *at += length + ((*at)[length] == ',' && (*at)[length + 1]);
    return true;
}

/* Adds a setting: an item of --percent or --k-root. Returns an exit code. */
static int add_setting(comparison *c, const report_values *v, const char *word)
{
    char *end;
    plane_setting *s = &c->setting[c->settings++];
    s->percent = v->percent ? strtod(word, &end) : 40;
    if (v->percent && (*end || !(s->percent >= 0) || !(s->percent <= 100)))
        return refuse_value("--percent", word, "a number from 0 to 100");
    if (!v->percent)
        snprintf(s->k_root, sizeof s->k_root, "%s", word);
    snprintf(s->word, sizeof s->word, v->percent ? "-%s%%" : "-K%s", word);
    for (const plane_setting *earlier = c->setting; earlier < s; earlier++)
        if (strcmp(earlier->word, s->word) == 0)
            return command_usage("report", "%s: '%s' is given twice; give each number once",
                                 v->percent ? "--percent" : "--k-root", word);
    selection_options chosen = { v->select,  v->percent ? s->percent : -1,
                                 v->epsilon, v->percent ? NULL : s->k_root,
                                 v->normals, -1 };
    return selection_check("report", &chosen);
}

/* Reads --percent or --k-root, the numbers of planes for the selections of the theses. Returns an
 * exit code. */
static int read_settings(comparison *c, const report_values *v)
{
    const char *list = v->percent ? v->percent : v->k_root;
    char word[sizeof c->setting->k_root];
    int code = EXIT_OK;
    selection_options all = { v->select, v->percent ? 1 : -1, v->epsilon, NULL, v->normals, -1 };
    if (!list) { /* --seed needs no check: it always selects the points of queries */
        c->setting[c->settings++].percent = 40;
        return selection_check("report", &all);
    }
    if (v->percent && v->k_root)
        return command_usage("report", "--percent and --k-root cannot be used together; give one");
    for (const char *at = list; *at && code == EXIT_OK;) {
        if (c->settings == SETTINGS_MAX || !next_word(&at, word, sizeof word))
            return refuse_value(v->percent ? "--percent" : "--k-root", list,
                                "a list of at most 12 numbers, separated by commas");
        code = add_setting(c, v, word);
    }
    if (c->settings == 0)
        return refuse_value(v->percent ? "--percent" : "--k-root", list, "a number");
    if (c->settings == 1) /* with one setting only, the names of methods omit its number */
        c->setting[0].word[0] = 0;
    return code;
}

static int read_options(comparison *c, report_values *v, bool mesh)
{
    char extra;
    word_levels levels = { .last = EBPO_LEVELS_MAX - 1, .is_contiguous = true };
    if (v->levels && (!words_read_levels(v->levels, &levels) || !levels.is_contiguous))
        return refuse_value("--levels", v->levels,
                            "one level or a first and a last one, such as 0-6 or 3-");
    c->first = levels.first;
    c->last = levels.last;
    if (sscanf(v->view, "%lf,%lf%c", &c->azimuth, &c->elevation, &extra) != 2 ||
        !(fabs(c->azimuth) <= 360) || !(fabs(c->elevation) <= 90))
        return refuse_value(
            "--view", v->view,
            "an azimuth from -360 to 360, a comma, and an elevation from -90 to 90");
    bool building = v->select || v->percent || v->k_root || v->normals >= 0 || v->max_level >= 0 ||
                    v->leaf_faces >= 0 || v->epsilon >= 0 || v->keep || v->unlimited;
    if (!mesh && building)
        return command_usage(
            "report", "--select, --percent, --k-root, --normals, --max-level, --leaf-faces, "
                      "--epsilon, --unlimited and --keep apply to a mesh only; give a mesh, or "
                      "omit them");
    if (v->coalesce >= 0 && !v->unlimited)
        return command_usage("report", "--coalesce applies to --unlimited only");
    const ebpo_build_options standard = EBPO_BUILD_OPTIONS_INIT;
    v->select = v->select ? v->select : 1u << EBPO_SELECT_INHERIT;
    if (v->unlimited && v->select == 1u << EBPO_SELECT_INHERIT)
        return command_usage("report",
                             "--unlimited applies to --select kmedoids, offset or random; add one "
                             "of them");
    int code = read_settings(c, v);
    if (code != EXIT_OK)
        return code;
    v->normals = v->normals >= 0 ? v->normals : (int)standard.normals;
    v->leaf_faces = v->leaf_faces >= 0 ? v->leaf_faces : standard.leaf_faces;
    v->epsilon = v->epsilon >= 0 ? v->epsilon : standard.epsilon;
    return EXIT_OK;
}

/* --- output --- */

/* Writes a file to the temporary folder. */
static ebpo_status write_one(const comparison *c, const char *name,
                             void (*write)(FILE *, const comparison *), ebpo_error *error)
{
    char path[sizeof c->folder + 32], *text = NULL;
    size_t size = 0;
    snprintf(path, sizeof path, "%s/%s", c->folder, name);
    FILE *f = open_memstream(&text, &size);
    if (f)
        write(f, c);
    bool complete = f && !ferror(f);
    if (f && fclose(f) != 0)
        complete = false;
    ebpo_status status = EBPO_E_MEMORY;
    if (complete)
        status = ebpo_write_file(path, text, size, error);
    else
        snprintf(error->message, sizeof error->message,
                 "%s: not enough memory; use fewer --levels, or --no-pictures", name);
    free(text);
    return error->status = status;
}

static void write_json(FILE *out, const comparison *c) { report_to_json(out, c, false); }

static ebpo_status write_all(const comparison *c, ebpo_error *error)
{
    ebpo_status status = write_one(c, "report.csv", report_csv, error);
    if (status == EBPO_OK)
        status = write_one(c, "report.json", write_json, error);
    if (status == EBPO_OK && !report_page_missing())
        status = write_one(c, "report.html", report_page, error);
    return status;
}

/* Removes the .ebpo.h5 files that this command has built, unless --keep was given. */
static void remove_built(const comparison *c)
{
    for (int i = 0; i < c->count && !c->v->keep; i++)
        if (strncmp(c->methods[i].path, c->folder, strlen(c->folder)) == 0)
            remove(c->methods[i].path);
}

static void print_summary(const comparison *c, const char *folder)
{
    printf("%s: ", folder);
    for (int i = 0; i < c->count; i++)
        printf("%s%s", i ? ", " : "", c->methods[i].name);
    printf("; levels %d to %d; %s/%sreport.csv, report.json in %.0f s\n", c->first,
           comparison_last(c), folder, report_page_missing() ? "" : "report.html, ", c->seconds);
    for (int i = 0; i < c->count; i++)
        for (int k = 0; k < c->methods[i].note_count; k++)
            printf("  %s: %s\n", c->methods[i].name, c->methods[i].note[k]);
}

/* --- the work --- */

static ebpo_status measure_methods(comparison *c, ebpo_error *error)
{
    ebpo_status status = report_make_points(c, error);
    for (int i = 0; i < c->count && status == EBPO_OK; i++)
        status = report_gather(c, &c->methods[i], error);
    for (int round = 0; round < ROUNDS; round++)
        for (int i = 0; i < c->count && status == EBPO_OK; i++)
            status = report_round(c, &c->methods[i], round, error);
    for (int i = 0; i < c->count; i++)
        report_medians(c, &c->methods[i]);
    if (c->v->no_pictures)
        c->without_pictures = "--no-pictures was given";
    else if (status == EBPO_OK)
        status = report_pictures(c, error);
    return status;
}

static int make_report(comparison *c, const char *const *operand, const char *folder,
                       progress_line *line)
{
    double begun = progress_now();
    ebpo_error error = EBPO_ERROR_INIT;
    int code = report_find_methods(c, operand);
    if (code != EXIT_OK)
        return code;
    ebpo_status status = measure_methods(c, &error);
    c->seconds = progress_now() - begun;
    if (status == EBPO_OK)
        status = write_all(c, &error);
    progress_wipe(line);
    if (status != EBPO_OK)
        return command_failed("report", &error);
    remove_built(c);
    if (!output_commit(folder, c->folder))
        return EXIT_FAILED;
    c->folder[0] = 0;
    if (report_page_missing())
        fprintf(stderr, "ebpo report: warning: report.html is not written: %s\n",
                report_page_missing());
    if (c->v->json)
        report_to_json(stdout, c, false);
    else if (!c->v->quiet)
        print_summary(c, folder);
    return EXIT_OK;
}

/* Sets `out` to the default name of the output folder: report-bunny for "dir/bunny.ply". */
static void default_folder(const char *operand, char *out, size_t capacity)
{
    char stem[201];
    report_stem(operand, stem, sizeof stem);
    snprintf(out, capacity, "report-%s", stem);
}

static const report_values standard = { .normals = -1,
                                        .max_level = -1,
                                        .leaf_faces = -1,
                                        .epsilon = -1,
                                        .coalesce = -1,
                                        .points = 5000,
                                        .seed = 1,
                                        .up = 1,
                                        .view = "30,20",
                                        .remote = REMOTE_VALUES_INIT };

static int run_report(void *given, const char **operand)
{
    report_values *v = given;
    char named_after_input[256];
    comparison c = { .v = v };
    if (!process_memory_take("report", v->memory, v->threads))
        return EXIT_USAGE;
    int is_hdf5 = command_is_hdf5("report", operand[0]);
    int code = is_hdf5 < 0 ? EXIT_FAILED : read_options(&c, v, !is_hdf5);
    if (code != EXIT_OK)
        return code;
    default_folder(operand[0], named_after_input, sizeof named_after_input);
    const char *folder = v->out ? v->out : named_after_input;
    code = output_begin(folder, operand, c.folder, sizeof c.folder);
    if (code != EXIT_OK)
        return code;
    progress_line line;
    c.progress = progress_start(&line, "report", v->quiet);
    c.methods = calloc(METHODS_MAX, sizeof *c.methods);
    if (c.methods) {
        code = make_report(&c, operand, folder, &line);
    } else {
        code = command_no_memory("report");
    }
    progress_wipe(&line);
    output_remove(c.folder);
    comparison_free(&c);
    return code;
}

const command command_report = { &spec, sizeof standard, &standard, run_report };
