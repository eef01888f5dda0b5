/* Points of a stroke are looked at in batches, on all cores; what each reaches is kept until it is
 * asked for. */
#include "core/strict_fp.h"

#include "extras/paint/reached.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "extras/paint/paint_reach.h"
#include "query/query_model.h"

/* Points that are looked at together: so many, or fewer when they reach so many faces already. */
enum { TOGETHER = 1024, FACES_TOGETHER = 1 << 20, GRAIN = 8 };

/* Of a budget, for each thread: more of them load what the others have just dropped. */
enum { THREAD_ROOM = 1 << 20 };

typedef struct found {
    ebpo_reached_face *face;
    uint64_t count, capacity;
    bool done, here;
} found;

struct ebpo_reacher {
    const ebpo_paint *p;
    unsigned threads;
    ebpo_reach *reach; /* one for each worker */
    found found[TOGETHER];
    uint32_t stroke, first, count; /* of the points at hand */
    atomic_uint_least64_t faces;
};

static ebpo_status keep(found *f, const ebpo_reach *reach, ebpo_error *error)
{
    f->count = 0;
    if (!f->here)
        return EBPO_OK;
    if (!ebpo_grow(&f->face, &f->capacity, reach->count, sizeof *f->face))
        return ebpo_fail_memory(error, reach->count * sizeof *f->face);
    for (uint64_t k = 0; k < reach->count; k++) {
        ebpo_reached_face *one = &f->face[f->count++];
        one->face = reach->face[k].face;
        memcpy(one->within, reach->face[k].within, sizeof one->within);
    }
    return EBPO_OK;
}

/* What is not done as there are too many faces already is asked for again; never the first. */
static ebpo_status find_some(void *context, uint64_t begin, uint64_t end, unsigned worker,
                             ebpo_error *error)
{
    ebpo_reacher *r = context;
    ebpo_reach *reach = &r->reach[worker];
    ebpo_status status = EBPO_OK;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++) {
        found *f = &r->found[i];
        if (i > 0 && atomic_load(&r->faces) > FACES_TOGETHER)
            break;
        status = ebpo_paint_reach(reach, r->p, r->stroke, r->first + (uint32_t)i, &f->here, error);
        if (status == EBPO_OK)
            status = keep(f, reach, error);
        atomic_fetch_add(&r->faces, f->count);
        f->done = status == EBPO_OK;
    }
    ebpo_context_let_go(reach->context); /* who waits here shall not keep others from room */
    return status;
}

/* Large reaches are freed again: what is kept for all of them is bounded. */
static void begin_batch(ebpo_reacher *r, uint32_t stroke, uint32_t i)
{
    uint32_t left = r->p->stroke[stroke].count - i;
    r->stroke = stroke;
    r->first = i;
    r->count = left < TOGETHER ? left : TOGETHER;
    atomic_store(&r->faces, 0);
    for (uint32_t k = 0; k < TOGETHER; k++) {
        found *f = &r->found[k];
        if (f->capacity > FACES_TOGETHER / TOGETHER) {
            free(f->face);
            f->face = NULL;
            f->capacity = 0;
        }
        f->done = false;
        f->count = 0;
    }
}

ebpo_status ebpo_reacher_find(ebpo_reacher *r, uint32_t stroke, uint32_t i, ebpo_reached *out,
                              ebpo_error *error)
{
    bool among = stroke == r->stroke && i >= r->first && i - r->first < r->count;
    if (!among || !r->found[i - r->first].done) {
        begin_batch(r, stroke, i);
        ebpo_status status =
            ebpo_parallel_for(r->threads, NULL, r->count, GRAIN, find_some, r, NULL, "", error);
        if (status != EBPO_OK)
            return status;
    }
    const found *f = &r->found[i - r->first];
    *out = (ebpo_reached){ f->face, f->count, f->here };
    return EBPO_OK;
}

ebpo_status ebpo_reacher_new(const ebpo_paint *p, ebpo_context *context, unsigned threads,
                             ebpo_reacher **out, ebpo_error *error)
{
    ebpo_reacher *r = *out = ebpo_alloc_zero(1, sizeof *r);
    if (!r)
        return ebpo_fail_memory(error, sizeof *r);
    r->p = p;
    uint64_t most = p->point_count / GRAIN + 1, memory = context->model->options.memory;
    if (memory && memory / THREAD_ROOM < most)
        most = memory / THREAD_ROOM + 1;
    r->threads = ebpo_thread_count(threads);
    r->threads = r->threads < most ? r->threads : (unsigned)most;
    ebpo_status status = EBPO_OK;
    r->reach = ebpo_alloc_zero(r->threads, sizeof *r->reach);
    if (!r->reach)
        status = ebpo_fail_memory(error, r->threads * sizeof *r->reach);
    for (unsigned t = 0; t < r->threads && status == EBPO_OK; t++) {
        ebpo_context *own = context;
        if (t > 0)
            status = ebpo_context_new(context->model, &own, error);
        if (status == EBPO_OK)
            ebpo_reach_begin(&r->reach[t], own);
    }
    if (status != EBPO_OK) {
        ebpo_reacher_free(r);
        *out = NULL;
    }
    return status;
}

void ebpo_reacher_free(ebpo_reacher *r)
{
    if (!r)
        return;
    for (unsigned t = 0; r->reach && t < r->threads; t++) {
        ebpo_context *own = r->reach[t].context;
        if (!own)
            break;
        ebpo_reach_end(&r->reach[t]);
        if (t > 0)
            ebpo_context_free(own);
    }
    for (uint32_t k = 0; k < TOGETHER; k++)
        free(r->found[k].face);
    free(r->reach);
    free(r);
}
