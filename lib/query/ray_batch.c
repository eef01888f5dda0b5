/* Many rays: pieces of them on all cores, each thread with a context of its own. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "core/sized.h"
#include "query/load_ahead.h"
#include "query/query_model.h"
#include "query/ray_walk.h"

/* Rays that a thread takes at a time; of a model that is not all in memory more, which are
 * neighbours on the curve. */
enum { PIECE = 128, PIECE_ALONG_CURVE = 1024 };

/* Where the hits of a ray are, before they are put together. */
typedef struct found {
    unsigned worker;
    uint64_t begin, end;
} found;

typedef struct batch {
    const ebpo_ray *rays;
    uint64_t count;
    ebpo_ray_options options;
    ebpo_ray_wants wants;
    unsigned threads;
    ebpo_context **context; /* [threads] the first one is the caller's */
    uint64_t *held;         /* [threads] hits in these, if all are wanted */
    double *entry;          /* [count][3] in the order of work; NULL: the rays' own order */
    uint64_t *order;        /* [count] */
    /* [count] each: one of these */
    ebpo_ray_hit *first;
    bool *any;
    found *all;
} batch;

/* --- one ray --- */

static ebpo_status answer(batch *b, uint64_t i, unsigned worker, ebpo_error *error)
{
    ebpo_casting c;
    const ebpo_ray *r = &b->rays[i];
    ebpo_casting_begin(&c, b->context[worker], r->origin, r->direction, r->t_max, b->wants,
                       b->options.sides);
    ebpo_status status = ebpo_ray_walk(&c, error);
    if (status != EBPO_OK)
        return status;
    if (b->wants == EBPO_WANTS_FIRST)
        b->first[i] = c.count ? ebpo_hit_of(&c.first) : (ebpo_ray_hit){ INFINITY, EBPO_NO_FACE, 0 };
    else if (b->wants == EBPO_WANTS_ANY)
        b->any[i] = c.count;
    else {
        found f = { .worker = worker, .begin = b->held[worker] };
        status = ebpo_casting_sort(&c, f.begin, &f.end, error);
        b->held[worker] = f.end;
        b->all[i] = f;
    }
    return status;
}

static ebpo_status answer_piece(void *user, uint64_t begin, uint64_t end, unsigned worker,
                                ebpo_error *error)
{
    batch *b = user;
    ebpo_status status = EBPO_OK;
    ebpo_batch along = { .count = 0 };
    if (b->order)
        ebpo_batch_begin(&along, b->context[worker], b->entry + 3 * begin, end - begin, false);
    for (uint64_t i = 0; i < end - begin && status == EBPO_OK; i++) {
        uint64_t k = begin + (b->order ? ebpo_batch_next(&along, i) : i);
        status = answer(b, b->order ? b->order[k] : k, worker, error);
    }
    ebpo_batch_end(&along);
    return status;
}

/* --- the order of work --- */

/* About where the ray comes to the box; its own beginning where that is inside, or it misses. */
static void entry_of(const ebpo_box *box, const ebpo_ray *ray, double out[3])
{
    double from = 0;
    for (int k = 0; k < 3; k++) {
        double low = box->origin[k], high = low + box->size[k],
               t = ((ray->direction[k] > 0 ? low : high) - ray->origin[k]) / ray->direction[k];
        from = t > from && t <= ray->t_max ? t : from;
    }
    for (int k = 0; k < 3; k++) {
        double low = box->origin[k], x = ray->origin[k] + from * ray->direction[k];
        out[k] = x > low ? fmin(x, low + box->size[k]) : low;
    }
}

/* Where there is no room for an order, rays are followed as they come. */
static void put_in_order(batch *b, const ebpo_model *m)
{
    ebpo_box box = ebpo_model_box(m);
    double *entry = ebpo_alloc(b->count, 3 * sizeof *entry);
    b->entry = ebpo_alloc(b->count, 3 * sizeof *entry);
    for (uint64_t i = 0; entry && i < b->count; i++)
        entry_of(&box, &b->rays[i], entry + 3 * i);
    if (entry && b->entry)
        b->order = ebpo_curve_order(&box, entry, b->count);
    for (uint64_t i = 0; b->order && i < b->count; i++)
        memcpy(b->entry + 3 * i, entry + 3 * b->order[i], 3 * sizeof *entry);
    free(entry);
}

/* --- all of them --- */

static ebpo_segment segment_of(const ebpo_ray *r)
{
    ebpo_segment s = { .t_max = r->t_max };
    memcpy(s.origin, r->origin, sizeof s.origin);
    memcpy(s.direction, r->direction, sizeof s.direction);
    return s;
}

static ebpo_status check_rays(const batch *b, const ebpo_model *m, ebpo_error *error)
{
    for (uint64_t i = 0; i < b->count; i++) {
        ebpo_segment ray = segment_of(&b->rays[i]);
        const char *fault = ebpo_ray_fault(&ray);
        if (fault)
            return ebpo_fail(error, EBPO_E_ARGUMENT, "ray %" PRIu64 " %s", i, fault);
    }
    return ebpo_check_mesh(m, error);
}

static ebpo_status make_contexts(batch *b, ebpo_context *own, ebpo_error *error)
{
    b->context = ebpo_alloc_zero(b->threads, sizeof *b->context);
    b->held = ebpo_alloc_zero(b->threads, sizeof *b->held);
    if (!b->context || !b->held)
        return ebpo_fail_memory(error, b->threads * sizeof *b->context);
    b->context[0] = own;
    ebpo_status status = EBPO_OK;
    for (unsigned i = 1; i < b->threads && status == EBPO_OK; i++)
        status = ebpo_context_new(own->model, &b->context[i], error);
    return status;
}

static void clear(batch *b)
{
    for (unsigned i = 1; b->context && i < b->threads; i++)
        ebpo_context_free(b->context[i]);
    free(b->context);
    free(b->held);
    free(b->entry);
    free(b->order);
    free(b->all);
}

static ebpo_status answer_all(batch *b, ebpo_context *context, const ebpo_ray_options *options,
                              ebpo_error *error)
{
    const ebpo_model *m = context->model;
    b->options = (ebpo_ray_options)EBPO_RAY_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_ray_options, &b->options, options, error);
    if (status == EBPO_OK && b->options.sides > EBPO_RAY_BACK)
        status = ebpo_fail_value(error);
    if (status == EBPO_OK)
        status = check_rays(b, m, error);
    if (status != EBPO_OK || b->count == 0)
        return status;
    bool shared = m->whole || m->options.loading == EBPO_LOAD_CACHE;
    if (!m->whole && shared && b->count > 1)
        put_in_order(b, m);
    uint64_t piece = b->order ? PIECE_ALONG_CURVE : PIECE, pieces = (b->count - 1) / piece + 1;
    b->threads = shared ? ebpo_thread_count(b->options.threads) : 1;
    if (b->threads > pieces)
        b->threads = (unsigned)pieces;
    status = make_contexts(b, context, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(b->threads, NULL, b->count, piece, answer_piece, b, NULL, NULL,
                                   error);
    return status;
}

ebpo_status ebpo_ray_first_many(ebpo_context *context, const ebpo_ray *rays, uint64_t count,
                                const ebpo_ray_options *options, ebpo_ray_hit *out,
                                ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    batch b = { .rays = rays, .count = count, .wants = EBPO_WANTS_FIRST, .first = out };
    ebpo_status status = answer_all(&b, context, options, error);
    clear(&b);
    return status;
}

ebpo_status ebpo_ray_any_many(ebpo_context *context, const ebpo_ray *rays, uint64_t count,
                              const ebpo_ray_options *options, bool *any, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    batch b = { .rays = rays, .count = count, .wants = EBPO_WANTS_ANY, .any = any };
    ebpo_status status = answer_all(&b, context, options, error);
    clear(&b);
    return status;
}

/* Puts the hits together in the order of the rays, in the caller's context. */
static ebpo_status gather(const batch *b, ebpo_context *context, ebpo_error *error)
{
    uint64_t total = 0;
    if (!ebpo_grow(&context->hit_begin, &context->hit_begin_capacity, b->count + 1,
                   sizeof *context->hit_begin))
        return ebpo_fail_memory(error, (b->count + 1) * sizeof *context->hit_begin);
    for (uint64_t i = 0; i < b->count; i++) {
        context->hit_begin[i] = total;
        total += b->all[i].end - b->all[i].begin;
    }
    context->hit_begin[b->count] = total;
    ebpo_ray_hit *hits = ebpo_alloc(total, sizeof *hits);
    if (!hits)
        return ebpo_fail_memory(error, total * sizeof *hits);
    for (uint64_t i = 0; i < b->count; i++) {
        const found *f = &b->all[i];
        if (f->end > f->begin)
            memcpy(hits + context->hit_begin[i], b->context[f->worker]->hits + f->begin,
                   (f->end - f->begin) * sizeof *hits);
    }
    free(context->hits);
    context->hits = hits;
    context->hit_capacity = total;
    return EBPO_OK;
}

ebpo_status ebpo_ray_all_many(ebpo_context *context, const ebpo_ray *rays, uint64_t count,
                              const ebpo_ray_options *options, const ebpo_ray_hit **hits,
                              const uint64_t **begin, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    batch b = { .rays = rays, .count = count, .wants = EBPO_WANTS_ALL };
    *hits = NULL;
    *begin = NULL;
    b.all = ebpo_alloc(count, sizeof *b.all);
    ebpo_status status = b.all ? answer_all(&b, context, options, error)
                               : ebpo_fail_memory(error, count * sizeof *b.all);
    if (status == EBPO_OK)
        status = gather(&b, context, error);
    if (status == EBPO_OK) {
        *hits = context->hits;
        *begin = context->hit_begin;
    }
    clear(&b);
    return status;
}
