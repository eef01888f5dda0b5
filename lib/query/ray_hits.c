#include "geom/strict_fp.h"

#include "query/ray_hits.h"

#include <math.h>
#include <stdlib.h>

#include "base/alloc.h"
#include "base/error.h"
#include "geom/ray_triangle.h"

void ebpo_casting_begin(ebpo_casting *c, ebpo_context *context, const ebpo_segment *ray,
                        ebpo_ray_wants wants, ebpo_ray_sides sides)
{
    c->context = context;
    c->ray = *ray;
    c->wants = wants;
    c->sides = sides;
    c->limit = ray->t_max;
    c->done = c->no_memory = false;
    c->count = 0;
}

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

ebpo_status ebpo_casting_sort(ebpo_casting *c, uint64_t begin, uint64_t *end, ebpo_error *error)
{
    ebpo_context *k = c->context;
    *end = begin;
    if (!ebpo_grow(&k->hits, &k->hit_capacity, begin + c->count, sizeof *k->hits))
        return ebpo_fail_memory(error, (begin + c->count) * sizeof *k->hits);
    if (c->count)
        qsort_r(k->met, c->count, sizeof *k->met, compare_met, &c->ray);
    for (uint64_t i = 0; i < c->count; i++)
        if (i == 0 || k->met[i].file_face != k->met[i - 1].file_face) /* subtrees share faces */
            k->hits[(*end)++] = ebpo_hit_of(&k->met[i]);
    return EBPO_OK;
}

const char *ebpo_ray_fault(const ebpo_segment *ray)
{
    bool moves = false;
    for (int k = 0; k < 3; k++) {
        if (!isfinite(ray->origin[k]) || !isfinite(ray->direction[k]))
            return "has a coordinate that is not a finite number";
        moves = moves || ray->direction[k] != 0;
    }
    if (!moves)
        return "needs a direction other than (0, 0, 0)";
    return ray->t_max >= 0 ? NULL : "needs a t_max of 0 or more";
}
