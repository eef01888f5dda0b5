/* ebpo ray: what rays hit. */
#include <float.h>
#include <stddef.h>
#include <string.h>

#include "cli/command.h"
#include "cmd/commands.h"
#include "cmd/query_run.h"

static const arg_option options[] = {
    OPTION_FLAG("all", 'a', query_values, all,
                "print all hits: their number, then t, face and side of each"),
    OPTION_FLAG("any", 0, query_values, any, "print only whether anything is hit: yes or no"),
    OPTION_WORD("sides", 0, query_values, ray_sides, "SIDES", ray_sides,
                "which faces count: both, the default; front, met against their normal; back"),
    OPTION_REAL("tmax", 0, query_values, tmax, "T", 0, DBL_MAX,
                "for rays without their own tmax: they end at origin + T direction"),
    QUERY_MODEL_OPTIONS_FOR("opening and for rays"),
    QUERY_FORM_OPTIONS(
        "each ray is six doubles, each answer a double, a uint64 and an int64, or with --any a "
        "uint64 (little-endian)"),
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

/* Rows are rays. */
_Static_assert(sizeof(ebpo_ray) == POINTS_WIDEST * sizeof(double), "as points_next fills them");
static struct {
    ebpo_ray rays[POINTS_BATCH];
    ebpo_ray_hit first[POINTS_BATCH];
    bool any[POINTS_BATCH];
} batch;

static ebpo_status answer_all(const query_job *job, ebpo_context *context, uint64_t count,
                              const ebpo_ray_options *how, ebpo_error *error)
{
    const ebpo_ray_hit *hits;
    const uint64_t *begin;
    ebpo_status status = ebpo_ray_all_many(context, batch.rays, count, how, &hits, &begin, error);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        answers_ray_all(job->form, hits + begin[i], begin[i + 1] - begin[i]);
    return status;
}

static ebpo_status answer(const query_job *job, ebpo_context *context, const double *rows,
                          uint64_t count, ebpo_error *error)
{
    ebpo_ray_options how = EBPO_RAY_OPTIONS_INIT;
    ebpo_status status;
    how.sides = (ebpo_ray_sides)job->values->ray_sides;
    how.threads = (unsigned)job->values->threads;
    memcpy(batch.rays, rows, count * sizeof *batch.rays);
    if (job->values->all)
        return answer_all(job, context, count, &how, error);
    if (job->values->any) {
        status = ebpo_ray_any_many(context, batch.rays, count, &how, batch.any, error);
        if (status == EBPO_OK)
            answers_ray_any(job->form, batch.any, count);
        return status;
    }
    status = ebpo_ray_first_many(context, batch.rays, count, &how, batch.first, error);
    if (status == EBPO_OK)
        answers_ray_first(job->form, batch.first, count);
    return status;
}

static const query_values usual = QUERY_VALUES_INIT;

static int run(void *given, const char **operand)
{
    query_values *v = given;
    if (v->any && v->all)
        return command_usage("ray", "--any has no effect with --all; leave out one of them");
    query_job job = { .command = "ray", .values = v, .kind = POINTS_RAYS, .answer = answer };
    return query_run(&job, operand[0], operand[1]);
}

const command command_ray = { &spec, sizeof usual, &usual, run };
