/* ebpo distance: how far points are from the model, and from what. */
#include <float.h>
#include <stddef.h>

#include "cli/command.h"
#include "cmd/commands.h"
#include "cmd/query_run.h"

static const arg_option options[] = {
    OPTION_WORD("mode", 'm', query_values, distance_mode, "MODE", distance_modes,
                "exact, the default, or one of EBP 2017, which do not guarantee the minimum: "
                "recursive, leaves, envelope"),
    OPTION_REAL("max-distance", 0, query_values, max_distance, "D", 0, DBL_MAX,
                "ignore what is farther than D: inf"),
    OPTION_FLAG("unsigned", 0, query_values, unsigned_distance,
                "no sign (surfaces have none anyway)"),
    OPTION_FLAG("no-warm", 0, query_values, no_warm,
                "do not start from the previous answer; the answers are the same"),
    QUERY_LIMIT_OPTIONS(
        "look only at levels 0 to L and print lo and hi, between which the distance lies"),
    QUERY_MODEL_OPTIONS,
    QUERY_PREFETCH_OPTION,
    QUERY_FORM_OPTIONS("each point is three doubles, each answer seven doubles and a uint64, or lo "
                       "and hi (little-endian)"),
    { 0 },
};

static const arg_spec spec = {
    .command = "distance",
    .operands = "MODEL [POINTS]",
    .least = 1,
    .most = 2,
    .summary = "tells how far points are from the model: distance, nearest point, normal, face",
    .text = "MODEL is an .ebpo.h5 file. POINTS holds lines 'x y z', or is a PLY file; if absent or "
            "'-', standard input. Distances are correctly rounded, and negative inside a solid.",
    .options = options,
};

/* Then all that is certain is an interval. */
static bool limited(const ebpo_distance_options *o)
{
    return o->mode == EBPO_DISTANCE_EXACT && (o->level >= 0 || o->deadline_ns);
}

static ebpo_status answer(const query_job *job, ebpo_context *context, const double *rows,
                          uint64_t count, ebpo_error *error)
{
    ebpo_distance_result *results = job->results;
    ebpo_status status = ebpo_distance_many(context, rows, count, &job->distance, results, error);
    if (status == EBPO_OK)
        answers_distance(job->form, limited(&job->distance), results, count);
    return status;
}

static const query_values usual = QUERY_VALUES_INIT;

static int run(void *given, const char **operand)
{
    query_values *v = given;
    if (!query_distance_fits("distance", v) ||
        (v->level >= 0 && !query_accepts("distance", v, QUERY_MAX_DISTANCE, "--level")))
        return EXIT_USAGE;
    static ebpo_distance_result results[POINTS_BATCH];
    query_job job = {
        .command = "distance", .values = v, .kind = POINTS, .answer = answer, .results = results
    };
    return query_run(&job, operand[0], operand[1]);
}

const command command_distance = { &spec, sizeof usual, &usual, run };
