/* The broad phase: sweep and prune along the axis on which boxes are spread most. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "extras/scene/scene_parts.h"

/* 400 MB while they are sorted. */
static const uint64_t most_pairs = UINT64_C(1) << 23;

typedef struct box {
    double min[3], max[3];
    uint64_t instance;
} box;

typedef struct sweep {
    const ebpo_scene *scene;
    box *boxes;
    uint64_t count;
    double clearance; /* the greatest of any rule */
    SCENE_LIST(ebpo_scene_pair, pairs);
} sweep;

static ebpo_status make_boxes(sweep *s, double from, double to, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < s->count && status == EBPO_OK; i++) {
        box *b = &s->boxes[i];
        b->instance = i;
        status = ebpo_scene_instance_box(s->scene, i, from, to, b->min, b->max, error);
    }
    return status;
}

/* The axis of which least is overlapped by chance: boxes' sizes beside the size of all. */
static int best_axis(const sweep *s)
{
    int best = 0;
    double least = INFINITY;
    for (int k = 0; k < 3; k++) {
        double low = INFINITY, high = -INFINITY, sizes = 0;
        for (uint64_t i = 0; i < s->count; i++) {
            low = fmin(low, s->boxes[i].min[k]);
            high = fmax(high, s->boxes[i].max[k]);
            sizes += s->boxes[i].max[k] - s->boxes[i].min[k];
        }
        double share = sizes / (high - low);
        if (share < least) {
            least = share;
            best = k;
        }
    }
    return best;
}

/* The comparison's axis goes first in each box while they are sorted and swept. */
static void turn_axis(sweep *s, int axis)
{
    for (uint64_t i = 0; i < s->count; i++) {
        box *b = &s->boxes[i];
        double low = b->min[0], high = b->max[0];
        b->min[0] = b->min[axis];
        b->max[0] = b->max[axis];
        b->min[axis] = low;
        b->max[axis] = high;
    }
}

static int compare_boxes(const void *a, const void *b)
{
    const box *x = a, *y = b;
    if (x->min[0] != y->min[0])
        return x->min[0] < y->min[0] ? -1 : 1;
    return (x->instance > y->instance) - (x->instance < y->instance);
}

/* At most `by` apart on each axis, errs towards true: what differences lose is added. */
static bool near_each_other(const box *x, const box *y, double by)
{
    for (int k = 0; k < 3; k++) {
        double gap = fmax(x->min[k] - y->max[k], y->min[k] - x->max[k]);
        if (gap > by + fabs(gap) * 0x1p-50)
            return false;
    }
    return true;
}

static ebpo_status take_pair(sweep *s, const box *x, const box *y, ebpo_error *error)
{
    ebpo_scene_pair pair = { x->instance, y->instance, 0 };
    if (pair.a > pair.b)
        pair = (ebpo_scene_pair){ pair.b, pair.a, 0 };
    if (!ebpo_scene_pair_rule(s->scene, pair.a, pair.b, &pair.clearance) ||
        !near_each_other(x, y, pair.clearance))
        return EBPO_OK;
    if (s->pairs_count == most_pairs)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "more than %" PRIu64 " pairs of instances come near each other: place "
                         "fewer at one place, have pairs ignored, or ask for a shorter time",
                         most_pairs);
    if (!ebpo_grow(&s->pairs, &s->pairs_capacity, s->pairs_count + 1, sizeof pair))
        return ebpo_fail_memory(error, (s->pairs_count + 1) * sizeof pair);
    s->pairs[s->pairs_count++] = pair;
    return EBPO_OK;
}

static ebpo_status sweep_boxes(sweep *s, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < s->count; i++) {
        const box *x = &s->boxes[i];
        for (uint64_t j = i + 1; j < s->count && status == EBPO_OK; j++) {
            const box *y = &s->boxes[j];
            double gap = y->min[0] - x->max[0];
            if (gap > s->clearance + fabs(gap) * 0x1p-50)
                break;
            if (near_each_other(x, y, s->clearance))
                status = take_pair(s, x, y, error);
        }
    }
    return status;
}

static int compare_pairs(const void *a, const void *b)
{
    const ebpo_scene_pair *x = a, *y = b;
    if (x->a != y->a)
        return x->a < y->a ? -1 : 1;
    return (x->b > y->b) - (x->b < y->b);
}

static double greatest_clearance(const ebpo_scene *scene)
{
    double most = 0;
    for (uint64_t i = 0; i < scene->rules_count; i++)
        most = fmax(most, scene->rules[i].clearance);
    return most;
}

ebpo_status ebpo_scene_pairs(const ebpo_scene *scene, double from, double to,
                             ebpo_scene_pairs_fn take, void *user, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    if (!(isfinite(from) && isfinite(to) && from <= to))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "there is no time from %g to %g", from, to);
    sweep s = { .scene = scene,
                .count = scene->instances_count,
                .clearance = greatest_clearance(scene) };
    s.boxes = ebpo_alloc(s.count, sizeof *s.boxes);
    ebpo_status status =
        s.boxes ? make_boxes(&s, from, to, error) : ebpo_fail_memory(error, s.count * sizeof(box));
    if (status == EBPO_OK && s.count) {
        turn_axis(&s, best_axis(&s));
        qsort(s.boxes, s.count, sizeof *s.boxes, compare_boxes);
        status = sweep_boxes(&s, error);
    }
    free(s.boxes);
    if (status == EBPO_OK && s.pairs_count) {
        qsort(s.pairs, s.pairs_count, sizeof *s.pairs, compare_pairs);
        (void)take(user, s.pairs, s.pairs_count);
    }
    free(s.pairs);
    return status;
}
