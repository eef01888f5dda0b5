/* Options shared by the query commands: memory of a model, and queries. */
#ifndef EBPO_TOOLS_QUERY_ARGS_H
#define EBPO_TOOLS_QUERY_ARGS_H

#include <ebpo/query.h>
#include <math.h>

#include "cli/args.h"
#include "cli/remote_args.h"

typedef struct query_values {
    const char *memory, *deadline, *attribute, *out, *shard;
    int64_t cut_level, threads, level, nearest, together;
    double max_distance, tmax, within, threshold;
    /* indices in the lists of words with these names: inside_modes, distance_modes, ray_sides */
    int inside_mode, distance_mode, ray_sides;
    bool prefetch, raw, json, unsigned_distance, no_warm, all, any, header, csv, npy, force;
    remote_values remote;
} query_values;
#define QUERY_VALUES_INIT                                                         \
    {                                                                             \
        .cut_level = -1, .level = -1, .max_distance = INFINITY, .tmax = INFINITY, \
        .within = INFINITY, .threshold = 0.5, .remote = REMOTE_VALUES_INIT        \
    }

/* Words for --mode, NULL-terminated; EBP 2017, section 4.3. */
extern const char *const inside_modes[];   /* fast, cache, nodes, ... */
extern const char *const distance_modes[]; /* in the order of ebpo_distance_mode */
extern const char *const ray_sides[];      /* for --sides, in the order of ebpo_ray_sides */

/* Options as bits, for query_check_effect. */
enum {
    QUERY_LEVEL = 1,
    QUERY_DEADLINE = 2,
    QUERY_MAX_DISTANCE = 4,
    QUERY_UNSIGNED = 8,
    QUERY_NO_WARM = 16,
    QUERY_PREFETCH = 32
};

/* Returns true if `ebpo distance` returns a list of faces for each point (--nearest, --within). */
static inline bool query_lists(const query_values *v)
{
    return v->nearest > 0 || isfinite(v->within);
}

/* Returns false, after an error message, if an option was given whose bit is in `ineffective`.
 * These options have no effect together with the option `with`, such as "--mode leaves". The caller
 * then exits with EXIT_USAGE. */
bool query_check_effect(const char *name, const query_values *v, unsigned ineffective,
                        const char *with);
/* Return false, after an error message, if an option was given that has no effect with the other
 * options of the command `inside` or `distance`. The caller then exits with EXIT_USAGE. */
bool query_inside_fits(const char *name, const query_values *v);
bool query_distance_fits(const char *name, const query_values *v);

/* Converts the values to options of the library. `name`: name of the command, for messages. Returns
 * false, after an error message, for an invalid value. The caller then exits with EXIT_USAGE. */
bool query_options_from(const char *name, const query_values *v, ebpo_model_options *model,
                        ebpo_inside_options *inside, ebpo_distance_options *distance);

/* Reads the value of --deadline as nanoseconds. Returns false, after an error message, for an
 * invalid value. */
bool query_read_time(const char *name, const char *text, uint64_t *out);

/* A file, the model of the file in memory, and a context. */
typedef struct query_session {
    ebpo_file *file;
    ebpo_model *model;
    ebpo_context *context;
} query_session;
#define QUERY_SESSION_INIT \
    {                      \
        NULL, NULL, NULL   \
    }

/* Opens a file, its model and a context. `level`: a level that the file must have; -1: none.
 * Returns an exit code; errors have been reported on stderr. Call query_close in any case. */
int query_open(query_session *s, const char *name, const char *path,
               const ebpo_model_options *options, int level, const remote_values *remote);
/* Open the file and then its model, in two steps, without a context. */
int query_open_file(query_session *s, const char *name, const char *path,
                    const ebpo_model_options *options, int level, const remote_values *remote);
int query_open_model(query_session *s, const char *name, const ebpo_model_options *options);
void query_close(query_session *s);

#endif
