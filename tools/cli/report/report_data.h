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
    METHODS_MAX = 12,
    METHOD_NOTES = 10, /* maximum number of notes of a method */
    SETTINGS_MAX = METHODS_MAX,
    DEADLINES = 8, /* number of measured deadlines */
    BUDGETS = 5,   /* number of measured budgets */
    TARGETS = 8,   /* number of measured targets */
    ROUNDS = 3,    /* number of rounds (round_times) */
    /* maximum number of distance queries for the error bounds of a level; without a maximum, flat
     * and huge models would need too much time */
    REPORT_QUERIES = 200000
};

/* Values of each level; the table level_metrics describes them. */
typedef enum level_metric {
    METRIC_BYTES,
    METRIC_CUMULATIVE_BYTES,
    METRIC_GRAY,
    METRIC_LEAVES,
    METRIC_PLANES,
    METRIC_LEAF_PLANES,
    METRIC_VOLUME,
    METRIC_EXCESS,
    METRIC_LEVELS_VOLUME,
    METRIC_LEVELS_EXCESS,
    METRIC_LIMIT_VOLUME,
    METRIC_LIMIT_EXCESS,
    METRIC_EXCESS_TO_LIMIT,
    METRIC_FAR_LO,
    METRIC_FAR_HI,
    METRIC_FAR_MEAN,
    METRIC_FAR_RMS,
    METRIC_MAYBE_UNIFORM,
    METRIC_MAYBE_NEAR,
    METRIC_WIDTH_MEAN,
    METRIC_WIDTH_MEDIAN,
    METRIC_WIDTH_P99,
    METRIC_INSIDE_NS,
    METRIC_DISTANCE_NS,
    METRIC_READING_SECONDS,
    METRIC_READ_BYTES,
    METRIC_READS,
    METRIC_LINE_BYTES,
    METRIC_LINE_TRIPS,
    METRIC_LEVEL_MEMORY,
    METRIC_THESIS_BYTES,
    METRIC_THESIS_CUMULATIVE,
    LEVEL_METRICS
} level_metric;

/* Values of a whole method. */
typedef enum whole_metric {
    METRIC_FILE_BYTES,
    METRIC_HEAD_BYTES,
    METRIC_ALL_PLANES,
    METRIC_BUILD_SECONDS,
    METRIC_OPEN_SECONDS,
    METRIC_MEMORY_BYTES,
    METRIC_EXACT_INSIDE_NS,
    METRIC_EXACT_DISTANCE_NS,
    WHOLE_METRICS
} whole_metric;

/* Values of distance queries with a deadline. */
typedef enum deadline_metric {
    METRIC_DEADLINE_EXACT,
    METRIC_DEADLINE_WIDTH_MEDIAN,
    METRIC_DEADLINE_WIDTH_P99,
    METRIC_DEADLINE_TOOK_MEDIAN,
    METRIC_DEADLINE_TOOK_P99,
    METRIC_DEADLINE_TOOK_MAX,
    METRIC_DEADLINE_LATE,
    DEADLINE_METRICS
} deadline_metric;

/* Values of a memory budget. */
typedef enum budget_metric {
    METRIC_BUDGET_BYTES,
    METRIC_BUDGET_LEVEL,
    METRIC_BUDGET_WIDTH,
    METRIC_BUDGET_NS,
    METRIC_BUDGET_LOADS,
    METRIC_BUDGET_READ,
    BUDGET_METRICS
} budget_metric;

/* Values of a subset that was made for a target, which is a requested error or size. */
typedef enum target_metric {
    METRIC_SUBSET_BYTES,
    METRIC_SUBSET_FAR_LO,
    METRIC_SUBSET_FAR_HI,
    METRIC_SUBSET_RATIO,
    METRIC_SUBSET_SECONDS,
    TARGET_METRICS
} target_metric;

typedef struct metric_name {
    /* unit "1": a share or a ratio; "model": the model's unit of length; "model^3": its cube */
    const char *name, *unit;
    bool timed;          /* true: the value depends on times, and differs from run to run */
    const char *meaning; /* description of the value */
    /* why the value may be absent if no note of the method gives a reason; NULL: never absent */
    const char *absent;
} metric_name;
extern const metric_name level_metrics[LEVEL_METRICS], whole_metrics[WHOLE_METRICS],
    deadline_metrics[DEADLINE_METRICS], budget_metrics[BUDGET_METRICS],
    target_metrics[TARGET_METRICS];

extern const unsigned deadlines_us[DEADLINES]; /* deadlines in microseconds */
/* budget i is the memory of the whole model (METRIC_MEMORY_BYTES) divided by budget_parts[i] */
extern const unsigned budget_parts[BUDGETS];

typedef enum target_kind { TARGET_ERROR, TARGET_SIZE } target_kind;

typedef struct target_result {
    target_kind kind;
    double requested; /* TARGET_ERROR: error in the model's unit; TARGET_SIZE: bytes */
    double metric[TARGET_METRICS];
} target_result;

/* Times of one round. Methods take turns within a round, so that other load of the machine affects
 * all methods alike. The results are medians of the rounds. */
typedef struct round_times {
    double reading[EBPO_LEVELS_MAX]; /* seconds (METRIC_READING_SECONDS) */
    /* nanoseconds of a query to each level */
    double inside[EBPO_LEVELS_MAX], distance[EBPO_LEVELS_MAX];
    double open;                         /* seconds (METRIC_OPEN_SECONDS) */
    double exact_inside, exact_distance; /* nanoseconds of an exact query */
    double deadline[DEADLINES][DEADLINE_METRICS];
} round_times;

/* A method is an .ebpo.h5 file: an operand, or built from a mesh with a selection of planes.
 * Unavailable values are NAN, and a note gives the reason. */
typedef struct method {
    char name[64], path[4096];
    ebpo_info info;
    ebpo_solid_volume solid; /* bounds of the volume of the solid */
    /* If volumes are beyond the range of a double: the share of the root cell that is inside the
     * solid, from which the excess is computed. Otherwise 0. */
    double solid_share;
    ebpo_stored_sizes stored;
    int levels; /* number of levels in the file */
    double whole[WHOLE_METRICS], level[EBPO_LEVELS_MAX][LEVEL_METRICS],
        deadline[DEADLINES][DEADLINE_METRICS], budget[BUDGETS][BUDGET_METRICS];
    round_times round[ROUNDS];
    target_result targets[TARGETS];
    int target_count, note_count;
    ebpo_thesis_levels *unlimited;  /* results of --unlimited; NULL: not computed */
    double unlimited_seconds;       /* seconds to compute `unlimited` */
    char note[METHOD_NOTES][320];   /* [note_count] */
    char *picture[EBPO_LEVELS_MAX]; /* picture of each level as a data URI; NULL: no picture */
} method;

/* Values of the options. */
typedef struct report_values {
    const char *out, *levels, *percent, *k_root;
    uint32_t select;
    int normals, up;
    double epsilon;
    int64_t max_level, leaf_faces, points, seed, threads;
    const char *view, *memory;
    arg_list names;
    int coalesce;
    bool no_pictures, targets, keep, json, quiet, unlimited;
    remote_values remote;
} report_values;

/* A number of planes for the selections of the theses. Each setting makes one method for each
 * selection. */
typedef struct plane_setting {
    double percent;  /* value of --percent, used if `k_root` is "" */
    char k_root[24]; /* value of --k-root */
    char word[32];   /* follows the selection's name in the method's name; "": only one setting */
} plane_setting;

typedef struct comparison {
    const report_values *v;
    plane_setting setting[SETTINGS_MAX];
    int settings;
    int first, last;           /* levels to measure; a method that has fewer levels ends earlier */
    double azimuth, elevation; /* direction from which pictures are drawn, in degrees */
    method *methods;           /* [count] */
    int count;
    char model[256];   /* model name for the page */
    char *portrait;    /* picture of the model itself as a data URI; NULL: no picture */
    double diagonal;   /* diagonal of the bounding box of the model */
    uint64_t points;   /* number of points for queries, which are the same for all methods */
    double *uniform;   /* [points][3] uniform in the bounding box of the model */
    double *near;      /* [points][3] near the surface; NULL: no method has a mesh */
    char folder[4096]; /* the temporary folder in which the report is written */
    const char *without_pictures; /* why there are no pictures; NULL: there are pictures */
    ebpo_progress progress;
    double seconds; /* duration of the whole report */
} comparison;

/* Returns the last measured level of this method. If no level is measured, the result is less than
 * c->first. */
int method_last(const comparison *c, const method *m);
/* Returns the deepest measured level of all methods. */
int comparison_last(const comparison *c);

/* Initializes a method; all values are NAN. */
void method_begin(method *m, const char *name, const char *path);
/* Adds the note "WHAT: WHY", unless the method has this note or too many notes. */
void method_note(method *m, const char *what, const char *why);
void comparison_free(comparison *c);

/* Writes the short name of a file or URL: "bunny" for "dir/bunny.ebpo.h5". */
void report_stem(const char *path, char *out, size_t capacity);

/* If `status` means that a file or this build does not support a measurement, adds the note "WHAT:
 * " with the message of `error`, and returns EBPO_OK. Otherwise returns `status`. */
ebpo_status method_note_missing(method *m, const char *what, ebpo_status status, ebpo_error *error);

/* Sorts the values, and returns their quantile: the least value v of which a fraction of at least
 * `share` of all values is less than or equal to v. Returns NAN if `count` is 0. */
double quantile_of(double *values, uint64_t count, double share);

/* The steps of a report in their order. A function with the parameter `m` sets values of this
 * method. */
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
/* Counts the bytes and round trips that reading each level over a network needs. */
EBPO_MUST_USE ebpo_status report_lines(comparison *c, method *m, ebpo_error *error);
/* Measures distances while only a part of the model is in memory. METRIC_MEMORY_BYTES must be set.
 */
EBPO_MUST_USE ebpo_status report_budgets(comparison *c, method *m, ebpo_file *file,
                                         ebpo_error *error);
EBPO_MUST_USE ebpo_status report_targets(comparison *c, method *m, ebpo_file *file,
                                         ebpo_model *model, ebpo_error *error);
EBPO_MUST_USE ebpo_status report_pictures(comparison *c, ebpo_error *error);

/* Finds the methods: reads the files of the operands, or builds a file with each selection from a
 * mesh. Returns an exit code; errors have been reported on stderr. */
int report_find_methods(comparison *c, const char *const *operand);

/* Write the report as CSV, JSON or HTML. `in_page`: see json.h. */
void report_csv(FILE *out, const comparison *c);
void report_to_json(FILE *out, const comparison *c, bool in_page);
void report_page(FILE *out, const comparison *c);
/* Returns why this build writes no page, and how to get a build that does. Returns NULL if this
 * build writes the page. */
const char *report_page_missing(void);

/* Returns the name of the processor, such as "Intel(R) Xeon(R) Processor @ 2.50GHz", or "" if it is
 * not known. The string is static. */
const char *machine_processor(void);
/* Returns the number of cores that this process may use. */
unsigned machine_cores(void);

#endif
