/* ebpo measure: area, volume, centroid, inertia, and the volume of each level. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>

#include <ebpo/limit.h>

#include "cli/command.h"
#include "cli/file_facts.h"
#include "cli/progress.h"
#include "cli/remote_args.h"
#include "cmd/commands.h"

typedef struct values {
    bool json, deviation, derived, limit;
    int64_t threads, questions;
    double tolerance;
    remote_values remote;
} values;

static const arg_option options[] = {
    OPTION_THREADS(values, threads),
    OPTION_FLAG("deviation", 0, values, deviation,
                "also print how far each level reaches beyond the model: certain bounds on the "
                "farthest point, mean and rms over its surface"),
    OPTION_REAL("tolerance", 0, values, tolerance, "T", 1e-6, 1000,
                "with --deviation: refine the bounds until the upper one is at most 1 + T times "
                "the lower one; default 0.05"),
    OPTION_INT("questions", 0, values, questions, "N", 0, 9007199254740992.0,
               "with --deviation: stop after about N distances for each level and print what is "
               "certain by then; default 200000; 0: no limit"),
    OPTION_FLAG("derived", 0, values, derived,
                "also print the volume of each level with its leaves cut by planes derived from "
                "their faces"),
    OPTION_FLAG("limit", 0, values, limit,
                "the same, and the sum of the volumes of the solid's convex hulls in the cells: no "
                "convex envelopes of these cells are smaller"),
    OPTION_FLAG("json", 0, values, json, "print the numbers as JSON"),
    REMOTE_OPTIONS(values, remote),
    { 0 },
};

static const arg_spec spec = {
    .command = "measure",
    .operands = "FILE",
    .least = 1,
    .most = 1,
    .summary = "measures area, volume, centroid, inertia, and the volume or reach of each level",
    .text = "FILE is an .ebpo.h5 file with its mesh, or its URL. Volume, centroid and inertia are "
            "those of the winding number's integral (density 1); a surface has only an area.",
    .options = options,
};

/* --- words --- */

/* What is measured of levels, as wished; [level_count], or NULL. */
typedef struct measures {
    const double *derived; /* with limit: always */
    const ebpo_deviation *deviation;
    const ebpo_limit *limit;
} measures;

static void print_limit(const ebpo_info *info, double volume, const ebpo_limit *limit)
{
    double ratio = facts_excess_ratio(info, volume, limit->volume);
    printf(" %24.16g", limit->volume);
    if (info->solid && isnan(ratio))
        printf(" %17s", "-");
    else if (info->solid)
        printf(" %17.4f", ratio);
}

static void print_levels(const ebpo_info *info, const measures *m)
{
    const ebpo_deviation *deviation = m->deviation;
    printf("%5s %24s %9s", "level", "envelopes' volume", info->solid ? "% solid" : "% box");
    if (deviation)
        printf(" %13s %13s %13s %13s", "reaches", "at most", "mean", "rms");
    if (m->derived)
        printf(" %24s %9s", "leaves' planes derived", info->solid ? "% solid" : "% box");
    if (m->limit)
        printf(" %24s%s", "hulls' volume", info->solid ? "   excess to limit" : "");
    putchar('\n');
    for (int i = 0; i < info->level_count; i++) {
        printf("%5d %24.16g %9.2f", i, facts_volume(info, i), facts_percent(info, i));
        if (deviation)
            printf(" %13.6g %13.6g %13.6g %13.6g", deviation[i].lo, deviation[i].hi,
                   deviation[i].mean, deviation[i].rms);
        if (m->derived)
            printf(" %24.16g %9.2f", m->derived[i], facts_share(info, m->derived[i]));
        if (m->limit)
            print_limit(info, m->derived[i], &m->limit[i]);
        putchar('\n');
    }
}

static void print_mass(const char *path, const ebpo_info *info, const ebpo_mass *mass,
                       const measures *m)
{
    printf("%s: %s%s%s\n", path, info->solid ? "a solid" : "a surface",
           info->unit[0] ? ", unit " : "", info->unit);
    if (facts_inside_out(info))
        printf("  warning   %s\n", facts_inside_out(info));
    printf("  area      %.16g\n", mass->area);
    if (info->solid) {
        const double *c = mass->centroid;
        printf("  volume    %.16g\n  centroid  %.16g %.16g %.16g\n", mass->volume, c[0], c[1],
               c[2]);
        for (int k = 0; k < 3; k++)
            printf("  %-9s %.16g %.16g %.16g\n", k ? "" : "inertia", mass->inertia[k][0],
                   mass->inertia[k][1], mass->inertia[k][2]);
    }
    putchar('\n');
    print_levels(info, m);
}

/* --- JSON --- */

static void json_deviation(json *j, const ebpo_deviation *d)
{
    json_object(j, "deviation");
    json_real(j, "lo", d->lo);
    json_real(j, "hi", d->hi);
    json_reals(j, "place", d->place, 3);
    json_real(j, "mean", d->mean);
    json_real(j, "rms", d->rms);
    json_uint(j, "samples", d->samples);
    json_uint(j, "questions", d->questions);
    json_end(j);
}

static void json_limit(json *j, const ebpo_info *info, double volume, const ebpo_limit *limit)
{
    json_real(j, "limit_volume", limit->volume);
    if (info->solid)
        json_real(j, "excess_to_limit", facts_excess_ratio(info, volume, limit->volume));
    json_uint(j, "hulls", limit->hulls);
    json_uint(j, "flat_hulls", limit->flat);
}

static void json_mass(json *j, const char *path, const ebpo_info *info, const ebpo_mass *mass,
                      const measures *m)
{
    json_text(j, "file", path);
    json_text(j, "kind", info->solid ? "solid" : "surface");
    json_bool(j, "inside_out", facts_inside_out(info) != NULL);
    json_text(j, "unit", info->unit);
    json_real(j, "area", mass->area);
    if (info->solid) {
        json_real(j, "volume", mass->volume);
        json_reals(j, "centroid", mass->centroid, 3);
        json_array(j, "inertia");
        for (int k = 0; k < 3; k++)
            json_reals(j, NULL, mass->inertia[k], 3);
        json_end(j);
    }
    json_array(j, "levels");
    for (int i = 0; i < info->level_count; i++) {
        json_object(j, NULL);
        json_int(j, "level", i);
        json_real(j, "envelope_volume", facts_volume(info, i));
        json_real(j, info->solid ? "percent_of_solid" : "percent_of_box", facts_percent(info, i));
        if (m->deviation)
            json_deviation(j, &m->deviation[i]);
        if (m->derived)
            json_real(j, "derived_volume", m->derived[i]);
        if (m->limit)
            json_limit(j, info, m->derived[i], &m->limit[i]);
        json_end(j);
    }
    json_end(j);
}

static ebpo_status measure_levels(ebpo_file *file, const values *v, ebpo_progress progress,
                                  ebpo_deviation *out, ebpo_error *error)
{
    ebpo_model *model = NULL;
    ebpo_model_options opening = EBPO_MODEL_OPTIONS_INIT;
    ebpo_deviation_options wanted = EBPO_DEVIATION_OPTIONS_INIT;
    opening.threads = wanted.threads = (unsigned)v->threads;
    wanted.tolerance = v->tolerance;
    wanted.questions = (uint64_t)v->questions;
    wanted.progress = opening.progress = progress;
    ebpo_status status = ebpo_model_new(file, &opening, &model, error);
    for (int i = 0; i < ebpo_file_info(file)->level_count && status == EBPO_OK; i++) {
        out[i] = (ebpo_deviation)EBPO_DEVIATION_INIT;
        status = ebpo_deviation_level(model, file, i, &wanted, &out[i], error);
        wanted.at_most = out[i].hi;
    }
    ebpo_model_free(model);
    return status;
}

static ebpo_status limit_levels(ebpo_file *file, const values *v, ebpo_progress progress,
                                ebpo_limit *out, ebpo_error *error)
{
    ebpo_limit_options wanted = EBPO_LIMIT_OPTIONS_INIT;
    wanted.threads = (unsigned)v->threads;
    wanted.progress = progress;
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < ebpo_file_info(file)->level_count && status == EBPO_OK; i++) {
        out[i] = (ebpo_limit)EBPO_LIMIT_INIT;
        status = ebpo_limit_level(file, i, &wanted, &out[i], error);
    }
    return status;
}

static ebpo_status derive_levels(ebpo_file *file, const values *v, ebpo_progress progress,
                                 double *out, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < ebpo_file_info(file)->level_count && status == EBPO_OK; i++)
        status = facts_derived(file, i, (unsigned)v->threads, progress, &out[i], error);
    return status;
}

static int measure(const char *path, const values *v)
{
    ebpo_deviation levels[EBPO_LEVELS_MAX];
    ebpo_limit limits[EBPO_LEVELS_MAX];
    double volumes[EBPO_LEVELS_MAX];
    bool derived = v->derived || v->limit;
    measures m = { derived ? volumes : NULL, v->deviation ? levels : NULL,
                   v->limit ? limits : NULL };
    progress_line line;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    ebpo_mass mass = EBPO_MASS_INIT;
    if (remote_open(&file, path, &v->remote, &error) != EBPO_OK)
        return command_failed("measure", &error);
    if (!(ebpo_file_info(file)->parts & EBPO_PART_MESH)) {
        ebpo_close(file);
        fprintf(stderr,
                "ebpo measure: %s: has no mesh to measure; convert the mesh again without "
                "'--without mesh'\n",
                path);
        return EXIT_FAILED;
    }
    ebpo_status status = ebpo_measure(file, (unsigned)v->threads, &mass, &error);
    ebpo_progress progress = progress_start(&line, "measure", v->json);
    if (status == EBPO_OK && v->deviation)
        status = measure_levels(file, v, progress, levels, &error);
    if (status == EBPO_OK && derived)
        status = derive_levels(file, v, progress, volumes, &error);
    if (status == EBPO_OK && v->limit)
        status = limit_levels(file, v, progress, limits, &error);
    progress_wipe(&line);
    traffic t = traffic_of(file);
    if (status == EBPO_OK && v->json) {
        json j;
        json_begin(&j, stdout);
        json_object(&j, NULL);
        json_mass(&j, remote_shown(path), ebpo_file_info(file), &mass, &m);
        remote_json(&j, &t, &v->remote);
        json_finish(&j);
    } else if (status == EBPO_OK) {
        print_mass(remote_shown(path), ebpo_file_info(file), &mass, &m);
        remote_tell(&t, &v->remote, false);
    }
    ebpo_close(file);
    return status == EBPO_OK ? EXIT_FINE : command_failed("measure", &error);
}

static const values usual = { .tolerance = 0.05,
                              .questions = 200000,
                              .remote = REMOTE_VALUES_INIT };

static int run(void *given, const char **operand)
{
    values *v = given;
    return command_wants_hdf5("measure", operand[0]) ? measure(operand[0], v) : EXIT_FAILED;
}

const command command_measure = { &spec, sizeof usual, &usual, run };
