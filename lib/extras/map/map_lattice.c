/* Computes distances of given points and of the points of a lattice (a regular grid).
 *
 * A lattice is evaluated in slabs. A slab is a group of consecutive layers, and is divided into
 * bricks. The points of a brick are close to each other, so that each subtree is loaded few times
 * and the processor's caches keep the data. Each thread has a separate query context, which is made
 * at its first query. Results do not depend on the number of threads.
 *
 * See docs/guide/maps.md. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/map/map_lattice.h"
#include "query/load_ahead.h"
#include "query/query_model.h"

/* Sets *out to the caller's options, or to the defaults if `given` is NULL, and checks them. */
static ebpo_status check_map_options(ebpo_map_options *out, const ebpo_map_options *given,
                                     ebpo_error *error)
{
    *out = (ebpo_map_options)EBPO_MAP_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_map_options, out, given, error);
    if (status == EBPO_OK && !(out->max_distance >= 0))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "max_distance must be 0 or more; INFINITY means no limit");
    return status;
}

ebpo_status ebpo_map_queries_make(ebpo_map_queries *out, ebpo_model *model,
                                  const ebpo_map_options *options, ebpo_error *error)
{
    ebpo_distance_options distance = EBPO_DISTANCE_OPTIONS_INIT;
    distance.max_distance = options->max_distance;
    distance.unsigned_distance = options->unsigned_distance;
    *out = (ebpo_map_queries){ .model = model, .distance = distance };
    out->threads = ebpo_thread_count(options->threads);
    /* this call with 0 points fails now, before the threads start, if distances of the model cannot
     * be queried */
    ebpo_status status = ebpo_context_new(model, &out->context[0], error);
    return status == EBPO_OK ? ebpo_distance_many(out->context[0], NULL, 0, &distance, NULL, error)
                             : status;
}

void ebpo_map_queries_free(ebpo_map_queries *queries)
{
    for (int i = 0; i < EBPO_MAP_THREADS; i++)
        ebpo_context_free(queries->context[i]);
}

ebpo_status ebpo_map_query(ebpo_map_queries *queries, unsigned worker, const double *points,
                           uint64_t count, ebpo_distance_result *results, ebpo_error *error)
{
    ebpo_context **context = &queries->context[worker];
    ebpo_status status = *context ? EBPO_OK : ebpo_context_new(queries->model, context, error);
    return status == EBPO_OK
               ? ebpo_distance_many(*context, points, count, &queries->distance, results, error)
               : status;
}

/* --- given points --- */

typedef struct points_job {
    ebpo_map_queries queries;
    const double *points;  /* [3 * number of points] */
    const uint64_t *order; /* indices of points in their order along the Morton curve, in which
                              consecutive points are close to each other; NULL: input order */
    double *distances;     /* [number of points] the result, in input order */
} points_job;

/* Returns the index, in the input, of the point that is evaluated at position i of the order. */
static uint64_t index_of(const points_job *j, uint64_t i) { return j->order ? j->order[i] : i; }

/* Computes the distances of the points at positions begin .. end - 1 of the order. */
static ebpo_status query_piece(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    points_job *j = context;
    uint64_t count = end - begin;
    double(*points)[3] = ebpo_alloc(count, sizeof *points);
    ebpo_distance_result *results = ebpo_alloc(count, sizeof *results);
    ebpo_status status =
        points && results ? EBPO_OK : ebpo_fail_memory(error, count * sizeof *results);
    for (uint64_t i = 0; status == EBPO_OK && i < count; i++)
        memcpy(points[i], j->points + 3 * index_of(j, begin + i), sizeof points[i]);
    if (status == EBPO_OK)
        status = ebpo_map_query(&j->queries, worker, points[0], count, results, error);
    for (uint64_t i = 0; status == EBPO_OK && i < count; i++)
        j->distances[index_of(j, begin + i)] = results[i].distance;
    free(points);
    free(results);
    return status;
}

ebpo_status ebpo_map_points(ebpo_model *model, const double *points, uint64_t count,
                            const ebpo_map_options *options, double *distances, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_map_options o;
    points_job job = { .points = points, .distances = distances };
    ebpo_status status = check_map_options(&o, options, error);
    if (status == EBPO_OK)
        status = ebpo_check_points(points, count, error);
    if (status != EBPO_OK)
        return status;
    ebpo_box box = ebpo_model_box(model);
    /* A model that is wholly in memory loads no subtrees, so that the order does not matter. The
     * order is also NULL if memory is short: the input order is slower, but gives the same results.
     */
    uint64_t *order = model->whole ? NULL : ebpo_curve_order(&box, points, count);
    job.order = order;
    status = ebpo_map_queries_make(&job.queries, model, &o, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(job.queries.threads, NULL, count, EBPO_MAP_PIECE, query_piece,
                                   &job, &o.progress, "computing distances", error);
    ebpo_map_queries_free(&job.queries);
    free(order);
    return status;
}

/* --- lattices --- */

enum {
    BRICK = 16,           /* number of points along a side of a brick; 16^3 = EBPO_MAP_PIECE */
    SLAB_VALUES = 8 << 20 /* greatest number of values of a slab that has more than one layer */
};
#define POINTS_MAX (UINT64_C(1) << 40) /* greatest number of points of a lattice */

typedef struct slab_job {
    ebpo_map_queries queries;
    const ebpo_lattice *lattice;
    uint64_t first, layers; /* first layer and number of layers of the slab */
    uint64_t bricks[3];     /* number of bricks of the slab along each axis */
    double *values;         /* [layers][count[1]][count[0]] distances of the slab's points */
} slab_job;

/* Computes the position of a point of the lattice from its indices along the axes. */
static void point_of(const ebpo_lattice *l, uint64_t i, uint64_t j, uint64_t k, double out[3])
{
    for (int c = 0; c < 3; c++)
        out[c] = l->origin[c] + (double)i * l->step[0][c] + (double)j * l->step[1][c] +
                 (double)k * l->step[2][c];
}

typedef struct brick {
    uint64_t low[3], high[3]; /* on each axis, indices low .. high - 1 of points in the slab */
} brick;

/* Returns the brick of the slab with this number; numbers increase first along axis 0. */
static brick brick_of(const slab_job *j, uint64_t number)
{
    const uint64_t size[3] = { j->lattice->count[0], j->lattice->count[1], j->layers };
    brick b;
    for (int c = 0; c < 3; c++) {
        b.low[c] = number % j->bricks[c] * BRICK;
        b.high[c] = b.low[c] + BRICK < size[c] ? b.low[c] + BRICK : size[c];
        number /= j->bricks[c];
    }
    return b;
}

/* Computes the points of a brick, and returns their number. */
static uint64_t fill_points(const slab_job *j, const brick *b, double (*points)[3])
{
    uint64_t count = 0;
    for (uint64_t z = b->low[2]; z < b->high[2]; z++)
        for (uint64_t y = b->low[1]; y < b->high[1]; y++)
            for (uint64_t x = b->low[0]; x < b->high[0]; x++)
                point_of(j->lattice, x, y, j->first + z, points[count++]);
    return count;
}

/* Copies the distances of a brick's points, in the order of fill_points, to j->values. */
static void keep_distances(const slab_job *j, const brick *b, const ebpo_distance_result *results)
{
    const uint64_t *size = j->lattice->count;
    for (uint64_t z = b->low[2]; z < b->high[2]; z++)
        for (uint64_t y = b->low[1]; y < b->high[1]; y++)
            for (uint64_t x = b->low[0]; x < b->high[0]; x++)
                j->values[(z * size[1] + y) * size[0] + x] = (results++)->distance;
}

/* Computes the distances of the points of bricks begin .. end - 1. */
static ebpo_status query_bricks(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                ebpo_error *error)
{
    slab_job *j = context;
    double(*points)[3] = ebpo_alloc(EBPO_MAP_PIECE, sizeof *points);
    ebpo_distance_result *results = ebpo_alloc(EBPO_MAP_PIECE, sizeof *results);
    ebpo_status status =
        points && results ? EBPO_OK : ebpo_fail_memory(error, EBPO_MAP_PIECE * sizeof *results);
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++) {
        brick b = brick_of(j, i);
        status = ebpo_map_query(&j->queries, worker, points[0], fill_points(j, &b, points), results,
                                error);
        if (status == EBPO_OK)
            keep_distances(j, &b, results);
    }
    free(points);
    free(results);
    return status;
}

/* Checks the number of points, and checks that the eight corners of the lattice are finite. If they
 * are finite, all points are finite, because each coordinate is monotonic in each of the three
 * indices. */
static ebpo_status check_lattice(const ebpo_lattice *l, ebpo_error *error)
{
    uint64_t points = 0;
    if (l->count[0] == 0 || l->count[1] == 0 || l->count[2] == 0)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "a lattice needs at least one point on each axis");
    if (!ebpo_mul_ok(l->count[0], l->count[1], &points) ||
        !ebpo_mul_ok(points, l->count[2], &points) || points > POINTS_MAX)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the lattice has more than 2^40 points; use fewer points");
    for (int corner = 0; corner < 8; corner++) {
        double p[3];
        point_of(l, corner & 1 ? l->count[0] - 1 : 0, corner & 2 ? l->count[1] - 1 : 0,
                 corner & 4 ? l->count[2] - 1 : 0, p);
        if (!isfinite(p[0]) || !isfinite(p[1]) || !isfinite(p[2]))
            return ebpo_fail(error, EBPO_E_ARGUMENT, "the lattice has points that are not finite");
    }
    return EBPO_OK;
}

/* Returns the number of layers of a slab: a multiple of BRICK if possible, at least 1. */
static uint64_t layers_of_slab(const ebpo_lattice *l)
{
    uint64_t layers = SLAB_VALUES / (l->count[0] * l->count[1]);
    layers = layers < BRICK ? layers : layers / BRICK * BRICK;
    layers = layers ? layers : 1;
    return layers < l->count[2] ? layers : l->count[2];
}

/* Computes the distances of all points of the slab. Progress is reported as a number of points. */
static ebpo_status map_slab(slab_job *j, const ebpo_map_options *o, ebpo_error *error)
{
    const uint64_t size[3] = { j->lattice->count[0], j->lattice->count[1], j->layers };
    uint64_t layer_points = size[0] * size[1], bricks = 1;
    ebpo_pass pass = { &o->progress, j->first * layer_points, (j->first + j->layers) * layer_points,
                       j->lattice->count[2] * layer_points };
    ebpo_progress progress = ebpo_pass_progress(&pass);
    for (int c = 0; c < 3; c++) {
        j->bricks[c] = (size[c] + BRICK - 1) / BRICK;
        bricks *= j->bricks[c];
    }
    return ebpo_parallel_for(j->queries.threads, NULL, bricks, 1, query_bricks, j, &progress,
                             "computing distances", error);
}

ebpo_status ebpo_map_lattice(ebpo_model *model, const ebpo_lattice *lattice,
                             const ebpo_map_options *options, ebpo_map_fn take, void *user,
                             ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_map_options o;
    slab_job job = { .lattice = lattice };
    ebpo_status status = check_map_options(&o, options, error);
    if (status == EBPO_OK)
        status = check_lattice(lattice, error);
    if (status != EBPO_OK)
        return status;
    uint64_t most = layers_of_slab(lattice),
             slab_values = most * lattice->count[0] * lattice->count[1];
    job.values = ebpo_alloc(slab_values, sizeof *job.values);
    status = job.values ? ebpo_map_queries_make(&job.queries, model, &o, error)
                        : ebpo_fail_memory(error, slab_values * sizeof *job.values);
    while (status == EBPO_OK && job.first < lattice->count[2]) {
        uint64_t remaining = lattice->count[2] - job.first;
        job.layers = remaining < most ? remaining : most;
        status = map_slab(&job, &o, error);
        if (status == EBPO_OK)
            status = take(user, job.values, job.first, job.layers, error);
        job.first += job.layers;
    }
    ebpo_map_queries_free(&job.queries);
    free(job.values);
    return status;
}

ebpo_status ebpo_lattice_of_box(const double low[3], const double high[3], const uint64_t count[3],
                                ebpo_lattice *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    *out = (ebpo_lattice){ .count = { count[0], count[1], count[2] } };
    for (int c = 0; c < 3; c++) {
        bool one = count[c] == 1; /* then the point is in the middle of the box */
        if (!isfinite(low[c]) || !isfinite(high[c]) || !(low[c] < high[c]) ||
            !isfinite(high[c] - low[c]))
            return ebpo_fail(error, EBPO_E_ARGUMENT,
                             "a box needs a finite low corner below a finite high corner");
        out->origin[c] = one ? low[c] + (high[c] - low[c]) / 2 : low[c];
        out->step[c][c] =
            one ? high[c] - low[c] : (high[c] - low[c]) / (double)(count[c] ? count[c] - 1 : 1);
    }
    return check_lattice(out, error);
}
