/* ebpo distance: measures distances of points to the model, and finds the nearest points. */
#include <float.h>
#include <stddef.h>

#include "cli/command.h"
#include "cli/commands/commands.h"
#include "cli/commands/query_catalogue.h"
#include "cli/commands/query_run.h"

#include "cli/options/distance.inc"

/* Returns true if the options allow an interval as the result. */
static bool gives_interval(const ebpo_distance_options *o)
{
    return o->mode == EBPO_DISTANCE_EXACT && (o->level >= 0 || o->deadline_ns);
}

/* The list of the faces near one point. */
typedef struct listing {
    const ebpo_sampler *sampler; /* for --attribute; NULL: none */
    result_text *text;           /* the list is appended here */
    result_form form;
    bool begun; /* a face was printed */
} listing;

static bool list_face(void *user, const ebpo_near_face *face)
{
    listing *l = user;
    results_near(l->text, l->form, face, !l->begun, l->sampler);
    l->begun = true;
    return !result_text_is_over(l->text);
}

static ebpo_status compute_lists(const query_job *job, query_worker *w, const double *rows,
                                 uint64_t count, ebpo_error *error)
{
    ebpo_within_options o = EBPO_WITHIN_OPTIONS_INIT;
    ebpo_status status = EBPO_OK;
    o.radius = job->values->within;
    o.most = (uint64_t)job->values->nearest;
    for (uint64_t i = 0; i < count && status == EBPO_OK && !result_text_is_over(w->text); i++) {
        listing l = { job->sampler, w->text, job->form, false };
        status = ebpo_distance_within(w->context, rows + 3 * i, &o, list_face, &l, error);
        if (status == EBPO_OK)
            results_near_end(w->text, job->form, !l.begun, job->sampler);
    }
    return status;
}

/* Returns the array with the index of the nearest model for each of `count` points, for a query in
 * a catalogue. The array is in w->results, after the distances. */
static uint64_t *models_of(const query_worker *w, uint64_t count)
{
    return (uint64_t *)(void *)((ebpo_distance_result *)w->results + count);
}

static ebpo_status compute_distances(const query_job *job, query_worker *w, const double *rows,
                                     uint64_t count, ebpo_error *error)
{
    ebpo_catalogue_query_options catalogue_options = query_catalogue_options(job);
    if (job->catalogue)
        return ebpo_catalogue_distance(job->catalogue, job->models, rows, count, &catalogue_options,
                                       w->results, models_of(w, count), error);
    if (count && query_lists(job->values))
        return compute_lists(job, w, rows, count, error);
    return ebpo_distance_many(w->context, rows, count, &job->distance, w->results, error);
}

static void print_distances(const query_job *job, query_worker *w, const double *rows,
                            uint64_t count)
{
    (void)rows;
    if (!query_lists(job->values))
        results_distance(w->text, job->form, !job->catalogue && gives_interval(&job->distance),
                         w->results, count, job->sampler,
                         job->catalogue ? models_of(w, count) : NULL);
}

static const char *distance_columns(const query_job *job)
{
    return job->catalogue ? "distance,x,y,z,nx,ny,nz,face,model"
           : gives_interval(&job->distance) && !query_lists(job->values)
               ? "lo,hi"
               : "distance,x,y,z,nx,ny,nz,face";
}

static const char *distance_dtype(const query_job *job, unsigned *bytes)
{
    if (query_lists(job->values))
        return NULL;
    if (job->catalogue) {
        *bytes = 72;
        return "[('distance', '<f8'), ('point', '<f8', (3,)), ('normal', '<f8', (3,)), ('face', "
               "'<u8'), ('model', '<u8')]";
    }
    *bytes = gives_interval(&job->distance) ? 16 : 64;
    return gives_interval(&job->distance)
               ? "[('lo', '<f8'), ('hi', '<f8')]"
               : "[('distance', '<f8'), ('point', '<f8', (3,)), ('normal', '<f8', (3,)), ('face', "
                 "'<u8')]";
}

static const query_values standard = QUERY_VALUES_INIT;

static int run_distance(void *given, const char **operand)
{
    query_values *v = given;
    if (!query_distance_fits("distance", v) ||
        (v->level >= 0 && !query_check_effect("distance", v, QUERY_MAX_DISTANCE, "--max-level")))
        return EXIT_USAGE;
    if (v->attribute && v->distance_mode == EBPO_DISTANCE_ENVELOPE)
        return command_usage("distance", "--attribute has no effect with --mode envelope; omit "
                                         "one of them");
    if (v->attribute &&
        !query_check_effect("distance", v, QUERY_LEVEL | QUERY_DEADLINE, "--attribute"))
        return EXIT_USAGE;
    query_job job = { .command = "distance",
                      .values = v,
                      .kind = POINTS,
                      .result_bytes = sizeof(ebpo_distance_result),
                      .subtree_overhead = 0.65, /* measured, see docs/measured/queries.md */
                      .result = compute_distances,
                      .print = print_distances,
                      .columns = distance_columns,
                      .dtype = distance_dtype };
    return query_run(&job, operand[0], operand[1]);
}

const command command_distance = { &spec, sizeof standard, &standard, run_distance };
