/* ebpo measure: computes area, volume, centroid, inertia, and the volume of each level. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>

#include <ebpo/limit.h>

#include "cli/command.h"
#include "cli/file_facts.h"
#include "cli/mesh_findings.h"
#include "cli/process_memory.h"
#include "cli/progress.h"
#include "cli/remote_args.h"
#include "cli/tables.h"
#include "cli/words.h"
#include "cli/commands/commands.h"

typedef struct values {
    bool json, error_bound, derived, limit;
    int64_t threads, queries;
    double tolerance;
    const char *memory;
    remote_values remote;
} values;

#include "cli/options/measure.inc"

/* --- words --- */

/* Requested measurements. Arrays have an entry for each level; NULL: not requested. */
typedef struct measures {
    ebpo_solid_volume solid; /* volume of the model */
    const double *derived;   /* volumes of envelopes with leaf planes that follow from the faces;
                              * not NULL if `limit` is not NULL */
    const ebpo_error_bound *error_bound; /* largest distances of envelopes from the model */
    const ebpo_limit *limit; /* volumes of the convex hulls, which no envelopes can undercut */
} measures;

static void print_limit(const ebpo_info *info, const ebpo_solid_volume *solid, double volume,
                        const ebpo_limit *limit)
{
    char cell[TABLE_CELL];
    printf(" %24s", table_cell(cell, "%.16g", limit->volume));
    if (info->solid)
        printf(" %17s",
               table_cell(cell, "%.4f", facts_excess_ratio(info, solid, volume, limit->volume)));
}

static void print_levels(const ebpo_info *info, const measures *m)
{
    const ebpo_error_bound *error_bound = m->error_bound;
    char whole[TABLE_CELL];
    snprintf(whole, sizeof whole, "%% %s", facts_whole(info, &m->solid));
    printf("%5s %24s %10s", "level", "envelopes' volume", whole);
    if (error_bound)
        printf(" %13s %13s %13s %13s", "reaches", "at most", "mean", "rms");
    if (m->derived)
        printf(" %24s %10s", "leaves' planes derived", whole);
    if (m->limit)
        printf(" %24s%s", "hulls' volume", info->solid ? "   excess to limit" : "");
    putchar('\n');
    for (int i = 0; i < info->level_count; i++) {
        char volume[TABLE_CELL], percent[TABLE_CELL];
        printf("%5d %24s %10s", i, table_cell(volume, "%.16g", facts_volume(info, i)),
               table_cell(percent, "%.2f", facts_percent(info, &m->solid, i)));
        if (error_bound)
            printf(" %13.6g %13.6g %13.6g %13.6g", error_bound[i].lo, error_bound[i].hi,
                   error_bound[i].mean, error_bound[i].rms);
        if (m->derived)
            printf(" %24s %10s", table_cell(volume, "%.16g", m->derived[i]),
                   table_cell(percent, "%.2f", facts_share(info, &m->solid, m->derived[i])));
        if (m->limit)
            print_limit(info, &m->solid, m->derived[i], &m->limit[i]);
        putchar('\n');
    }
}

static void print_legend(const ebpo_info *info, const measures *m)
{
    printf("volumes in the model's unit%s%s cubed; ", info->unit[0] ? " " : "", info->unit);
    facts_print_whole(stdout, info, &m->solid);
    if (m->error_bound)
        puts("reaches, at most: bounds of the largest distance of the envelopes beyond the model;\n"
             "mean, rms: over the envelopes' surface");
    if (m->limit && info->solid)
        puts("excess to limit: the envelopes' volume beyond the solid's, divided by that of the\n"
             "hulls; - if the hulls have the solid's volume");
    if (!isfinite(facts_volume(info, 0)))
        table_beyond(stdout);
}

static void print_inertia(const ebpo_info *info, const ebpo_mass *mass)
{
    char cell[3][TABLE_CELL], unit[TABLE_CELL];
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 3; i++)
            table_scaled(cell[i], 16, mass->scaled_inertia[k][i], 5 * mass->exponent);
        printf("  %-9s %s %s %s%s\n", k ? "" : "inertia", cell[0], cell[1], cell[2],
               k ? "" : table_unit(unit, info->unit, 5));
    }
}

static void print_volume(const ebpo_info *info, const ebpo_mass *mass)
{
    char cell[TABLE_CELL], lo[32], hi[32], unit[TABLE_CELL];
    bool known = !isnan(mass->scaled_volume);
    table_unit(unit, info->unit, 3);
    if (known)
        printf("  volume    %s%s\n",
               table_scaled(cell, 16, mass->scaled_volume, 3 * mass->exponent), unit);
    else if (isfinite(mass->volume_hi))
        printf("  volume    %s to %s%s\n", words_real(mass->volume_lo, lo),
               words_real(mass->volume_hi, hi), unit);
    else
        puts("  volume    not known");
    if (known && mass->scaled_volume == mass->scaled_integral)
        return;
    printf("  integral  of the winding number: %s%s%s\n",
           table_scaled(cell, 16, mass->scaled_integral, 3 * mass->exponent), unit,
           known
               ? ""
               : "; centroid and inertia are those of the winding number as a density:\n"
                 "            components intersect, repeat or cross themselves, or the mesh is no "
                 "2-manifold");
}

/* Returns true if the file defines which points are inside the model, and thus a volume. */
static bool has_inside(const ebpo_info *info)
{
    return info->solid || info->parts & EBPO_PART_BORDER;
}

/* Prints how much the integral and the centroid depend on the caps. Caps are faces that close the
 * holes of a surface; a hole can be closed by different caps. */
static void print_caps(const ebpo_info *info, const ebpo_mass *mass)
{
    char unit[2][TABLE_CELL], share[TABLE_CELL];
    double percent = 100 * mass->caps_integral / fabs(mass->integral);
    printf("  caps      the error of the integral is at most %.2g; the choice of caps in the hulls "
           "of\n"
           "            their loops changes it by at most %.6g%s (%s %%), the centroid by %.6g%s\n",
           mass->integral_error, mass->caps_integral, table_unit(unit[0], info->unit, 3),
           table_cell(share, "%.3g", percent), mass->caps_centroid,
           table_unit(unit[1], info->unit, 1));
}

static void print_mass(const char *path, const ebpo_info *info, const ebpo_mass *mass,
                       const measures *m)
{
    printf("%s: %s%s%s\n", path, info->solid ? "a solid" : "a surface",
           info->unit[0] ? ", unit " : "", info->unit);
    if (facts_inside_out(info))
        printf("  warning   %s\n", facts_inside_out(info));
    char cell[TABLE_CELL], unit[TABLE_CELL];
    printf("  area      %s%s\n", table_scaled(cell, 16, mass->scaled_area, 2 * mass->exponent),
           table_unit(unit, info->unit, 2));
    if (has_inside(info)) {
        const double *c = mass->centroid;
        print_volume(info, mass);
        if (!info->solid)
            print_caps(info, mass);
        printf("  centroid  %.16g %.16g %.16g%s\n", c[0], c[1], c[2],
               table_unit(unit, info->unit, 1));
        print_inertia(info, mass);
    }
    if (!info->unit[0])
        puts("  (in the model's unit, which the file does not name, squared, cubed and so on)");
    if (has_inside(info))
        printf(
            "  (intersecting faces of one component were not checked: ebpo check --crossings%s)\n",
            info->solid ? "" : "; holes are closed by caps");
    putchar('\n');
    print_levels(info, m);
    print_legend(info, m);
}

/* --- JSON --- */

static void json_error_bound(json *j, const ebpo_error_bound *d)
{
    json_object(j, "error_bound");
    json_real(j, "lo", d->lo);
    json_real(j, "hi", d->hi);
    json_reals(j, "location", d->location, 3);
    json_real(j, "mean", d->mean);
    json_real(j, "rms", d->rms);
    json_uint(j, "samples", d->samples);
    json_uint(j, "queries", d->queries);
    json_end(j);
}

static void json_limit(json *j, const ebpo_info *info, const ebpo_solid_volume *solid,
                       double volume, const ebpo_limit *limit)
{
    json_real(j, "limit_volume", limit->volume);
    if (info->solid)
        json_real(j, "excess_to_limit", facts_excess_ratio(info, solid, volume, limit->volume));
    json_uint(j, "hulls", limit->hulls);
    json_uint(j, "flat_hulls", limit->flat);
}

static void json_mass(json *j, const char *path, const ebpo_info *info, const ebpo_mass *mass,
                      const measures *m)
{
    char percent[32];
    snprintf(percent, sizeof percent, "percent_of_%s", facts_whole(info, &m->solid));
    json_text(j, "file", path);
    json_text(j, "kind", info->solid ? "solid" : "surface");
    json_bool(j, "inside_out", facts_inside_out(info) != NULL);
    json_text(j, "unit", info->unit);
    table_json(j, "area", mass->scaled_area, 2 * mass->exponent);
    if (has_inside(info)) {
        if (isnan(mass->scaled_volume))
            json_null(j, "volume");
        else
            table_json(j, "volume", mass->scaled_volume, 3 * mass->exponent);
        json_real(j, "volume_lo", mass->volume_lo);
        json_real(j, "volume_hi", mass->volume_hi);
        table_json(j, "winding_integral", mass->scaled_integral, 3 * mass->exponent);
        json_reals(j, "centroid", mass->centroid, 3);
        json_array(j, "inertia");
        for (int k = 0; k < 3; k++) {
            json_array(j, NULL);
            for (int i = 0; i < 3; i++)
                table_json(j, NULL, mass->scaled_inertia[k][i], 5 * mass->exponent);
            json_end(j);
        }
        json_end(j);
    }
    if (info->parts & EBPO_PART_BORDER) {
        json_object(j, "caps");
        json_real(j, "integral_error", mass->integral_error);
        json_real(j, "centroid_error", mass->centroid_error);
        json_real(j, "integral", mass->caps_integral);
        json_real(j, "centroid", mass->caps_centroid);
        json_end(j);
    }
    json_array(j, "levels");
    for (int i = 0; i < info->level_count; i++) {
        json_object(j, NULL);
        json_int(j, "level", i);
        json_real(j, "envelope_volume", facts_volume(info, i));
        json_real(j, percent, facts_percent(info, &m->solid, i));
        if (m->error_bound)
            json_error_bound(j, &m->error_bound[i]);
        if (m->derived)
            json_real(j, "derived_volume", m->derived[i]);
        if (m->limit)
            json_limit(j, info, &m->solid, m->derived[i], &m->limit[i]);
        json_end(j);
    }
    json_end(j);
}

/* Computes out[i], the error bound of level i. */
static ebpo_status bound_levels(ebpo_file *file, const values *v, ebpo_progress progress,
                                ebpo_error_bound *out, ebpo_error *error)
{
    ebpo_model *model = NULL;
    ebpo_model_options model_options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_error_bound_options bound_options = EBPO_ERROR_BOUND_OPTIONS_INIT;
    model_options.threads = bound_options.threads = (unsigned)v->threads;
    bound_options.tolerance = v->tolerance;
    bound_options.queries = (uint64_t)v->queries;
    bound_options.progress = model_options.progress = progress;
    ebpo_status status = ebpo_model_new(file, &model_options, &model, error);
    for (int i = 0; i < ebpo_file_info(file)->level_count && status == EBPO_OK; i++) {
        out[i] = (ebpo_error_bound)EBPO_ERROR_BOUND_INIT;
        status = ebpo_level_error_bound(model, file, i, &bound_options, &out[i], error);
        /* the envelopes of the next level are inside the envelopes of level i */
        bound_options.at_most = out[i].hi;
    }
    ebpo_model_free(model);
    return status;
}

static ebpo_status limit_levels(ebpo_file *file, const values *v, ebpo_progress progress,
                                ebpo_limit *out, ebpo_error *error)
{
    ebpo_limit_options limit_options = EBPO_LIMIT_OPTIONS_INIT;
    limit_options.threads = (unsigned)v->threads;
    limit_options.progress = progress;
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < ebpo_file_info(file)->level_count && status == EBPO_OK; i++) {
        out[i] = (ebpo_limit)EBPO_LIMIT_INIT;
        status = ebpo_limit_level(file, i, &limit_options, &out[i], error);
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

static int measure_file(const char *path, const values *v)
{
    ebpo_error_bound bounds[EBPO_LEVELS_MAX];
    ebpo_limit limits[EBPO_LEVELS_MAX];
    double volumes[EBPO_LEVELS_MAX];
    bool derived = v->derived || v->limit;
    measures m = { .derived = derived ? volumes : NULL,
                   .error_bound = v->error_bound ? bounds : NULL,
                   .limit = v->limit ? limits : NULL };
    progress_line line;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    ebpo_mass mass = EBPO_MASS_INIT;
    if (remote_open(&file, path, &v->remote, &error) != EBPO_OK)
        return command_failed("measure", &error);
    if (!(ebpo_file_info(file)->parts & EBPO_PART_MESH)) {
        ebpo_close(file);
        fprintf(
            stderr,
            "ebpo measure: %s: has no mesh to measure; convert the source again with its mesh\n",
            path);
        return EXIT_FAILED;
    }
    ebpo_status status = ebpo_measure(file, (unsigned)v->threads, &mass, &error);
    m.solid = facts_measured(ebpo_file_info(file), &mass);
    ebpo_progress progress = progress_start(&line, "measure", v->json);
    if (status == EBPO_OK && v->error_bound)
        status = bound_levels(file, v, progress, bounds, &error);
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
        remote_report(&t, &v->remote, false);
    }
    ebpo_close(file);
    return status == EBPO_OK ? EXIT_OK : command_failed("measure", &error);
}

static const values standard = { .tolerance = 0.05,
                                 .queries = 200000,
                                 .remote = REMOTE_VALUES_INIT };

static int run_measure(void *given, const char **operand)
{
    values *v = given;
    if (!v->error_bound && (v->tolerance != standard.tolerance || v->queries != standard.queries))
        return command_usage("measure",
                             "--tolerance and --max-queries apply to --error-bound only; add it");
    if (!process_memory_take("measure", v->memory, v->threads))
        return EXIT_USAGE;
    return command_requires_hdf5("measure", operand[0]) ? measure_file(operand[0], v) : EXIT_FAILED;
}

const command command_measure = { &spec, sizeof standard, &standard, run_measure };
