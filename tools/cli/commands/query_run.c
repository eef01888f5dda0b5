/* Runs a query command: opens the model or catalogue, reads rows (points, rays or boxes), and
 * writes the results of each row. */
#include "cli/commands/query_run.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "cli/command.h"
#include "cli/json.h"
#include "cli/model_stats.h"
#include "cli/npy_results.h"
#include "cli/points_cut.h"
#include "cli/commands/query_catalogue.h"
#include "cli/commands/query_holding.h"
#include "cli/commands/query_pipe.h"
#include "cli/commands/query_shard.h"

static void report_stats(const query_job *job, const query_holding *holding)
{
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    traffic t = traffic_of(holding->session.file);
    ebpo_model_get_stats(holding->session.model, &stats);
    if (!job->values->json) {
        stats_print(stderr, &stats);
        query_holding_report(holding);
        remote_report(&t, &job->values->remote, false);
        return;
    }
    json j;
    json_begin(&j, stderr);
    json_object(&j, NULL);
    stats_json(&j, &stats);
    query_holding_json(holding, &j);
    remote_json(&j, &t, &job->values->remote);
    json_finish(&j);
}

/* Returns the given number of threads or, if none was given, the number of cores that this process
 * may use. Loading modes that keep no data use one thread, because each thread would drop the data
 * of other threads. */
static unsigned threads_for(const query_values *v, const ebpo_model_options *model_options)
{
    unsigned count = v->threads ? (unsigned)v->threads : command_cores();
    count = count < QUERY_THREADS_MAX ? count : QUERY_THREADS_MAX;
    return model_options->loading == EBPO_LOAD_CACHE && count ? count : 1;
}

/* Opens the attributes of --attribute. Returns an exit code. */
static int open_sampler(query_job *job, const query_holding *holding, ebpo_sampler **out)
{
    ebpo_error error = EBPO_ERROR_INIT;
    const query_values *v = job->values;
    *out = NULL;
    if (v->attribute && ebpo_sampler_new(holding->session.file, v->attribute, (unsigned)v->threads,
                                         out, &error) != EBPO_OK)
        return command_failed(job->command, &error);
    job->sampler = *out;
    return EXIT_OK;
}

static int query_all(query_job *job, query_holding *holding, points *in,
                     const ebpo_model_options *options)
{
    progress_line line;
    /* no progress line if results are printed on the terminal */
    (void)progress_start(&line, job->command, isatty(STDOUT_FILENO));
    npy_results npy = { .command = job->command };
    bool as_npy = job->values->npy;
    if (as_npy)
        npy.dtype = job->dtype(job, &npy.bytes);
    if (as_npy && !npy_begin(&npy, in))
        return EXIT_FAILED;
    int code = query_pipe_run(job, holding, in, threads_for(job->values, options), &line);
    progress_wipe(&line);
    return as_npy && !npy_end(&npy) ? EXIT_FAILED : code;
}

/* Checks that only one output format is given. --raw, which also describes the input, may be
 * combined with another format, which then has priority. Returns false after a report on standard
 * error. */
static bool form_fits(const query_job *job)
{
    const query_values *v = job->values;
    unsigned bytes;
    const char *given = v->npy ? "--npy" : "--csv", *other = v->json ? "--json" : "--csv";
    if ((v->npy && v->csv) || (v->json && (v->npy || v->csv)))
        (void)command_usage(job->command, "%s has no effect with %s; omit one of them", given,
                            other);
    else if (v->npy && !job->dtype(job, &bytes))
        (void)command_usage(job->command, "--npy needs results of a fixed size, not lists");
    else if (v->npy && v->attribute)
        (void)command_usage(job->command, "--attribute has no effect with --npy; omit one of them");
    else if (v->attribute && strlen(v->attribute) > RESULT_NAMES)
        (void)command_usage(job->command,
                            "--attribute: the names have more than %d bytes in total; name fewer "
                            "attributes",
                            RESULT_NAMES);
    else
        return true;
    return false;
}

static result_form form_of(const query_values *v)
{
    return v->json  ? RESULTS_JSON
           : v->npy ? RESULTS_RAW
           : v->csv ? RESULTS_CSV
           : v->raw ? RESULTS_RAW
                    : RESULTS_TEXT;
}

/* Number of rows evaluated together if output goes to a file and only parts of the model are in
 * memory. The rows are evaluated in the order of subtrees, so that few subtrees are loaded again.
 */
enum { TOGETHER_IN_PARTS = 1 << 20 };
/* Assumed maximum of the bytes that a row and its results need. */
enum { TOGETHER_BYTES = 1024 };

/* Returns the number of rows to evaluate together. */
static uint64_t rows_together(const query_values *v, const query_holding *holding)
{
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    const uint64_t most = SIZE_MAX / TOGETHER_BYTES; /* matters on 32-bit machines only */
    if (v->together)
        return (uint64_t)v->together < most ? (uint64_t)v->together : most;
    bool parts =
        v->out && !holding->may_load_all &&
        (holding->external ||
         (ebpo_model_get_stats(holding->session.model, &stats) == EBPO_OK && !stats.resident));
    return parts ? TOGETHER_IN_PARTS : POINTS_BATCH;
}

static int open_model(query_job *job, const char *model, const ebpo_model_options *options,
                      query_holding *holding)
{
    if (!query_catalogue_named(model))
        return query_holding_open(holding, job->command, model, job->values, options,
                                  job->subtree_overhead);
    query_holding_external(holding, job->command);
    job->result_bytes += sizeof(uint64_t); /* the indices of models are stored after all results */
    return query_catalogue_open(job, model, options);
}

/* Opens the model or catalogue, and runs the query on the points of `in`. Returns an exit code. */
static int run_query(query_job *job, const char *model, points *in,
                     const ebpo_model_options *options, query_shard *shard)
{
    query_holding holding;
    ebpo_sampler *sampler = NULL;
    int code = open_model(job, model, options, &holding);
    if (code == EXIT_OK)
        code = open_sampler(job, &holding, &sampler);
    if (code == EXIT_OK)
        code = query_shard_begin(shard);
    if (code == EXIT_OK) {
        in->rows_per_block = rows_together(job->values, &holding);
        code = query_all(job, &holding, in, options);
        code = query_shard_end(shard, job, code);
    }
    ebpo_sampler_free(sampler);
    if (holding.session.model && job->values->remote.stats)
        report_stats(job, &holding);
    if (job->catalogue && job->values->remote.stats)
        query_catalogue_report(job);
    query_catalogue_close(job);
    query_holding_close(&holding);
    return code;
}

static int open_and_run(query_job *job, const char *model, const char *path,
                        const ebpo_model_options *options, query_shard *shard)
{
    const query_values *v = job->values;
    int code;
    points in;
    if (query_shard_done(shard, job, &code))
        return code;
    bool ok = points_open_shard(&in, job->command, path, job->kind, v->raw, v->tmax, shard->number,
                                shard->shards ? shard->shards : 1);
    in.header = v->header;
    if (ok && shard->shards)
        ok = points_cut(&in, shard->number, shard->shards);
    code = ok ? run_query(job, model, &in, options, shard) : EXIT_FAILED;
    points_close(&in);
    return code;
}

int query_run(query_job *job, const char *model, const char *path)
{
    ebpo_model_options options;
    query_shard shard;
    if (!query_options_from(job->command, job->values, &options, &job->inside, &job->distance))
        return EXIT_USAGE;
    if (!form_fits(job) || (query_catalogue_named(model) && !query_catalogue_fits(job)))
        return EXIT_USAGE;
    job->form = form_of(job->values);
    int code = EXIT_USAGE;
    if (query_shard_fits(&shard, job, model, path)) {
        job->continues = shard.shards && shard.number > 0;
        code = open_and_run(job, model, path, &options, &shard);
    }
    query_shard_free(&shard);
    return code;
}
