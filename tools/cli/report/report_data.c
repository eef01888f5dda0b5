#include "cli/report/report_data.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/command.h"

const unsigned deadlines_us[DEADLINES] = { 1, 2, 5, 10, 20, 50, 100, 1000 };
const unsigned budget_parts[BUDGETS] = { 1, 2, 4, 8, 16 };

#define NO_VOLUME                                                                            \
    "a surface, or a solid without volume, has none that could be exceeded; or the solid's " \
    "volume is not known, as components meet or the mesh is no 2-manifold; or volumes are "  \
    "beyond the range of a double, and there is nothing that they are taken by instead"
#define OUT_OF_RANGE "in the model's unit cubed it is beyond the range of a double"
#define NO_MESH      "the file has no mesh, see below"
#define NO_INSIDE    "a surface has no inside"
#define NOT_TIMED    "this could not be asked of the method, see below"

const figure_name level_figures[LEVEL_FIGURES] = {
    [OF_BYTES] = { "bytes", "B", false, "of the level in the file", NULL },
    [OF_CUMULATIVE_BYTES] = { "cumulative_bytes", "B", false,
                              "of the head and of levels 0 to this one", NULL },
    [OF_GRAY] = { "gray", "nodes", false, "gray nodes of the level", NULL },
    [OF_LEAVES] = { "leaf", "nodes", false, "leaves of the level", NULL },
    [OF_PLANES] = { "planes", "planes", false, "stored for the level's gray nodes", NULL },
    [OF_LEAF_PLANES] = { "leaf_planes", "planes", false, "stored for the level's leaves", NULL },
    [OF_VOLUME] = { "envelope_volume", "model^3", false,
                    "of the envelopes that stand for the model at this level; leaves by their "
                    "stored planes, else by planes derived from their faces",
                    OUT_OF_RANGE },
    [OF_EXCESS] = { "excess", "%", false,
                    "volume of the envelopes beyond the solid's, in percent of the solid's",
                    NO_VOLUME },
    [OF_LEVELS_VOLUME] = { "levels_volume", "model^3", false,
                           "the same from levels 0 to this one alone, without the mesh: leaves "
                           "without stored planes have their parent's envelope",
                           OUT_OF_RANGE },
    [OF_LEVELS_EXCESS] = { "levels_excess", "%", false, "its excess", NO_VOLUME },
    [OF_LIMIT_VOLUME] = { "limit_volume", "model^3", false,
                          "of the convex hulls of the solid in each cell: no convex envelope is "
                          "smaller",
                          NO_MESH },
    [OF_LIMIT_EXCESS] = { "limit_excess", "%", false, "its excess",
                          "the file has no mesh or no volume, or this build no qhull" },
    [OF_EXCESS_TO_LIMIT] = { "excess_to_limit", "1", false, "excess / limit_excess",
                             "the limit is the solid itself, or there is none, or no volume within "
                             "the range of a double" },
    [OF_FAR_LO] = { "hausdorff_lo", "model", false,
                    "the one-sided Hausdorff distance from the envelopes to the model is at least "
                    "this",
                    NO_MESH },
    [OF_FAR_HI] = { "hausdorff_hi", "model", false, "and certainly at most this", NO_MESH },
    [OF_FAR_MEAN] = { "distance_mean", "model", false,
                      "mean distance from the level's surface to the model, sampled",
                      "no sample lies on the level's surface, or the file has no mesh" },
    [OF_FAR_RMS] = { "distance_rms", "model", false, "root of its mean square",
                     "no sample lies on the level's surface, or the file has no mesh" },
    [OF_MAYBE_UNIFORM] = { "maybe_uniform", "1", false,
                           "share of points, uniform in the model's box, that a point-in-solid "
                           "test to this level leaves open",
                           NO_INSIDE },
    [OF_MAYBE_NEAR] = { "maybe_near", "1", false,
                        "the same of points within 1 % of the diagonal from the surface",
                        "a surface has no inside, and a file without mesh no points near it" },
    [OF_WIDTH_MEAN] = { "width_mean", "model", false,
                        "of the interval that holds the distance, known to this level; uniform "
                        "points",
                        NULL },
    [OF_WIDTH_MEDIAN] = { "width_median", "model", false, "half of the points have a narrower one",
                          NULL },
    [OF_WIDTH_P99] = { "width_p99", "model", false, "99 % of the points have a narrower one",
                       NULL },
    [OF_INSIDE_NS] = { "inside_ns", "ns", true,
                       "a point-in-solid test to this level, uniform points, many at a time, one "
                       "thread",
                       NO_INSIDE },
    [OF_DISTANCE_NS] = { "distance_ns", "ns", true, "a distance to this level, the same way",
                         NULL },
    [OF_HAVE_SECONDS] = { "have_seconds", "s", true,
                          "to open the file and read levels 0 to this one, after the system was "
                          "asked to forget the file",
                          NULL },
    [OF_READ_BYTES] = { "read_bytes", "B", false, "asked of the file for that", NULL },
    [OF_READS] = { "reads", "reads", false, "in so many reads", NULL },
    [OF_LINE_BYTES] = { "line_bytes", "B", false,
                        "sent by a server for that: the file's first 128 KiB, and what else is "
                        "needed in pieces of 4 KiB",
                        NOT_TIMED },
    [OF_LINE_TRIPS] = { "line_trips", "trips", false,
                        "round trips to the server, the first 128 KiB included; what is announced "
                        "together comes together",
                        NOT_TIMED },
    [OF_LEVEL_MEMORY] = { "level_memory_bytes", "B", false,
                          "memory of a model that keeps levels 0 to this one and loads what is "
                          "below when it is asked for; before anything is loaded",
                          NOT_TIMED },
    [OF_THESIS_BYTES] = { "thesis_bytes", "B", false,
                          "what the theses' cost model takes for the level", NO_MESH },
    [OF_THESIS_CUMULATIVE] = { "thesis_cumulative_bytes", "B", false,
                               "and for levels 0 to this one", NO_MESH },
};

const figure_name whole_figures[WHOLE_FIGURES] = {
    [OF_FILE_BYTES] = { "file_bytes", "B", false,
                        "of the file, mesh included where it is in the file", NULL },
    [OF_HEAD_BYTES] = { "head_bytes", "B", false, "in front of level 0", NULL },
    [OF_ALL_PLANES] = { "all_planes", "planes", false, "stored in the file", NULL },
    [OF_BUILD_SECONDS] = { "build_seconds", "s", true,
                           "to build the tree from the checked mesh; files that were there before "
                           "do not tell",
                           "files that were there before do not tell" },
    [OF_OPEN_SECONDS] = { "open_seconds", "s", true,
                          "to take the whole model into memory, made for questions", NULL },
    [OF_MEMORY_BYTES] = { "memory_bytes", "B", false, "that it takes there", NOT_TIMED },
    [OF_EXACT_INSIDE_NS] = { "exact_inside_ns", "ns", true,
                             "an exact point-in-solid test, uniform points, many at a time, one "
                             "thread",
                             "a surface has no inside, and a file without mesh no exact answers" },
    [OF_EXACT_DISTANCE_NS] = { "exact_distance_ns", "ns", true, "an exact distance, the same way",
                               NO_MESH },
};

const figure_name deadline_figures[DEADLINE_FIGURES] = {
    [OF_DUE_EXACT] = { "deadline_exact", "1", true,
                       "share of distances that are exact by then; uniform points, one at a time",
                       NOT_TIMED },
    [OF_DUE_WIDTH_MEDIAN] = { "deadline_width_median", "model", true,
                              "width of the interval that is certain by then: half of the points "
                              "have a narrower one",
                              NOT_TIMED },
    [OF_DUE_WIDTH_P99] = { "deadline_width_p99", "model", true,
                           "99 % of the points have a narrower one", NOT_TIMED },
    [OF_DUE_TOOK_MEDIAN] = { "deadline_took_median", "ns", true,
                             "time that the answer took: half took less", NOT_TIMED },
    [OF_DUE_TOOK_P99] = { "deadline_took_p99", "ns", true, "99 % took less", NOT_TIMED },
    [OF_DUE_TOOK_MAX] = { "deadline_took_max", "ns", true, "the longest", NOT_TIMED },
    [OF_DUE_LATE] = { "deadline_late", "1", true,
                      "share of answers that took longer than the deadline", NOT_TIMED },
};

const figure_name budget_figures[BUDGET_FIGURES] = {
    [OF_BUDGET_BYTES] = { "budget_bytes", "B", false, "the budget for all of a model's memory",
                          NOT_TIMED },
    [OF_BUDGET_LEVEL] = { "budget_level", "level", false,
                          "the deepest level that stays in memory; all where everything fits",
                          "everything is in memory, or the budget is too small, see below" },
    [OF_BUDGET_WIDTH] = { "budget_width_median", "model", false,
                          "what stays in memory tells of a distance: half of the points have a "
                          "narrower interval; 0 where everything fits",
                          NOT_TIMED },
    [OF_BUDGET_NS] = { "budget_distance_ns", "ns", true,
                       "an exact distance, uniform points, one at a time, loads included",
                       NOT_TIMED },
    [OF_BUDGET_LOADS] = { "budget_loads", "loads", false, "subtrees loaded for a distance, mean",
                          NOT_TIMED },
    [OF_BUDGET_READ] = { "budget_read_bytes", "B", false, "read for a distance, mean", NOT_TIMED },
};

const figure_name need_figures[NEED_FIGURES] = {
    [OF_NEED_BYTES] = { "need_bytes", "B", false, "of the file that was cut to the need", NULL },
    [OF_NEED_FAR_LO] = { "need_hausdorff_lo", "model", false,
                         "its envelopes reach beyond the model by at least this", NO_MESH },
    [OF_NEED_FAR_HI] = { "need_hausdorff_hi", "model", false, "and certainly by at most this",
                         NO_MESH },
    [OF_NEED_RATIO] = { "need_ratio", "1", false,
                        "need_hausdorff_hi / the error that was asked for, or / what the whole "
                        "file reaches where that is more (leaves cannot be refined); need_bytes / "
                        "the size: 1 or less keeps the word",
                        NO_MESH },
    [OF_NEED_SECONDS] = { "need_seconds", "s", true, "to make the file", NULL },
};

int method_last(const comparison *c, const method *m)
{
    return m->levels - 1 < c->last ? m->levels - 1 : c->last;
}

int comparison_last(const comparison *c)
{
    int last = -1;
    for (int i = 0; i < c->count; i++)
        last = method_last(c, &c->methods[i]) > last ? method_last(c, &c->methods[i]) : last;
    return last;
}

static void fill_nan(double *v, int count)
{
    for (int i = 0; i < count; i++)
        v[i] = NAN;
}

void method_begin(method *m, const char *name, const char *path)
{
    memset(m, 0, sizeof *m);
    snprintf(m->name, sizeof m->name, "%s", name);
    snprintf(m->path, sizeof m->path, "%s", path);
    fill_nan(m->whole, WHOLE_FIGURES);
    fill_nan(&m->level[0][0], EBPO_LEVELS_MAX * LEVEL_FIGURES);
    fill_nan(&m->due[0][0], DEADLINES * DEADLINE_FIGURES);
    fill_nan(&m->budget[0][0], BUDGETS * BUDGET_FIGURES);
    for (int i = 0; i < ROUNDS; i++) {
        round_times *r = &m->round[i];
        fill_nan(r->have, EBPO_LEVELS_MAX);
        fill_nan(r->inside, EBPO_LEVELS_MAX);
        fill_nan(r->distance, EBPO_LEVELS_MAX);
        fill_nan(&r->due[0][0], DEADLINES * DEADLINE_FIGURES);
        r->open = r->exact_inside = r->exact_distance = NAN;
    }
}

void method_note(method *m, const char *what, const char *why)
{
    char text[sizeof m->note[0]];
    snprintf(text, sizeof text, "%s: %s", what, why);
    for (int i = 0; i < m->note_count; i++)
        if (strcmp(m->note[i], text) == 0)
            return;
    if (m->note_count < METHOD_NOTES)
        memcpy(m->note[m->note_count++], text, sizeof text);
}

ebpo_status method_without(method *m, const char *what, ebpo_status status, ebpo_error *error)
{
    if (status != EBPO_E_ABSENT && status != EBPO_E_UNSUPPORTED && status != EBPO_E_NOT_SOLID)
        return status;
    method_note(m, what, error->message);
    *error = (ebpo_error)EBPO_ERROR_INIT;
    return EBPO_OK;
}

void comparison_free(comparison *c)
{
    for (int i = 0; i < c->count; i++)
        for (int k = 0; k < EBPO_LEVELS_MAX; k++)
            free(c->methods[i].picture[k]);
    free(c->methods);
    free(c->portrait);
    free(c->uniform);
    free(c->near);
}

void report_stem(const char *path, char *out, size_t capacity)
{
    const char *shown = remote_shown(path), *slash = strrchr(shown, '/');
    snprintf(out, capacity, "%s", slash ? slash + 1 : shown);
    char *ending = strstr(out, ".ebpo.h5");
    char *dot = ending ? ending : strrchr(out, '.');
    if (dot && dot != out)
        *dot = 0;
}

static int compare_doubles(const void *a, const void *b)
{
    double x, y;
    memcpy(&x, a, sizeof x);
    memcpy(&y, b, sizeof y);
    return (x > y) - (x < y);
}

double quantile_of(double *values, uint64_t count, double share)
{
    if (!count)
        return NAN;
    qsort(values, count, sizeof *values, compare_doubles);
    double place = ceil(share * (double)count);
    uint64_t below = place < 1 ? 1 : (uint64_t)place;
    return values[(below < count ? below : count) - 1];
}

const char *machine_processor(void)
{
    static char name[128];
    char line[512];
    FILE *f = name[0] ? NULL : fopen("/proc/cpuinfo", "r");
    while (f && fgets(line, sizeof line, f)) {
        char *colon = strchr(line, ':');
        if (strncmp(line, "model name", 10) == 0 && colon) {
            colon[1 + strcspn(colon + 1, "\n")] = 0;
            snprintf(name, sizeof name, "%s", colon + 1 + (colon[1] == ' '));
            break;
        }
    }
    if (f)
        fclose(f);
    return name;
}

unsigned machine_cores(void) { return command_cores(); }
