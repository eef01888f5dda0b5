/* The first contact. */
#include "core/strict_fp.h"

#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/collide/gathering.h"
#include "extras/collide/subtree_pairs.h"

/* -1: late. */
static ebpo_status first_search(const ebpo_collision *q, ebpo_pair_walk *w, const char *stage,
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
    ebpo_status status = first_search(q, w, stage, found, error);
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

/* All pairs, in one order. */

/* Pairs as they are handed out. */
typedef struct giving {
    const ebpo_collision *question;
    const ebpo_accel_pair *pair;
    ebpo_pairs_fn take;
    void *user;
    bool enough;
} giving;

enum { GIVEN_AT_ONCE = 1024 };

static void all_give(giving *v, const ebpo_met_pair *met, uint64_t count)
{
    ebpo_face_pair out[GIVEN_AT_ONCE];
    for (uint64_t at = 0; at < count && !v->enough; at += GIVEN_AT_ONCE) {
        uint64_t n = count - at < GIVEN_AT_ONCE ? count - at : GIVEN_AT_ONCE;
        for (uint64_t i = 0; i < n; i++)
            out[i] = ebpo_collision_pair(v->question, v->pair->accel[0], v->pair->accel[1],
                                         &met[at + i]);
        v->enough = !v->take(v->user, out, n);
    }
}

/* Runs of faces of the first model: as long as what they find has room, twice as long after one
 * that had. A single face may take more. */
static ebpo_status in_runs(giving *v, ebpo_gathering *g, ebpo_error *error)
{
    uint32_t faces = v->pair->accel[0]->face_count, run = faces;
    uint64_t most = v->question->collider->options.memory / (2 * sizeof(ebpo_met_pair)) + 1;
    for (uint32_t begin = 0; begin < faces && !v->enough;) {
        uint32_t end = faces - begin > run ? begin + run : faces;
        g->most = end - begin == 1 ? UINT64_MAX : most;
        ebpo_status status = ebpo_gather(g, v->pair, begin, end, error);
        if (status != EBPO_OK)
            return status;
        run = end - begin;
        if (g->full) {
            run = run / 2;
            continue;
        }
        all_give(v, g->met, g->met_count);
        begin = end;
        run = run < faces / 2 ? 2 * run : faces;
    }
    return EBPO_OK;
}

static ebpo_status all_pairs(const ebpo_collision *q, bool self, ebpo_pairs_fn take, void *user,
                             ebpo_error *error)
{
    if (ebpo_collision_is_in_parts(q))
        return ebpo_gather_parts(q, self, take, user, error);
    const ebpo_accel *accel[2] = { q->model[0]->whole, q->model[1]->whole };
    const ebpo_block_posing *posing[2] = { &q->posing[0], &q->posing[1] };
    ebpo_accel_pair pair;
    if (accel[0]->bound_count == 0 || accel[1]->bound_count == 0)
        return EBPO_OK;
    ebpo_accel_pair_make(&pair, accel, posing, q->reach);
    if (pair.apart)
        return EBPO_OK;
    giving v = { q, &pair, take, user, false };
    ebpo_gathering g = { .question = q, .self = self };
    ebpo_status status = in_runs(&v, &g, error);
    ebpo_gathering_free(&g);
    return status;
}

ebpo_status ebpo_collide_all(ebpo_collider *c, const ebpo_collide_options *options,
                             ebpo_pairs_fn take, void *user, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_collision q;
    ebpo_status status = ebpo_collision_begin(&q, c, options, error);
    return status == EBPO_OK ? all_pairs(&q, false, take, user, error) : status;
}

ebpo_status ebpo_collide_self(ebpo_collider *c, const ebpo_collide_options *options,
                              ebpo_pairs_fn take, void *user, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_collision q;
    ebpo_collide_options here = EBPO_COLLIDE_OPTIONS_INIT;
    if (c->model[0] != c->model[1])
        return ebpo_fail(error, EBPO_E_ARGUMENT, "one model with itself: the collider has two");
    ebpo_status status = ebpo_collision_begin(&q, c, options, error);
    if (status != EBPO_OK)
        return status;
    here.deadline_ns = q.options.deadline_ns;
    here.progress = q.options.progress;
    return ebpo_collide_self_posed(c, &here, take, user, error);
}

ebpo_status ebpo_collide_self_posed(ebpo_collider *c, const ebpo_collide_options *options,
                                    ebpo_pairs_fn take, void *user, ebpo_error *error)
{
    ebpo_collision q;
    ebpo_status status = ebpo_collision_begin(&q, c, options, error);
    return status == EBPO_OK ? all_pairs(&q, true, take, user, error) : status;
}
