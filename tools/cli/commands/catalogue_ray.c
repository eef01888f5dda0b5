#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cli/commands/catalogue_models.h"

typedef struct search {
    ebpo_ray_sides sides;
    ebpo_ray_hit *out;
    uint64_t *model;
    double *far; /* of hits at a t beyond doubles (inf): t along the ray's longer direction */
} search;

/* Returns a ray whose direction is longer by a power of two, exactly, so that every hit's t is
 * finite. */
static ebpo_ray lengthen_ray(const ebpo_ray *ray)
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
static ebpo_status is_nearer(const search *s, ebpo_context *context, const ebpo_ray *ray,
                             const ebpo_ray_hit *hit, uint32_t item, bool *nearer,
                             ebpo_error *error)
{
    ebpo_ray_options how = EBPO_RAY_OPTIONS_INIT;
    const ebpo_ray_hit *kept = &s->out[item];
    *nearer = hit->t < kept->t;
    if (hit->face == EBPO_NO_FACE || hit->t < INFINITY)
        return EBPO_OK;
    ebpo_ray along = lengthen_ray(ray);
    ebpo_ray_hit there;
    how.sides = s->sides;
    how.threads = 1;
    ebpo_status status = ebpo_ray_first_many(context, &along, 1, &how, &there, error);
    *nearer = kept->face == EBPO_NO_FACE || (kept->t == INFINITY && there.t < s->far[item]);
    if (status == EBPO_OK && *nearer)
        s->far[item] = there.t;
    return status;
}

/* Asks one model. Models come in their order: of equal t the first one's stays. What is behind is
 * not looked for. */
static ebpo_status ask_rays(ebpo_context *context, const held_model *model, void *user,
                            ebpo_error *error)
{
    const model_run *run = user;
    const search *s = run->user;
    ebpo_ray_options how = EBPO_RAY_OPTIONS_INIT;
    ebpo_ray_hit *told = malloc(run->count * sizeof *told);
    ebpo_ray *rays = malloc(run->count * sizeof *rays);
    ebpo_status status = told && rays ? EBPO_OK : catalogue_no_memory(error);
    for (size_t i = 0; i < run->count && status == EBPO_OK; i++) {
        memcpy(&rays[i], run->rows + 7 * i, sizeof *rays);
        rays[i].t_max = fmin(rays[i].t_max, s->out[run->pair[i].item].t);
    }
    how.sides = s->sides;
    how.threads = 1;
    if (status == EBPO_OK)
        status = ebpo_ray_first_many(context, rays, run->count, &how, told, error);
    for (size_t i = 0; i < run->count && status == EBPO_OK; i++) {
        uint32_t item = run->pair[i].item;
        bool nearer;
        status = is_nearer(s, context, &rays[i], &told[i], item, &nearer, error);
        if (status != EBPO_OK || !nearer)
            continue;
        status = held_face(model, &told[i].face, error);
        s->out[item] = told[i];
        s->model[item] = run->model;
    }
    free(told);
    free(rays);
    return status;
}

ebpo_status catalogue_ray(catalogue_models *m, const ebpo_ray *rays, uint64_t count,
                          ebpo_ray_sides sides, ebpo_ray_hit *out, uint64_t *model,
                          ebpo_error *error)
{
    search s = { sides, out, model, malloc((count + 1) * sizeof *s.far) };
    box_pairs pairs = { NULL, 0, 0 };
    ebpo_status status = s.far ? catalogue_need_surface(m, error) : catalogue_no_memory(error);
    for (uint64_t at = 0; at < count && status == EBPO_OK; pairs.count = 0) {
        for (; at < count && pairs.count < CATALOGUE_PAIRS && status == EBPO_OK; at++) {
            out[at] = (ebpo_ray_hit){ INFINITY, EBPO_NO_FACE, 0 };
            model[at] = CATALOGUE_NO_MODEL;
            if (!catalogue_boxes_on_ray(&m->seen, rays[at].origin, rays[at].direction, (uint32_t)at,
                                        &pairs))
                status = catalogue_no_memory(error);
        }
        if (status == EBPO_OK)
            status = catalogue_runs(m, &pairs, (const double *)(const void *)rays, 7, true,
                                    ask_rays, &s, error);
    }
    free(pairs.pair);
    free(s.far);
    return status;
}
