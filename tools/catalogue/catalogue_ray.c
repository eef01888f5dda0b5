#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "catalogue/catalogue_models.h"

typedef struct search {
    ebpo_ray_sides sides;
    ebpo_ray_hit *out;
    uint64_t *model;
} search;

/* Models come in their order: of equal t the first one's stays. What is behind is not looked for.
 */
static ebpo_status ask(ebpo_context *context, const held_model *model, void *user,
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
        bool first = s->out[item].face == EBPO_NO_FACE; /* t may be beyond doubles: inf */
        if (told[i].face == EBPO_NO_FACE || !(first || told[i].t < s->out[item].t))
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
    search s = { sides, out, model };
    box_pairs pairs = { NULL, 0, 0 };
    ebpo_status status = catalogue_need_surface(m, error);
    if (status != EBPO_OK)
        return status;
    for (uint64_t at = 0; at < count && status == EBPO_OK; pairs.count = 0) {
        for (; at < count && pairs.count < CATALOGUE_PAIRS && status == EBPO_OK; at++) {
            out[at] = (ebpo_ray_hit){ INFINITY, EBPO_NO_FACE, 0 };
            model[at] = CATALOGUE_NO_MODEL;
            if (!catalogue_boxes_on_ray(&m->seen, rays[at].origin, rays[at].direction, (uint32_t)at,
                                        &pairs))
                status = catalogue_no_memory(error);
        }
        if (status == EBPO_OK)
            status = catalogue_runs(m, &pairs, (const double *)(const void *)rays, 7, true, ask, &s,
                                    error);
    }
    free(pairs.pair);
    return status;
}
