#include "core/strict_fp.h"

#include "extras/collide/subtree_walk.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"

ebpo_status ebpo_subtree_walk_begin(ebpo_subtree_walk *w, const ebpo_collision *question, bool self,
                                    ebpo_error *error)
{
    w->question = question;
    w->self = self;
    for (int i = 0; i < 2; i++)
        if (!question->model[i]->whole && !w->context[i]) {
            ebpo_status status = ebpo_context_new(question->model[i], &w->context[i], error);
            if (status != EBPO_OK)
                return status;
        }
    return EBPO_OK;
}

uint64_t ebpo_subtree_walk_loads(const ebpo_subtree_walk *w)
{
    uint64_t loads = 0;
    for (int i = 0; i < 2; i++)
        loads += w->context[i] ? w->context[i]->loaded : 0;
    return loads;
}

void ebpo_subtree_walk_let_go(ebpo_subtree_walk *w)
{
    for (int i = 0; i < 2; i++)
        ebpo_context_let_go(w->context[i]);
}

void ebpo_subtree_walk_free(ebpo_subtree_walk *w)
{
    for (int i = 0; i < 2; i++)
        ebpo_context_free(w->context[i]);
    ebpo_pair_walk_free(&w->walk);
    free(w->told);
}

int ebpo_told_pair_compare(const void *x, const void *y)
{
    const ebpo_told_pair *p = x, *q = y;
    if (p->file[0] != q->file[0])
        return p->file[0] < q->file[0] ? -1 : 1;
    return (p->file[1] > q->file[1]) - (p->file[1] < q->file[1]);
}

ebpo_face_pair ebpo_told_pair_tell(const ebpo_collision *q, const ebpo_told_pair *t)
{
    int a = q->turned, b = !q->turned;
    return (ebpo_face_pair){ t->source[a], t->source[b], t->file[a], t->file[b], t->kind, 0 };
}

/* --- one pair --- */

static ebpo_status load(ebpo_subtree_walk *w, int side, uint32_t number, const ebpo_accel **out,
                        ebpo_error *error)
{
    ebpo_accel *loaded = w->question->model[side]->whole;
    ebpo_status status =
        loaded ? EBPO_OK : ebpo_context_subtree(w->context[side], number, &loaded, error);
    *out = loaded;
    return status;
}

static ebpo_status tell(ebpo_subtree_walk *w, const ebpo_accel *const accel[2], ebpo_error *error)
{
    const ebpo_pair_walk *found = &w->walk;
    if (!ebpo_grow(&w->told, &w->capacity, found->met_count, sizeof *w->told))
        return ebpo_fail_memory(error, found->met_count * sizeof *w->told);
    for (uint64_t i = 0; i < found->met_count; i++) {
        uint32_t local[2] = { found->met[i].a, found->met[i].b };
        ebpo_told_pair t = { .kind = found->met[i].kind };
        for (int side = 0; side < 2; side++) {
            t.file[side] = (uint32_t)ebpo_accel_file_face(accel[side], local[side]);
            t.source[side] = (uint32_t)ebpo_accel_source_face(accel[side], local[side]);
        }
        if (w->self && t.file[0] == t.file[1])
            continue;
        if (w->self && t.file[0] > t.file[1])
            t = (ebpo_told_pair){ { t.file[1], t.file[0] }, { t.source[1], t.source[0] }, t.kind };
        w->told[w->count++] = t;
    }
    return EBPO_OK;
}

static ebpo_status no_memory(const ebpo_pair_walk *w, ebpo_error *error)
{
    return ebpo_fail_memory(error, (w->capacity + 64) * sizeof *w->stack);
}

static ebpo_status walk_down(ebpo_subtree_walk *w, const ebpo_accel *const accel[2],
                             ebpo_error *error)
{
    const ebpo_collision *q = w->question;
    const ebpo_block_posing *posing[2] = { &q->posing[0], &q->posing[1] };
    ebpo_accel_pair pair;
    ebpo_pair_walk *down = &w->walk;
    ebpo_accel_pair_make(&pair, accel, posing, q->reach);
    if (pair.apart)
        return EBPO_OK;
    ebpo_pair_walk_begin(down, &pair);
    down->first = false;
    down->neighbours = w->self;
    down->self = w->self && accel[0] == accel[1];
    if (!down->kernels->start(down))
        return no_memory(down, error);
    while (down->top > 0) {
        if (!down->kernels->run(down, EBPO_WALK_PAIRS))
            return no_memory(down, error);
        if ((w->late = ebpo_collision_is_late(q)))
            return EBPO_OK;
    }
    return tell(w, accel, error);
}

ebpo_status ebpo_subtree_walk_pair(ebpo_subtree_walk *w, const ebpo_subtree_pair *pair,
                                   ebpo_error *error)
{
    const ebpo_accel *accel[2];
    w->count = 0;
    ebpo_status status = load(w, 0, pair->a, &accel[0], error);
    if (status == EBPO_OK && w->self && pair->a == pair->b)
        accel[1] = accel[0];
    else if (status == EBPO_OK)
        status = load(w, 1, pair->b, &accel[1], error);
    if (status != EBPO_OK)
        return status;
    w->first_end = accel[0]->first_face + (accel[0]->face_count - accel[0]->outer_count);
    if (accel[0]->bound_count == 0 || accel[1]->bound_count == 0)
        return EBPO_OK;
    return walk_down(w, accel, error);
}
