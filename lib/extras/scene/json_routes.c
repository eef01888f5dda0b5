/* Poses and routes in a scene file. */
#include "core/strict_fp.h"

#include "extras/scene/json_routes.h"

#include <stdlib.h>
#include <string.h>

#include "core/error.h"
#include "geometry/pose.h"

/* A pose whose rotation may be given as a matrix, or as a quaternion x, y, z, w of any length. */
typedef struct read_pose {
    ebpo_pose pose;
    double turn[4];
    bool has_turn;
} read_pose;

static ebpo_status pose_members(json_reader *r, const json_t *value, read_pose *out)
{
    static const char *const known[] = { "translation", "rotation", "quaternion", "scale", NULL };
    ebpo_pose *p = &out->pose;
    ebpo_status status = json_members(r, value, known);
    if (status == EBPO_OK)
        status = json_get_reals(r, value, "translation", false, p->translation, 3);
    if (status == EBPO_OK)
        status = json_get_reals(r, value, "rotation", false, &p->rotation[0][0], 9);
    if (status == EBPO_OK)
        status = json_get_reals(r, value, "quaternion", false, out->turn, 4);
    if (status == EBPO_OK)
        status = json_get_real(r, value, "scale", false, &p->scale);
    out->has_turn = json_object_get(value, "quaternion") != NULL;
    if (status == EBPO_OK && out->has_turn && json_object_get(value, "rotation"))
        return json_bad(r, "has both rotation and quaternion");
    return status;
}

/* As a key, whose quaternion has a length of 1. */
static ebpo_status key_of(json_reader *r, const read_pose *p, double time, scene_route *route)
{
    static const double nowhere[3] = { 0, 0, 0 };
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_posing posing;
    scene_key key = { .time = time, .scale = p->pose.scale };
    memcpy(key.translation, p->pose.translation, sizeof key.translation);
    memcpy(key.turn, p->turn, sizeof key.turn);
    if (!p->has_turn) {
        ebpo_status status = ebpo_posing_make(&posing, &p->pose, nowhere, &why);
        if (status != EBPO_OK)
            return json_judge(r, status, &why);
        scene_turn_of_matrix(p->pose.rotation, key.turn);
    }
    return json_judge(r, scene_add_key(route, &key, &why), &why);
}

ebpo_status json_read_pose(json_reader *r, const json_t *object, const char *key, ebpo_pose *out)
{
    const json_t *value = json_object_get(object, key);
    if (!value)
        return EBPO_OK;
    read_pose p = { .pose = EBPO_POSE_INIT };
    scene_route alone = { 0 };
    json_enter(r, key, 0);
    ebpo_status status = pose_members(r, value, &p);
    if (status == EBPO_OK && p.has_turn) {
        status = key_of(r, &p, 0, &alone);
        if (status == EBPO_OK)
            scene_route_at(&alone, 0, &p.pose);
        free(alone.keys);
    }
    json_leave(r);
    *out = p.pose; /* of a matrix: judged with the instance */
    return status;
}

static scene_route *last_route(json_reader *r)
{
    return &r->scene->routes[r->scene->routes_count - 1];
}

static ebpo_status read_key(json_reader *r, const char *name, const json_t *value)
{
    static const char *const known[] = { "time", "pose", NULL };
    (void)name;
    double time = 0;
    read_pose p = { .pose = EBPO_POSE_INIT };
    ebpo_status status = json_members(r, value, known);
    if (status == EBPO_OK)
        status = json_get_real(r, value, "time", true, &time);
    if (status != EBPO_OK)
        return status;
    json_enter(r, "pose", 0);
    status = pose_members(r, json_object_get(value, "pose"), &p);
    json_leave(r);
    return status == EBPO_OK ? key_of(r, &p, time, last_route(r)) : status;
}

static ebpo_status read_poses(json_reader *r, const json_t *value)
{
    double begin = 0, step = 0;
    const json_t *poses = json_object_get(value, "poses");
    ebpo_status status = json_get_real(r, value, "begin", false, &begin);
    if (status == EBPO_OK)
        status = json_get_real(r, value, "step", true, &step);
    if (status != EBPO_OK)
        return status;
    if (!json_is_array(poses))
        return json_bad_at(r, "poses", "is not an array");
    json_enter(r, "poses", 0);
    for (size_t i = 0; i < json_array_size(poses) && status == EBPO_OK; i++) {
        read_pose p = { .pose = EBPO_POSE_INIT };
        json_enter(r, NULL, i);
        status = pose_members(r, json_array_get(poses, i), &p);
        if (status == EBPO_OK)
            status = key_of(r, &p, begin + step * (double)i, last_route(r));
        json_leave(r);
    }
    json_leave(r);
    return status;
}

static ebpo_status read_csv(json_reader *r, const json_t *value)
{
    const char *path = NULL;
    ebpo_status status = json_get_text(r, value, "csv", true, &path);
    if (status != EBPO_OK)
        return status;
    ebpo_scene_options here = *r->options;
    here.remote = false;
    const char *refused = scene_path_refused(path, &here, false);
    if (refused)
        return json_bad_at(r, "csv", refused);
    char *joined = scene_join_path(r->scene->folder, path);
    status = joined ? EBPO_OK : ebpo_fail_memory(r->error, strlen(path));
    if (status == EBPO_OK && !here.outside)
        status = scene_stays_within(r->scene->folder, joined, r->error);
    if (status == EBPO_OK)
        status = scene_read_csv(last_route(r), joined, &r->pose_bytes, r->error);
    free(joined);
    return status;
}

static ebpo_status read_between(json_reader *r, const json_t *value)
{
    const char *between = "even";
    ebpo_status status = json_get_text(r, value, "between", false, &between);
    if (status != EBPO_OK)
        return status;
    last_route(r)->jumps = strcmp(between, "jump") == 0;
    return last_route(r)->jumps || strcmp(between, "even") == 0
               ? EBPO_OK
               : json_bad_at(r, "between", "is neither even nor jump");
}

ebpo_status json_read_route(json_reader *r, const char *name, const json_t *value)
{
    static const char *const known[] = { "keys", "poses", "begin", "step", "csv", "between", NULL };
    uint64_t number;
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_status status = json_members(r, value, known);
    if (status == EBPO_OK)
        status = json_judge(r, scene_add_route(r->scene, name, &number, &why), &why);
    if (status == EBPO_OK)
        status = read_between(r, value);
    if (status != EBPO_OK)
        return status;
    bool keys = json_object_get(value, "keys"), poses = json_object_get(value, "poses"),
         csv = json_object_get(value, "csv");
    if (keys + poses + csv != 1)
        return json_bad(r, "has not one of keys, poses and csv");
    if (!poses && (json_object_get(value, "begin") || json_object_get(value, "step")))
        return json_bad(r, "begin and step are for poses");
    status = keys    ? json_each_item(r, value, "keys", read_key)
             : poses ? read_poses(r, value)
                     : read_csv(r, value);
    return status == EBPO_OK && last_route(r)->count == 0 ? json_bad(r, "has no poses") : status;
}
