#include "core/strict_fp.h"

#include "query/ray_hits.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/sort.h"
#include "geometry/ray_triangle.h"

bool ebpo_casting_meets(const ebpo_casting *c, int facing, ebpo_met *m)
{
    const double(*triangle)[3] = (const double(*)[3])m->triangle;
    if (facing)
        ebpo_ray_interior(&c->ray, triangle, facing, &m->meeting);
    else
        ebpo_ray_triangle(&c->ray, triangle, &m->meeting);
    return m->meeting.meets && (c->sides == EBPO_RAY_BOTH ||
                                m->meeting.facing == (c->sides == EBPO_RAY_FRONT ? 1 : -1));
}

/* By t, then in the order of the file. */
static int compare_met(const void *a, const void *b, void *ray)
{
    const ebpo_met *x = a, *y = b;
    int sign = ebpo_ray_compare(ray, (const double(*)[3])x->triangle, &x->meeting,
                                (const double(*)[3])y->triangle, &y->meeting);
    return sign ? sign : (x->file_face > y->file_face) - (x->file_face < y->file_face);
}

static void keep_first(ebpo_casting *c, const ebpo_met *m)
{
    if (c->count && compare_met(m, &c->first, &c->ray) >= 0)
        return;
    c->first = *m;
    c->count = 1;
    double limit = m->meeting.t * (1 + 0x1p-48) + DBL_MIN;
    c->limit = limit < c->limit ? limit : c->limit;
}

void ebpo_casting_keep(ebpo_casting *c, const ebpo_met *m)
{
    ebpo_context *k = c->context;
    if (c->wants == EBPO_WANTS_FIRST) {
        keep_first(c, m);
    } else if (c->wants == EBPO_WANTS_ANY) {
        c->count = 1;
        c->done = true;
    } else if (ebpo_grow(&k->met, &k->met_capacity, c->count + 1, sizeof *k->met)) {
        k->met[c->count++] = *m;
    } else {
        c->done = c->no_memory = true;
    }
}

/* Mostly few, and in order but for some: what is met is found from the nearest box on. */
static void sort_met(ebpo_met *met, uint64_t count, ebpo_segment *ray)
{
    if (count > 16) {
        ebpo_sort_with(met, count, sizeof *met, compare_met, ray);
        return;
    }
    for (uint64_t i = 1; i < count; i++) {
        uint64_t at = i;
        ebpo_met m = met[i];
        for (; at > 0 && compare_met(&met[at - 1], &m, ray) > 0; at--)
            met[at] = met[at - 1];
        met[at] = m;
    }
}

ebpo_status ebpo_casting_sort(ebpo_casting *c, uint64_t begin, uint64_t *end, ebpo_error *error)
{
    ebpo_context *k = c->context;
    *end = begin;
    if (!ebpo_grow(&k->hits, &k->hit_capacity, begin + c->count, sizeof *k->hits))
        return ebpo_fail_memory(error, (begin + c->count) * sizeof *k->hits);
    sort_met(k->met, c->count, &c->ray);
    for (uint64_t i = 0; i < c->count; i++)
        if (i == 0 || k->met[i].file_face != k->met[i - 1].file_face) /* subtrees share faces */
            k->hits[(*end)++] = ebpo_hit_of(&k->met[i]);
    return EBPO_OK;
}

const char *ebpo_ray_fault_of(const ebpo_segment *ray)
{
    double nothing = 0, longest = 0;
    for (int k = 0; k < 3; k++) {
        nothing += ray->origin[k] * 0 + ray->direction[k] * 0;
        longest = fabs(ray->direction[k]) > longest ? fabs(ray->direction[k]) : longest;
    }
    if (nothing != 0) /* no number: a coordinate is not a finite one */
        return "has a coordinate that is not a finite number";
    if (longest == 0)
        return "needs a direction other than (0, 0, 0)";
    return ray->t_max >= 0 ? NULL : "needs a t_max of 0 or more";
}
