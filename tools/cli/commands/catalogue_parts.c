/* Parts of one model: what is true of the whole at points that are on faces or caps of a part. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cli/commands/catalogue_models.h"

/* Rays that are tried before a point is given up. */
enum { DIRECTIONS = 64 };

static double *rows_of(const double *points, const uint32_t *numbers, size_t count, size_t width)
{
    double *rows = calloc(count * width + 1, sizeof *rows);
    for (size_t i = 0; rows && i < count; i++)
        memcpy(rows + i * width, points + (size_t)3 * numbers[i], 3 * sizeof *rows);
    return rows;
}

/* --- on faces --- */

static ebpo_status ask_box(ebpo_context *context, const held_model *model, void *user,
                           ebpo_error *error)
{
    const model_run *run = user;
    bool *found = run->user;
    ebpo_status status = EBPO_OK;
    (void)model;
    for (size_t i = 0; i < run->count && status == EBPO_OK; i++) {
        const uint64_t *faces;
        uint64_t count = 0;
        const double *p = run->rows + 3 * i;
        if (!found[run->pair[i].item])
            status = ebpo_faces_in_box(context, p, p, &faces, &count, error);
        if (status == EBPO_OK && count)
            found[run->pair[i].item] = true;
    }
    return status;
}

ebpo_status catalogue_on_surface(catalogue_models *m, const double *points, const uint32_t *numbers,
                                 size_t count, bool *out, ebpo_error *error)
{
    box_pairs pairs = { NULL, 0, 0 };
    double *rows = rows_of(points, numbers, count, 3);
    ebpo_status status = rows ? catalogue_need_surface(m, error) : catalogue_no_memory(error);
    for (size_t at = 0; at < count && status == EBPO_OK; pairs.count = 0) {
        for (; at < count && pairs.count < CATALOGUE_PAIRS && status == EBPO_OK; at++)
            if (!catalogue_boxes_holding(&m->seen, rows + 3 * at, (uint32_t)at, &pairs))
                status = catalogue_no_memory(error);
        if (status == EBPO_OK)
            status = catalogue_runs(m, &pairs, rows, 3, true, ask_box, out, error);
    }
    free(pairs.pair);
    free(rows);
    return status;
}

/* --- on caps --- */

/* What rays go out through less what they go in through. A ray that meets an edge, or runs along a
 * face, tells nothing: another one is cast. */
typedef struct cast {
    int64_t *sum;
    bool *plain;
} cast;

static ebpo_status ask_rays(ebpo_context *context, const held_model *model, void *user,
                            ebpo_error *error)
{
    const model_run *run = user;
    const cast *c = run->user;
    const ebpo_ray_hit *hits;
    const uint64_t *begin;
    ebpo_ray_options how = EBPO_RAY_OPTIONS_INIT;
    (void)model;
    how.threads = 1;
    ebpo_status status = ebpo_ray_all_many(context, (const ebpo_ray *)(const void *)run->rows,
                                           run->count, &how, &hits, &begin, error);
    for (size_t i = 0; i < run->count && status == EBPO_OK; i++)
        for (uint64_t k = begin[i]; k < begin[i + 1]; k++) {
            c->sum[run->pair[i].item] -= hits[k].side;
            c->plain[run->pair[i].item] &= hits[k].side != 0;
        }
    return status;
}

/* Numbers that look like chance (splitmix64), always the same ones. */
static double next_random(uint64_t *state)
{
    uint64_t z = *state += 0x9e3779b97f4a7c15;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9;
    z = (z ^ z >> 27) * 0x94d049bb133111eb;
    return (double)((z ^ z >> 31) >> 11) * 0x1p-52 - 1;
}

/* One ray from each of the points. */
static ebpo_status cast_all(catalogue_models *m, double *rows, size_t count, const double d[3],
                            const cast *c, ebpo_error *error)
{
    box_pairs pairs = { NULL, 0, 0 };
    ebpo_status status = EBPO_OK;
    for (size_t at = 0; at < count && status == EBPO_OK; pairs.count = 0) {
        for (; at < count && pairs.count < CATALOGUE_PAIRS && status == EBPO_OK; at++) {
            double *row = rows + 7 * at;
            memcpy(row + 3, d, 3 * sizeof *d);
            row[6] = INFINITY;
            c->sum[at] = 0;
            c->plain[at] = true;
            if (!catalogue_boxes_on_ray(&m->seen, row, d, (uint32_t)at, &pairs))
                status = catalogue_no_memory(error);
        }
        if (status == EBPO_OK)
            status = catalogue_runs(m, &pairs, rows, 7, true, ask_rays, (void *)c, error);
    }
    free(pairs.pair);
    return status;
}

/* Points that are known leave; `left` of them stay, whose numbers are in place. */
static size_t keep_unknown(double *rows, uint32_t *place, size_t left, const cast *c,
                           int64_t *winding)
{
    size_t kept = 0;
    for (size_t i = 0; i < left; i++)
        if (c->plain[i]) {
            winding[place[i]] = c->sum[i];
        } else {
            memmove(rows + 7 * kept, rows + 7 * i, 3 * sizeof *rows);
            place[kept++] = place[i];
        }
    return kept;
}

ebpo_status catalogue_crossings(catalogue_models *m, const double *points, const uint32_t *numbers,
                                size_t count, int64_t *winding, ebpo_error *error)
{
    double *rows = rows_of(points, numbers, count, 7);
    uint32_t *place = malloc(count * sizeof *place);
    cast c = { malloc(count * sizeof *c.sum), malloc(count * sizeof *c.plain) };
    bool fine = rows && place && c.sum && c.plain;
    ebpo_status status = fine ? catalogue_need_surface(m, error) : catalogue_no_memory(error);
    size_t left = count;
    uint64_t state = 20;
    for (size_t i = 0; fine && i < count; i++)
        place[i] = (uint32_t)i;
    for (int i = 0; i < DIRECTIONS && left && status == EBPO_OK; i++) {
        double d[3] = { next_random(&state), next_random(&state), next_random(&state) };
        status = cast_all(m, rows, left, d, &c, error);
        if (status == EBPO_OK)
            left = keep_unknown(rows, place, left, &c, winding);
    }
    if (status == EBPO_OK && left)
        status = catalogue_fail(error, EBPO_E_LIMIT, m->c->path,
                                "no ray from %g %g %g tells its winding number", rows[0], rows[1],
                                rows[2]);
    free(rows);
    free(place);
    free(c.sum);
    free(c.plain);
    return status;
}
