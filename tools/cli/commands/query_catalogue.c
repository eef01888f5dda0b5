#include "cli/commands/query_catalogue.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "cli/command.h"
#include "cli/model_stats.h"
#include "cli/words.h"

/* Returns the first given option, or the command, that a catalogue does not support; NULL: none. */
static const char *refused_option(const query_job *job)
{
    const query_values *v = job->values;
    return job->kind == POINTS_BOXES ? "ebpo box"
           : v->nearest              ? "--nearest"
           : isfinite(v->within)     ? "--within"
           : v->all                  ? "--all"
           : v->any                  ? "--any"
           : v->attribute            ? "--attribute"
           : v->level >= 0           ? "--max-level"
           : v->deadline             ? "--deadline"
           : v->inside_mode          ? "--mode"
           : v->distance_mode        ? "--mode"
           : v->no_warm              ? "--no-warm"
           : v->cut_level >= 0       ? "--cut-level"
           : v->prefetch             ? "--prefetch"
                                     : NULL;
}

bool query_catalogue_named(const char *name)
{
    size_t length = strlen(name);
    return length > 5 && strcmp(name + length - 5, ".json") == 0 && !ebpo_is_url(name);
}

bool query_catalogue_fits(const query_job *job)
{
    const char *what = refused_option(job);
    if (what)
        command_usage(job->command, "%s needs a model, not a catalogue; give an .ebpo.h5 file",
                      what);
    return !what;
}

/* Opens a model of the catalogue with the options for URLs. user: a remote_values. */
static ebpo_status open_model(void *user, const char *path, ebpo_file **out, ebpo_error *error)
{
    return remote_open(out, path, user, error);
}

int query_catalogue_open(query_job *job, const char *path, const ebpo_model_options *options)
{
    ebpo_error error = EBPO_ERROR_INIT;
    const query_values *v = job->values;
    ebpo_catalogue_options catalogue_options = EBPO_CATALOGUE_OPTIONS_INIT;
    ebpo_catalogue_models_options models_options = EBPO_CATALOGUE_MODELS_OPTIONS_INIT;
    catalogue_options.open_file = open_model;
    catalogue_options.user = (void *)&v->remote;
    models_options.memory = v->memory ? options->memory : ebpo_free_memory() / 2;
    models_options.threads = options->threads;
    ebpo_status status = ebpo_catalogue_open(path, &catalogue_options, &job->catalogue, &error);
    if (status == EBPO_OK)
        status = ebpo_catalogue_models_new(&models_options, &job->models, &error);
    return status == EBPO_OK ? EXIT_OK : command_failed(job->command, &error);
}

void query_catalogue_close(query_job *job)
{
    ebpo_catalogue_models_free(job->models);
    ebpo_catalogue_free(job->catalogue);
    job->models = NULL;
    job->catalogue = NULL;
}

ebpo_catalogue_query_options query_catalogue_options(const query_job *job)
{
    ebpo_catalogue_query_options o = EBPO_CATALOGUE_QUERY_OPTIONS_INIT;
    o.threads = 1; /* other threads query other rows */
    o.max_distance = job->distance.max_distance;
    o.unsigned_distance = job->distance.unsigned_distance;
    o.sides = (ebpo_ray_sides)job->values->ray_sides;
    return o;
}

void query_catalogue_report(const query_job *job)
{
    ebpo_catalogue_facts facts = EBPO_CATALOGUE_FACTS_INIT;
    ebpo_catalogue_models_stats n = EBPO_CATALOGUE_MODELS_STATS_INIT;
    ebpo_model_stats sums = EBPO_MODEL_STATS_INIT;
    ebpo_catalogue_get_facts(job->catalogue, &facts);
    ebpo_catalogue_models_get_stats(job->models, &n, &sums);
    if (!job->values->json) {
        stats_print(stderr, &sums);
        char models[40];
        words_plural(models, sizeof models, facts.count, "model", "models");
        fprintf(stderr, "catalogue: %s, opened %" PRIu64 ", closed %" PRIu64 "\n", models, n.opened,
                n.closed);
        return;
    }
    json j;
    json_begin(&j, stderr);
    json_object(&j, NULL);
    stats_json(&j, &sums);
    json_object(&j, "catalogue");
    json_uint(&j, "models", facts.count);
    json_uint(&j, "opened", n.opened);
    json_uint(&j, "closed", n.closed);
    json_finish(&j);
}

/* --- shards --- */

int query_catalogue_facts(json *j, const char *command, const char *path)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_catalogue *c = NULL;
    ebpo_catalogue_facts facts = EBPO_CATALOGUE_FACTS_INIT;
    struct stat st;
    char hash[20];
    if (ebpo_catalogue_open(path, NULL, &c, &error) != EBPO_OK)
        return command_failed(command, &error);
    ebpo_catalogue_get_facts(c, &facts);
    snprintf(hash, sizeof hash, "%016" PRIx64, facts.file_hash);
    json_object(j, "catalogue");
    json_uint(j, "bytes", facts.file_bytes);
    json_text(j, "fnv1a", hash); /* hash of the catalogue file, which contains all digests */
    json_array(j, "numbers");
    for (uint64_t i = 0; i < facts.count; i++) {
        const char *numbers = ebpo_catalogue_get_entry(c, i)->numbers;
        if (!numbers || stat(numbers, &st) != 0)
            continue;
        json_uint(j, NULL, (uint64_t)st.st_size);
        json_int(j, NULL, st.st_mtim.tv_sec);
        json_int(j, NULL, st.st_mtim.tv_nsec);
    }
    json_end(j);
    json_end(j);
    ebpo_catalogue_free(c);
    return EXIT_OK;
}
