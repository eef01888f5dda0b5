#include "core/strict_fp.h"

#include "extras/scene/pair_motion.h"

#include <math.h>
#include <string.h>

static const scene_route *route_of(const ebpo_scene *scene, uint64_t instance)
{
    uint64_t route = scene->instances[instance].as.route;
    return route == EBPO_SCENE_NONE ? NULL : &scene->routes[route];
}

bool scene_pair_rides(const ebpo_scene *scene, const ebpo_scene_pair *pair)
{
    const scene_route *a = route_of(scene, pair->a), *b = route_of(scene, pair->b);
    if (!a || !b)
        return false;
    return a == b || (a->count == b->count && a->jumps == b->jumps &&
                      memcmp(a->keys, b->keys, a->count * sizeof *a->keys) == 0);
}

double scene_pair_rounding(const ebpo_scene *scene, const ebpo_scene_pair *pair)
{
    double sum = 0;
    for (int i = 0; i < 2; i++) {
        uint64_t instance = i ? pair->b : pair->a;
        const scene_route *route = route_of(scene, instance);
        if (route)
            sum += scene_route_rounding(route, scene_reach_of(scene, &scene->instances[instance]));
    }
    return sum;
}

/* The pose of the route is the same for both, to the last bit: points of theirs that are `reach`
 * apart at most where the route begins are scale times that apart. */
static double ride(const ebpo_scene *scene, const ebpo_scene_pair *pair, double from, double to)
{
    scene_reach a = scene_reach_of(scene, &scene->instances[pair->a]);
    scene_reach b = scene_reach_of(scene, &scene->instances[pair->b]);
    return scene_route_growth(route_of(scene, pair->a), from, to,
                              (scene_reach){ a.length + b.length, a.size + b.size });
}

ebpo_status scene_pair_motion(const ebpo_scene *scene, const ebpo_scene_pair *pair, bool rides,
                              double from, double to, double *out, ebpo_error *error)
{
    double a, b;
    ebpo_status status = ebpo_scene_motion(scene, pair->a, from, to, &a, error);
    if (status == EBPO_OK)
        status = ebpo_scene_motion(scene, pair->b, from, to, &b, error);
    if (status != EBPO_OK)
        return status;
    *out = (a + b) * (1 + 0x1p-50);
    if (rides && from < to)
        *out = fmin(*out, ride(scene, pair, from, to));
    return EBPO_OK;
}

double scene_pair_next(const ebpo_scene *scene, const ebpo_scene_pair *pair, double from, double to)
{
    double next = to;
    for (int i = 0; i < 2; i++) {
        const scene_route *route = route_of(scene, i ? pair->b : pair->a);
        if (route)
            next = fmin(next, scene_route_next(route, from, to));
    }
    return next;
}
