/* What is nearest of all models: the face next to a point, and the first face that a ray meets.
 *
 * A point asks the models in the order in which their boxes are near, one after the other, as long
 * as the next box may hold something nearer than what was found; many points take their turns
 * together, so that each model is asked about all of them at once. Of models at the same rounded
 * distance the first one in the catalogue is taken, whichever was asked first; so a box counts as
 * near while it is not farther beyond what rounding may have done (catalogue_boxes.c).
 *
 * A ray asks the models whose boxes it may meet in the order of the catalogue, each only up to what
 * was met before. Where t is beyond doubles for several, a ray whose direction is longer by a power
 * of two, exactly, says which is first. */
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

/* Points of a stretch, and what was found so far of all. */
typedef struct search {
    const ebpo_catalogue_asker *a;
    const double *points;
    uint32_t count;
    double max_distance;
    ebpo_distance_result *out;
    uint64_t *model;
    ebpo_catalogue_pairs near; /* of each point, the nearest box first */
    ebpo_catalogue_pairs asks;
} search;

static int nearest_first(const void *a, const void *b)
{
    const ebpo_catalogue_pair *x = a, *y = b;
    return x->least != y->least ? (x->least < y->least ? -1 : 1)
                                : (x->box > y->box) - (x->box < y->box);
}

static ebpo_status take_nearest(const search *s, const ebpo_catalogue_run *run,
                                const ebpo_catalogue_held *model, ebpo_distance_result *told,
                                ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < run->count && status == EBPO_OK; i++) {
        uint32_t item = run->pair[i].item;
        double now = s->out[item].distance, new = told[i].distance;
        if (told[i].face == EBPO_NO_FACE ||
            !(new < now || (new == now && run->model < s->model[item])))
            continue;
        status = ebpo_catalogue_held_face(model, &told[i].face, error);
        s->out[item] = told[i];
        s->model[item] = run->model;
    }
    return status;
}

static ebpo_status ask_distances(ebpo_context *context, const ebpo_catalogue_held *model,
                                 void *user, ebpo_error *error)
{
    const ebpo_catalogue_run *run = user;
    const search *s = run->user;
    ebpo_distance_options o = EBPO_DISTANCE_OPTIONS_INIT;
    ebpo_distance_result *told = ebpo_alloc(run->count, sizeof *told);
    double farthest = 0;
    if (!told)
        return ebpo_fail_memory(error, run->count * sizeof *told);
    for (uint64_t i = 0; i < run->count; i++)
        farthest = fmax(farthest, s->out[run->pair[i].item].distance);
    o.max_distance = fmin(farthest * (1 + EBPO_CATALOGUE_SLACK), s->max_distance);
    o.unsigned_distance = true;
    ebpo_status status = ebpo_distance_many(context, run->rows, run->count, &o, told, error);
    if (status == EBPO_OK)
        status = take_nearest(s, run, model, told, error);
    free(told);
    return status;
}

/* Each of some points asks its next box, as long as that may hold something nearer. `begin` has
 * where each point's boxes begin, and where the next point's do; `turn` is room for as many. */
static ebpo_status ask_in_turn(search *s, const uint64_t *begin, uint64_t *turn, uint32_t points,
                               ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    memcpy(turn, begin, points * sizeof *turn);
    do {
        s->asks.count = 0;
        for (uint32_t i = 0; i < points; i++) {
            const ebpo_catalogue_pair *next = s->near.pair + turn[i];
            if (turn[i] == begin[i + 1])
                continue;
            if (next->least * (1 - EBPO_CATALOGUE_SLACK) <=
                fmin(s->out[next->item].distance, s->max_distance)) {
                s->asks.pair[s->asks.count++] = *next;
                turn[i]++;
            } else {
                turn[i] = begin[i + 1]; /* boxes behind it are farther still */
            }
        }
        status =
            ebpo_catalogue_ask_runs(s->a, &s->asks, s->points, 3, true, ask_distances, s, error);
    } while (s->asks.count && status == EBPO_OK);
    return status;
}

/* From *at on, as many points as there is room for; *at is then behind them. */
static ebpo_status ask_some(search *s, uint32_t *at, uint64_t *begin, uint64_t *turn,
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
    return status == EBPO_OK ? ask_in_turn(s, begin, turn, points, error) : status;
}

static ebpo_status ask_nearest(search *s, ebpo_error *error)
{
    uint64_t *begin = ebpo_alloc((uint64_t)s->count + 1, sizeof *begin);
    uint64_t *turn = ebpo_alloc(s->count, sizeof *turn);
    s->asks.pair = ebpo_alloc(s->count, sizeof *s->asks.pair);
    ebpo_status status = begin && turn && s->asks.pair
                             ? EBPO_OK
                             : ebpo_fail_memory(error, (uint64_t)s->count * sizeof *s->asks.pair);
    for (uint32_t at = 0; at < s->count && status == EBPO_OK;)
        status = ask_some(s, &at, begin, turn, error);
    free(begin);
    free(turn);
    free(s->asks.pair);
    free(s->near.pair);
    return status;
}

static ebpo_status sign_distances(const ebpo_catalogue_asker *a, const double *points,
                                  uint32_t count, ebpo_distance_result *out, ebpo_error *error)
{
    ebpo_inside_result *where = ebpo_alloc(count, sizeof *where);
    ebpo_status status = where ? ebpo_catalogue_ask_inside(a, points, count, where, NULL, error)
                               : ebpo_fail_memory(error, count * sizeof *where);
    for (uint32_t i = 0; i < count && status == EBPO_OK; i++)
        if (where[i].where == EBPO_IN && isfinite(out[i].distance))
            out[i].distance = -out[i].distance;
    free(where);
    return status;
}

static ebpo_status ask_distance(const ebpo_catalogue_asker *a, const double *rows, uint32_t count,
                                void *out, uint64_t *model, ebpo_error *error)
{
    ebpo_distance_result *told = out;
    search s = { .a = a,
                 .points = rows,
                 .count = count,
                 .max_distance = a->options->max_distance,
                 .out = told,
                 .model = model };
    for (uint32_t i = 0; i < count; i++) {
        told[i] = (ebpo_distance_result){ .distance = INFINITY,
                                          .point = { NAN, NAN, NAN },
                                          .face = EBPO_NO_FACE };
        model[i] = EBPO_CATALOGUE_NO_MODEL;
    }
    ebpo_status status = ask_nearest(&s, error);
    return status == EBPO_OK && !a->c->surface && !a->options->unsigned_distance
               ? sign_distances(a, rows, count, told, error)
               : status;
}

ebpo_status ebpo_catalogue_distance(const ebpo_catalogue *c, ebpo_catalogue_models *models,
                                    const double *points, uint64_t count,
                                    const ebpo_catalogue_ask_options *options,
                                    ebpo_distance_result *out, uint64_t *model, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_catalogue_ask_options own;
    ebpo_catalogue_job j = { { c, models, &own }, .ask = ask_distance,   .stage = "distance",
                             .width = 3,          .result = sizeof *out, .ordered = true,
                             .rows = points,      .out = (char *)out,    .model = model };
    ebpo_status status = ebpo_catalogue_take_options(&own, options, error);
    if (status == EBPO_OK)
        status = ebpo_catalogue_need_surface(c, error);
    if (status == EBPO_OK)
        status = ebpo_check_points(points, count, error);
    return status == EBPO_OK ? ebpo_catalogue_ask_rows(&j, count, error) : status;
}

/* --- rays --- */

_Static_assert(sizeof(ebpo_ray) == 7 * sizeof(double), "a ray is a row of seven numbers");

typedef struct shot {
    ebpo_ray_sides sides;
    ebpo_ray_hit *out;
    uint64_t *model;
    double *far; /* of hits at a t beyond doubles (inf): t along the ray's longer direction */
} shot;

/* Returns a ray whose direction is longer by a power of two, exactly, so that every hit's t is
 * finite. */
static ebpo_ray longer_ray(const ebpo_ray *ray)
{
    enum { ENOUGH = 3 }; /* coordinates are at most 2^1025 apart */
    ebpo_ray out = *ray;
    int exponent;
    frexp(fmax(fmax(fabs(ray->direction[0]), fabs(ray->direction[1])), fabs(ray->direction[2])),
          &exponent);
    for (int k = 0; k < 3 && exponent < ENOUGH; k++)
        out.direction[k] = ldexp(ray->direction[k], ENOUGH - exponent);
    out.t_max = INFINITY;
    return out;
}

/* Returns true if a hit comes before the one that is kept. Of those beyond doubles a longer ray
 * says it. */
static ebpo_status is_nearer(const shot *s, ebpo_context *context, const ebpo_ray *ray,
                             const ebpo_ray_hit *hit, uint32_t item, bool *nearer,
                             ebpo_error *error)
{
    ebpo_ray_options how = EBPO_RAY_OPTIONS_INIT;
    const ebpo_ray_hit *kept = &s->out[item];
    *nearer = hit->t < kept->t;
    if (hit->face == EBPO_NO_FACE || hit->t < INFINITY)
        return EBPO_OK;
    ebpo_ray along = longer_ray(ray);
    ebpo_ray_hit there;
    how.sides = s->sides;
    how.threads = 1;
    ebpo_status status = ebpo_ray_first_many(context, &along, 1, &how, &there, error);
    *nearer = kept->face == EBPO_NO_FACE || (kept->t == INFINITY && there.t < s->far[item]);
    if (status == EBPO_OK && *nearer)
        s->far[item] = there.t;
    return status;
}

static ebpo_status take_hits(const shot *s, const ebpo_catalogue_run *run, const ebpo_ray *rays,
                             ebpo_context *context, const ebpo_catalogue_held *model,
                             ebpo_ray_hit *told, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < run->count && status == EBPO_OK; i++) {
        uint32_t item = run->pair[i].item;
        bool nearer;
        status = is_nearer(s, context, &rays[i], &told[i], item, &nearer, error);
        if (status != EBPO_OK || !nearer)
            continue;
        status = ebpo_catalogue_held_face(model, &told[i].face, error);
        s->out[item] = told[i];
        s->model[item] = run->model;
    }
    return status;
}

/* Asks one model. Models come in their order: of equal t the first one's stays. What is behind is
 * not looked for. */
static ebpo_status ask_hits(ebpo_context *context, const ebpo_catalogue_held *model, void *user,
                            ebpo_error *error)
{
    const ebpo_catalogue_run *run = user;
    const shot *s = run->user;
    ebpo_ray_options how = EBPO_RAY_OPTIONS_INIT;
    ebpo_ray_hit *told = ebpo_alloc(run->count, sizeof *told);
    ebpo_ray *rays = ebpo_alloc(run->count, sizeof *rays);
    ebpo_status status =
        told && rays ? EBPO_OK : ebpo_fail_memory(error, run->count * sizeof *rays);
    for (uint64_t i = 0; i < run->count && status == EBPO_OK; i++) {
        memcpy(&rays[i], run->rows + 7 * i, sizeof *rays);
        rays[i].t_max = fmin(rays[i].t_max, s->out[run->pair[i].item].t);
    }
    how.sides = s->sides;
    how.threads = 1;
    if (status == EBPO_OK)
        status = ebpo_ray_first_many(context, rays, run->count, &how, told, error);
    if (status == EBPO_OK)
        status = take_hits(s, run, rays, context, model, told, error);
    free(told);
    free(rays);
    return status;
}

static ebpo_status ask_rays(const ebpo_catalogue_asker *a, const double *rows, uint32_t count,
                            void *out, uint64_t *model, ebpo_error *error)
{
    shot s = { a->options->sides, out, model, ebpo_alloc(count, sizeof *s.far) };
    if (!s.far)
        return ebpo_fail_memory(error, count * sizeof *s.far);
    for (uint32_t i = 0; i < count; i++) {
        s.out[i] = (ebpo_ray_hit){ INFINITY, EBPO_NO_FACE, 0 };
        s.far[i] = INFINITY;
        model[i] = EBPO_CATALOGUE_NO_MODEL;
    }
    ebpo_status status = ebpo_catalogue_ask_all(a, rows, count, 7, ebpo_catalogue_find_ray, true,
                                                ask_hits, &s, error);
    free(s.far);
    return status;
}

ebpo_status ebpo_catalogue_ray(const ebpo_catalogue *c, ebpo_catalogue_models *models,
                               const ebpo_ray *rays, uint64_t count,
                               const ebpo_catalogue_ask_options *options, ebpo_ray_hit *out,
                               uint64_t *model, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_catalogue_ask_options own;
    ebpo_catalogue_job j = { { c, models, &own },   .ask = ask_rays,
                             .stage = "rays",       .width = 7,
                             .result = sizeof *out, .rows = (const double *)(const void *)rays,
                             .out = (char *)out,    .model = model };
    ebpo_status status = ebpo_catalogue_take_options(&own, options, error);
    if (status == EBPO_OK)
        status = ebpo_catalogue_need_surface(c, error);
    if (status == EBPO_OK)
        status = ebpo_check_ray_rows(rays, count, error);
    return status == EBPO_OK ? ebpo_catalogue_ask_rows(&j, count, error) : status;
}
