/* Depth first, nearest child first; what is certainly beyond the limit, or certainly was in a band
 * before, is passed over. */
#include "core/strict_fp.h"

#include "query/near_band.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"

void ebpo_near_band_begin(ebpo_near_band *band, uint64_t most)
{
    band->limit = band->radius;
    band->most = most;
    band->count = 0;
    band->cut = false;
}

/* --- order --- */

static int compare(const void *x, const void *y)
{
    const ebpo_near *a = x, *b = y;
    if (a->file_face == b->file_face)
        return 0;
    int sign = ebpo_near_compare(a->p, (const double(*)[3])a->triangle, &a->bounds,
                                 (const double(*)[3])b->triangle, &b->bounds);
    return sign ? sign : a->file_face < b->file_face ? -1 : 1;
}

void ebpo_near_band_settle(ebpo_near_band *band)
{
    uint64_t kept = 0;
    if (band->count)
        qsort(band->near, band->count, sizeof *band->near, compare);
    for (uint64_t i = 0; i < band->count; i++)
        if (kept == 0 || band->near[i].file_face != band->near[kept - 1].file_face)
            band->near[kept++] = band->near[i];
    band->count = kept < band->most ? kept : band->most;
    if (band->count < band->most)
        return;
    band->limit = fmin(band->limit, band->near[band->count - 1].bounds.hi);
    band->cut = true;
}

/* --- faces --- */

/* Sorting is put off until there are about twice as many as wanted. */
static void add(ebpo_near_band *band, const ebpo_near *face)
{
    enum { SPARE_LEAST = 64 };
    uint64_t spare = band->most < SPARE_LEAST ? SPARE_LEAST : band->most;
    if (band->count == band->most + spare)
        ebpo_near_band_settle(band);
    if (!ebpo_grow(&band->near, &band->capacity, band->count + 1, sizeof *band->near))
        band->no_memory = true;
    else
        band->near[band->count++] = *face;
}

static void try_face(ebpo_near_band *band, const ebpo_accel *s, uint32_t slot)
{
    ebpo_near face;
    uint32_t local = ebpo_accel_slot_face(s, slot);
    if (local == EBPO_NO_SLOT || band->no_memory)
        return;
    ebpo_accel_triangle(s, slot, face.triangle);
    ebpo_triangle_distance_bounds(band->p, (const double(*)[3])face.triangle, &face.bounds);
    if (face.bounds.lo > band->limit || ebpo_near_band_is_past(band, face.bounds.hi))
        return;
    face.p = band->p;
    face.file_face = ebpo_accel_file_face(s, local);
    face.source_face = ebpo_accel_source_face(s, local);
    if (band->has_after && compare(&face, &band->after) <= 0)
        return;
    if (face.bounds.hi > band->radius &&
        ebpo_triangle_distance_compare_to(band->p, (const double(*)[3])face.triangle,
                                          band->radius) > 0)
        return;
    add(band, &face);
}

/* --- the hierarchy --- */

typedef struct searching {
    ebpo_near_band *band;
    const ebpo_accel *s;
    double error; /* bound on what rounding does to distances of the hierarchy's boxes */
} searching;

/* Where exact arithmetic might be finite, this is. */
static double length3(const double x[3])
{
    double most = fmax(x[0], fmax(x[1], x[2]));
    if (!(most > 0))
        return 0;
    double a = x[0] / most, b = x[1] / most, c = x[2] / most;
    return most * sqrt(a * a + b * b + c * c);
}

/* Certain bounds of the distances of all points of a child's box. */
static void box_bounds(const searching *g, const ebpo_bound *b, int lane, double *lower,
                       double *upper)
{
    const double *p = g->band->p;
    double near[3], far[3];
    for (int k = 0; k < 3; k++) {
        ebpo_bound_sides sides = ebpo_bound_side(b, lane, k);
        double low = g->s->centre[k] + sides.low / g->s->scale,
               high = g->s->centre[k] + sides.high / g->s->scale;
        near[k] = fmax(fmax(low - p[k], p[k] - high), 0);
        far[k] = fmax(fabs(low - p[k]), fabs(p[k] - high));
    }
    /* a difference that overflows may have been finite before rounding */
    *lower = fmin(fmax(length3(near) - g->error, 0), 0x1p1022);
    *upper = length3(far) + g->error;
}

static void search(const searching *g, uint32_t child)
{
    ebpo_near_band *band = g->band;
    if (child & EBPO_IS_BLOCK) {
        for (uint32_t lane = 0; lane < EBPO_BLOCK; lane++)
            try_face(band, g->s, (child & ~EBPO_IS_BLOCK) * EBPO_BLOCK + lane);
        return;
    }
    const ebpo_bound *b = &g->s->bound[child];
    double lower[8], upper;
    int order[8], count = 0;
    for (int lane = 0; lane < b->count; lane++) {
        box_bounds(g, b, lane, &lower[lane], &upper);
        if (lower[lane] > band->limit || ebpo_near_band_is_past(band, upper))
            continue;
        int at = count++;
        for (; at > 0 && lower[order[at - 1]] > lower[lane]; at--)
            order[at] = order[at - 1];
        order[at] = lane;
    }
    for (int i = 0; i < count && lower[order[i]] <= band->limit; i++)
        search(g, b->child[order[i]]);
}

void ebpo_near_band_search(ebpo_near_band *band, const ebpo_accel *s)
{
    searching g = { band, s, 0 };
    double size = s->reach / s->scale * 0x1p-46;
    for (int k = 0; k < 3; k++) /* each side takes part with a few roundings of such numbers */
        size += fabs(band->p[k]) * 0x1p-46 + fabs(s->centre[k]) * 0x1p-46;
    g.error = size;
    if (s->bound_count)
        search(&g, s->top);
}
