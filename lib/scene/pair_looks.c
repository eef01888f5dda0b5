#include "geom/strict_fp.h"

#include "scene/pair_looks.h"

#include <math.h>

#include "base/error.h"
#include "base/sized.h"
#include "scene/left_out.h"

/* Of a collider that is not there: nothing is left to be near. */
static ebpo_status ask_distance(scene_looks *l, double time, double *lo, double *hi,
                                ebpo_error *error)
{
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_clearance_options how = EBPO_CLEARANCE_OPTIONS_INIT;
    ebpo_clearance found = { .distance = { .lo = INFINITY, .hi = INFINITY } };
    how.tolerance = l->tolerance;
    how.warm = true; /* lo and hi may differ by it: each pair has a collider of its own */
    ebpo_status status = scene_pose_pair(l->scene, l->pair, time, &options, error);
    if (status == EBPO_OK && l->collider)
        status = ebpo_collide_distance(l->collider, &options, &how, &found, error);
    *lo = found.distance.lo;
    *hi = found.distance.hi;
    return status;
}

ebpo_status scene_look(scene_looks *l, double time, double *lo, double *hi, ebpo_error *error)
{
    l->gap = INFINITY;
    ebpo_status status = ask_distance(l, time, lo, hi, error);
    if (status == EBPO_OK)
        status = scene_left_out(l->scene, l->pair, time, &l->gap, &l->lacking, error);
    *lo = fmin(*lo, l->gap);
    return status;
}

ebpo_status scene_pair_motion(const ebpo_scene *scene, const ebpo_scene_pair *pair, double from,
                              double to, double *out, ebpo_error *error)
{
    double a, b;
    ebpo_status status = ebpo_scene_motion(scene, pair->a, from, to, &a, error);
    if (status == EBPO_OK)
        status = ebpo_scene_motion(scene, pair->b, from, to, &b, error);
    if (status == EBPO_OK)
        *out = (a + b) * (1 + 0x1p-50);
    return status;
}

double scene_pair_next(const ebpo_scene *scene, const ebpo_scene_pair *pair, double from, double to)
{
    double next = to;
    for (int i = 0; i < 2; i++) {
        uint64_t route = scene->instances[i ? pair->b : pair->a].as.route;
        if (route != EBPO_SCENE_NONE)
            next = fmin(next, scene_route_next(&scene->routes[route], from, to));
    }
    return next;
}

ebpo_status scene_take_way_options(ebpo_scene_way_options *own,
                                   const ebpo_scene_way_options *options, ebpo_error *error)
{
    ebpo_status status = EBPO_TAKE(ebpo_scene_way_options, own, options, error);
    if (status == EBPO_OK && !(own->tolerance > 0 && own->tolerance < INFINITY))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "the tolerance %g is not above 0", own->tolerance);
    if (!own->most_looks)
        own->most_looks = 10000;
    return status;
}
