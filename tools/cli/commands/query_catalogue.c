#include "cli/commands/query_catalogue.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "cli/command.h"
#include "cli/model_sums.h"

/* What a catalogue is not asked, in the order in which it is said. */
static const char *refused_option(const query_job *job)
{
    const query_values *v = job->values;
    return job->kind == POINTS_BOXES ? "ebpo box"
           : v->nearest              ? "--nearest"
           : isfinite(v->within)     ? "--within"
           : v->all                  ? "--all"
           : v->any                  ? "--any"
           : v->attribute            ? "--attribute"
           : v->level >= 0           ? "--level"
           : v->deadline             ? "--deadline"
           : v->inside_mode          ? "--mode"
           : v->distance_mode        ? "--mode"
           : v->no_warm              ? "--no-warm"
           : v->cut_level >= 0       ? "--cut-level"
           : v->prefetch             ? "--prefetch"
                                     : NULL;
}

bool query_catalogue_fits(const query_job *job)
{
    const char *what = refused_option(job);
    if (what)
        command_usage(job->command, "%s asks one model, not a catalogue", what);
    return !what;
}

int query_catalogue_open(query_job *job, const char *path, const ebpo_model_options *options)
{
    ebpo_error error = EBPO_ERROR_INIT;
    const query_values *v = job->values;
    catalogue *c = NULL;
    holding_options o = { .memory = v->memory ? options->memory : ebpo_free_memory() / 2,
                          .threads = options->threads,
                          .remote = &v->remote };
    if (catalogue_read(path, &c, &error) != EBPO_OK)
        return command_failed(job->command, &error);
    job->models = calloc(1, sizeof *job->models);
    if (job->models && catalogue_models_make(job->models, c, &o))
        return EXIT_FINE;
    if (!job->models)
        catalogue_free(c);
    return command_no_memory(job->command);
}

void query_catalogue_close(query_job *job)
{
    catalogue *c = job->models ? (catalogue *)job->models->c : NULL;
    if (job->models)
        catalogue_models_free(job->models);
    catalogue_free(c);
    free(job->models);
    job->models = NULL;
}

void query_catalogue_tell(const query_job *job)
{
    holding_counts n;
    holding_get_counts(job->models->held, &n);
    if (!job->values->json) {
        stats_print(stderr, &n.sums);
        fprintf(stderr, "catalogue: %" PRIu64 " models, opened %" PRIu64 ", closed %" PRIu64 "\n",
                job->models->c->count, n.opened, n.closed);
        return;
    }
    json j;
    json_begin(&j, stderr);
    json_object(&j, NULL);
    stats_json(&j, &n.sums);
    json_object(&j, "catalogue");
    json_uint(&j, "models", job->models->c->count);
    json_uint(&j, "opened", n.opened);
    json_uint(&j, "closed", n.closed);
    json_finish(&j);
}

/* --- shards --- */

int query_catalogue_facts(json *j, const char *command, const char *path)
{
    ebpo_error error = EBPO_ERROR_INIT;
    catalogue *c = NULL;
    struct stat st;
    char hash[20];
    if (catalogue_read(path, &c, &error) != EBPO_OK)
        return command_failed(command, &error);
    snprintf(hash, sizeof hash, "%016" PRIx64, c->hash);
    json_object(j, "catalogue");
    json_uint(j, "bytes", c->bytes);
    json_text(j, "fnv1a", hash); /* it has the digest of each model */
    json_array(j, "numbers");
    for (uint64_t i = 0; i < c->count; i++)
        if (c->entry[i].numbers && stat(c->entry[i].numbers, &st) == 0) {
            json_uint(j, NULL, (uint64_t)st.st_size);
            json_int(j, NULL, st.st_mtim.tv_sec);
            json_int(j, NULL, st.st_mtim.tv_nsec);
        }
    json_end(j);
    json_end(j);
    catalogue_free(c);
    return EXIT_FINE;
}
