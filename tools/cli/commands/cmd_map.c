/* ebpo map: distances on a plane, on a grid, or of another model's vertices. */
#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>

#include "cli/command.h"
#include "cli/json.h"
#include "cli/model_memory.h"
#include "cli/progress.h"
#include "cli/words.h"
#include "cli/commands/commands.h"
#include "cli/commands/map_job.h"

typedef map_values values;

static const char *const palette_words[] = { "diverging", "thesis", NULL };

#include "cli/options/map.inc"

static const map_values usual = { .margin = MAP_MARGIN,
                                  .max_distance = INFINITY,
                                  .remote = REMOTE_VALUES_INIT };

/* --- what is asked for --- */

static bool ends_so(const char *out, const char *const *endings)
{
    for (; *endings; endings++)
        if (words_end_with(out, *endings))
            return true;
    return false;
}

static int check_output(const map_values *v)
{
    static const char *const of_grid[] = { ".vtkhdf", ".h5", ".nrrd", NULL },
                             *const of_plane[] = { ".vtkhdf", ".h5", ".nrrd", ".png", NULL },
                             *const of_vertices[] = { ".ply", NULL },
                             *const png[] = { ".png", NULL };
    if (v->grid && !v->out)
        return command_usage("map", "--grid needs --output: a name that ends with .vtkhdf, .h5 or "
                                    ".nrrd");
    if (v->out && !ends_so(v->out, v->grid ? of_grid : v->plane ? of_plane : of_vertices))
        return command_usage("map", "--output '%s': expected a name that ends with %s", v->out,
                             v->grid    ? ".vtkhdf, .h5 or .nrrd"
                             : v->plane ? ".vtkhdf, .h5, .nrrd or .png"
                                        : ".ply");
    if (v->picture && v->grid)
        return command_usage("map", "--picture shows a plane or vertices; give --plane as well "
                                    "in a second run");
    if (v->picture && !ends_so(v->picture, png))
        return command_usage("map", "--picture '%s': expected a name that ends with .png",
                             v->picture);
    bool coloured = v->picture || (v->out && (v->from || ends_so(v->out, png)));
    if (!coloured && (v->range != usual.range || v->palette != usual.palette))
        return command_usage("map", "--range and --palette belong to pictures and to the PLY of "
                                    "--from");
    return EXIT_FINE;
}

static int check(const map_values *v)
{
    int kinds = (v->plane != NULL) + (v->grid != NULL) + (v->from != NULL);
    if (kinds != 1)
        return command_usage("map", "expected one of --plane, --grid and --from: which points?");
    if (v->from && (v->box || v->margin != usual.margin))
        return command_usage("map", "--box and --margin belong to --plane and --grid");
    if ((v->grid || v->from) && v->size && !v->picture)
        return command_usage("map", "--size belongs to --plane and to the picture of --from");
    if (v->box && v->margin != usual.margin)
        return command_usage("map", "--margin is around the model's box; leave it out with --box");
    if (v->bounds && !v->from)
        return command_usage("map", "--bounds belongs to --from");
    if (v->bounds && isfinite(v->max_distance))
        return command_usage("map", "--bounds needs all distances: leave out --max-distance");
    return check_output(v);
}

static int overwrites(const char *path, const map_values *v)
{
    const char *outs[] = { v->out, v->picture }, *ins[] = { path, v->from };
    for (int i = 0; i < 4; i++)
        if (outs[i / 2] && ins[i % 2] && command_overwrites("map", ins[i % 2], outs[i / 2]))
            return EXIT_USAGE;
    if (v->out && v->picture && command_same_file(v->out, v->picture))
        return command_usage("map", "--output and --picture name one file");
    return EXIT_FINE;
}

/* --- what is told --- */

static void print_percentiles(const ebpo_map_stats *s)
{
    printf("  %-10s", "percent");
    for (int i = 0; i < EBPO_MAP_PERCENTILES; i++)
        printf(" %12g", ebpo_map_percent(i));
    printf("\n  %-10s", "signed");
    for (int i = 0; i < EBPO_MAP_PERCENTILES; i++)
        printf(" %12.6g", s->percentile[i]);
    printf("\n  %-10s", "unsigned");
    for (int i = 0; i < EBPO_MAP_PERCENTILES; i++)
        printf(" %12.6g", s->percentile_unsigned[i]);
    putchar('\n');
}

static void print_stats(const map_job *j)
{
    const ebpo_map_stats *s = &j->stats;
    const char *unit = ebpo_file_info(j->file)->unit;
    printf("%s: distances of %llu points%s%s%s\n", remote_shown(j->path),
           (unsigned long long)(s->count + s->beyond), unit[0] ? ", unit " : "", unit,
           j->v->from ? ", vertices of the other model" : "");
    printf("  inside     %llu, on the model %llu", (unsigned long long)s->inside,
           (unsigned long long)s->on);
    if (s->beyond)
        printf(", beyond --max-distance %llu", (unsigned long long)s->beyond);
    printf("\n  from       %.9g to %.9g, farthest without signs %.9g\n", s->min, s->max,
           s->farthest);
    printf("  mean       %.9g, without signs %.9g\n  rms        %.9g, standard deviation %.9g\n",
           s->mean, s->mean_unsigned, s->rms, s->deviation);
    if (isfinite(s->percentile[0]))
        print_percentiles(s);
    if (j->v->bounds)
        printf("  hausdorff  %.9g to %.9g, from all of its faces; %llu distances\n", j->reach.lo,
               j->reach.hi, (unsigned long long)j->reach.questions);
}

static void json_stats(const map_job *j, json *out)
{
    const ebpo_map_stats *s = &j->stats;
    double percents[EBPO_MAP_PERCENTILES];
    for (int i = 0; i < EBPO_MAP_PERCENTILES; i++)
        percents[i] = ebpo_map_percent(i);
    json_text(out, "file", remote_shown(j->path));
    json_text(out, "points", j->v->from ? "vertices" : j->plane ? "plane" : "grid");
    json_text(out, "unit", ebpo_file_info(j->file)->unit);
    json_uint(out, "count", s->count);
    json_uint(out, "beyond", s->beyond);
    json_uint(out, "inside", s->inside);
    json_uint(out, "on", s->on);
    json_real(out, "min", s->min);
    json_real(out, "max", s->max);
    json_real(out, "farthest", s->farthest);
    json_real(out, "mean", s->mean);
    json_real(out, "mean_unsigned", s->mean_unsigned);
    json_real(out, "rms", s->rms);
    json_real(out, "standard_deviation", s->deviation);
    if (isfinite(s->percentile[0])) {
        json_reals(out, "percents", percents, EBPO_MAP_PERCENTILES);
        json_reals(out, "percentiles", s->percentile, EBPO_MAP_PERCENTILES);
        json_reals(out, "percentiles_unsigned", s->percentile_unsigned, EBPO_MAP_PERCENTILES);
    }
    if (j->v->bounds) {
        json_object(out, "hausdorff");
        json_real(out, "lo", j->reach.lo);
        json_real(out, "hi", j->reach.hi);
        json_reals(out, "place", j->reach.place, 3);
        json_uint(out, "questions", j->reach.questions);
        json_end(out);
    }
    if (j->range > 0)
        json_real(out, "colour_range", j->range);
    if (j->v->out)
        json_text(out, "output", j->v->out);
    if (j->v->picture)
        json_text(out, "picture", j->v->picture);
}

static void tell(const map_job *j)
{
    traffic t = traffic_of(j->file);
    if (!j->v->json) {
        if (!j->v->quiet)
            print_stats(j);
        remote_tell(&t, &j->v->remote, false);
        return;
    }
    json out;
    json_begin(&out, stdout);
    json_object(&out, NULL);
    json_stats(j, &out);
    remote_json(&out, &t, &j->v->remote);
    json_finish(&out);
}

/* --- running --- */

static ebpo_status open_model(map_job *j, uint64_t memory, bool given, ebpo_progress progress,
                              ebpo_error *error)
{
    ebpo_model_options o = EBPO_MODEL_OPTIONS_INIT;
    o.memory = memory;
    o.threads = (unsigned)j->v->threads;
    o.progress = progress;
    if (!given)
        model_memory_usual("map", j->file, j->path, &o);
    return ebpo_model_new(j->file, &o, &j->model, error);
}

static int run_job(map_job *j, uint64_t memory)
{
    const map_values *v = j->v;
    ebpo_error error = EBPO_ERROR_INIT;
    progress_line line;
    ebpo_progress progress = progress_start(&line, "map", v->quiet || v->json);
    j->options.progress = progress;
    ebpo_status status = remote_open(&j->file, j->path, &v->remote, &error);
    if (status != EBPO_OK)
        return command_failed("map", &error);
    int code = v->from ? EXIT_FINE : map_find_lattice(j);
    if (code != EXIT_FINE)
        return code;
    status = open_model(j, memory, v->memory != NULL, progress, &error);
    if (status == EBPO_OK)
        status = v->from ? map_vertices(j, progress, &error) : map_plane_or_grid(j, &error);
    progress_wipe(&line);
    if (status == EBPO_OK)
        tell(j);
    return status == EBPO_OK ? EXIT_FINE : command_failed("map", &error);
}

static int run(void *given, const char **operand)
{
    map_values *v = given;
    map_job j = { .v = v,
                  .path = operand[0],
                  .options = EBPO_MAP_OPTIONS_INIT,
                  .stats = EBPO_MAP_STATS_INIT,
                  .reach = EBPO_MAP_REACH_INIT,
                  .range = v->range };
    uint64_t memory = 0;
    int code = check(v);
    if (code == EXIT_FINE && v->memory && !words_read_size(v->memory, &memory))
        code = command_usage("map", "--memory '%s': expected " WORDS_SIZE_EXPECTED, v->memory);
    if (code == EXIT_FINE && v->size && !map_read_size(v->size, &j.width, &j.height))
        code = EXIT_USAGE;
    if (code == EXIT_FINE)
        code = overwrites(operand[0], v);
    if (code == EXIT_FINE && !command_wants_hdf5("map", operand[0]))
        code = EXIT_FAILED;
    if (code != EXIT_FINE)
        return code;
    if (v->from && !v->size) {
        j.width = 1200;
        j.height = 900;
    }
    j.options.max_distance = v->max_distance;
    j.options.unsigned_distance = v->unsigned_distance;
    j.options.threads = (unsigned)v->threads;
    code = run_job(&j, memory);
    ebpo_model_free(j.model);
    ebpo_close(j.file);
    return code;
}

const command command_map = { &spec, sizeof usual, &usual, run };
