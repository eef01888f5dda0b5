/* ebpo ray: what rays hit. */
#include <float.h>
#include <stddef.h>

#include "cli/command.h"
#include "cmd/commands.h"
#include "cmd/query_run.h"

static const arg_option options[] = {
    OPTION_FLAG("all", 'a', query_values, all,
                "print all hits: their number, then t, face and side of each"),
    OPTION_REAL("tmax", 0, query_values, tmax, "T", 0, DBL_MAX,
                "for rays without their own tmax: they end at origin + T direction"),
    QUERY_MODEL_OPTIONS,
    QUERY_FORM_OPTIONS(
        "each ray is six doubles, each answer a double, a uint64 and an int64 (little-endian)"),
    { 0 },
};

static const arg_spec spec = {
    .command = "ray",
    .operands = "MODEL [RAYS]",
    .least = 1,
    .most = 2,
    .summary = "tells what rays hit: t, face and side of the first face",
    .text =
        "MODEL is an .ebpo.h5 file. RAYS holds lines 'ox oy oz dx dy dz [tmax]'; if absent or '-', "
        "standard input. What is hit, and in which order, is exact; '-' means nothing is hit.",
    .options = options,
};

static ebpo_status answer_one(const query_job *job, ebpo_context *context, const double *ray,
                              ebpo_error *error)
{
    ebpo_status status;
    if (job->values->all) {
        const ebpo_ray_hit *hits;
        uint64_t count;
        status = ebpo_ray_all(context, ray, ray + 3, ray[6], &hits, &count, error);
        if (status == EBPO_OK)
            answers_ray_all(job->form, hits, count);
    } else {
        ebpo_ray_hit hit;
        bool any;
        status = ebpo_ray_first(context, ray, ray + 3, ray[6], &hit, &any, error);
        if (status == EBPO_OK)
            answers_ray_first(job->form, any ? &hit : NULL);
    }
    return status;
}

static ebpo_status answer(const query_job *job, ebpo_context *context, const double *rows,
                          uint64_t count, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        status = answer_one(job, context, rows + 7 * i, error);
    return status;
}

static const query_values usual = QUERY_VALUES_INIT;

static int run(void *given, const char **operand)
{
    query_values *v = given;
    query_job job = { .command = "ray", .values = v, .kind = POINTS_RAYS, .answer = answer };
    return query_run(&job, operand[0], operand[1]);
}

const command command_ray = { &spec, sizeof usual, &usual, run };
