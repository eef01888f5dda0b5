/* Classifies points by winding numbers, summed over the models whose boxes contain the points.
 *
 * If the models are independent, a point is inside if it is inside any model. If a face of a model
 * contains the point, this model adds 0 to the sum.
 *
 * If the models are parts of one model, they are closed by caps, which do not belong to the surface
 * of the whole model. If the point is on no face and no cap, the winding numbers of all parts add
 * up to the winding number of the whole model. A point on a face or cap of a part is *doubtful*.
 * The point is on the surface of the whole model if a face that is not a cap contains it; a box
 * query for the point decides this exactly. Otherwise the point is on a cap, and its winding number
 * is counted along a ray. The ray passes through the files `surface` of the parts, because these
 * files have no caps. The winding number is the number of faces where the ray leaves the solid,
 * minus the number of faces where the ray enters the solid. If a ray hits an edge or runs along a
 * face, its crossings are not counted, and a ray in another direction is cast. All queries use the
 * same sequence of directions. The winding number does not depend on the ray whose crossings are
 * counted.
 *
 * Source: docs/guide/clusters.md, "Beyond 2^32 faces". */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "catalogue/catalogue_in.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/hash.h"
#include "query/query_model.h"

/* Maximum number of rays that are cast from a point. */
enum { DIRECTIONS = 64 };

/* Result for a point from the models that were queried so far. */
typedef struct point_result {
    int64_t winding; /* sum of the winding numbers */
    bool in;         /* true: the point is inside a model */
    bool on;         /* true: the point is on a face of a model */
} point_result;

/* Adds the winding numbers that the points have in one model to the points' results. */
static ebpo_status query_windings(ebpo_context *context, const ebpo_catalogue_held *model,
                                  void *user, ebpo_error *error)
{
    const ebpo_catalogue_run *run = user;
    point_result *all = run->user;
    ebpo_inside_result *reported = ebpo_alloc(run->count, sizeof *reported);
    (void)model;
    if (!reported)
        return ebpo_fail_memory(error, run->count * sizeof *reported);
    ebpo_status status = ebpo_inside_many(context, run->rows, run->count, NULL, reported, error);
    for (uint64_t i = 0; i < run->count && status == EBPO_OK; i++) {
        point_result *f = &all[run->pair[i].item];
        f->winding += reported[i].winding;
        f->in |= reported[i].where == EBPO_IN;
        f->on |= reported[i].where == EBPO_ON;
    }
    free(reported);
    return status;
}

/* --- doubtful points of parts: on the surface --- */

/* Doubtful points whose results are not yet known. */
typedef struct doubtful {
    uint32_t count;
    uint32_t *number; /* [count] index of the point among all points of the range */
    double *rows;     /* [count][7] rays that begin at the points (ebpo_ray) */
    bool *on_surface; /* [count] true: the point is on the surface of the whole model */
    int64_t *sum;     /* [count] winding number that the last ray has given */
    bool *decided;    /* [count] true: the winding number of the last ray is valid */
} doubtful;

/* Sets on_surface for the points that are on a face of one model. */
static ebpo_status query_box(ebpo_context *context, const ebpo_catalogue_held *model, void *user,
                             ebpo_error *error)
{
    const ebpo_catalogue_run *run = user;
    const doubtful *d = run->user;
    ebpo_status status = EBPO_OK;
    (void)model;
    for (uint64_t i = 0; i < run->count && status == EBPO_OK; i++) {
        const uint64_t *faces;
        uint64_t count = 0;
        const double *p = run->rows + 7 * i;
        if (!d->on_surface[run->pair[i].item])
            status = ebpo_faces_in_box(context, p, p, &faces, &count, error);
        if (status == EBPO_OK && count)
            d->on_surface[run->pair[i].item] = true;
    }
    return status;
}

/* Writes the results of those points i for which known[i] is true to `all`, and removes these
 * points from `d`. If `on` is true, these points are on the surface. Otherwise d->sum[i] is the
 * winding number of point i. */
static void keep_unknown(doubtful *d, const bool *known, bool on, point_result *all)
{
    uint32_t kept = 0;
    for (uint32_t i = 0; i < d->count; i++) {
        if (known[i]) {
            all[d->number[i]].on = on;
            all[d->number[i]].winding = on ? 0 : d->sum[i];
            continue;
        }
        memmove(d->rows + (size_t)7 * kept, d->rows + (size_t)7 * i, 3 * sizeof *d->rows);
        d->number[kept++] = d->number[i];
    }
    d->count = kept;
}

/* --- doubtful points of parts: on caps --- */

/* Counts the crossings of the rays with the surface of one model. */
static ebpo_status query_crossings(ebpo_context *context, const ebpo_catalogue_held *model,
                                   void *user, ebpo_error *error)
{
    const ebpo_catalogue_run *run = user;
    const doubtful *d = run->user;
    const ebpo_ray_hit *hits;
    const uint64_t *begin;
    ebpo_ray_options how = EBPO_RAY_OPTIONS_INIT;
    (void)model;
    how.threads = 1;
    ebpo_status status = ebpo_ray_all_many(context, (const ebpo_ray *)(const void *)run->rows,
                                           run->count, &how, &hits, &begin, error);
    for (uint64_t i = 0; i < run->count && status == EBPO_OK; i++)
        for (uint64_t k = begin[i]; k < begin[i + 1]; k++) {
            d->sum[run->pair[i].item] -= hits[k].side;
            d->decided[run->pair[i].item] &= hits[k].side != 0;
        }
    return status;
}

/* Casts one ray from each of the remaining points. */
static ebpo_status cast_rays(const ebpo_catalogue_batch *a, doubtful *d, uint64_t *state,
                             ebpo_error *error)
{
    double direction[3];
    for (int k = 0; k < 3; k++)
        direction[k] = 2 * ebpo_random_unit(ebpo_random_next(state)) - 1;
    for (uint32_t i = 0; i < d->count; i++) {
        double *row = d->rows + (size_t)7 * i;
        memcpy(row + 3, direction, sizeof direction);
        row[6] = INFINITY;
        d->sum[i] = 0;
        d->decided[i] = true;
    }
    return ebpo_catalogue_query_all(a, d->rows, d->count, 7, ebpo_catalogue_find_ray, true,
                                    query_crossings, d, error);
}

/* Classifies the doubtful points. First finds the points on the whole model's surface; the
 * remaining points are on caps. */
static ebpo_status classify_doubtful(const ebpo_catalogue_batch *a, doubtful *d, point_result *all,
                                     ebpo_error *error)
{
    uint64_t state = 20;
    ebpo_status status = ebpo_catalogue_need_surface(a->c, error);
    if (status == EBPO_OK)
        status = ebpo_catalogue_query_all(a, d->rows, d->count, 7, ebpo_catalogue_find_point, true,
                                          query_box, d, error);
    if (status == EBPO_OK)
        keep_unknown(d, d->on_surface, true, all);
    for (int i = 0; i < DIRECTIONS && d->count && status == EBPO_OK; i++) {
        status = cast_rays(a, d, &state, error);
        if (status == EBPO_OK)
            keep_unknown(d, d->decided, false, all);
    }
    if (status == EBPO_OK && d->count)
        status = ebpo_fail_file(error, EBPO_E_LIMIT, ebpo_catalogue_shown(a->c),
                                "no ray from the point %g %g %g gives its winding number",
                                d->rows[0], d->rows[1], d->rows[2]);
    return status;
}

/* --- parts together --- */

/* Finds the doubtful points, classifies them, and replaces their results. */
static ebpo_status correct_doubtful(const ebpo_catalogue_batch *a, const double *points,
                                    uint32_t count, point_result *all, ebpo_error *error)
{
    uint32_t doubtful_count = 0;
    for (uint32_t i = 0; i < count; i++)
        doubtful_count += all[i].on;
    if (doubtful_count == 0)
        return EBPO_OK;
    doubtful d = { 0,
                   ebpo_alloc(doubtful_count, sizeof *d.number),
                   ebpo_alloc(doubtful_count, 7 * sizeof *d.rows),
                   ebpo_alloc_zero(doubtful_count, sizeof *d.on_surface),
                   ebpo_alloc_zero(doubtful_count, sizeof *d.sum),
                   ebpo_alloc(doubtful_count, sizeof *d.decided) };
    bool good = d.number && d.rows && d.on_surface && d.sum && d.decided;
    for (uint32_t i = 0; i < count && good; i++)
        if (all[i].on) {
            memcpy(d.rows + (size_t)7 * d.count, points + (size_t)3 * i, 3 * sizeof *points);
            memset(d.rows + (size_t)7 * d.count + 3, 0, 4 * sizeof *d.rows);
            d.number[d.count++] = i;
        }
    ebpo_status status = good ? classify_doubtful(a, &d, all, error)
                              : ebpo_fail_memory(error, doubtful_count * 8 * sizeof *d.rows);
    free(d.number);
    free(d.rows);
    free(d.on_surface);
    free(d.sum);
    free(d.decided);
    return status;
}

static bool is_inside(ebpo_rule rule, int64_t winding)
{
    return rule == EBPO_RULE_NONZERO   ? winding != 0
           : rule == EBPO_RULE_EVENODD ? winding % 2 != 0
                                       : winding > 0;
}

ebpo_status ebpo_catalogue_query_inside(const ebpo_catalogue_batch *a, const double *rows,
                                        uint32_t count, void *out, uint64_t *model,
                                        ebpo_error *error)
{
    ebpo_inside_result *reported = out;
    const ebpo_catalogue_options *how = &a->c->how;
    point_result *all = ebpo_alloc_zero(count, sizeof *all);
    (void)model;
    if (!all)
        return ebpo_fail_memory(error, count * sizeof *all);
    ebpo_status status = ebpo_catalogue_query_all(a, rows, count, 3, ebpo_catalogue_find_point,
                                                  false, query_windings, all, error);
    if (status == EBPO_OK && how->parts)
        status = correct_doubtful(a, rows, count, all, error);
    for (uint32_t i = 0; i < count && status == EBPO_OK; i++) {
        const point_result *f = &all[i];
        bool in = how->parts ? !f->on && is_inside(how->rule, f->winding) : f->in;
        reported[i] = (ebpo_inside_result){ .where = in      ? EBPO_IN
                                                     : f->on ? EBPO_ON
                                                             : EBPO_OUT,
                                            .winding = (int32_t)f->winding };
    }
    free(all);
    return status;
}

ebpo_status ebpo_catalogue_inside(const ebpo_catalogue *c, ebpo_catalogue_models *models,
                                  const double *points, uint64_t count,
                                  const ebpo_catalogue_query_options *options,
                                  ebpo_inside_result *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_catalogue_query_options own;
    ebpo_catalogue_job j = { { c, models, &own },   .run_query = ebpo_catalogue_query_inside,
                             .stage = "inside",     .width = 3,
                             .result = sizeof *out, .ordered = true,
                             .rows = points,        .out = (char *)out };
    ebpo_status status = ebpo_catalogue_take_options(&own, options, error);
    if (status == EBPO_OK && c->surface)
        status = ebpo_fail_file(error, EBPO_E_NOT_SOLID, c->surface->path,
                                "is a surface: catalogues combine the winding numbers of solids "
                                "only; query its file, or repair its source");
    if (status == EBPO_OK)
        status = ebpo_check_points(points, count, error);
    return status == EBPO_OK ? ebpo_catalogue_query_rows(&j, count, error) : status;
}
