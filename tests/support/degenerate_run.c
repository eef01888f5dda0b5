/* Runs one degenerate or ill-conditioned case from the mesh to the results. */
#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include <ebpo/lod.h>
#include <ebpo/verify.h>

#include "degenerate.h"

__attribute__((format(printf, 2, 3))) static void fault(degenerate_result *r, const char *format,
                                                        ...)
{
    size_t at = strlen(r->fault);
    va_list arguments;
    va_start(arguments, format);
    if (at + 3 < sizeof r->fault) {
        if (at > 0)
            at += (size_t)snprintf(r->fault + at, sizeof r->fault - at, "; ");
        vsnprintf(r->fault + at, sizeof r->fault - at, format, arguments);
    }
    va_end(arguments);
}

static query_variant variant_of(const degenerate_case *c)
{
    query_variant v = { "degenerate", c->leaf ? c->leaf : 16, c->levels ? c->levels - 1 : -1,
                        c->rule, 0 };
    return v;
}

ebpo_status degenerate_build(const degenerate_case *c, ebpo_mesh *mesh, ebpo_tree *tree,
                             ebpo_error *error)
{
    query_variant v = variant_of(c);
    return query_build(tree, mesh, &v, error);
}

static void run_refused(const degenerate_case *c, degenerate_result *r)
{
    if (c->status == EBPO_OK)
        fault(r, "does not convert: %s: %s", ebpo_status_name(r->status), r->message);
    else if (r->status != c->status || !strstr(r->message, c->message))
        fault(r, "fails with %s, \"%s\", instead of %s, \"%s\"", ebpo_status_name(r->status),
              r->message, ebpo_status_name(c->status), c->message);
}

static void run_verify(const query_model *m, const ebpo_mesh *source, degenerate_result *r)
{
    ebpo_verify_options options = EBPO_VERIFY_OPTIONS_INIT;
    ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    options.source = source;
    options.threads = 1;
    if (ebpo_verify(m->file, &options, &report, &error) != EBPO_OK) {
        fault(r, "cannot be verified: %s", error.message);
        return;
    }
    r->checks = report.checks;
    r->violations = report.violations;
    if (r->violations == 0)
        return;
    const ebpo_verify_count *kinds[] = { &report.structure, &report.content, &report.containment,
                                         &report.nesting,   &report.labels,  &report.lists,
                                         &report.source };
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
        if (kinds[i]->violations)
            fault(r, "%llu violations, first %s", (unsigned long long)kinds[i]->violations,
                  kinds[i]->first);
}

static bool query_points(query_model *m, uint64_t count, degenerate_result *r)
{
    enum { BATCH = 256 };
    double *points = query_alloc(count, 3 * sizeof *points);
    query_truth *truth = query_alloc(BATCH, sizeof *truth);
    ebpo_inside_result *inside = query_alloc(BATCH, sizeof *inside);
    ebpo_distance_result *distance = query_alloc(BATCH, sizeof *distance);
    ebpo_error error = EBPO_ERROR_INIT;
    bool fine = true;
    query_make_points(m, count, 1, points);
    for (uint64_t i = 0; i < 3 * count; i++)
        if (!isfinite(points[i]))
            points[i] = DBL_MAX;
    for (uint64_t at = 0; at < count && fine; at += BATCH) {
        const double *p = points + 3 * at;
        uint64_t n = count - at < BATCH ? count - at : BATCH;
        query_find_truths(m, p, n, truth);
        if (m->info.solid) {
            fine = ebpo_inside_many(m->context, p, n, NULL, inside, &error) == EBPO_OK;
            r->wrong += fine ? query_wrong_inside(m, p, truth, n, inside) : 0;
            r->queries += n;
        }
        fine = fine && ebpo_distance_many(m->context, p, n, NULL, distance, &error) == EBPO_OK;
        r->wrong += fine ? query_wrong_distance(m, p, truth, n, false, distance) : 0;
        r->queries += n;
    }
    if (!fine)
        fault(r, "a query fails: %s", error.message);
    free(points);
    free(truth);
    free(inside);
    free(distance);
    return fine;
}

static void query_rays(query_model *m, uint64_t count, degenerate_result *r)
{
    uint64_t state = 5;
    for (uint64_t i = 0; i < count; i++) {
        query_ray ray;
        query_make_ray(m, &state, ray.origin, ray.direction, &ray.t_max);
        for (int k = 0; k < 3; k++) {
            if (!isfinite(ray.origin[k]))
                ray.origin[k] = DBL_MAX;
            if (!isfinite(ray.direction[k]))
                ray.direction[k] = copysign(DBL_MAX, ray.direction[k]);
        }
        r->wrong += !query_one_ray(m, m->context, &ray);
        r->queries++;
    }
}

static double relative(double value, double truth)
{
    return value == truth ? 0 : fabs(value - truth) / fabs(truth);
}

static void run_levels(const degenerate_case *c, query_model *m, degenerate_result *r)
{
    double set = c->set != 0 ? c->set : r->volume, before = INFINITY, volume = 0;
    ebpo_lod_options options = EBPO_LOD_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    options.threads = 1;
    r->rise = -1;
    for (int level = 0; level < m->info.level_count; level++) {
        if (ebpo_lod_level(m->file, level, &options, NULL, &volume, &error) != EBPO_OK) {
            fault(r, "level %d cannot be cut: %s", level, error.message);
            return;
        }
        double rise = before < INFINITY ? volume / before - 1 : -1;
        r->rise = fmax(r->rise, rise);
        if (!(rise <= DEGENERATE_ENVELOPE))
            fault(r, "level %d of volume %.17g is larger than the level before, of %.17g", level,
                  volume, before);
        if (!isnan(set) && !(volume >= set * (1 - DEGENERATE_ENVELOPE)))
            fault(r, "level %d of volume %.17g is smaller than the solid, of %.17g", level, volume,
                  set);
        before = volume;
    }
    r->excess = volume / set - 1;
}

static void run_volumes(const degenerate_case *c, query_model *m, degenerate_result *r)
{
    ebpo_mass mass = EBPO_MASS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    if (ebpo_measure(m->file, 1, &mass, &error) != EBPO_OK) {
        fault(r, "cannot be measured: %s", error.message);
        return;
    }
    r->volume = oracle_volume(m->judge);
    double within = c->within > 0 ? c->within : DEGENERATE_MEASURE;
    if (c->volume > 0 && !(relative(r->volume, c->volume) <= within))
        fault(r, "the mesh's volume is %.17g, by the formula %.17g", r->volume, c->volume);
    if (!isnormal(r->volume)) {
        if (r->volume == 0 || isinf(r->volume)
                ? mass.integral != r->volume
                : !(fabs(mass.integral - r->volume) <= DBL_MIN * DBL_EPSILON))
            fault(r, "the measured volume is %.17g, exactly %.17g", mass.integral, r->volume);
        return;
    }
    r->has_volume = true;
    r->volume_error = relative(mass.integral, r->volume);
    if (!(r->volume_error <= (c->measure > 0 ? c->measure : DEGENERATE_MEASURE)))
        fault(r, "the measured volume is %.17g, exactly %.17g", mass.integral, r->volume);
    if (r->volume > 0)
        run_levels(c, m, r);
}

static ebpo_mesh copy_of(const ebpo_mesh *mesh)
{
    ebpo_mesh copy = *mesh;
    size_t size = 3 * mesh->vertex_count;
    if (mesh->xyz32)
        copy.xyz32 =
            memcpy(query_alloc(size, sizeof *copy.xyz32), mesh->xyz32, size * sizeof *copy.xyz32);
    if (mesh->xyz64)
        copy.xyz64 =
            memcpy(query_alloc(size, sizeof *copy.xyz64), mesh->xyz64, size * sizeof *copy.xyz64);
    copy.faces = memcpy(query_alloc(mesh->face_count, 3 * sizeof *copy.faces), mesh->faces,
                        mesh->face_count * 3 * sizeof *copy.faces);
    return copy;
}

static void run_converted(const degenerate_case *c, query_model *m, const ebpo_mesh *source,
                          uint64_t queries, degenerate_result *r)
{
    struct stat file;
    r->levels = m->info.level_count;
    if (c->status != EBPO_OK)
        fault(r, "converts, which should fail with %s", ebpo_status_name(c->status));
    if (m->info.solid == c->surface)
        fault(r, "is a %s", m->info.solid ? "solid" : "surface");
    if (c->reached && r->levels != c->reached)
        fault(r, "has %d levels instead of %d", r->levels, c->reached);
    r->bytes_per_face = stat(m->path, &file) == 0 ? (double)file.st_size / (double)r->faces : NAN;
    run_verify(m, source, r);
    if (m->info.solid)
        run_volumes(c, m, r);
    if (query_points(m, queries, r))
        query_rays(m, queries / 4 + 1, r);
    if (r->wrong)
        fault(r, "%llu wrong results of %llu", (unsigned long long)r->wrong,
              (unsigned long long)r->queries);
}

void degenerate_run(const degenerate_case *c, uint64_t queries, degenerate_result *r)
{
    query_model m;
    query_variant variant = variant_of(c);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh mesh = c->make(c), source = copy_of(&mesh);
    memset(r, 0, sizeof *r);
    r->faces = mesh.face_count;
    r->excess = NAN;
    r->status = query_model_try(&m, c->name, mesh, &variant, &error);
    memcpy(r->message, error.message, sizeof r->message);
    if (r->status != EBPO_OK) {
        run_refused(c, r);
    } else {
        run_converted(c, &m, &source, queries, r);
        query_model_free(&m);
    }
    ebpo_mesh_free(&source);
}
