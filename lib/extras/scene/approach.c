/* When instances first come near each other: between two looks nothing is missed, for the way that
 * both can go in the time between is shorter than what is between them. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/scene/left_out.h"
#include "extras/scene/pair_looks.h"

typedef struct travel {
    const ebpo_scene *scene;
    ebpo_scene_way_options how;
    double from, to;
    scene_pairs_list list;
    ebpo_scene_way *ways;
} travel;

/* The next time to look: until then the way is shorter than `gap`; w->time where there is none. */
static ebpo_status next_look(const travel *t, const scene_looks *looks, const ebpo_scene_way *w,
                             double gap, double *next, ebpo_error *error)
{
    double low = w->time, high = t->to, at = high, length = 0;
    ebpo_status status = scene_looks_motion(looks, low, at, &length, error);
    if (status != EBPO_OK || length < gap) {
        *next = at;
        return status;
    }
    /* halved until it fits, then a little longer again */
    for (int n = 0; n < 70 && status == EBPO_OK && (low == w->time || n < 8); n++) {
        at = low + (high - low) / 2;
        status = scene_looks_motion(looks, w->time, at, &length, error);
        if (length < gap)
            low = at;
        else
            high = at;
    }
    *next = low;
    return status;
}

/* Past a jump. *next stays where nothing jumps: there rounding alone may be longer than the gap,
 * however short the time. */
static ebpo_status jump(const scene_looks *looks, const ebpo_scene_way *w, double *next,
                        ebpo_error *error)
{
    double length, at = nextafter(w->time, INFINITY);
    ebpo_status status = scene_looks_motion(looks, w->time, at, &length, error);
    if (status == EBPO_OK && length == INFINITY)
        *next = at;
    return status;
}

static bool is_reached(const travel *t, const ebpo_scene_way *w)
{
    return scene_is_within(w->hi, w->clearance, t->how.tolerance);
}

static ebpo_status look(const travel *t, scene_looks *looks, ebpo_scene_way *w, ebpo_error *error)
{
    ebpo_status status = scene_look(looks, w->time, &w->lo, &w->hi, error);
    w->looks++;
    if (status != EBPO_OK || is_reached(t, w) || looks->gap > w->clearance)
        return status;
    return scene_lacks(t->scene, looks->pair, looks->lacking, w->time, false, error);
}

static ebpo_status go(const travel *t, scene_looks *looks, ebpo_scene_way *w, ebpo_error *error)
{
    for (;;) {
        double next;
        ebpo_status status = look(t, looks, w, error);
        if (status != EBPO_OK)
            return status;
        w->reached = is_reached(t, w);
        if (w->reached || w->time >= t->to)
            return EBPO_OK;
        status = next_look(t, looks, w, w->lo - w->clearance, &next, error);
        if (status == EBPO_OK && !(next > w->time))
            status = jump(looks, w, &next, error);
        if (status != EBPO_OK)
            return status;
        if (w->looks >= t->how.most_looks || !(next > w->time)) {
            w->reached = -1;
            return EBPO_OK;
        }
        w->time = next;
    }
}

static ebpo_status go_pairs(void *context, uint64_t begin, uint64_t end, unsigned worker,
                            ebpo_error *error)
{
    const travel *t = context;
    ebpo_status status = EBPO_OK;
    (void)worker;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++) {
        const ebpo_scene_pair *pair = &t->list.pairs[i];
        scene_looks looks;
        t->ways[i] = (ebpo_scene_way){
            .a = pair->a, .b = pair->b, .time = t->from, .clearance = pair->clearance
        };
        status = scene_looks_begin(&looks, t->scene, pair, t->how.tolerance, error);
        if (status == EBPO_OK)
            status = go(t, &looks, &t->ways[i], error);
        ebpo_collider_free(looks.collider);
    }
    return status;
}

ebpo_status ebpo_scene_approach(ebpo_scene *scene, double from, double to,
                                const ebpo_scene_way_options *options, ebpo_scene_ways_fn take,
                                void *user, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    travel t = { .scene = scene, .how = EBPO_SCENE_WAY_OPTIONS_INIT, .from = from, .to = to };
    ebpo_status status = scene_take_way_options(&t.how, options, error);
    if (status == EBPO_OK)
        status = scene_list_pairs(scene, from, to, &t.list, error);
    t.ways = ebpo_alloc(t.list.count, sizeof *t.ways);
    if (status == EBPO_OK && !t.ways)
        status = ebpo_fail_memory(error, t.list.count * sizeof *t.ways);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(ebpo_thread_count(t.how.threads), NULL, t.list.count, 1,
                                   go_pairs, &t, &t.how.progress, "following routes", error);
    if (status == EBPO_OK && t.list.count)
        (void)take(user, t.ways, t.list.count);
    free(t.list.pairs);
    free(t.ways);
    return status;
}
