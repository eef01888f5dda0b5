/* The first contact. */
#include "core/strict_fp.h"

#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/collide/gather_parts.h"

/* -1: late. */
static ebpo_status search(const ebpo_collision *q, ebpo_pair_walk *w, const char *stage,
                          int32_t *found, ebpo_error *error)
{
    if (!w->kernels->start(w))
        return ebpo_fail_memory(error, w->capacity * sizeof *w->stack);
    while (w->top > 0) {
        if (!w->kernels->run(w, EBPO_WALK_PAIRS))
            return ebpo_fail_memory(error, w->capacity * sizeof *w->stack);
        if (w->top > 0 && ebpo_collision_is_late(q)) {
            *found = -1;
            return EBPO_OK;
        }
        if (!ebpo_progress_step(&q->options.progress, stage, 0, 0, error))
            return EBPO_E_CANCELLED;
    }
    *found = w->met_count > 0;
    return EBPO_OK;
}

ebpo_status ebpo_collision_first(const ebpo_collision *q, const ebpo_accel *const accel[2],
                                 const char *stage, int32_t *found, ebpo_error *error)
{
    ebpo_pair_walk *w = &q->collider->walk;
    ebpo_accel_pair pair;
    const ebpo_block_posing *posing[2] = { &q->posing[0], &q->posing[1] };
    *found = 0;
    if (accel[0]->bound_count == 0 || accel[1]->bound_count == 0)
        return EBPO_OK;
    ebpo_accel_pair_make(&pair, accel, posing, q->reach);
    if (pair.apart)
        return EBPO_OK;
    ebpo_pair_walk_begin(w, &pair);
    w->first = true;
    w->self = false;
    ebpo_status status = search(q, w, stage, found, error);
    ebpo_collider_count(q->collider, w);
    return status;
}

ebpo_status ebpo_collide_first(ebpo_collider *c, const ebpo_collide_options *options,
                               ebpo_face_pair *out, int32_t *found, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_collision q;
    *out = (ebpo_face_pair){ EBPO_NO_FACE, EBPO_NO_FACE, EBPO_NO_FACE, EBPO_NO_FACE, 0, 0 };
    *found = 0;
    ebpo_status status = ebpo_collision_begin(&q, c, options, error);
    if (status == EBPO_OK && ebpo_collision_is_in_parts(&q))
        return ebpo_first_of_parts(&q, out, found, error);
    if (status != EBPO_OK)
        return status;
    const ebpo_accel *accel[2] = { q.model[0]->whole, q.model[1]->whole };
    status = ebpo_collision_first(&q, accel, "first contact", found, error);
    if (status == EBPO_OK && *found == 1)
        *out = ebpo_collision_pair(&q, q.model[0]->whole, q.model[1]->whole, &c->walk.met[0]);
    return status;
}
