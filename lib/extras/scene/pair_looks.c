#include "core/strict_fp.h"

#include "extras/scene/pair_looks.h"

#include <math.h>

#include "core/error.h"
#include "extras/scene/left_out.h"

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

ebpo_status scene_looks_begin(scene_looks *l, const ebpo_scene *scene, const ebpo_scene_pair *pair,
                              double tolerance, ebpo_error *error)
{
    *l = (scene_looks){ .scene = scene, .pair = pair, .tolerance = tolerance / 4 };
    /* finer ones would take long, for digits that the next pose has otherwise */
    l->tolerance = fmax(l->tolerance, scene_pair_rounding(scene, pair) / 16);
    l->rides = scene_pair_rides(scene, pair);
    return scene_collider(scene, pair, 1, &l->collider, error);
}

ebpo_status scene_looks_motion(const scene_looks *l, double from, double to, double *out,
                               ebpo_error *error)
{
    return scene_pair_motion(l->scene, l->pair, l->rides, from, to, out, error);
}

bool scene_is_within(double hi, double lo, double tolerance)
{
    return hi <= lo || (hi - lo) * (1 + 0x1p-52) <= tolerance;
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
