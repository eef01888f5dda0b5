/* Measures queries that are limited to a level: the share of undecided points, the widths of
 * intervals, and the times. */
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

/* Returns twice the area of a face, with lengths divided by `unit`, so that no square overflows. */
static double doubled_area(const ebpo_mesh *mesh, uint64_t face, double unit)
{
    double p[3][3], u[3], v[3];
    for (int i = 0; i < 3; i++)
        vertex_of(mesh, face, i, p[i]);
    for (int k = 0; k < 3; k++) {
        u[k] = (p[1][k] - p[0][k]) / unit;
        v[k] = (p[2][k] - p[0][k]) / unit;
    }
    return sqrt(pow(u[1] * v[2] - u[2] * v[1], 2) + pow(u[2] * v[0] - u[0] * v[2], 2) +
                pow(u[0] * v[1] - u[1] * v[0], 2));
}

/* Returns the first index i with sums[i] > value. sums[i] is the sum of the areas of faces 0 to
 * i. */
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

/* Generates a random point in a ball. The centre of the ball is a random point of the mesh's faces,
 * uniform by area. */
static void make_near_point(const ebpo_mesh *mesh, const double *sums, double radius,
                            uint64_t *random, double out[3])
{
    uint64_t face =
        pick_by_sum(sums, mesh->face_count, bench_random_unit(random) * sums[mesh->face_count - 1]);
    double s = bench_random_unit(random), t = bench_random_unit(random), p[3][3], offset[3];
    if (s + t > 1) {
        s = 1 - s;
        t = 1 - t;
    }
    for (int i = 0; i < 3; i++)
        vertex_of(mesh, face, i, p[i]);
    do
        for (int k = 0; k < 3; k++)
            offset[k] = 2 * bench_random_unit(random) - 1;
    while (offset[0] * offset[0] + offset[1] * offset[1] + offset[2] * offset[2] > 1);
    for (int k = 0; k < 3; k++)
        out[k] = p[0][k] + s * (p[1][k] - p[0][k]) + t * (p[2][k] - p[0][k]) + radius * offset[k];
}

/* Makes the points near the surface, from the mesh of `m`. */
static ebpo_status make_near_points(comparison *c, const method *m, ebpo_error *error)
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
        sums[i] = sum += doubled_area(&mesh, i, c->diagonal);
    for (uint64_t i = 0; status == EBPO_OK && i < c->points; i++)
        make_near_point(&mesh, sums, c->diagonal / 100, &random, c->near + 3 * i);
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
            return make_near_points(c, &c->methods[i], error);
    return EBPO_OK;
}

/* --- queries --- */

/* State of the queries of one method (an .ebpo.h5 file that is compared with others). All queries
 * are run in several rounds, and each round measures their times. Arrays have an entry for each
 * point. */
typedef struct level_queries {
    comparison *c;
    method *m;
    ebpo_context *context;
    ebpo_inside_result *inside;     /* results of the last inside query */
    ebpo_distance_result *distance; /* results of the last distance query */
    double *width;                  /* widths of intervals */
    round_times *round;
    bool first; /* true: the first round; later rounds only measure times */
} level_queries;

/* Runs queries of all points: distance queries if `distance`, otherwise inside queries. Sets *ns to
 * the nanoseconds per point. */
static ebpo_status time_queries(level_queries *q, bool distance, const double *points, int level,
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
            ? ebpo_distance_many(q->context, points, q->c->points, &options, q->distance, error)
            : ebpo_inside_many(q->context, points, q->c->points, &inside, q->inside, error);
    *ns = (double)(tool_clock() - begin) / (double)q->c->points;
    return status;
}

static double share_of_maybe(const level_queries *q)
{
    uint64_t count = 0;
    for (uint64_t i = 0; i < q->c->points; i++)
        count += q->inside[i].where == EBPO_MAYBE;
    return (double)count / (double)q->c->points;
}

static ebpo_status measure_inside(level_queries *q, int level, ebpo_error *error)
{
    double *f = q->m->level[level], ignored;
    ebpo_status status =
        time_queries(q, false, q->c->uniform, level, &q->round->inside[level], error);
    if (status != EBPO_OK || !q->first)
        return status;
    f[METRIC_MAYBE_UNIFORM] = share_of_maybe(q);
    if (!q->c->near)
        return EBPO_OK;
    status = time_queries(q, false, q->c->near, level, &ignored, error);
    f[METRIC_MAYBE_NEAR] = share_of_maybe(q);
    return status;
}

static ebpo_status measure_distance(level_queries *q, int level, ebpo_error *error)
{
    double *f = q->m->level[level], sum = 0;
    ebpo_status status =
        time_queries(q, true, q->c->uniform, level, &q->round->distance[level], error);
    if (status != EBPO_OK || !q->first)
        return status;
    for (uint64_t i = 0; i < q->c->points; i++) {
        q->width[i] = q->distance[i].hi - q->distance[i].lo;
        sum += q->width[i] / (double)q->c->points;
    }
    f[METRIC_WIDTH_MEAN] = sum;
    f[METRIC_WIDTH_MEDIAN] = quantile_of(q->width, q->c->points, 0.5);
    f[METRIC_WIDTH_P99] = quantile_of(q->width, q->c->points, 0.99);
    return EBPO_OK;
}

/* Measures the times of exact queries, which need the mesh. */
static ebpo_status time_exact(level_queries *q, ebpo_error *error)
{
    ebpo_status status = q->m->info.solid ? time_queries(q, false, q->c->uniform, EBPO_LEVEL_ALL,
                                                         &q->round->exact_inside, error)
                                          : EBPO_OK;
    if (status == EBPO_OK)
        status =
            time_queries(q, true, q->c->uniform, EBPO_LEVEL_ALL, &q->round->exact_distance, error);
    if (status == EBPO_OK)
        return EBPO_OK;
    q->round->exact_inside = q->round->exact_distance = NAN;
    return method_note_missing(q->m, "exact results", status, error);
}

static ebpo_status query_all(level_queries *q, ebpo_error *error)
{
    const comparison *c = q->c;
    ebpo_status status = EBPO_OK;
    int last = method_last(c, q->m);
    for (int i = c->first; i <= last && status == EBPO_OK; i++) {
        if (c->progress.report)
            c->progress.report(c->progress.user, "queries", (uint64_t)(i - c->first),
                               (uint64_t)(last - c->first + 1));
        if (q->m->info.solid)
            status = measure_inside(q, i, error);
        if (status == EBPO_OK)
            status = measure_distance(q, i, error);
    }
    return status == EBPO_OK ? time_exact(q, error) : status;
}

ebpo_status report_limited(comparison *c, method *m, ebpo_model *model, int round,
                           ebpo_error *error)
{
    level_queries q = { .c = c, .m = m, .round = &m->round[round], .first = round == 0 };
    ebpo_status status = ebpo_context_new(model, &q.context, error);
    q.inside = malloc(c->points * sizeof *q.inside);
    q.distance = malloc(c->points * sizeof *q.distance);
    q.width = malloc(c->points * sizeof *q.width);
    if (status == EBPO_OK && (!q.inside || !q.distance || !q.width))
        status = no_memory(error);
    if (status == EBPO_OK)
        status = query_all(&q, error);
    free(q.inside);
    free(q.distance);
    free(q.width);
    ebpo_context_free(q.context);
    return status;
}
