/* Finds the nearest face of all models to a point, and the first face that a ray hits.
 *
 * For a point, the models are queried in the order of the distances of their boxes from the point.
 * The search ends when no remaining box can contain a face that is nearer than the nearest face so
 * far. Many points are processed together: in each step, the points are grouped by their next
 * model, and each of these models is queried once, with all points of its group. If several models
 * have the same rounded distance, the first of these models in the catalogue gives the result,
 * independent of the order of queries. To ensure this, a box is skipped only if its distance
 * exceeds the nearest distance by more than the rounding error (catalogue_boxes.c).
 *
 * For a ray, the models whose boxes the ray may intersect are queried in the order of the
 * catalogue, each only up to the nearest hit so far. A hit is at the point origin + t direction. If
 * t overflows for several hits, t is computed again with the direction multiplied by a power of
 * two, which is exact. The hit with the smallest new t is the first hit. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "catalogue/catalogue_in.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "query/query_model.h"

/* --- distances --- */

/* Points of a range, and their results from the models that were queried so far. */
typedef struct search {
    const ebpo_catalogue_batch *a;
    const double *points;
    uint32_t count;
    double max_distance;
    ebpo_distance_result *out;
    uint64_t *model;
    ebpo_catalogue_pairs near;    /* for each point, its boxes, the nearest box first */
    ebpo_catalogue_pairs queries; /* the boxes to query in this step, at most one for each point */
} search;

static int nearest_first(const void *a, const void *b)
{
    const ebpo_catalogue_pair *x = a, *y = b;
    return x->min_distance != y->min_distance ? (x->min_distance < y->min_distance ? -1 : 1)
                                              : (x->box > y->box) - (x->box < y->box);
}

/* Compares the results of one model with the results so far, and keeps the nearer face of each
 * point. If distances are equal, keeps the face of the model that is first in the catalogue. */
static ebpo_status merge_nearest(const search *s, const ebpo_catalogue_run *run,
                                 const ebpo_catalogue_held *model, ebpo_distance_result *reported,
                                 ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < run->count && status == EBPO_OK; i++) {
        uint32_t item = run->pair[i].item;
        double current = s->out[item].distance, candidate = reported[i].distance;
        if (reported[i].face == EBPO_NO_FACE ||
            !(candidate < current || (candidate == current && run->model < s->model[item])))
            continue;
        status = ebpo_catalogue_held_face(model, &reported[i].face, error);
        s->out[item] = reported[i];
        s->model[item] = run->model;
    }
    return status;
}

static ebpo_status query_distances(ebpo_context *context, const ebpo_catalogue_held *model,
                                   void *user, ebpo_error *error)
{
    const ebpo_catalogue_run *run = user;
    const search *s = run->user;
    ebpo_distance_options o = EBPO_DISTANCE_OPTIONS_INIT;
    ebpo_distance_result *reported = ebpo_alloc(run->count, sizeof *reported);
    double farthest = 0;
    if (!reported)
        return ebpo_fail_memory(error, run->count * sizeof *reported);
    for (uint64_t i = 0; i < run->count; i++)
        farthest = fmax(farthest, s->out[run->pair[i].item].distance);
    o.max_distance = fmin(farthest * (1 + EBPO_CATALOGUE_SLACK), s->max_distance);
    o.unsigned_distance = true;
    ebpo_status status = ebpo_distance_many(context, run->rows, run->count, &o, reported, error);
    if (status == EBPO_OK)
        status = merge_nearest(s, run, model, reported, error);
    free(reported);
    return status;
}

/* Queries the models of the next box of each point, again and again, until no remaining box may
 * contain a nearer face. `begin`: [points + 1] index in s->near of each point's first box; the last
 * element is the number of all boxes. `next_box`: [points] space for the index of each point's next
 * box. */
static ebpo_status query_in_steps(search *s, const uint64_t *begin, uint64_t *next_box,
                                  uint32_t points, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    memcpy(next_box, begin, points * sizeof *next_box);
    do {
        s->queries.count = 0;
        for (uint32_t i = 0; i < points; i++) {
            const ebpo_catalogue_pair *next = s->near.pair + next_box[i];
            if (next_box[i] == begin[i + 1])
                continue;
            if (next->min_distance * (1 - EBPO_CATALOGUE_SLACK) <=
                fmin(s->out[next->item].distance, s->max_distance)) {
                s->queries.pair[s->queries.count++] = *next;
                next_box[i]++;
            } else {
                next_box[i] = begin[i + 1]; /* later boxes are farther away */
            }
        }
        status = ebpo_catalogue_query_runs(s->a, &s->queries, s->points, 3, true, query_distances,
                                           s, error);
    } while (s->queries.count && status == EBPO_OK);
    return status;
}

/* Processes as many points from *at on as have about EBPO_CATALOGUE_PAIRS boxes together. Sets *at
 * to the first point that is not processed. `begin`, `next_box`: space for query_in_steps. */
static ebpo_status query_some(search *s, uint32_t *at, uint64_t *begin, uint64_t *next_box,
                              ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    uint32_t first = *at, points = 0;
    s->near.count = 0;
    for (; first + points < s->count && s->near.count < EBPO_CATALOGUE_PAIRS && status == EBPO_OK;
         points++) {
        uint32_t item = first + points;
        begin[points] = s->near.count;
        if (!ebpo_catalogue_boxes_near(&s->a->c->seen, s->points + (size_t)3 * item,
                                       s->max_distance, item, &s->near))
            status = ebpo_fail_memory(error, s->near.count * sizeof *s->near.pair);
        if (s->near.count > begin[points])
            qsort(s->near.pair + begin[points], s->near.count - begin[points], sizeof *s->near.pair,
                  nearest_first);
    }
    begin[points] = s->near.count;
    *at = first + points;
    return status == EBPO_OK ? query_in_steps(s, begin, next_box, points, error) : status;
}

static ebpo_status query_nearest(search *s, ebpo_error *error)
{
    uint64_t *begin = ebpo_alloc((uint64_t)s->count + 1, sizeof *begin);
    uint64_t *next_box = ebpo_alloc(s->count, sizeof *next_box);
    s->queries.pair = ebpo_alloc(s->count, sizeof *s->queries.pair);
    ebpo_status status =
        begin && next_box && s->queries.pair
            ? EBPO_OK
            : ebpo_fail_memory(error, (uint64_t)s->count * sizeof *s->queries.pair);
    for (uint32_t at = 0; at < s->count && status == EBPO_OK;)
        status = query_some(s, &at, begin, next_box, error);
    free(begin);
    free(next_box);
    free(s->queries.pair);
    free(s->near.pair);
    return status;
}

static ebpo_status sign_distances(const ebpo_catalogue_batch *a, const double *points,
                                  uint32_t count, ebpo_distance_result *out, ebpo_error *error)
{
    ebpo_inside_result *where = ebpo_alloc(count, sizeof *where);
    ebpo_status status = where ? ebpo_catalogue_query_inside(a, points, count, where, NULL, error)
                               : ebpo_fail_memory(error, count * sizeof *where);
    for (uint32_t i = 0; i < count && status == EBPO_OK; i++)
        if (where[i].where == EBPO_IN && isfinite(out[i].distance))
            out[i].distance = -out[i].distance;
    free(where);
    return status;
}

static ebpo_status query_distance(const ebpo_catalogue_batch *a, const double *rows, uint32_t count,
                                  void *out, uint64_t *model, ebpo_error *error)
{
    ebpo_distance_result *reported = out;
    search s = { .a = a,
                 .points = rows,
                 .count = count,
                 .max_distance = a->options->max_distance,
                 .out = reported,
                 .model = model };
    for (uint32_t i = 0; i < count; i++) {
        reported[i] = (ebpo_distance_result){ .distance = INFINITY,
                                              .point = { NAN, NAN, NAN },
                                              .face = EBPO_NO_FACE };
        model[i] = EBPO_CATALOGUE_NO_MODEL;
    }
    ebpo_status status = query_nearest(&s, error);
    return status == EBPO_OK && !a->c->surface && !a->options->unsigned_distance
               ? sign_distances(a, rows, count, reported, error)
               : status;
}

ebpo_status ebpo_catalogue_distance(const ebpo_catalogue *c, ebpo_catalogue_models *models,
                                    const double *points, uint64_t count,
                                    const ebpo_catalogue_query_options *options,
                                    ebpo_distance_result *out, uint64_t *model, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_catalogue_query_options own;
    ebpo_catalogue_job j = { { c, models, &own }, .run_query = query_distance, .stage = "distance",
                             .width = 3,          .result = sizeof *out,       .ordered = true,
                             .rows = points,      .out = (char *)out,          .model = model };
    ebpo_status status = ebpo_catalogue_take_options(&own, options, error);
    if (status == EBPO_OK)
        status = ebpo_catalogue_need_surface(c, error);
    if (status == EBPO_OK)
        status = ebpo_check_points(points, count, error);
    return status == EBPO_OK ? ebpo_catalogue_query_rows(&j, count, error) : status;
}

/* --- rays --- */

_Static_assert(sizeof(ebpo_ray) == 7 * sizeof(double), "a ray is a row of seven numbers");

typedef struct ray_search {
    ebpo_ray_sides sides;
    ebpo_ray_hit *out;
    uint64_t *model;
    double *longer_t; /* [item] for a hit whose t is INFINITY: t along the longer_ray */
} ray_search;

/* Returns the ray with its direction multiplied by a power of two, which is exact, so that the t of
 * every hit is finite. */
static ebpo_ray longer_ray(const ebpo_ray *ray)
{
    /* If the largest component of the direction is at least 2^2, every t is finite, because the
     * difference of two coordinates is at most 2^1025. */
    enum { ENOUGH = 3 };
    ebpo_ray out = *ray;
    int exponent;
    frexp(fmax(fmax(fabs(ray->direction[0]), fabs(ray->direction[1])), fabs(ray->direction[2])),
          &exponent);
    for (int k = 0; k < 3 && exponent < ENOUGH; k++)
        out.direction[k] = ldexp(ray->direction[k], ENOUGH - exponent);
    out.t_max = INFINITY;
    return out;
}

/* Sets *nearer to true if `hit` comes before the first hit of this ray so far, s->out[item]. If t
 * is INFINITY for both hits, compares their t along the longer_ray. */
static ebpo_status is_nearer(const ray_search *s, ebpo_context *context, const ebpo_ray *ray,
                             const ebpo_ray_hit *hit, uint32_t item, bool *nearer,
                             ebpo_error *error)
{
    ebpo_ray_options how = EBPO_RAY_OPTIONS_INIT;
    const ebpo_ray_hit *kept = &s->out[item];
    *nearer = hit->t < kept->t;
    if (hit->face == EBPO_NO_FACE || hit->t < INFINITY)
        return EBPO_OK;
    ebpo_ray along = longer_ray(ray);
    ebpo_ray_hit longer_hit;
    how.sides = s->sides;
    how.threads = 1;
    ebpo_status status = ebpo_ray_first_many(context, &along, 1, &how, &longer_hit, error);
    *nearer =
        kept->face == EBPO_NO_FACE || (kept->t == INFINITY && longer_hit.t < s->longer_t[item]);
    if (status == EBPO_OK && *nearer)
        s->longer_t[item] = longer_hit.t;
    return status;
}

static ebpo_status merge_hits(const ray_search *s, const ebpo_catalogue_run *run,
                              const ebpo_ray *rays, ebpo_context *context,
                              const ebpo_catalogue_held *model, ebpo_ray_hit *reported,
                              ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < run->count && status == EBPO_OK; i++) {
        uint32_t item = run->pair[i].item;
        bool nearer;
        status = is_nearer(s, context, &rays[i], &reported[i], item, &nearer, error);
        if (status != EBPO_OK || !nearer)
            continue;
        status = ebpo_catalogue_held_face(model, &reported[i].face, error);
        s->out[item] = reported[i];
        s->model[item] = run->model;
    }
    return status;
}

/* Queries one model for hits that are not farther away than the hits so far. Models are queried in
 * the order of the catalogue. So if two hits have an equal t, the hit of the model that is first in
 * the catalogue is kept. */
static ebpo_status query_hits(ebpo_context *context, const ebpo_catalogue_held *model, void *user,
                              ebpo_error *error)
{
    const ebpo_catalogue_run *run = user;
    const ray_search *s = run->user;
    ebpo_ray_options how = EBPO_RAY_OPTIONS_INIT;
    ebpo_ray_hit *reported = ebpo_alloc(run->count, sizeof *reported);
    ebpo_ray *rays = ebpo_alloc(run->count, sizeof *rays);
    ebpo_status status =
        reported && rays ? EBPO_OK : ebpo_fail_memory(error, run->count * sizeof *rays);
    for (uint64_t i = 0; i < run->count && status == EBPO_OK; i++) {
        memcpy(&rays[i], run->rows + 7 * i, sizeof *rays);
        rays[i].t_max = fmin(rays[i].t_max, s->out[run->pair[i].item].t);
    }
    how.sides = s->sides;
    how.threads = 1;
    if (status == EBPO_OK)
        status = ebpo_ray_first_many(context, rays, run->count, &how, reported, error);
    if (status == EBPO_OK)
        status = merge_hits(s, run, rays, context, model, reported, error);
    free(reported);
    free(rays);
    return status;
}

static ebpo_status query_rays(const ebpo_catalogue_batch *a, const double *rows, uint32_t count,
                              void *out, uint64_t *model, ebpo_error *error)
{
    ray_search s = { a->options->sides, out, model, ebpo_alloc(count, sizeof *s.longer_t) };
    if (!s.longer_t)
        return ebpo_fail_memory(error, count * sizeof *s.longer_t);
    for (uint32_t i = 0; i < count; i++) {
        s.out[i] = (ebpo_ray_hit){ INFINITY, EBPO_NO_FACE, 0 };
        s.longer_t[i] = INFINITY;
        model[i] = EBPO_CATALOGUE_NO_MODEL;
    }
    ebpo_status status = ebpo_catalogue_query_all(a, rows, count, 7, ebpo_catalogue_find_ray, true,
                                                  query_hits, &s, error);
    free(s.longer_t);
    return status;
}

ebpo_status ebpo_catalogue_ray(const ebpo_catalogue *c, ebpo_catalogue_models *models,
                               const ebpo_ray *rays, uint64_t count,
                               const ebpo_catalogue_query_options *options, ebpo_ray_hit *out,
                               uint64_t *model, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_catalogue_query_options own;
    ebpo_catalogue_job j = { { c, models, &own },   .run_query = query_rays,
                             .stage = "rays",       .width = 7,
                             .result = sizeof *out, .rows = (const double *)(const void *)rays,
                             .out = (char *)out,    .model = model };
    ebpo_status status = ebpo_catalogue_take_options(&own, options, error);
    if (status == EBPO_OK)
        status = ebpo_catalogue_need_surface(c, error);
    if (status == EBPO_OK)
        status = ebpo_check_ray_rows(rays, 0, count, error);
    return status == EBPO_OK ? ebpo_catalogue_query_rows(&j, count, error) : status;
}
