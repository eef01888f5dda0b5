/* Searches along the routes of pairs of instances. The first search finds the first time at which a
 * pair comes within its clearance. The second search finds the least distance of a pair over an
 * interval of time.
 *
 * Both searches evaluate the distance at some times, and use one bound: the distance of two
 * instances changes by at most the sum of their motions. The first search goes forward in time from
 * one evaluation to the next. Between two evaluations the motion is shorter than the distance minus
 * the clearance, so no contact is missed.
 * The second search divides the interval of time into shorter intervals. It keeps the shorter
 * intervals in a heap, ordered by a lower bound of the distance in each of them. It repeatedly
 * halves the first interval of the heap, until the result is within the tolerance. Routes jump only
 * at ends of intervals.
 * A result is a pair of guaranteed bounds. A search that reaches the maximum number of evaluations
 * returns its current bounds.
 *
 * See docs/guide/scenes.md. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/sort.h"
#include "extras/scene/instance_pair.h"

/* The search for the first approach of each pair. */
typedef struct approach_search {
    const ebpo_scene *scene;
    ebpo_scene_approach_options options;
    double from, to; /* the interval of time */
} approach_search;

/* Sets *next to the time of the next evaluation, so that the motion from result->time to *next is
 * shorter than `max_motion`. Sets *next to result->time if no later time is possible. */
static ebpo_status next_evaluation(const approach_search *search,
                                   const ebpo_scene_evaluations *evaluations,
                                   const ebpo_scene_approach_result *result, double max_motion,
                                   double *next, ebpo_error *error)
{
    /* the motion from result->time to `low` is short enough; the motion to `high` is too long */
    double low = result->time, high = search->to, at = high, length = 0;
    ebpo_status status = ebpo_scene_evaluations_motion(evaluations, low, at, &length, error);
    if (status != EBPO_OK || length < max_motion) {
        *next = at;
        return status;
    }
    /* bisection: at least eight steps, and then until `low` is later than result->time */
    for (int n = 0; n < 70 && status == EBPO_OK && (low == result->time || n < 8); n++) {
        at = low + (high - low) / 2;
        status = ebpo_scene_evaluations_motion(evaluations, result->time, at, &length, error);
        if (length < max_motion)
            low = at;
        else
            high = at;
    }
    *next = low;
    return status;
}

/* Handles the case that the motion up to the next double after result->time is already too long. If
 * a route jumps at this double, the motion is INFINITY, and *next is set to the double. Otherwise
 * the bound of the rounding alone is too long, and *next is not changed. */
static ebpo_status move_past_jump(const ebpo_scene_evaluations *evaluations,
                                  const ebpo_scene_approach_result *result, double *next,
                                  ebpo_error *error)
{
    double length, at = nextafter(result->time, INFINITY);
    ebpo_status status =
        ebpo_scene_evaluations_motion(evaluations, result->time, at, &length, error);
    if (status == EBPO_OK && length == INFINITY)
        *next = at;
    return status;
}

/* Returns true if the distance is certainly at most the clearance plus the tolerance. */
static bool is_reached(const approach_search *search, const ebpo_scene_approach_result *result)
{
    return ebpo_scene_is_within(result->hi, result->clearance, search->options.tolerance);
}

/* Evaluates the distance at result->time, and sets the result's bounds. Fails with EBPO_E_ABSENT if
 * the faces in the files are not within the clearance, but omitted faces may be. */
static ebpo_status approach_evaluate(const approach_search *search,
                                     ebpo_scene_evaluations *evaluations,
                                     ebpo_scene_approach_result *result, ebpo_error *error)
{
    ebpo_status status =
        ebpo_scene_evaluate(evaluations, result->time, &result->lo, &result->hi, error);
    result->evaluations++;
    if (status != EBPO_OK || is_reached(search, result) ||
        evaluations->omitted_distance > result->clearance)
        return status;
    return ebpo_scene_fail_omitted(search->scene, evaluations->pair, evaluations->omitted_in,
                                   result->time, false, error);
}

/* Evaluates the distance at increasing times. Ends when the pair is within its clearance, or at the
 * end of the interval of time. Ends without a decision (result->reached is -1) at the maximum
 * number of evaluations, or if no later time is possible. */
static ebpo_status follow_pair(const approach_search *search, ebpo_scene_evaluations *evaluations,
                               ebpo_scene_approach_result *result, ebpo_error *error)
{
    for (;;) {
        double next;
        ebpo_status status = approach_evaluate(search, evaluations, result, error);
        if (status != EBPO_OK)
            return status;
        result->reached = is_reached(search, result);
        if (result->reached || result->time >= search->to)
            return EBPO_OK;
        status = next_evaluation(search, evaluations, result, result->lo - result->clearance, &next,
                                 error);
        if (status == EBPO_OK && !(next > result->time))
            status = move_past_jump(evaluations, result, &next, error);
        if (status != EBPO_OK)
            return status;
        if (result->evaluations >= search->options.max_evaluations || !(next > result->time)) {
            result->reached = -1;
            return EBPO_OK;
        }
        result->time = next;
    }
}

static ebpo_status find_approach(const void *context, const ebpo_scene_pair *pair, void *result,
                                 ebpo_error *error)
{
    const approach_search *search = context;
    ebpo_scene_approach_result *approach = result;
    ebpo_scene_evaluations evaluations;
    *approach = (ebpo_scene_approach_result){
        .a = pair->a, .b = pair->b, .time = search->from, .clearance = pair->clearance
    };
    ebpo_status status = ebpo_scene_evaluations_begin(&evaluations, search->scene, pair,
                                                      search->options.tolerance, error);
    if (status == EBPO_OK)
        status = follow_pair(search, &evaluations, approach, error);
    ebpo_collider_free(evaluations.collider);
    return status;
}

ebpo_status ebpo_scene_approach(ebpo_scene *scene, double from, double to,
                                const ebpo_scene_approach_options *options,
                                ebpo_scene_approaches_fn take, void *user, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    approach_search context = {
        .scene = scene, .options = EBPO_SCENE_APPROACH_OPTIONS_INIT, .from = from, .to = to
    };
    void *approaches = NULL;
    uint64_t count = 0;
    ebpo_status status = ebpo_scene_take_approach_options(&context.options, options, error);
    ebpo_scene_search search = { find_approach,
                                 &context,
                                 sizeof(ebpo_scene_approach_result),
                                 1,
                                 context.options.threads,
                                 &context.options.progress,
                                 "following routes" };
    if (status == EBPO_OK)
        status = ebpo_scene_find_in_pairs(scene, from, to, &search, &approaches, &count, error);
    if (status == EBPO_OK && count)
        (void)take(user, approaches, count);
    free(approaches);
    return status;
}

/* --- the least distance --- */

/* The search for the least distance of each pair. */
typedef struct least_search {
    const ebpo_scene *scene;
    double from, to, tolerance;
    uint64_t max_evaluations;
} least_search;

/* A part of the searched interval of time. No route jumps inside it. */
typedef struct time_interval {
    double from, to;
    double at_from, at_to; /* lower bounds of the distance at both ends */
    double motion;         /* upper bound of the change of the distance from one end to the other */
    double least;          /* lower bound of the distance in the interval */
} time_interval;

/* The search for the least distance of one pair. */
typedef struct interval_search {
    ebpo_scene_evaluations evaluations;
    ebpo_scene_least *out;
    /* At some of the evaluated times, a face that a file omits may be the nearest face. The limit
     * is the least lower bound of the distance at these times, and the result's lower bound is at
     * most the limit. INFINITY: there is no such time. */
    double limit;
    EBPO_SCENE_LIST(time_interval, intervals); /* a heap; intervals[0] has the least `least` */
} interval_search;

/* --- intervals of time --- */

static bool is_less(const time_interval *a, const time_interval *b) { return a->least < b->least; }

EBPO_HEAP(heap, time_interval, is_less)

static ebpo_status put_interval(interval_search *s, const time_interval *p, ebpo_error *error)
{
    uint64_t count = s->intervals_count;
    if (!ebpo_grow(&s->intervals, &s->intervals_capacity, count + 1, sizeof *s->intervals))
        return ebpo_fail_memory(error, (count + 1) * sizeof *s->intervals);
    heap_add(s->intervals, s->intervals_count++, p);
    return EBPO_OK;
}

/* --- evaluations --- */

/* Evaluates the distance at a time, sets *lo, and updates the upper bound of the result. */
static ebpo_status least_distance_evaluate(interval_search *s, double time, double *lo,
                                           ebpo_error *error)
{
    double hi;
    ebpo_status status = ebpo_scene_evaluate(&s->evaluations, time, lo, &hi, error);
    s->out->evaluations++;
    if (status == EBPO_OK && s->evaluations.omitted_distance < hi)
        s->limit = fmin(s->limit, *lo);
    if (status == EBPO_OK && hi < s->out->hi) {
        s->out->hi = hi;
        s->out->time = time;
    }
    return status;
}

/* Adds an interval. From one end of the interval to the other, the distance changes by at most
 * p.motion in total. So at all times between the ends, the distance is at least (at_from + at_to -
 * motion) / 2. */
static ebpo_status add_interval(interval_search *s, time_interval p, ebpo_error *error)
{
    ebpo_status status =
        ebpo_scene_evaluations_motion(&s->evaluations, p.from, p.to, &p.motion, error);
    if (status != EBPO_OK)
        return status;
    p.least = fmin(fmin(p.at_from, p.at_to), (p.at_from + p.at_to - p.motion) / 2);
    p.least = p.least > 0 ? p.least * (1 - 0x1p-50) : 0;
    return put_interval(s, &p, error);
}

static ebpo_status least_distance_halve(interval_search *s, const time_interval *p, double middle,
                                        ebpo_error *error)
{
    double at_middle;
    ebpo_status status = least_distance_evaluate(s, middle, &at_middle, error);
    if (status == EBPO_OK)
        status =
            add_interval(s, (time_interval){ p->from, middle, p->at_from, at_middle, 0, 0 }, error);
    return status == EBPO_OK
               ? add_interval(s, (time_interval){ middle, p->to, at_middle, p->at_to, 0, 0 }, error)
               : status;
}

/* Returns the time of the next key, at which routes may jump. If both instances follow one route,
 * their distance does not jump, and `to` is returned. */
static double next_jump(const interval_search *s, double from, double to)
{
    return s->evaluations.shares_route
               ? to
               : ebpo_scene_pair_next(s->evaluations.scene, s->evaluations.pair, from, to);
}

/* Makes an interval from each key to the last representable time before the next key, so that
 * routes jump only between intervals. The last interval is the time `to`. */
static ebpo_status begin_intervals(interval_search *s, double from, double to, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (double at = from; status == EBPO_OK;) {
        double next = next_jump(s, at, to), end = next > at ? nextafter(next, -INFINITY) : at;
        time_interval p = { .from = at, .to = end };
        status = least_distance_evaluate(s, at, &p.at_from, error);
        p.at_to = p.at_from;
        if (status == EBPO_OK && end > at)
            status = least_distance_evaluate(s, end, &p.at_to, error);
        if (status == EBPO_OK)
            status = add_interval(s, p, error);
        if (!(next > at))
            break;
        at = next;
    }
    return status;
}

/* Returns true if the lower bound of p, the first interval of the heap, is within the tolerance.
 * Also returns true if this bound cannot be improved: omitted faces limit it, the maximum number of
 * evaluations is reached, or p is too short. */
static bool is_done(const interval_search *s, const time_interval *p, double middle,
                    const least_search *search)
{
    double hi = s->out->hi;
    double min_width = hi - s->limit; /* omitted faces make hi - lo at least this wide */
    return ebpo_scene_is_within(hi, p->least, search->tolerance) ||
           s->limit - p->least <= min_width / 8 || s->out->evaluations >= search->max_evaluations ||
           p->motion <= search->tolerance / 8 || !(middle > p->from && middle < p->to);
}

/* Sets *out to true if at least half of the motion bound of the interval p comes from rounding,
 * which does not become smaller if p is halved. */
static ebpo_status is_rounding(const interval_search *s, const time_interval *p, bool *out,
                               ebpo_error *error)
{
    double least = 0;
    ebpo_status status = ebpo_scene_evaluations_motion(&s->evaluations, p->from,
                                                       nextafter(p->from, INFINITY), &least, error);
    *out = p->motion <= 2 * least;
    return status;
}

/* Halves the first interval of the heap until its lower bound is good enough. */
static ebpo_status least_distance_narrow(interval_search *s, const least_search *search,
                                         ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    while (status == EBPO_OK) {
        time_interval p = heap_take(s->intervals, s->intervals_count--);
        double middle = p.from + (p.to - p.from) / 2;
        s->out->lo = fmin(p.least, s->out->hi);
        bool done = is_done(s, &p, middle, search);
        if (!done)
            status = is_rounding(s, &p, &done, error);
        if (done)
            break;
        if (status == EBPO_OK)
            status = least_distance_halve(s, &p, middle, error);
    }
    return status;
}

static ebpo_status find_least(const void *context, const ebpo_scene_pair *pair, void *result,
                              ebpo_error *error)
{
    const least_search *search = context;
    ebpo_scene_least *out = result;
    interval_search s = { .limit = INFINITY, .out = out };
    *out = (ebpo_scene_least){ .a = pair->a,
                               .b = pair->b,
                               .time = search->from,
                               .hi = INFINITY,
                               .clearance = pair->clearance };
    ebpo_status status =
        ebpo_scene_evaluations_begin(&s.evaluations, search->scene, pair, search->tolerance, error);
    if (status == EBPO_OK)
        status = begin_intervals(&s, search->from, search->to, error);
    if (status == EBPO_OK)
        status = least_distance_narrow(&s, search, error);
    ebpo_collider_free(s.evaluations.collider);
    free(s.intervals);
    return status;
}

ebpo_status ebpo_scene_least_distances(ebpo_scene *scene, double from, double to,
                                       const ebpo_scene_approach_options *options,
                                       ebpo_scene_least_fn take, void *user, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    least_search s = { .scene = scene, .from = from, .to = to };
    ebpo_scene_approach_options checked = EBPO_SCENE_APPROACH_OPTIONS_INIT;
    void *found = NULL;
    uint64_t count = 0;
    ebpo_status status = ebpo_scene_take_approach_options(&checked, options, error);
    s.tolerance = checked.tolerance;
    s.max_evaluations = checked.max_evaluations;
    ebpo_scene_search search = {
        find_least,        &s, sizeof(ebpo_scene_least), 1, checked.threads, &checked.progress,
        "following routes"
    };
    if (status == EBPO_OK)
        status = ebpo_scene_find_in_pairs(scene, from, to, &search, &found, &count, error);
    if (status == EBPO_OK && count)
        (void)take(user, found, count);
    free(found);
    return status;
}
