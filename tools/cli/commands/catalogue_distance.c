#include <math.h>
#include <stdlib.h>

#include "cli/commands/catalogue_models.h"

/* Points of a stretch, and what was found so far of all. */
typedef struct search {
    catalogue_models *m;
    const double *points;
    double max_distance;
    ebpo_distance_result *out;
    uint64_t *model;
    box_pairs near; /* of each point, the nearest box first */
    box_pairs asks;
} search;

static int nearest_first(const void *a, const void *b)
{
    const box_pair *x = a, *y = b;
    return x->least != y->least ? (x->least < y->least ? -1 : 1)
                                : (x->box > y->box) - (x->box < y->box);
}

static ebpo_status take_nearer(const search *s, const model_run *run, const held_model *model,
                               ebpo_distance_result *told, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (size_t i = 0; i < run->count && status == EBPO_OK; i++) {
        uint32_t item = run->pair[i].item;
        double now = s->out[item].distance, new = told[i].distance;
        if (told[i].face == EBPO_NO_FACE ||
            !(new < now || (new == now && run->model < s->model[item])))
            continue;
        status = held_face(model, &told[i].face, error);
        s->out[item] = told[i];
        s->model[item] = run->model;
    }
    return status;
}

static ebpo_status ask_distances(ebpo_context *context, const held_model *model, void *user,
                                 ebpo_error *error)
{
    const model_run *run = user;
    const search *s = run->user;
    ebpo_distance_options o = EBPO_DISTANCE_OPTIONS_INIT;
    ebpo_distance_result *told = malloc(run->count * sizeof *told);
    double farthest = 0;
    if (!told)
        return catalogue_no_memory(error);
    for (size_t i = 0; i < run->count; i++)
        farthest = fmax(farthest, s->out[run->pair[i].item].distance);
    o.max_distance = fmin(farthest * (1 + BOX_SLACK), s->max_distance);
    o.unsigned_distance = true;
    ebpo_status status = ebpo_distance_many(context, run->rows, run->count, &o, told, error);
    if (status == EBPO_OK)
        status = take_nearer(s, run, model, told, error);
    free(told);
    return status;
}

/* Each point asks its next box, as long as that may hold something nearer. `begin` has where each
 * point's boxes begin, and where the next point's do. */
static ebpo_status ask_in_turn(search *s, size_t *begin, size_t points, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    size_t *turn = malloc(points * sizeof *turn + 1);
    if (!turn)
        return catalogue_no_memory(error);
    for (size_t i = 0; i < points; i++)
        turn[i] = begin[i];
    do {
        s->asks.count = 0;
        for (size_t i = 0; i < points; i++) {
            const box_pair *next = s->near.pair + turn[i];
            if (turn[i] == begin[i + 1])
                continue;
            if (next->least * (1 - BOX_SLACK) <=
                fmin(s->out[next->item].distance, s->max_distance)) {
                s->asks.pair[s->asks.count++] = *next;
                turn[i]++;
            } else {
                turn[i] = begin[i + 1]; /* boxes behind it are farther still */
            }
        }
        status = catalogue_runs(s->m, &s->asks, s->points, 3, true, ask_distances, s, error);
    } while (s->asks.count && status == EBPO_OK);
    free(turn);
    return status;
}

/* From `at` on, as many as there is room for; returns where it ended. */
static ebpo_status answer_stretch(search *s, uint64_t *at, uint64_t count, ebpo_error *error)
{
    enum { POINTS_AT_A_TIME = 1 << 20 };
    uint64_t most = count - *at < POINTS_AT_A_TIME ? count - *at : POINTS_AT_A_TIME;
    size_t *begin = malloc((most + 1) * sizeof *begin), points = 0;
    ebpo_status status = begin ? EBPO_OK : catalogue_no_memory(error);
    s->near.count = 0;
    for (; points < most && s->near.count < CATALOGUE_PAIRS && status == EBPO_OK; points++) {
        uint64_t item = *at + points;
        begin[points] = s->near.count;
        if (!catalogue_boxes_near(&s->m->seen, s->points + 3 * item, s->max_distance,
                                  (uint32_t)item, &s->near))
            status = catalogue_no_memory(error);
        if (s->near.count > begin[points])
            qsort(s->near.pair + begin[points], s->near.count - begin[points], sizeof *s->near.pair,
                  nearest_first);
    }
    s->asks.pair = status == EBPO_OK ? malloc(points * sizeof *s->asks.pair + 1) : NULL;
    if (status == EBPO_OK && !s->asks.pair)
        status = catalogue_no_memory(error);
    if (status == EBPO_OK) {
        begin[points] = s->near.count;
        status = ask_in_turn(s, begin, points, error);
    }
    free(s->asks.pair);
    free(begin);
    *at += points;
    return status;
}

static ebpo_status sign_distances(catalogue_models *m, const double *points, uint64_t count,
                                  ebpo_distance_result *out, ebpo_error *error)
{
    ebpo_inside_result *where = malloc(count * sizeof *where);
    ebpo_status status =
        where ? catalogue_inside(m, points, count, where, error) : catalogue_no_memory(error);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        if (where[i].where == EBPO_IN && isfinite(out[i].distance))
            out[i].distance = -out[i].distance;
    free(where);
    return status;
}

ebpo_status catalogue_distance(catalogue_models *m, const double *points, uint64_t count,
                               double max_distance, bool unsigned_distance,
                               ebpo_distance_result *out, uint64_t *model, ebpo_error *error)
{
    search s = { m, points, max_distance, out, model, { NULL, 0, 0 }, { NULL, 0, 0 } };
    ebpo_status status = catalogue_need_surface(m, error);
    if (status != EBPO_OK)
        return status;
    for (uint64_t i = 0; i < count; i++) {
        out[i] = (ebpo_distance_result){ .distance = INFINITY,
                                         .point = { NAN, NAN, NAN },
                                         .face = EBPO_NO_FACE };
        model[i] = CATALOGUE_NO_MODEL;
    }
    for (uint64_t at = 0; at < count && status == EBPO_OK;)
        status = answer_stretch(&s, &at, count, error);
    free(s.near.pair);
    return status == EBPO_OK && count && !m->surface && !unsigned_distance
               ? sign_distances(m, points, count, out, error)
               : status;
}
