/* Computes the broad phase of a scene: finds the pairs of instances that may come near each other
 * in an interval of time.
 *
 * Rules select the pairs and their clearances. If several rules apply to a pair, the greatest
 * clearance counts; a rule that ignores the pair overrides all others.
 *
 * The box of an instance contains the instance at all times of the interval. The time between two
 * keys is divided into steps of little rotation. The boxes at both ends of a step are widened by
 * the greatest distance of the motion from a straight line.
 *
 * Sweep and prune sorts boxes along the axis with the least expected overlap. Pairs are returned in
 * the order of their instances. If rounding makes a test uncertain, the pair is returned. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "extras/scene/scene_parts.h"

static int compare_rules(const void *a, const void *b)
{
    const ebpo_scene_rule_entry *x = a, *y = b;
    if (x->a != y->a)
        return x->a < y->a ? -1 : 1;
    return (x->b > y->b) - (x->b < y->b);
}

static int compare_sets(const void *a, const void *b)
{
    const uint64_t *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

/* Sorts the instance's sets in ascending order and removes duplicates. */
static void sort_sets(ebpo_scene_instance_entry *i)
{
    uint32_t kept = 0;
    if (i->set_count)
        qsort(i->sets, i->set_count, sizeof *i->sets, compare_sets);
    for (uint32_t k = 0; k < i->set_count; k++)
        if (!kept || i->sets[kept - 1] != i->sets[k])
            i->sets[kept++] = i->sets[k];
    i->set_count = kept;
}

/* Merges the rules for each pair of sets into one rule. The merged rule has the greatest
 * clearance of these rules, or ignores pairs if one of these rules does. */
void ebpo_scene_sort_rules(ebpo_scene *scene)
{
    uint64_t kept = 0;
    if (scene->rules_count)
        qsort(scene->rules, scene->rules_count, sizeof *scene->rules, compare_rules);
    for (uint64_t i = 0; i < scene->rules_count; i++) {
        ebpo_scene_rule_entry rule = scene->rules[i];
        ebpo_scene_rule_entry *last = kept ? &scene->rules[kept - 1] : NULL;
        if (last && last->a == rule.a && last->b == rule.b)
            last->clearance = last->clearance < 0 || rule.clearance < 0
                                  ? -1
                                  : fmax(last->clearance, rule.clearance);
        else
            scene->rules[kept++] = rule;
    }
    scene->rules_count = kept;
    for (uint64_t i = 0; i < scene->instances_count; i++)
        sort_sets(&scene->instances[i]);
}

/* Returns the clearance of the rule for two sets: below 0 if it ignores pairs, 0 if there is no
 * rule. */
static double rule_of(const ebpo_scene *scene, uint64_t a, uint64_t b)
{
    ebpo_scene_rule_entry wanted = { a < b ? a : b, a < b ? b : a, 0 };
    const ebpo_scene_rule_entry *rule =
        bsearch(&wanted, scene->rules, scene->rules_count, sizeof *scene->rules, compare_rules);
    return rule ? rule->clearance : 0;
}

/* Applies the clearance of one rule to the clearance of a pair: the pair gets the greater
 * clearance. Returns false if the rule ignores the pair. */
static bool apply_rule(double rule_clearance, double *pair_clearance)
{
    *pair_clearance = fmax(*pair_clearance, rule_clearance);
    return rule_clearance >= 0;
}

/* Applies all rules for a set of x and a set of y, by looking up the rule of each pair of sets.
 * Returns false if a rule ignores the pair. */
static bool apply_rules_by_sets(const ebpo_scene *scene, const ebpo_scene_instance_entry *x,
                                const ebpo_scene_instance_entry *y, double *clearance)
{
    for (uint32_t i = 0; i < x->set_count; i++)
        for (uint32_t k = 0; k < y->set_count; k++)
            if (!apply_rule(rule_of(scene, x->sets[i], y->sets[k]), clearance))
                return false;
    return true;
}

static bool is_in(const ebpo_scene_instance_entry *i, uint64_t set)
{
    return bsearch(&set, i->sets, i->set_count, sizeof set, compare_sets) != NULL;
}

/* Does the same as apply_rules_by_sets, by testing each rule of the scene. */
static bool test_all_rules(const ebpo_scene *scene, const ebpo_scene_instance_entry *x,
                           const ebpo_scene_instance_entry *y, double *clearance)
{
    for (uint64_t i = 0; i < scene->rules_count; i++) {
        const ebpo_scene_rule_entry *r = &scene->rules[i];
        if (((is_in(x, r->a) && is_in(y, r->b)) || (is_in(x, r->b) && is_in(y, r->a))) &&
            !apply_rule(r->clearance, clearance))
            return false;
    }
    return true;
}

bool ebpo_scene_pair_rule(const ebpo_scene *scene, uint64_t a, uint64_t b, double *clearance)
{
    *clearance = 0;
    if (a == b || a >= scene->instances_count || b >= scene->instances_count)
        return false;
    const ebpo_scene_instance_entry *x = &scene->instances[a], *y = &scene->instances[b];
    if (x->description.fixed && y->description.fixed)
        return false;
    /* Use the faster way. Instances with 100,000 groups each have so many pairs of groups that
     * looking up their rules would take hours. */
    bool fewer_rules = scene->rules_count < (uint64_t)x->set_count * y->set_count;
    return (fewer_rules ? test_all_rules : apply_rules_by_sets)(scene, x, y, clearance);
}

/* --- poses, boxes and motion --- */

/* Relative margin for sums of a few products, far greater than their rounding errors. */
static const double slack = 0x1p-44;
/* Greatest rotation in a step of box_between, in radians. A step rotates further only if the
 * greatest number of steps does not suffice. */
static const double step_angle = 0.125;

static const ebpo_scene_route *route_of(const ebpo_scene *scene, const ebpo_scene_instance_entry *i)
{
    return i->description.route == EBPO_SCENE_NONE ? NULL : &scene->routes[i->description.route];
}

static void pose_at(const ebpo_scene *scene, const ebpo_scene_instance_entry *i, double time,
                    ebpo_pose *out)
{
    const ebpo_scene_route *route = route_of(scene, i);
    ebpo_pose moved;
    *out = i->description.pose;
    if (!route)
        return;
    ebpo_scene_route_at(route, time, &moved);
    ebpo_scene_compose(&moved, &i->description.pose, out);
}

static ebpo_status check_time(const ebpo_scene *scene, uint64_t instance, double from, double to,
                              ebpo_error *error)
{
    if (instance >= scene->instances_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "there is no instance %llu",
                         (unsigned long long)instance);
    if (!(isfinite(from) && isfinite(to) && from <= to))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "%g to %g is not an interval of time", from, to);
    return EBPO_OK;
}

static ebpo_status check_loaded(const ebpo_scene *scene, uint64_t instance, double from, double to,
                                ebpo_error *error)
{
    ebpo_status status = check_time(scene, instance, from, to, error);
    if (status != EBPO_OK)
        return status;
    const ebpo_scene_model_entry *m = &scene->models[scene->instances[instance].description.model];
    return m->file != EBPO_SCENE_NONE
               ? EBPO_OK
               : ebpo_fail(error, EBPO_E_ARGUMENT, "model '%.80s' has not been loaded", m->name);
}

ebpo_status ebpo_scene_pose(const ebpo_scene *scene, uint64_t instance, double time, ebpo_pose *out,
                            ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_status status = check_time(scene, instance, time, time, error);
    if (status == EBPO_OK)
        pose_at(scene, &scene->instances[instance], time, out);
    return status;
}

/* Computes a box of the posed vertices, including rounding. */
static void posed_box(const ebpo_pose *pose, const ebpo_scene_model_entry *m, double min[3],
                      double max[3])
{
    for (int i = 0; i < 3; i++) {
        double low = 0, high = 0, size = fabs(pose->translation[i]);
        for (int k = 0; k < 3; k++) {
            double f = pose->scale * pose->rotation[i][k], a = f * m->min[k], b = f * m->max[k];
            low += fmin(a, b);
            high += fmax(a, b);
            size += fmax(fabs(a), fabs(b));
        }
        double rounding = size * 0x1p-48 + 0x1p-1000;
        min[i] = low + pose->translation[i] - rounding;
        max[i] = high + pose->translation[i] + rounding;
    }
}

/* Returns x, or `infinite` if x is NaN after an overflow. The box is then unbounded on this side.
 */
static double or_infinite(double x, double infinite) { return isnan(x) ? infinite : x; }

/* Extends the box min .. max so that it contains the box low .. high, enlarged by `distance` on
 * each side. */
static void join_box(double min[3], double max[3], const double low[3], const double high[3],
                     double distance)
{
    for (int k = 0; k < 3; k++) {
        min[k] = fmin(min[k], or_infinite(low[k] - distance, -INFINITY));
        max[k] = fmax(max[k], or_infinite(high[k] + distance, INFINITY));
    }
}

static void empty_box(double min[3], double max[3])
{
    for (int k = 0; k < 3; k++) {
        min[k] = INFINITY;
        max[k] = -INFINITY;
    }
}

ebpo_scene_extent ebpo_scene_extent_of(const ebpo_scene *scene, const ebpo_scene_instance_entry *i)
{
    const ebpo_scene_model_entry *m = &scene->models[i->description.model];
    double min[3], max[3], far[3];
    ebpo_scene_extent extent = { 0, 0 };
    posed_box(&i->description.pose, m, min, max);
    for (int k = 0; k < 3; k++) {
        far[k] = fmax(fabs(min[k]), fabs(max[k]));
        extent.size += fabs(i->description.pose.translation[k]) +
                       i->description.pose.scale * fmax(fabs(m->min[k]), fabs(m->max[k]));
    }
    extent.max_distance = ebpo_scene_length_above(far);
    return extent;
}

/* Extends the box min .. max so that it contains the box of the instance at a time, enlarged by
 * `distance` on each side. */
static void box_at(const ebpo_scene *scene, const ebpo_scene_instance_entry *i, double time,
                   double distance, double min[3], double max[3])
{
    double low[3], high[3];
    ebpo_pose pose;
    pose_at(scene, i, time, &pose);
    posed_box(&pose, &scene->models[i->description.model], low, high);
    join_box(min, max, low, high, distance);
}

/* Extends the box min .. max so that it contains the instance between two times. No key of its
 * route may be between them.
 * The number of steps follows from the angle of rotation, which is estimated from the sag of the
 * whole arc (its greatest distance from a straight line): sag = max_distance * angle^2 / 8. */
static void box_between(const ebpo_scene *scene, const ebpo_scene_instance_entry *i,
                        ebpo_scene_extent extent, double from, double to, double min[3],
                        double max[3])
{
    const ebpo_scene_route *route = route_of(scene, i);
    ebpo_scene_step arc = ebpo_scene_route_step(route, from, to, extent);
    double angle = extent.max_distance > 0 ? sqrt(8 * arc.sag / extent.max_distance) : 0;
    int steps = angle < 32 * step_angle ? 1 + (int)(angle / step_angle) : 32;
    for (int n = 0; n < steps; n++) {
        double begin = n == 0 ? from : from + (to - from) * n / steps;
        double end = n + 1 == steps ? to : from + (to - from) * (n + 1) / steps;
        double sag = ebpo_scene_route_step(route, begin, end, extent).sag;
        box_at(scene, i, begin, sag, min, max);
        box_at(scene, i, end, sag, min, max);
    }
}

/* Extends the box min .. max so that it contains the instance at all times from .. to. */
static void swept_box(const ebpo_scene *scene, const ebpo_scene_instance_entry *i, double from,
                      double to, double min[3], double max[3])
{
    const ebpo_scene_route *route = route_of(scene, i);
    ebpo_scene_extent extent = ebpo_scene_extent_of(scene, i);
    if (!route || from == to) {
        box_at(scene, i, from, 0, min, max);
        return;
    }
    for (double at = from; at < to;) {
        double next = ebpo_scene_route_next(route, at, to);
        box_between(scene, i, extent, at, next, min, max);
        at = next;
    }
}

ebpo_status ebpo_scene_motion(const ebpo_scene *scene, uint64_t instance, double from, double to,
                              double *length, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_status status = check_loaded(scene, instance, from, to, error);
    if (status != EBPO_OK)
        return status;
    const ebpo_scene_instance_entry *i = &scene->instances[instance];
    const ebpo_scene_route *route = route_of(scene, i);
    ebpo_scene_extent extent = ebpo_scene_extent_of(scene, i);
    double sum = 0;
    for (double at = from; route && at < to;) {
        double next = ebpo_scene_route_next(route, at, to);
        sum += ebpo_scene_route_step(route, at, next, extent).length;
        /* true if `next` is the time of a key other than the first key; in this case the key that
         * follows `next` is later than the key that follows `at` */
        bool ends_at_key =
            next > route->keys[0].time && ebpo_scene_route_next(route, next, INFINITY) >
                                              ebpo_scene_route_next(route, at, INFINITY);
        if (route->jumps && ends_at_key)
            sum = INFINITY;
        at = next;
    }
    *length = sum * (1 + slack);
    return EBPO_OK;
}

ebpo_status ebpo_scene_instance_box(const ebpo_scene *scene, uint64_t instance, double from,
                                    double to, double min[3], double max[3], ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_status status = check_loaded(scene, instance, from, to, error);
    empty_box(min, max);
    if (status == EBPO_OK)
        swept_box(scene, &scene->instances[instance], from, to, min, max);
    return status;
}

ebpo_status ebpo_scene_box(const ebpo_scene *scene, double from, double to, double min[3],
                           double max[3], ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_status status = EBPO_OK;
    empty_box(min, max);
    for (uint64_t i = 0; i < scene->instances_count && status == EBPO_OK; i++) {
        status = check_loaded(scene, i, from, to, error);
        if (status == EBPO_OK)
            swept_box(scene, &scene->instances[i], from, to, min, max);
    }
    return status;
}

/* --- sweep and prune --- */

/* Maximum number of pairs; this number of pairs takes 400 MB while it is sorted. */
static const uint64_t max_pairs = UINT64_C(1) << 23;

typedef struct box {
    double min[3], max[3];
    uint64_t instance;
} box;

typedef struct sweep {
    const ebpo_scene *scene;
    box *boxes;
    uint64_t count;
    double clearance; /* greatest clearance of all rules */
    EBPO_SCENE_LIST(ebpo_scene_pair, pairs);
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

/* Returns the axis with the least expected overlap. The overlap is estimated from the sizes of
 * boxes relative to the size of the box around all boxes. */
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

/* Exchanges the first axis of each box with the chosen axis, because boxes are sorted and compared
 * along the first axis. */
static void swap_axes(sweep *s, int axis)
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

/* Returns true if two boxes are at most `distance` apart on each axis, or if rounding makes this
 * uncertain. */
static bool near_each_other(const box *x, const box *y, double distance)
{
    for (int k = 0; k < 3; k++) {
        double gap = fmax(x->min[k] - y->max[k], y->min[k] - x->max[k]);
        if (gap > distance + fabs(gap) * 0x1p-50)
            return false;
    }
    return true;
}

/* Adds the pair of the boxes' instances to the result, if the rules do not ignore it and the boxes
 * are within its clearance. */
static ebpo_status add_pair_of_boxes(sweep *s, const box *x, const box *y, ebpo_error *error)
{
    ebpo_scene_pair pair = { x->instance, y->instance, 0 };
    if (pair.a > pair.b)
        pair = (ebpo_scene_pair){ pair.b, pair.a, 0 };
    if (!ebpo_scene_pair_rule(s->scene, pair.a, pair.b, &pair.clearance) ||
        !near_each_other(x, y, pair.clearance))
        return EBPO_OK;
    if (s->pairs_count == max_pairs)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "more than %" PRIu64 " pairs of instances come near each other: place "
                         "fewer instances at one position, let rules ignore "
                         "pairs, or use a shorter time",
                         max_pairs);
    if (!ebpo_grow(&s->pairs, &s->pairs_capacity, s->pairs_count + 1, sizeof pair))
        return ebpo_fail_memory(error, (s->pairs_count + 1) * sizeof pair);
    s->pairs[s->pairs_count++] = pair;
    return EBPO_OK;
}

/* Compares each box with the boxes that follow it on the first axis, up to the first box that is
 * farther away than the greatest clearance. */
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
                status = add_pair_of_boxes(s, x, y, error);
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
        return ebpo_fail(error, EBPO_E_ARGUMENT, "%g to %g is not an interval of time", from, to);
    sweep s = { .scene = scene,
                .count = scene->instances_count,
                .clearance = greatest_clearance(scene) };
    s.boxes = ebpo_alloc(s.count, sizeof *s.boxes);
    ebpo_status status =
        s.boxes ? make_boxes(&s, from, to, error) : ebpo_fail_memory(error, s.count * sizeof(box));
    if (status == EBPO_OK && s.count) {
        swap_axes(&s, best_axis(&s));
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
