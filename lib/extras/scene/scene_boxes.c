/* Where instances are, in time: poses, boxes, and how far they move. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "extras/scene/scene_parts.h"

static const double slack = 0x1p-44;
/* Of a turn, in radians, that is taken as one step of a box. */
static const double step_turn = 0.125;

static const scene_route *route_of(const ebpo_scene *scene, const scene_instance *i)
{
    return i->as.route == EBPO_SCENE_NONE ? NULL : &scene->routes[i->as.route];
}

static void pose_at(const ebpo_scene *scene, const scene_instance *i, double time, ebpo_pose *out)
{
    const scene_route *route = route_of(scene, i);
    ebpo_pose moved;
    *out = i->as.pose;
    if (!route)
        return;
    scene_route_at(route, time, &moved);
    scene_compose(&moved, &i->as.pose, out);
}

static ebpo_status check_time(const ebpo_scene *scene, uint64_t instance, double from, double to,
                              ebpo_error *error)
{
    if (instance >= scene->instances_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "there is no instance %llu",
                         (unsigned long long)instance);
    if (!(isfinite(from) && isfinite(to) && from <= to))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "there is no time from %g to %g", from, to);
    return EBPO_OK;
}

static ebpo_status check_loaded(const ebpo_scene *scene, uint64_t instance, double from, double to,
                                ebpo_error *error)
{
    ebpo_status status = check_time(scene, instance, from, to, error);
    if (status != EBPO_OK)
        return status;
    const scene_model *m = &scene->models[scene->instances[instance].as.model];
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

/* Of the posed vertices; rounding is within. */
static void posed_box(const ebpo_pose *pose, const scene_model *m, double min[3], double max[3])
{
    for (int i = 0; i < 3; i++) {
        double low = 0, high = 0, size = fabs(pose->translation[i]);
        for (int k = 0; k < 3; k++) {
            double f = pose->scale * pose->rotation[i][k], a = f * m->min[k], b = f * m->max[k];
            low += fmin(a, b);
            high += fmax(a, b);
            size += fmax(fabs(a), fabs(b));
        }
        double off = size * 0x1p-48 + 0x1p-1000;
        min[i] = low + pose->translation[i] - off;
        max[i] = high + pose->translation[i] + off;
    }
}

/* What overflowed may be anywhere. */
static double or_else(double x, double all) { return isnan(x) ? all : x; }

static void join_box(double min[3], double max[3], const double low[3], const double high[3],
                     double by)
{
    for (int k = 0; k < 3; k++) {
        min[k] = fmin(min[k], or_else(low[k] - by, -INFINITY));
        max[k] = fmax(max[k], or_else(high[k] + by, INFINITY));
    }
}

static void empty_box(double min[3], double max[3])
{
    for (int k = 0; k < 3; k++) {
        min[k] = INFINITY;
        max[k] = -INFINITY;
    }
}

scene_reach scene_reach_of(const ebpo_scene *scene, const scene_instance *i)
{
    const scene_model *m = &scene->models[i->as.model];
    double min[3], max[3], far[3];
    scene_reach reach = { 0, 0 };
    posed_box(&i->as.pose, m, min, max);
    for (int k = 0; k < 3; k++) {
        far[k] = fmax(fabs(min[k]), fabs(max[k]));
        reach.size += fabs(i->as.pose.translation[k]) +
                      i->as.pose.scale * fmax(fabs(m->min[k]), fabs(m->max[k]));
    }
    reach.length = scene_length_above(far);
    return reach;
}

static void box_at(const ebpo_scene *scene, const scene_instance *i, double time, double by,
                   double min[3], double max[3])
{
    double low[3], high[3];
    ebpo_pose pose;
    pose_at(scene, i, time, &pose);
    posed_box(&pose, &scene->models[i->as.model], low, high);
    join_box(min, max, low, high, by);
}

/* Between two times that no key is between, in steps of little turning. */
static void box_between(const ebpo_scene *scene, const scene_instance *i, scene_reach reach,
                        double from, double to, double min[3], double max[3])
{
    const scene_route *route = route_of(scene, i);
    scene_step all = scene_route_step(route, from, to, reach);
    double turned = reach.length > 0 ? sqrt(8 * all.sag / reach.length) : 0;
    int steps = turned < 32 * step_turn ? 1 + (int)(turned / step_turn) : 32;
    for (int n = 0; n < steps; n++) {
        double begin = n == 0 ? from : from + (to - from) * n / steps;
        double end = n + 1 == steps ? to : from + (to - from) * (n + 1) / steps;
        double sag = scene_route_step(route, begin, end, reach).sag;
        box_at(scene, i, begin, sag, min, max);
        box_at(scene, i, end, sag, min, max);
    }
}

static void swept_box(const ebpo_scene *scene, const scene_instance *i, double from, double to,
                      double min[3], double max[3])
{
    const scene_route *route = route_of(scene, i);
    scene_reach reach = scene_reach_of(scene, i);
    if (!route || from == to) {
        box_at(scene, i, from, 0, min, max);
        return;
    }
    for (double at = from; at < to;) {
        double next = scene_route_next(route, at, to);
        box_between(scene, i, reach, at, next, min, max);
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
    const scene_instance *i = &scene->instances[instance];
    const scene_route *route = route_of(scene, i);
    scene_reach reach = scene_reach_of(scene, i);
    double sum = 0;
    for (double at = from; route && at < to;) {
        double next = scene_route_next(route, at, to);
        sum += scene_route_step(route, at, next, reach).length;
        bool key = next > route->keys[0].time &&
                   scene_route_next(route, next, INFINITY) > scene_route_next(route, at, INFINITY);
        if (route->jumps && key)
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
