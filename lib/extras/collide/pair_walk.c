#include "core/strict_fp.h"

#include "extras/collide/pair_walk.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "extras/collide/neighbours.h"
#include "geometry/triangle_pair.h"

void ebpo_pair_walk_free(ebpo_pair_walk *w)
{
    free(w->stack);
    free(w->met);
    w->stack = NULL;
    w->met = NULL;
    w->capacity = w->met_capacity = 0;
}

bool ebpo_pair_walk_room(ebpo_pair_walk *w, uint64_t more)
{
    return w->top + more <= w->capacity ||
           ebpo_grow(&w->stack, &w->capacity, w->top + more, sizeof *w->stack);
}

void ebpo_posed_triangle(const ebpo_accel *accel, const ebpo_posing *posing, uint32_t slot,
                         double out[3][3])
{
    double t[3][3];
    ebpo_accel_triangle(accel, slot, t);
    for (int i = 0; i < 3; i++)
        ebpo_posing_apply(posing, t[i], out[i]);
}

static ebpo_pair_kind exact_kind(ebpo_pair_walk *w, uint32_t slot_a, uint32_t slot_b)
{
    const ebpo_accel_pair *p = w->pair;
    double a[3][3], b[3][3];
    ebpo_posed_triangle(p->accel[0], &p->posing[0]->posing, slot_a, a);
    ebpo_posed_triangle(p->accel[1], &p->posing[1]->posing, slot_b, b);
    w->exact++;
    return w->neighbours ? ebpo_neighbours((const double(*)[3])a, (const double(*)[3])b)
                         : ebpo_triangle_pair((const double(*)[3])a, (const double(*)[3])b);
}

bool ebpo_pair_walk_decide(ebpo_pair_walk *w, uint32_t block_a, uint32_t block_b,
                           const ebpo_block_pairs *pairs)
{
    const ebpo_accel *const *s = w->pair->accel;
    uint32_t face_a = ebpo_accel_meshlet(s[0], block_a)->face,
             face_b = ebpo_accel_meshlet(s[1], block_b)->face;
    if (!ebpo_grow(&w->met, &w->met_capacity, w->met_count + pairs->count, sizeof *w->met))
        return false;
    for (unsigned i = 0; i < pairs->count; i++) {
        uint32_t lane_a = pairs->pair[i] & 7, lane_b = pairs->pair[i] >> 3 & 7;
        ebpo_met_pair met = { face_a + lane_a, face_b + lane_b, EBPO_PAIR_CROSSING };
        if (met.a < w->begin || met.a >= w->end || (w->self && met.a >= met.b))
            continue;
        if (w->neighbours || !(pairs->pair[i] & EBPO_CERTAINLY_CROSSING))
            met.kind = (int32_t)exact_kind(w, block_a * EBPO_BLOCK + lane_a,
                                           block_b * EBPO_BLOCK + lane_b);
        if (met.kind == EBPO_PAIR_APART)
            continue;
        w->met_slot[0] = block_a * EBPO_BLOCK + lane_a;
        w->met_slot[1] = block_b * EBPO_BLOCK + lane_b;
        w->met[w->met_count++] = met;
        if (w->first)
            break;
    }
    return true;
}
