/* ebpo distance: how far points are from the model, and from what. */
#include <float.h>
#include <stddef.h>

#include "cli/command.h"
#include "cmd/commands.h"
#include "cmd/query_run.h"

static const arg_option options[] = {
    { "mode", 'm', ARG_WORD, offsetof(query_values, distance_mode), "MODE",
      "exact, the default, or one of EBP 2017, which do not promise the\nminimum: recursive, "
      "leaves, envelope",
      0, 0, distance_modes },
    { "max-distance", 0, ARG_REAL, offsetof(query_values, max_distance), "D",
      "what is farther than D does not matter: inf", 0, DBL_MAX, NULL },
    ARG_SWITCH("unsigned", 0, query_values, unsigned_distance,
               "no sign (surfaces have none anyway)"),
    ARG_SWITCH("no-warm", 0, query_values, no_warm,
               "do not begin with the answer before; the answers are the same"),
    QUERY_LIMIT_OPTIONS(
        "look at levels 0 to L only and print lo and hi, between which\nthe distance is"),
    QUERY_MODEL_OPTIONS,
    QUERY_PREFETCH_OPTION,
    QUERY_FORM_OPTIONS("points are three doubles each, answers seven doubles and a uint64,\nor lo "
                       "and hi (little-endian)"),
    { 0 },
};

static const arg_spec spec = {
    .command = "distance",
    .operands = "MODEL [POINTS]",
    .least = 1,
    .most = 2,
    .summary = "how far points are from the model: distance, nearest point, normal, face",
    .text = "MODEL is an .ebpo.h5 file. POINTS: lines 'x y z', or a PLY; absent or '-': standard "
            "input. Distances are correctly rounded,\n"
            "negative inside a solid.",
    .options = options,
};

/* Then all that is certain is an interval. */
static bool limited(const ebpo_query_options *o)
{
    return o->mode == EBPO_DISTANCE_EXACT && (o->level >= 0 || o->deadline_ns);
}

static ebpo_status answer(const query_job *job, ebpo_context *context, const double *rows,
                          uint64_t count, ebpo_error *error)
{
    ebpo_distance_result *results = job->results;
    ebpo_status status = ebpo_distance_many(context, rows, count, &job->options, results, error);
    if (status == EBPO_OK)
        answers_distance(job->form, limited(&job->options), results, count);
    return status;
}

static int run(int argc, char **argv)
{
    query_values v = QUERY_VALUES_INIT;
    const char *operand[ARGS_OPERANDS_MAX];
    arg_result parsed = args_parse(&spec, argc, argv, &v, operand);
    if (parsed != ARGS_RUN)
        return parsed == ARGS_HELPED ? EXIT_FINE : EXIT_USAGE;
    if (!query_distance_fits("distance", &v) ||
        (v.level >= 0 && !query_accepts("distance", &v, QUERY_MAX_DISTANCE, "--level")))
        return EXIT_USAGE;
    static ebpo_distance_result results[POINTS_BATCH];
    query_job job = {
        .command = "distance", .values = &v, .kind = POINTS, .answer = answer, .results = results
    };
    return query_run(&job, operand[0], operand[1]);
}

const command command_distance = { &spec, run };
