/* Exact answers for where a probe was a moment ago: asked by the thread that loads, handed over as
 * boxes are. */
#include "core/strict_fp.h"

#include <math.h>

#include "extras/haptic/touch_parts.h"
#include "extras/haptic/vectors.h"

static ebpo_status ask(ebpo_touch *t, ebpo_known_place *out, ebpo_error *error)
{
    ebpo_distance_result near;
    ebpo_inside_result inside = { .where = EBPO_OUT };
    ebpo_status status = ebpo_distance(t->loading, out->place, NULL, &near, error);
    if (status == EBPO_OK && t->solid)
        status = ebpo_inside(t->loading, out->place, NULL, &inside, error);
    if (status != EBPO_OK)
        return status;
    out->distance = fabs(near.distance);
    copy(near.point, out->point);
    copy(near.normal, out->normal);
    out->winding = inside.winding;
    out->on = inside.where == EBPO_ON;
    out->there = true;
    return EBPO_OK;
}

ebpo_status ebpo_touch_learn(ebpo_touch *t, bool *moved, ebpo_error *error)
{
    ebpo_known_place *known = &t->known[t->own_known];
    for (int i = 0; i < 3; i++)
        known->place[i] = atomic_load_explicit(&t->hand_told[i], memory_order_relaxed);
    *moved = known->place[0] != t->asked[0] || known->place[1] != t->asked[1] ||
             known->place[2] != t->asked[2];
    if (!*moved)
        return EBPO_OK;
    ebpo_status status = ask(t, known, error);
    if (status != EBPO_OK)
        return status;
    copy(known->place, t->asked);
    unsigned got = atomic_exchange_explicit(&t->known_between, t->own_known | EBPO_TOUCH_FRESH,
                                            memory_order_acq_rel);
    t->own_known = got & ~(unsigned)EBPO_TOUCH_FRESH;
    return EBPO_OK;
}

const ebpo_known_place *ebpo_touch_known(ebpo_touch *t)
{
    if (atomic_load_explicit(&t->known_between, memory_order_relaxed) & EBPO_TOUCH_FRESH) {
        unsigned got = atomic_exchange_explicit(&t->known_between, t->answer, memory_order_acq_rel);
        t->answer = got & ~(unsigned)EBPO_TOUCH_FRESH;
    }
    return &t->known[t->answer];
}
