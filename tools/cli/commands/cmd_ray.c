/* ebpo ray: finds the faces hit by rays. */
#include <float.h>
#include <stddef.h>

#include "cli/command.h"
#include "cli/commands/commands.h"
#include "cli/commands/query_catalogue.h"
#include "cli/commands/query_run.h"

#include "cli/options/ray.inc"

/* The functions below read each row of numbers from points_parse as an ebpo_ray. */
_Static_assert(sizeof(ebpo_ray) == POINTS_WIDEST * sizeof(double), "a row is an ebpo_ray");

static ebpo_status compute_all_hits(const query_job *job, query_worker *w, const ebpo_ray *rays,
                                    uint64_t count, const ebpo_ray_options *ray_options,
                                    ebpo_error *error)
{
    const ebpo_ray_hit *hits;
    const uint64_t *begin;
    ebpo_status status =
        ebpo_ray_all_many(w->context, rays, count, ray_options, &hits, &begin, error);
    for (uint64_t i = 0; i < count && status == EBPO_OK && !result_text_is_over(w->text); i++)
        results_ray_all(w->text, job->form, &rays[i], hits + begin[i], begin[i + 1] - begin[i],
                        job->sampler);
    return status;
}

/* Returns the array with the index of the hit model for each of `count` rays, for a query in a
 * catalogue. The array is in w->results, after the hits. */
static uint64_t *models_of(const query_worker *w, uint64_t count)
{
    return (uint64_t *)(void *)((ebpo_ray_hit *)w->results + count);
}

static ebpo_status compute_rays(const query_job *job, query_worker *w, const double *rows,
                                uint64_t count, ebpo_error *error)
{
    const ebpo_ray *rays = (const ebpo_ray *)(const void *)rows;
    ebpo_ray_options ray_options = EBPO_RAY_OPTIONS_INIT;
    ray_options.sides = (ebpo_ray_sides)job->values->ray_sides;
    ray_options.threads = 1; /* other threads query other rays */
    if (job->catalogue) {
        ebpo_catalogue_query_options catalogue_options = query_catalogue_options(job);
        return ebpo_catalogue_ray(job->catalogue, job->models, rays, count, &catalogue_options,
                                  w->results, models_of(w, count), error);
    }
    if (job->values->all)
        return compute_all_hits(job, w, rays, count, &ray_options, error);
    if (job->values->any)
        return ebpo_ray_any_many(w->context, rays, count, &ray_options, w->results, error);
    return ebpo_ray_first_many(w->context, rays, count, &ray_options, w->results, error);
}

static void print_rays(const query_job *job, query_worker *w, const double *rows, uint64_t count)
{
    const ebpo_ray *rays = (const ebpo_ray *)(const void *)rows;
    if (job->values->any)
        results_ray_any(w->text, job->form, w->results, count);
    else if (!job->values->all)
        results_ray_first(w->text, job->form, rays, w->results, count, job->sampler,
                          job->catalogue ? models_of(w, count) : NULL);
}

static const char *ray_columns(const query_job *job)
{
    return job->values->any   ? "hit"
           : job->values->all ? "hits,t,face,side"
           : job->catalogue   ? "t,face,side,model"
                              : "t,face,side";
}

static const char *ray_dtype(const query_job *job, unsigned *bytes)
{
    *bytes = job->values->any ? 8 : 24;
    if (job->catalogue) {
        *bytes = 32;
        return "[('t', '<f8'), ('face', '<u8'), ('side', '<i8'), ('model', '<u8')]";
    }
    return job->values->all   ? NULL
           : job->values->any ? "'<u8'"
                              : "[('t', '<f8'), ('face', '<u8'), ('side', '<i8')]";
}

static const query_values standard = QUERY_VALUES_INIT;

static int run_ray(void *given, const char **operand)
{
    query_values *v = given;
    if (v->any && v->all)
        return command_usage("ray", "--any has no effect with --all; omit one of them");
    if (v->any && v->attribute)
        return command_usage("ray", "--attribute has no effect with --any; omit one of them");
    query_job job = { .command = "ray",
                      .values = v,
                      .kind = POINTS_RAYS,
                      .result_bytes = sizeof(ebpo_ray_hit),
                      .subtree_overhead = 0.6, /* measured, see docs/measured/queries.md */
                      .result = compute_rays,
                      .print = print_rays,
                      .columns = ray_columns,
                      .dtype = ray_dtype };
    return query_run(&job, operand[0], operand[1]);
}

const command command_ray = { &spec, sizeof standard, &standard, run_ray };
