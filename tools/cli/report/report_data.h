/* What `ebpo report` measures: figures of methods by level, and the tables that name them.
 * Everything that is written (CSV, JSON, the page) is written from here. */
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
    REPORT_QUESTIONS =
        200000 /* for the bounds of a level's deviation: flat and huge models would take for ever */
};

/* Of each level; the table level_figures says what they are. */
typedef enum level_figure {
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
    OF_HAVE_SECONDS,
    OF_READ_BYTES,
    OF_READS,
    OF_LINE_BYTES,
    OF_LINE_TRIPS,
    OF_LEVEL_MEMORY,
    OF_THESIS_BYTES,
    OF_THESIS_CUMULATIVE,
    LEVEL_FIGURES
} level_figure;

/* Of a method as a whole. */
typedef enum whole_figure {
    OF_FILE_BYTES,
    OF_HEAD_BYTES,
    OF_ALL_PLANES,
    OF_BUILD_SECONDS,
    OF_OPEN_SECONDS,
    OF_MEMORY_BYTES,
    OF_EXACT_INSIDE_NS,
    OF_EXACT_DISTANCE_NS,
    WHOLE_FIGURES
} whole_figure;

/* Of a deadline, for distances. */
typedef enum deadline_figure {
    OF_DUE_EXACT,
    OF_DUE_WIDTH_MEDIAN,
    OF_DUE_WIDTH_P99,
    OF_DUE_TOOK_MEDIAN,
    OF_DUE_TOOK_P99,
    OF_DUE_TOOK_MAX,
    OF_DUE_LATE,
    DEADLINE_FIGURES
} deadline_figure;

/* Of a memory budget. */
typedef enum budget_figure {
    OF_BUDGET_BYTES,
    OF_BUDGET_LEVEL,
    OF_BUDGET_WIDTH,
    OF_BUDGET_NS,
    OF_BUDGET_LOADS,
    OF_BUDGET_READ,
    BUDGET_FIGURES
} budget_figure;

/* Of a file that was cut to a need. */
typedef enum need_figure {
    OF_NEED_BYTES,
    OF_NEED_FAR_LO,
    OF_NEED_FAR_HI,
    OF_NEED_RATIO,
    OF_NEED_SECONDS,
    NEED_FIGURES
} need_figure;

typedef struct figure_name {
    /* unit "1": a share or a ratio; "model": the model's unit of length, "model^3" its cube */
    const char *name, *unit;
    bool timed; /* differs from run to run */
    const char *meaning;
    /* why it may be absent, where it may and no note of the method says so */
    const char *absent;
} figure_name;
extern const figure_name level_figures[LEVEL_FIGURES], whole_figures[WHOLE_FIGURES],
    deadline_figures[DEADLINE_FIGURES], budget_figures[BUDGET_FIGURES], need_figures[NEED_FIGURES];

extern const unsigned deadlines_us[DEADLINES];
extern const unsigned budget_parts[BUDGETS]; /* budgets are memory_bytes divided by these */

typedef enum need_kind { NEED_ERROR, NEED_SIZE } need_kind;

typedef struct need_result {
    need_kind kind;
    double asked; /* model's unit, or bytes */
    double figure[NEED_FIGURES];
} need_result;

/* What the clock said in one round; methods take turns, so that what else the machine does
 * meanwhile is shared out. Medians of the rounds become figures. */
typedef struct round_times {
    double have[EBPO_LEVELS_MAX], inside[EBPO_LEVELS_MAX], distance[EBPO_LEVELS_MAX];
    double open, exact_inside, exact_distance;
    double due[DEADLINES][DEADLINE_FIGURES];
} round_times;

/* One file. Figures that could not be had are NAN, and a note says why. */
typedef struct method {
    char name[64], path[4096];
    ebpo_info info;
    ebpo_solid_volume solid; /* what is known of its volume */
    /* where volumes are beyond the range of a double: what the solid fills of the root cell, by
     * which excess is taken; else 0 */
    double solid_share;
    ebpo_stored_sizes stored;
    int levels; /* of the file */
    double whole[WHOLE_FIGURES], level[EBPO_LEVELS_MAX][LEVEL_FIGURES],
        due[DEADLINES][DEADLINE_FIGURES], budget[BUDGETS][BUDGET_FIGURES];
    round_times round[ROUNDS];
    need_result need[NEEDS];
    int need_count, note_count;
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
    bool no_pictures, need, keep, json, quiet;
    remote_values remote;
} report_values;

/* How many planes the theses' selections take; each setting makes a method of each of them. */
typedef struct plane_setting {
    double percent;
    char k_root[24]; /* instead, if not "" */
    char word[32];   /* behind the selection's name; "" where there is one setting */
} plane_setting;

typedef struct comparison {
    const report_values *v;
    plane_setting setting[SETTINGS_MAX];
    int settings;
    int first, last; /* levels that are measured; last is at most a method's last one */
    double azimuth, elevation;
    method *methods; /* [count] */
    int count;
    char model[256]; /* what the page is about */
    char *portrait;  /* data URI of the model itself, or NULL */
    double diagonal; /* of the model's box */
    /* [points][3], the same for all methods; near NULL: no method has a mesh */
    double *uniform, *near;
    uint64_t points;
    char folder[4096];            /* for what is being made */
    const char *without_pictures; /* why there are none, or NULL */
    ebpo_progress progress;
    double seconds; /* the whole report took */
} comparison;

/* Index of the last level that is measured of this method; less than c->first: none is. */
int method_last(const comparison *c, const method *m);
/* The deepest one of all methods. */
int comparison_last(const comparison *c);

/* All figures NAN. */
void method_begin(method *m, const char *name, const char *path);
void method_note(method *m, const char *what, const char *why);
void comparison_free(comparison *c);

/* What a file is called: of "dir/bunny.ebpo.h5", or a URL that ends so, "bunny". */
void report_stem(const char *path, char *out, size_t capacity);

/* What a build or a file cannot tell is noted once and leaves figures away; all else stays an
 * error. */
ebpo_status method_without(method *m, const char *what, ebpo_status status, ebpo_error *error);

/* Value `share` (0 .. 1) of the way through ascending values, the least that no more than 1 - share
 * of them exceed; NAN of none. Sorts. */
double quantile_of(double *values, uint64_t count, double share);

/* The steps, in their order; each fills figures of one method. */
EBPO_MUST_USE ebpo_status report_make_points(comparison *c, ebpo_error *error);
EBPO_MUST_USE ebpo_status report_gather(comparison *c, method *m, ebpo_error *error);
EBPO_MUST_USE ebpo_status report_thesis(comparison *c, method *m, ebpo_file *file,
                                        ebpo_error *error);
EBPO_MUST_USE ebpo_status report_round(comparison *c, method *m, int round, ebpo_error *error);
EBPO_MUST_USE ebpo_status report_limited(comparison *c, method *m, ebpo_model *model, int round,
                                         ebpo_error *error);
EBPO_MUST_USE ebpo_status report_deadlines(comparison *c, method *m, ebpo_model *model, int round,
                                           ebpo_error *error);
/* After the last round. */
void report_settle(const comparison *c, method *m);
/* What having each level takes on a line to a server. */
EBPO_MUST_USE ebpo_status report_lines(comparison *c, method *m, ebpo_error *error);
/* Distances while not all of the model is in memory. After memory_bytes is known. */
EBPO_MUST_USE ebpo_status report_budgets(comparison *c, method *m, ebpo_file *file,
                                         ebpo_error *error);
EBPO_MUST_USE ebpo_status report_needs(comparison *c, method *m, ebpo_file *file, ebpo_model *model,
                                       ebpo_error *error);
EBPO_MUST_USE ebpo_status report_pictures(comparison *c, ebpo_error *error);

/* Files of the operands, or built from one mesh with each selection. An exit code; what is wrong
 * has been said on stderr. */
int report_find_methods(comparison *c, const char *const *operand);

/* What is written. */
void report_csv(FILE *out, const comparison *c);
void report_to_json(FILE *out, const comparison *c, bool in_page); /* in_page: see json.h */
void report_page(FILE *out, const comparison *c);
/* Why this build writes no page and how to get one, or NULL: it does. */
const char *report_page_missing(void);

/* "Intel(R) Xeon(R) Processor @ 2.50GHz", "" where the system does not tell; lent. */
const char *machine_processor(void);
/* Those that this process may use. */
unsigned machine_cores(void);

#endif
