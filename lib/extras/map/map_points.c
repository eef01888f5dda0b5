/* Distances of points that somebody else has placed. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/map/map_ask.h"
#include "query/load_ahead.h"
#include "query/query_model.h"

typedef struct points_job {
    ebpo_map_askers askers;
    const double *points;
    const uint64_t *order; /* along the curve; NULL: as they come */
    double *distances;
} points_job;

static uint64_t place_of(const points_job *j, uint64_t i) { return j->order ? j->order[i] : i; }

static ebpo_status ask_piece(void *context, uint64_t begin, uint64_t end, unsigned worker,
                             ebpo_error *error)
{
    points_job *j = context;
    uint64_t count = end - begin;
    double(*points)[3] = ebpo_alloc(count, sizeof *points);
    ebpo_distance_result *results = ebpo_alloc(count, sizeof *results);
    ebpo_status status =
        points && results ? EBPO_OK : ebpo_fail_memory(error, count * sizeof *results);
    for (uint64_t i = 0; status == EBPO_OK && i < count; i++)
        memcpy(points[i], j->points + 3 * place_of(j, begin + i), sizeof points[i]);
    if (status == EBPO_OK)
        status = ebpo_map_ask(&j->askers, worker, points[0], count, results, error);
    for (uint64_t i = 0; status == EBPO_OK && i < count; i++)
        j->distances[place_of(j, begin + i)] = results[i].distance;
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
    ebpo_status status = ebpo_map_take_options(&o, options, error);
    if (status == EBPO_OK)
        status = ebpo_check_points(points, count, error);
    if (status != EBPO_OK)
        return status;
    ebpo_box box = ebpo_model_box(model);
    uint64_t *order = model->whole ? NULL : ebpo_curve_order(&box, points, count);
    job.order = order; /* without memory for it, as they come: slower, and the same */
    status = ebpo_map_askers_make(&job.askers, model, &o, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(job.askers.threads, NULL, count, EBPO_MAP_PIECE, ask_piece, &job,
                                   &o.progress, "asking for distances", error);
    ebpo_map_askers_free(&job.askers);
    free(order);
    return status;
}
