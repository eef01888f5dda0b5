#include "cli/report/report_data.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/command.h"
#include "cli/words.h"

const unsigned deadlines_us[DEADLINES] = { 1, 2, 5, 10, 20, 50, 100, 1000 };
const unsigned budget_parts[BUDGETS] = { 1, 2, 4, 8, 16 };

#define NO_VOLUME                                                                                 \
    "a surface, or a solid without volume, has no volume to exceed; or the volume of the solid "  \
    "is not known, because components intersect or the mesh is not a 2-manifold; or volumes are " \
    "beyond the range of a double, and could not be computed in another unit"
#define OUT_OF_RANGE "the volume in the model's unit cubed is beyond the range of a double"
#define NO_MESH      "the file has no mesh, see below"
#define NO_INSIDE    "a surface has no inside"
#define NOT_TIMED    "this query is not available for the method, see below"

const metric_name level_metrics[LEVEL_METRICS] = {
    [METRIC_BYTES] = { "bytes", "B", false, "bytes of the level in the file", NULL },
    [METRIC_CUMULATIVE_BYTES] = { "cumulative_bytes", "B", false,
                                  "bytes of the header and of levels 0 to this level", NULL },
    [METRIC_GRAY] = { "gray", "nodes", false, "gray nodes of the level", NULL },
    [METRIC_LEAVES] = { "leaf", "nodes", false, "leaves of the level", NULL },
    [METRIC_PLANES] = { "planes", "planes", false, "planes stored for the gray nodes of the level",
                        NULL },
    [METRIC_LEAF_PLANES] = { "leaf_planes", "planes", false,
                             "planes stored for the leaves of the level", NULL },
    [METRIC_VOLUME] = { "envelope_volume", "model^3", false,
                        "volume of the envelopes that represent the model at this level; a leaf "
                        "without stored planes has planes that are derived from its faces",
                        OUT_OF_RANGE },
    [METRIC_EXCESS] = { "excess", "%", false,
                        "volume of the envelopes beyond the volume of the solid, in percent of the "
                        "volume of the solid",
                        NO_VOLUME },
    [METRIC_LEVELS_VOLUME] = { "levels_volume", "model^3", false,
                               "volume of the envelopes from levels 0 to this level alone, without "
                               "the mesh: a leaf without stored planes has the envelope of its "
                               "parent",
                               OUT_OF_RANGE },
    [METRIC_LEVELS_EXCESS] = { "levels_excess", "%", false, "excess of levels_volume", NO_VOLUME },
    [METRIC_LIMIT_VOLUME] = { "limit_volume", "model^3", false,
                              "volume of the convex hulls of the solid in each cell: no convex "
                              "envelope is smaller",
                              NO_MESH },
    [METRIC_LIMIT_EXCESS] = { "limit_excess", "%", false, "excess of limit_volume",
                              "the file has no mesh or no volume, or this build has no qhull" },
    [METRIC_EXCESS_TO_LIMIT] = { "excess_to_limit", "1", false, "excess / limit_excess",
                                 "the limit is the solid itself, or there is no limit, or no "
                                 "volume is within the range of a double" },
    [METRIC_FAR_LO] = { "hausdorff_lo", "model", false,
                        "lower bound of the one-sided Hausdorff distance from the envelopes to the "
                        "model",
                        NO_MESH },
    [METRIC_FAR_HI] = { "hausdorff_hi", "model", false,
                        "upper bound of the one-sided Hausdorff distance from the envelopes to the "
                        "model",
                        NO_MESH },
    [METRIC_FAR_MEAN] = { "distance_mean", "model", false,
                          "mean distance from the level's surface to the model, sampled",
                          "no sample lies on the level's surface, or the file has no mesh" },
    [METRIC_FAR_RMS] = { "distance_rms", "model", false,
                         "root mean square distance from the level's surface to the model, sampled",
                         "no sample lies on the level's surface, or the file has no mesh" },
    [METRIC_MAYBE_UNIFORM] = { "maybe_uniform", "1", false,
                               "share of points, uniform in the bounding box of the model, that a "
                               "point-in-solid query to this level leaves undecided",
                               NO_INSIDE },
    [METRIC_MAYBE_NEAR] = { "maybe_near", "1", false,
                            "share of undecided points among points within 1 % of the diagonal "
                            "from the surface",
                            "a surface has no inside, and without a mesh no points near the "
                            "surface are made" },
    [METRIC_WIDTH_MEAN] = { "width_mean", "model", false,
                            "mean width of the interval that contains the distance, in queries to "
                            "this level; uniform points",
                            NULL },
    [METRIC_WIDTH_MEDIAN] = { "width_median", "model", false,
                              "width of the interval: half of the points have a narrower interval",
                              NULL },
    [METRIC_WIDTH_P99] = { "width_p99", "model", false,
                           "width of the interval: 99 % of the points have a narrower interval",
                           NULL },
    [METRIC_INSIDE_NS] = { "inside_ns", "ns", true,
                           "time of a point-in-solid query to this level; uniform points, in a "
                           "batch, one thread",
                           NO_INSIDE },
    [METRIC_DISTANCE_NS] = { "distance_ns", "ns", true,
                             "time of a distance query to this level; uniform points, in a batch, "
                             "one thread",
                             NULL },
    [METRIC_READING_SECONDS] = { "reading_seconds", "s", true,
                                 "time to open the file and read levels 0 to this level, after the "
                                 "file was dropped from the page cache",
                                 NULL },
    [METRIC_READ_BYTES] = { "read_bytes", "B", false,
                            "bytes requested from the file to read levels 0 to this level", NULL },
    [METRIC_READS] = { "reads", "reads", false,
                       "number of read calls to read levels 0 to this level", NULL },
    [METRIC_LINE_BYTES] = { "line_bytes", "B", false,
                            "bytes sent by a server to read levels 0 to this level: the first 128 "
                            "KiB of the file, and further data in blocks of 4 KiB",
                            NOT_TIMED },
    [METRIC_LINE_TRIPS] = { "line_trips", "trips", false,
                            "round trips to the server, including the first 128 KiB; ranges with a "
                            "common prefetch hint need one round trip",
                            NOT_TIMED },
    [METRIC_LEVEL_MEMORY] = { "level_memory_bytes", "B", false,
                              "memory of a model that keeps levels 0 to this level and loads lower "
                              "levels on demand, before the first load",
                              NOT_TIMED },
    [METRIC_THESIS_BYTES] = { "thesis_bytes", "B", false,
                              "cost of the level in the cost model of the theses", NO_MESH },
    [METRIC_THESIS_CUMULATIVE] = { "thesis_cumulative_bytes", "B", false,
                                   "cost of levels 0 to this level in the cost model of the theses",
                                   NO_MESH },
};

const metric_name whole_metrics[WHOLE_METRICS] = {
    [METRIC_FILE_BYTES] = { "file_bytes", "B", false,
                            "size of the file, including the mesh if the file has the mesh", NULL },
    [METRIC_HEAD_BYTES] = { "head_bytes", "B", false, "size of the header, which is before level 0",
                            NULL },
    [METRIC_ALL_PLANES] = { "all_planes", "planes", false, "planes stored in the file", NULL },
    [METRIC_BUILD_SECONDS] = { "build_seconds", "s", true,
                               "time to build the tree from the checked mesh",
                               "not known for existing files" },
    [METRIC_OPEN_SECONDS] = { "open_seconds", "s", true,
                              "time to load the whole model into memory, ready for queries", NULL },
    [METRIC_MEMORY_BYTES] = { "memory_bytes", "B", false, "memory of the whole model", NOT_TIMED },
    [METRIC_EXACT_INSIDE_NS] = { "exact_inside_ns", "ns", true,
                                 "time of an exact point-in-solid query; uniform points, in a "
                                 "batch, one thread",
                                 "a surface has no inside, and a file without a mesh has no exact "
                                 "results" },
    [METRIC_EXACT_DISTANCE_NS] = { "exact_distance_ns", "ns", true,
                                   "time of an exact distance query; uniform points, in a batch, "
                                   "one thread",
                                   NO_MESH },
};

const metric_name deadline_metrics[DEADLINE_METRICS] = {
    [METRIC_DEADLINE_EXACT] = { "deadline_exact", "1", true,
                                "share of distances that are exact at the deadline; uniform "
                                "points, one "
                                "at a time",
                                NOT_TIMED },
    [METRIC_DEADLINE_WIDTH_MEDIAN] = { "deadline_width_median", "model", true,
                                       "width of the certain interval at the deadline: half of the "
                                       "points "
                                       "have a narrower interval",
                                       NOT_TIMED },
    [METRIC_DEADLINE_WIDTH_P99] = { "deadline_width_p99", "model", true,
                                    "width of the certain interval at the deadline: 99 % of the "
                                    "points have a narrower interval",
                                    NOT_TIMED },
    [METRIC_DEADLINE_TOOK_MEDIAN] = { "deadline_took_median", "ns", true,
                                      "time of a query: half of the queries took less", NOT_TIMED },
    [METRIC_DEADLINE_TOOK_P99] = { "deadline_took_p99", "ns", true,
                                   "time of a query: 99 % of the queries took less", NOT_TIMED },
    [METRIC_DEADLINE_TOOK_MAX] = { "deadline_took_max", "ns", true, "time of the longest query",
                                   NOT_TIMED },
    [METRIC_DEADLINE_LATE] = { "deadline_late", "1", true,
                               "share of queries that took longer than the deadline", NOT_TIMED },
};

const metric_name budget_metrics[BUDGET_METRICS] = {
    [METRIC_BUDGET_BYTES] = { "budget_bytes", "B", false, "budget for all memory of a model",
                              NOT_TIMED },
    [METRIC_BUDGET_LEVEL] = { "budget_level", "level", false, "deepest level that stays in memory",
                              "everything is in memory, or the budget is too small, see below" },
    [METRIC_BUDGET_WIDTH] = { "budget_width_median", "model", false,
                              "width of the interval of a distance from the data in memory: half "
                              "of the points have a narrower interval; 0 if the whole model fits",
                              NOT_TIMED },
    [METRIC_BUDGET_NS] = { "budget_distance_ns", "ns", true,
                           "time of an exact distance query, including loads; uniform points, one "
                           "at a time",
                           NOT_TIMED },
    [METRIC_BUDGET_LOADS] = { "budget_loads", "loads", false,
                              "mean number of subtrees loaded for a distance", NOT_TIMED },
    [METRIC_BUDGET_READ] = { "budget_read_bytes", "B", false,
                             "mean number of bytes read for a distance", NOT_TIMED },
};

const metric_name target_metrics[TARGET_METRICS] = {
    [METRIC_SUBSET_BYTES] = { "subset_bytes", "B", false,
                              "size of the file that was made for the target", NULL },
    [METRIC_SUBSET_FAR_LO] = { "subset_hausdorff_lo", "model", false,
                               "lower bound of the error of the envelopes in this file", NO_MESH },
    [METRIC_SUBSET_FAR_HI] = { "subset_hausdorff_hi", "model", false,
                               "upper bound of the error of the envelopes in this file", NO_MESH },
    [METRIC_SUBSET_RATIO] = { "subset_ratio", "1", false,
                              "for an error: subset_hausdorff_hi divided by the requested error, "
                              "or by the error of the whole file if that is larger (leaves cannot "
                              "be refined); for a size: subset_bytes divided by the requested "
                              "size. A ratio of at most 1 meets the target",
                              NO_MESH },
    [METRIC_SUBSET_SECONDS] = { "subset_seconds", "s", true, "time to make the file", NULL },
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
    fill_nan(m->whole, WHOLE_METRICS);
    fill_nan(&m->level[0][0], EBPO_LEVELS_MAX * LEVEL_METRICS);
    fill_nan(&m->deadline[0][0], DEADLINES * DEADLINE_METRICS);
    fill_nan(&m->budget[0][0], BUDGETS * BUDGET_METRICS);
    for (int i = 0; i < ROUNDS; i++) {
        round_times *r = &m->round[i];
        fill_nan(r->reading, EBPO_LEVELS_MAX);
        fill_nan(r->inside, EBPO_LEVELS_MAX);
        fill_nan(r->distance, EBPO_LEVELS_MAX);
        fill_nan(&r->deadline[0][0], DEADLINES * DEADLINE_METRICS);
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

ebpo_status method_note_missing(method *m, const char *what, ebpo_status status, ebpo_error *error)
{
    if (status != EBPO_E_ABSENT && status != EBPO_E_UNSUPPORTED && status != EBPO_E_NOT_SOLID)
        return status;
    method_note(m, what, error->message);
    *error = (ebpo_error)EBPO_ERROR_INIT;
    return EBPO_OK;
}

void comparison_free(comparison *c)
{
    for (int i = 0; i < c->count; i++) {
        free(c->methods[i].unlimited);
        for (int k = 0; k < EBPO_LEVELS_MAX; k++)
            free(c->methods[i].picture[k]);
    }
    free(c->methods);
    free(c->portrait);
    free(c->uniform);
    free(c->near);
}

void report_stem(const char *path, char *out, size_t capacity)
{
    snprintf(out, capacity, "%s", words_file_name(remote_shown(path)));
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
    double exact_rank = ceil(share * (double)count);
    uint64_t rank = exact_rank < 1 ? 1 : (uint64_t)exact_rank; /* the least value has rank 1 */
    return values[(rank < count ? rank : count) - 1];
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
