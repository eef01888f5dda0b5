/* Data of `ebpo report`: values of methods by level, and the tables that name the values. CSV, JSON
 * and the page are written from these data. */
#ifndef EBPO_TOOLS_REPORT_DATA_H
#define EBPO_TOOLS_REPORT_DATA_H

#include <ebpo/ebpo.h>
#include <math.h>

#include "cli/args.h"
#include "cli/progress.h"
#include "cli/remote_args.h"

enum {
    METHODS_MAX = ARGS_OPERANDS_MAX,
    METHOD_NOTES = 10,
    SETTINGS_MAX = METHODS_MAX,
    DEADLINES = 8,
    BUDGETS = 5,
    NEEDS = 8,
    ROUNDS = 3,
    REPORT_QUERIES =
        200000 /* limits the bounds of a level's error: flat and huge models would take too long */
};

/* Values of each level; the table level_metrics describes them. */
typedef enum level_metric {
    OF_BYTES,
    OF_CUMULATIVE_BYTES,
    OF_GRAY,
    OF_LEAVES,
    OF_PLANES,
    OF_LEAF_PLANES,
    OF_VOLUME,
    OF_EXCESS,
    OF_LEVELS_VOLUME,
    OF_LEVELS_EXCESS,
    OF_LIMIT_VOLUME,
    OF_LIMIT_EXCESS,
    OF_EXCESS_TO_LIMIT,
    OF_FAR_LO,
    OF_FAR_HI,
    OF_FAR_MEAN,
    OF_FAR_RMS,
    OF_MAYBE_UNIFORM,
    OF_MAYBE_NEAR,
    OF_WIDTH_MEAN,
    OF_WIDTH_MEDIAN,
    OF_WIDTH_P99,
    OF_INSIDE_NS,
    OF_DISTANCE_NS,
    OF_READING_SECONDS,
    OF_READ_BYTES,
    OF_READS,
    OF_LINE_BYTES,
    OF_LINE_TRIPS,
    OF_LEVEL_MEMORY,
    OF_THESIS_BYTES,
    OF_THESIS_CUMULATIVE,
    LEVEL_METRICS
} level_metric;

/* Values of a whole method. */
typedef enum whole_metric {
    OF_FILE_BYTES,
    OF_HEAD_BYTES,
    OF_ALL_PLANES,
    OF_BUILD_SECONDS,
    OF_OPEN_SECONDS,
    OF_MEMORY_BYTES,
    OF_EXACT_INSIDE_NS,
    OF_EXACT_DISTANCE_NS,
    WHOLE_METRICS
} whole_metric;

/* Values of distance queries with a deadline. */
typedef enum deadline_metric {
    OF_DUE_EXACT,
    OF_DUE_WIDTH_MEDIAN,
    OF_DUE_WIDTH_P99,
    OF_DUE_TOOK_MEDIAN,
    OF_DUE_TOOK_P99,
    OF_DUE_TOOK_MAX,
    OF_DUE_LATE,
    DEADLINE_METRICS
} deadline_metric;

/* Values of a memory budget. */
typedef enum budget_metric {
    OF_BUDGET_BYTES,
    OF_BUDGET_LEVEL,
    OF_BUDGET_WIDTH,
    OF_BUDGET_NS,
    OF_BUDGET_LOADS,
    OF_BUDGET_READ,
    BUDGET_METRICS
} budget_metric;

/* Values of a subset that was made for a need, which is a requested error or size. */
typedef enum need_metric {
    OF_NEED_BYTES,
    OF_NEED_FAR_LO,
    OF_NEED_FAR_HI,
    OF_NEED_RATIO,
    OF_NEED_SECONDS,
    NEED_METRICS
} need_metric;

typedef struct metric_name {
    /* unit "1": a share or a ratio; "model": the model's unit of length, "model^3" its cube */
    const char *name, *unit;
    bool timed; /* the value differs from run to run */
    const char *meaning;
    /* why it may be absent, when no note of the method gives a reason */
    const char *absent;
} metric_name;
extern const metric_name level_metrics[LEVEL_METRICS], whole_metrics[WHOLE_METRICS],
    deadline_metrics[DEADLINE_METRICS], budget_metrics[BUDGET_METRICS], need_metrics[NEED_METRICS];

extern const unsigned deadlines_us[DEADLINES];
extern const unsigned budget_parts[BUDGETS]; /* budgets are memory_bytes divided by these */

typedef enum need_kind { NEED_ERROR, NEED_SIZE } need_kind;

typedef struct need_result {
    need_kind kind;
    double requested; /* model's unit, or bytes */
    double metric[NEED_METRICS];
} need_result;

/* Times of one round. Methods take turns within a round, so that other load of the machine affects
 * all methods alike. The results are medians of the rounds. */
typedef struct round_times {
    double reading[EBPO_LEVELS_MAX], inside[EBPO_LEVELS_MAX], distance[EBPO_LEVELS_MAX];
    double open, exact_inside, exact_distance;
    double due[DEADLINES][DEADLINE_METRICS];
} round_times;

/* One file. Unavailable values are NAN, and a note gives the reason. */
typedef struct method {
    char name[64], path[4096];
    ebpo_info info;
    ebpo_solid_volume solid; /* bounds of the volume of the solid */
    /* if volumes are beyond the range of a double: the share of the root cell that is inside the
     * solid, from which the excess is computed; else 0 */
    double solid_share;
    ebpo_stored_sizes stored;
    int levels; /* number of levels in the file */
    double whole[WHOLE_METRICS], level[EBPO_LEVELS_MAX][LEVEL_METRICS],
        due[DEADLINES][DEADLINE_METRICS], budget[BUDGETS][BUDGET_METRICS];
    round_times round[ROUNDS];
    need_result need[NEEDS];
    int need_count, note_count;
    ebpo_thesis_levels *unlimited; /* --unlimited; NULL: not computed */
    double unlimited_seconds;
    char note[METHOD_NOTES][320];
    char *picture[EBPO_LEVELS_MAX]; /* data URIs, or NULL */
} method;

typedef struct report_values {
    const char *out, *levels, *percent, *k_root;
    uint32_t select;
    int normals, up;
    double epsilon;
    int64_t max_level, leaf_faces, points, seed, threads;
    const char *view, *memory;
    arg_list names;
    int coalesce;
    bool no_pictures, need, keep, json, quiet, unlimited;
    remote_values remote;
} report_values;

/* Number of planes for the selections of the theses. Each setting makes one method for each
 * selection. */
typedef struct plane_setting {
    double percent;
    char k_root[24]; /* --k-root, used instead if not "" */
    char word[32];   /* suffix of the selection's name; "" when there is one setting */
} plane_setting;

typedef struct comparison {
    const report_values *v;
    plane_setting setting[SETTINGS_MAX];
    int settings;
    int first, last; /* levels that are measured; last is at most the last level of a method */
    double azimuth, elevation;
    method *methods; /* [count] */
    int count;
    char model[256]; /* model name for the page */
    char *portrait;  /* data URI of the model itself, or NULL */
    double diagonal; /* diagonal of the bounding box of the model */
    /* [points][3], the same for all methods; near NULL: no method has a mesh */
    double *uniform, *near;
    uint64_t points;
    char folder[4096];            /* for temporary files */
    const char *without_pictures; /* reason for missing pictures, or NULL */
    ebpo_progress progress;
    double seconds; /* duration of the whole report */
} comparison;

/* Returns the last measured level of this method; less than c->first: none. */
int method_last(const comparison *c, const method *m);
/* Returns the deepest measured level of all methods. */
int comparison_last(const comparison *c);

/* Sets all values to NAN. */
void method_begin(method *m, const char *name, const char *path);
void method_note(method *m, const char *what, const char *why);
void comparison_free(comparison *c);

/* Writes the short name of a file: "bunny" for "dir/bunny.ebpo.h5", or for a URL with this ending.
 */
void report_stem(const char *path, char *out, size_t capacity);

/* Adds a note, once, why a build or a file has no results of a kind, and returns EBPO_OK. For
 * failures that are no such reason, returns `status`. */
ebpo_status method_note_missing(method *m, const char *what, ebpo_status status, ebpo_error *error);

/* Sorts the values, and returns the quantile `share` (0 .. 1): the least value that at most 1 -
 * share of the values exceed; NAN if there is none. */
double quantile_of(double *values, uint64_t count, double share);

/* The steps of a report in their order. Each sets values of one method. */
EBPO_MUST_USE ebpo_status report_make_points(comparison *c, ebpo_error *error);
EBPO_MUST_USE ebpo_status report_gather(comparison *c, method *m, ebpo_error *error);
EBPO_MUST_USE ebpo_status report_thesis(comparison *c, method *m, ebpo_file *file,
                                        ebpo_error *error);
EBPO_MUST_USE ebpo_status report_round(comparison *c, method *m, int round, ebpo_error *error);
EBPO_MUST_USE ebpo_status report_limited(comparison *c, method *m, ebpo_model *model, int round,
                                         ebpo_error *error);
EBPO_MUST_USE ebpo_status report_deadlines(comparison *c, method *m, ebpo_model *model, int round,
                                           ebpo_error *error);
/* Computes the medians of the rounds. */
void report_medians(const comparison *c, method *m);
/* Counts bytes and round trips for each level over a network. */
EBPO_MUST_USE ebpo_status report_lines(comparison *c, method *m, ebpo_error *error);
/* Measures distances while only a part of the model is in memory. Needs memory_bytes. */
EBPO_MUST_USE ebpo_status report_budgets(comparison *c, method *m, ebpo_file *file,
                                         ebpo_error *error);
EBPO_MUST_USE ebpo_status report_needs(comparison *c, method *m, ebpo_file *file, ebpo_model *model,
                                       ebpo_error *error);
EBPO_MUST_USE ebpo_status report_pictures(comparison *c, ebpo_error *error);

/* Opens files of the operands, or builds them from one mesh with each selection. Returns an exit
 * code; errors have been reported on stderr. */
int report_find_methods(comparison *c, const char *const *operand);

/* Output. */
void report_csv(FILE *out, const comparison *c);
void report_to_json(FILE *out, const comparison *c, bool in_page); /* in_page: see json.h */
void report_page(FILE *out, const comparison *c);
/* Returns why this build writes no page and how to get one, or NULL when it does. */
const char *report_page_missing(void);

/* "Intel(R) Xeon(R) Processor @ 2.50GHz", "" when not known; borrowed. */
const char *machine_processor(void);
/* Number of cores that this process may use. */
unsigned machine_cores(void);

#endif
