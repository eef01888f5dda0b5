/* Measures queries to a level: the share of undecided points, the widths of intervals, and the
 * times. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/bench/bench_run.h"
#include "cli/bench/bench_walk.h"
#include "cli/reading.h"
#include "cli/report/report_data.h"

static ebpo_status no_memory(ebpo_error *error)
{
    snprintf(error->message, sizeof error->message,
             "not enough memory for the points; use fewer --points");
    return error->status = EBPO_E_MEMORY;
}

/* --- points --- */

static void vertex_of(const ebpo_mesh *mesh, uint64_t face, int corner, double out[3])
{
    uint64_t v = mesh->faces[3 * face + (unsigned)corner];
    for (unsigned k = 0; k < 3; k++)
        out[k] = mesh->xyz32 ? (double)mesh->xyz32[3 * v + k] : mesh->xyz64[3 * v + k];
}

/* Returns an area in units of the diagonal, so that no square overflows. */
static double area_of(const ebpo_mesh *mesh, uint64_t face, double unit)
{
    double p[3][3], a[3], b[3];
    for (int i = 0; i < 3; i++)
        vertex_of(mesh, face, i, p[i]);
    for (int k = 0; k < 3; k++) {
        a[k] = (p[1][k] - p[0][k]) / unit;
        b[k] = (p[2][k] - p[0][k]) / unit;
    }
    return sqrt(pow(a[1] * b[2] - a[2] * b[1], 2) + pow(a[2] * b[0] - a[0] * b[2], 2) +
                pow(a[0] * b[1] - a[1] * b[0], 2));
}

static uint64_t pick_by_sum(const double *sums, uint64_t count, double value)
{
    uint64_t low = 0, high = count - 1;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (sums[middle] > value)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

/* Generates a point in a ball around a point that is uniform on the surface. */
static void near_point(const ebpo_mesh *mesh, const double *sums, double radius, uint64_t *random,
                       double out[3])
{
    uint64_t face =
        pick_by_sum(sums, mesh->face_count, bench_random_unit(random) * sums[mesh->face_count - 1]);
    double s = bench_random_unit(random), t = bench_random_unit(random), p[3][3], d[3];
    if (s + t > 1) {
        s = 1 - s;
        t = 1 - t;
    }
    for (int i = 0; i < 3; i++)
        vertex_of(mesh, face, i, p[i]);
    do
        for (int k = 0; k < 3; k++)
            d[k] = 2 * bench_random_unit(random) - 1;
    while (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] > 1);
    for (int k = 0; k < 3; k++)
        out[k] = p[0][k] + s * (p[1][k] - p[0][k]) + t * (p[2][k] - p[0][k]) + radius * d[k];
}

static ebpo_status make_near(comparison *c, const method *m, ebpo_error *error)
{
    ebpo_file *file = NULL;
    ebpo_mesh mesh = { 0 };
    ebpo_read_options read = reading_options(c->v->threads, NULL);
    double sum = 0, *sums = NULL;
    uint64_t random = (uint64_t)c->v->seed + 1;
    ebpo_status status = remote_open(&file, m->path, &c->v->remote, error);
    if (status == EBPO_OK)
        status = ebpo_file_read_mesh(file, &read, &mesh, error);
    if (status == EBPO_OK && (!(sums = malloc((mesh.face_count + 1) * sizeof *sums)) ||
                              !(c->near = malloc(3 * c->points * sizeof *c->near))))
        status = no_memory(error);
    for (uint64_t i = 0; status == EBPO_OK && i < mesh.face_count; i++)
        sums[i] = sum += area_of(&mesh, i, c->diagonal);
    for (uint64_t i = 0; status == EBPO_OK && i < c->points; i++)
        near_point(&mesh, sums, c->diagonal / 100, &random, c->near + 3 * i);
    free(sums);
    ebpo_mesh_free(&mesh);
    ebpo_close(file);
    return status;
}

ebpo_status report_make_points(comparison *c, ebpo_error *error)
{
    const ebpo_info *info = &c->methods[0].info;
    uint64_t random = (uint64_t)c->v->seed;
    c->points = (uint64_t)c->v->points;
    c->uniform = malloc(3 * c->points * sizeof *c->uniform);
    if (!c->uniform)
        return no_memory(error);
    for (uint64_t i = 0; i < 3 * c->points; i++) {
        double low = info->report.min[i % 3], high = info->report.max[i % 3],
               t = bench_random_unit(&random);
        c->uniform[i] = (1 - t) * low + t * high;
    }
    for (int i = 0; i < c->count; i++)
        if (c->methods[i].info.parts & EBPO_PART_MESH && !c->methods[i].info.pruned)
            return make_near(c, &c->methods[i], error);
    return EBPO_OK;
}

/* --- queries --- */

typedef struct level_queries {
    comparison *c;
    method *m;
    ebpo_context *context;
    ebpo_inside_result *inside;
    ebpo_distance_result *distance;
    double *width;
    round_times *round;
    bool first; /* first round; later rounds only measure times */
} level_queries;

/* Measures nanoseconds per point; results are in a->distance or a->inside. */
static ebpo_status time_queries(level_queries *a, bool distance, const double *points, int level,
                                double *ns, ebpo_error *error)
{
    ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
    options.level = level;
    ebpo_inside_options inside = EBPO_INSIDE_OPTIONS_INIT;
    inside.level = level;
    options.warm = false;
    options.unsigned_distance = true;
    uint64_t begin = tool_clock();
    ebpo_status status =
        distance
            ? ebpo_distance_many(a->context, points, a->c->points, &options, a->distance, error)
            : ebpo_inside_many(a->context, points, a->c->points, &inside, a->inside, error);
    *ns = (double)(tool_clock() - begin) / (double)a->c->points;
    return status;
}

static double share_of_maybe(const level_queries *a)
{
    uint64_t count = 0;
    for (uint64_t i = 0; i < a->c->points; i++)
        count += a->inside[i].where == EBPO_MAYBE;
    return (double)count / (double)a->c->points;
}

static ebpo_status measure_inside(level_queries *a, int level, ebpo_error *error)
{
    double *f = a->m->level[level], ignored;
    ebpo_status status =
        time_queries(a, false, a->c->uniform, level, &a->round->inside[level], error);
    if (status != EBPO_OK || !a->first)
        return status;
    f[METRIC_MAYBE_UNIFORM] = share_of_maybe(a);
    if (!a->c->near)
        return EBPO_OK;
    status = time_queries(a, false, a->c->near, level, &ignored, error);
    f[METRIC_MAYBE_NEAR] = share_of_maybe(a);
    return status;
}

static ebpo_status measure_distance(level_queries *a, int level, ebpo_error *error)
{
    double *f = a->m->level[level], sum = 0;
    ebpo_status status =
        time_queries(a, true, a->c->uniform, level, &a->round->distance[level], error);
    if (status != EBPO_OK || !a->first)
        return status;
    for (uint64_t i = 0; i < a->c->points; i++) {
        a->width[i] = a->distance[i].hi - a->distance[i].lo;
        sum += a->width[i] / (double)a->c->points;
    }
    f[METRIC_WIDTH_MEAN] = sum;
    f[METRIC_WIDTH_MEDIAN] = quantile_of(a->width, a->c->points, 0.5);
    f[METRIC_WIDTH_P99] = quantile_of(a->width, a->c->points, 0.99);
    return EBPO_OK;
}

/* Measures exact queries, which need the mesh. */
static ebpo_status time_exact(level_queries *a, ebpo_error *error)
{
    ebpo_status status = a->m->info.solid ? time_queries(a, false, a->c->uniform, EBPO_LEVEL_ALL,
                                                         &a->round->exact_inside, error)
                                          : EBPO_OK;
    if (status == EBPO_OK)
        status =
            time_queries(a, true, a->c->uniform, EBPO_LEVEL_ALL, &a->round->exact_distance, error);
    if (status == EBPO_OK)
        return EBPO_OK;
    a->round->exact_inside = a->round->exact_distance = NAN;
    return method_note_missing(a->m, "exact results", status, error);
}

static ebpo_status query_all(level_queries *a, ebpo_error *error)
{
    const comparison *c = a->c;
    ebpo_status status = EBPO_OK;
    int last = method_last(c, a->m);
    for (int i = c->first; i <= last && status == EBPO_OK; i++) {
        if (c->progress.report)
            c->progress.report(c->progress.user, "queries", (uint64_t)(i - c->first),
                               (uint64_t)(last - c->first + 1));
        if (a->m->info.solid)
            status = measure_inside(a, i, error);
        if (status == EBPO_OK)
            status = measure_distance(a, i, error);
    }
    return status == EBPO_OK ? time_exact(a, error) : status;
}

ebpo_status report_limited(comparison *c, method *m, ebpo_model *model, int round,
                           ebpo_error *error)
{
    level_queries a = { .c = c, .m = m, .round = &m->round[round], .first = round == 0 };
    ebpo_status status = ebpo_context_new(model, &a.context, error);
    a.inside = malloc(c->points * sizeof *a.inside);
    a.distance = malloc(c->points * sizeof *a.distance);
    a.width = malloc(c->points * sizeof *a.width);
    if (status == EBPO_OK && (!a.inside || !a.distance || !a.width))
        status = no_memory(error);
    if (status == EBPO_OK)
        status = query_all(&a, error);
    free(a.inside);
    free(a.distance);
    free(a.width);
    ebpo_context_free(a.context);
    return status;
}
