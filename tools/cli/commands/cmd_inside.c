/* ebpo inside: classifies points as inside, outside or on the surface. */
#include <stddef.h>

#include "cli/command.h"
#include "cli/commands/commands.h"
#include "cli/commands/query_catalogue.h"
#include "cli/commands/query_run.h"

#include "cli/options/inside.inc"

static ebpo_status compute_inside(const query_job *job, query_worker *w, const double *rows,
                                  uint64_t count, ebpo_error *error)
{
    ebpo_catalogue_query_options catalogue_options = query_catalogue_options(job);
    return job->catalogue
               ? ebpo_catalogue_inside(job->catalogue, job->models, rows, count, &catalogue_options,
                                       w->results, error)
               : ebpo_inside_many(w->context, rows, count, &job->inside, w->results, error);
}

static void print_inside(const query_job *job, query_worker *w, const double *rows, uint64_t count)
{
    (void)rows;
    results_inside(w->text, job->form, w->results, count);
}

static const char *inside_columns(const query_job *job)
{
    return job->inside.level >= 0 || job->inside.deadline_ns ? "where,winding,doubt"
                                                             : "where,winding";
}

static const char *inside_dtype(const query_job *job, unsigned *bytes)
{
    (void)job;
    *bytes = 8;
    return "[('where', '<i4'), ('winding', '<i4')]";
}

static const query_values standard = QUERY_VALUES_INIT;

static int run_inside(void *given, const char **operand)
{
    query_values *v = given;
    if (!query_inside_fits("inside", v))
        return EXIT_USAGE;
    query_job job = { .command = "inside",
                      .values = v,
                      .kind = POINTS,
                      .result_bytes = sizeof(ebpo_inside_result),
                      .subtree_overhead = 0.05, /* measured, see docs/measured/queries.md */
                      .result = compute_inside,
                      .print = print_inside,
                      .columns = inside_columns,
                      .dtype = inside_dtype };
    return query_run(&job, operand[0], operand[1]);
}

const command command_inside = { &spec, sizeof standard, &standard, run_inside };
