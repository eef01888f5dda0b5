/* Levels that cameras can tell apart: a node's envelope and what it stands for are both in its
 * cell, so cells that are no larger than a pixel are enough. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "extras/scene/scene_views.h"

enum { STEPS = 16 }; /* of a camera's way from key to key */

typedef struct seeing {
    scene_needs *needs;
    const ebpo_scene_camera *camera;
    double pixel; /* width of a pixel at a distance of 1 */
} seeing;

/* Where the eye is between two times that no key of the camera's route is between. */
static void eye_box(const seeing *s, double from, double to, scene_space *out)
{
    const ebpo_scene_camera *c = s->camera;
    ebpo_pose at;
    double length = 0;
    memcpy(out->min, c->eye, sizeof out->min);
    if (c->route != EBPO_SCENE_NONE) {
        const scene_route *route = &s->needs->scene->routes[c->route];
        scene_reach reach = { scene_length_above(c->eye), scene_length_above(c->eye) };
        scene_route_at(route, from, &at);
        length = scene_route_step(route, from, to, reach).length;
        for (int i = 0; i < 3; i++)
            out->min[i] =
                at.scale * ((at.rotation[i][0] * c->eye[0] + at.rotation[i][1] * c->eye[1]) +
                            at.rotation[i][2] * c->eye[2]) +
                at.translation[i];
    }
    for (int k = 0; k < 3; k++) {
        out->max[k] = out->min[k] + length;
        out->min[k] -= length;
    }
}

/* Of an instance, over a part of the time; the greatest scale that it has there. */
static ebpo_status distance_between(const seeing *s, uint64_t instance, double from, double to,
                                    double *distance, double *scale)
{
    scene_space eye, box;
    ebpo_pose at[2];
    eye_box(s, from, to, &eye);
    ebpo_status status = ebpo_scene_instance_box(s->needs->scene, instance, from, to, box.min,
                                                 box.max, s->needs->error);
    for (int i = 0; i < 2 && status == EBPO_OK; i++)
        status = ebpo_scene_pose(s->needs->scene, instance, i ? to : from, &at[i], s->needs->error);
    if (status != EBPO_OK)
        return status;
    *distance = scene_space_gap(&eye, &box);
    *scale = fmax(at[0].scale, at[1].scale);
    return EBPO_OK;
}

/* A static camera sees nothing that is behind it. */
static bool is_behind(const seeing *s, const scene_space *box)
{
    const ebpo_scene_camera *c = s->camera;
    double most = -INFINITY;
    for (int corner = 0; corner < 8; corner++) {
        double sum = 0;
        for (int k = 0; k < 3; k++)
            sum += (c->target[k] - c->eye[k]) *
                   ((corner >> k & 1 ? box->max[k] : box->min[k]) - c->eye[k]);
        most = fmax(most, sum);
    }
    return c->route == EBPO_SCENE_NONE && most < 0;
}

/* The first level whose cells are at most so large; -1: the last one is needed. */
static int level_for(const ebpo_info *info, double size)
{
    double cell = scene_length_above(info->box_size);
    for (int level = 0; level < info->level_count - 1; level++, cell /= 2)
        if (cell <= size)
            return level;
    return -1;
}

static ebpo_status see_instance(const seeing *s, uint64_t instance, double from, double to)
{
    const ebpo_scene *scene = s->needs->scene;
    uint64_t file = scene->models[scene->instances[instance].as.model].file;
    scene_file_need *need = &s->needs->files[file];
    scene_space box;
    double distance, scale;
    ebpo_status status =
        ebpo_scene_instance_box(scene, instance, from, to, box.min, box.max, s->needs->error);
    if (status != EBPO_OK || is_behind(s, &box))
        return status;
    status = distance_between(s, instance, from, to, &distance, &scale);
    if (status != EBPO_OK)
        return status;
    int level = level_for(ebpo_file_info(scene->files[file].file), distance * s->pixel / scale);
    if (!need->any || (need->last_level >= 0 && (level < 0 || level > need->last_level)))
        need->last_level = level;
    need->any = true;
    return EBPO_OK;
}

static ebpo_status see_from(const seeing *s, double from, double to)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < s->needs->scene->instances_count && status == EBPO_OK; i++)
        status = see_instance(s, i, from, to);
    return status;
}

/* From key to key of the camera's route, in steps. */
static ebpo_status see_along(const seeing *s)
{
    const scene_needs *n = s->needs;
    const scene_route *route =
        s->camera->route == EBPO_SCENE_NONE ? NULL : &n->scene->routes[s->camera->route];
    ebpo_status status = route ? EBPO_OK : see_from(s, n->from, n->to);
    for (double at = n->from; route && at < n->to && status == EBPO_OK;) {
        double next = scene_route_next(route, at, n->to);
        for (int i = 0; i < STEPS && status == EBPO_OK; i++)
            status = see_from(s, at + (next - at) * i / STEPS,
                              i + 1 < STEPS ? at + (next - at) * (i + 1) / STEPS
                                            : nextafter(next, -INFINITY));
        at = next;
    }
    return status == EBPO_OK ? see_from(s, n->to, n->to) : status;
}

ebpo_status scene_add_views(scene_needs *needs)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < needs->scene->cameras_count && status == EBPO_OK; i++) {
        const ebpo_scene_camera *c = &needs->scene->cameras[i];
        double half = c->fov * (3.14159265358979323846 / 360);
        seeing s = { needs, c, 2 * tan(half) / c->height };
        status = see_along(&s);
        for (uint64_t f = 0; f < needs->scene->files_count; f++)
            needs->files[f].askers++;
    }
    return status;
}
