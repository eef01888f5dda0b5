#include <stdlib.h>

#include "cli/commands/catalogue_models.h"

/* Of a point, so far. */
typedef struct found {
    int64_t winding;
    bool in, on;
} found;

static ebpo_status ask_inside(ebpo_context *context, const held_model *model, void *user,
                              ebpo_error *error)
{
    const model_run *run = user;
    found *all = run->user;
    ebpo_inside_result *told = malloc(run->count * sizeof *told);
    (void)model;
    if (!told)
        return catalogue_no_memory(error);
    ebpo_status status = ebpo_inside_many(context, run->rows, run->count, NULL, told, error);
    for (size_t i = 0; i < run->count && status == EBPO_OK; i++) {
        found *f = &all[run->pair[i].item];
        f->winding += told[i].winding;
        f->in |= told[i].where == EBPO_IN;
        f->on |= told[i].where == EBPO_ON;
    }
    free(told);
    return status;
}

static ebpo_status ask_all(catalogue_models *m, const double *points, uint64_t count, found *all,
                           ebpo_error *error)
{
    box_pairs pairs = { NULL, 0, 0 };
    ebpo_status status = EBPO_OK;
    for (uint64_t at = 0; at < count && status == EBPO_OK; pairs.count = 0) {
        for (; at < count && pairs.count < CATALOGUE_PAIRS && status == EBPO_OK; at++)
            if (!catalogue_boxes_holding(&m->all, points + 3 * at, (uint32_t)at, &pairs))
                status = catalogue_no_memory(error);
        if (status == EBPO_OK)
            status = catalogue_runs(m, &pairs, points, 3, false, ask_inside, all, error);
    }
    free(pairs.pair);
    return status;
}

/* --- parts of one model --- */

typedef struct doubtful {
    uint32_t *number; /* of points on faces or caps of a part, of which there is no sum yet */
    bool *real;
    int64_t *winding;
    size_t count;
} doubtful;

static ebpo_status judge_doubtful(catalogue_models *m, const double *points, doubtful *d,
                                  found *all, ebpo_error *error)
{
    ebpo_status status = catalogue_on_surface(m, points, d->number, d->count, d->real, error);
    size_t capped = 0;
    for (size_t i = 0; i < d->count && status == EBPO_OK; i++) {
        found *f = &all[d->number[i]];
        f->on = d->real[i];
        f->winding = 0;
        if (!f->on)
            d->number[capped++] = d->number[i];
    }
    if (status == EBPO_OK && capped)
        status = catalogue_crossings(m, points, d->number, capped, d->winding, error);
    for (size_t i = 0; i < capped && status == EBPO_OK; i++)
        all[d->number[i]].winding = d->winding[i];
    return status;
}

/* What the whole would say, also on caps. */
static ebpo_status of_whole(catalogue_models *m, const double *points, uint64_t count, found *all,
                            ebpo_error *error)
{
    doubtful d = { .count = 0 };
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < count; i++)
        d.count += all[i].on;
    d.number = malloc(d.count * sizeof *d.number + 1);
    d.real = calloc(d.count + 1, sizeof *d.real);
    d.winding = calloc(d.count + 1, sizeof *d.winding);
    if (!d.number || !d.real || !d.winding) {
        status = catalogue_no_memory(error);
    } else if (d.count) {
        d.count = 0;
        for (uint64_t i = 0; i < count; i++)
            if (all[i].on)
                d.number[d.count++] = (uint32_t)i;
        status = judge_doubtful(m, points, &d, all, error);
    }
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        found *f = &all[i];
        f->in = !f->on && (m->c->rule == EBPO_RULE_NONZERO   ? f->winding != 0
                           : m->c->rule == EBPO_RULE_EVENODD ? f->winding % 2 != 0
                                                             : f->winding > 0);
    }
    free(d.number);
    free(d.real);
    free(d.winding);
    return status;
}

ebpo_status catalogue_inside(catalogue_models *m, const double *points, uint64_t count,
                             ebpo_inside_result *out, ebpo_error *error)
{
    if (m->surface)
        return catalogue_fail(error, EBPO_E_NOT_SOLID, m->surface->path,
                              "is a surface: there is no inside");
    found *all = calloc(count + 1, sizeof *all);
    if (!all)
        return catalogue_no_memory(error);
    ebpo_status status = ask_all(m, points, count, all, error);
    if (status == EBPO_OK && m->c->parts)
        status = of_whole(m, points, count, all, error);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        out[i] = (ebpo_inside_result){ .where = all[i].in   ? EBPO_IN
                                                : all[i].on ? EBPO_ON
                                                            : EBPO_OUT,
                                       .winding = (int32_t)all[i].winding };
    free(all);
    return status;
}
