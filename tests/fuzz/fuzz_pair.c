/* SPDX-License-Identifier: MIT
 * Any bytes as a file whose model is collided with itself at poses, used with a haptic device, and
 * mapped by distance. */
#include "fuzz_support.h"

#include <ebpo/collide.h>
#include <ebpo/map.h>
#include <ebpo/haptic.h>

#include "known_leaks.h"

enum { PAIRS_MAX = 2000, DEADLINE_NS = 20000000 };

static bool take_pairs(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    (void)pairs;
    return (*(uint64_t *)user += count) < PAIRS_MAX;
}

static bool take_line(void *user, const ebpo_polyline *line)
{
    (void)line;
    return ++*(uint64_t *)user < PAIRS_MAX;
}

/* Poses of the model against itself: identity, beside itself, rotated and half as large. */
static ebpo_pose pose_of(int which, const ebpo_info *info)
{
    ebpo_pose pose = EBPO_POSE_INIT;
    if (which == 1)
        pose.translation[0] = info->box_size[0] / 3;
    if (which == 2) {
        memset(pose.rotation, 0, sizeof pose.rotation);
        pose.rotation[0][1] = pose.rotation[2][2] = 1;
        pose.rotation[1][0] = -1;
        pose.scale = 0.5;
    }
    return pose;
}

static void query_pair(ebpo_collider *collider, const ebpo_collide_options *options)
{
    static const double direction[3] = { 1, 0.5, 0 };
    uint64_t taken = 0;
    ebpo_face_pair pair;
    ebpo_relation_result relation;
    ebpo_collide_distance_result clearance;
    ebpo_value_bounds a_in_b, b_in_a;
    ebpo_separation out;
    ebpo_level_result levels;
    int32_t found;
    (void)!ebpo_collide_first(collider, options, &pair, &found, NULL);
    (void)!ebpo_collide_relation(collider, options, &relation, NULL);
    (void)!ebpo_collide_all(collider, options, take_pairs, &taken, NULL);
    (void)!ebpo_collide_polylines(collider, options, take_line, &taken, NULL);
    (void)!ebpo_collide_distance(collider, options, NULL, &clearance, NULL);
    (void)!ebpo_collide_depth(collider, options, 0.1, &a_in_b, &b_in_a, NULL);
    (void)!ebpo_collide_separation(collider, options, direction, &out, NULL);
    (void)!ebpo_collide_levels(collider, options, &levels, NULL);
}

static void collide(ebpo_model *model, const ebpo_info *info)
{
    ebpo_collider *collider;
    ebpo_collider_options limited = EBPO_COLLIDER_OPTIONS_INIT;
    limited.threads = 1;
    limited.memory = 1 << 20;
    if (ebpo_collider_new(model, model, &limited, &collider, NULL) != EBPO_OK)
        return;
    for (int which = 0; which < 3; which++) {
        ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
        options.pose_b = pose_of(which, info);
        options.deadline_ns = DEADLINE_NS;
        query_pair(collider, &options);
    }
    ebpo_collider_free(collider);
}

static void touch(ebpo_model *model, const ebpo_info *info)
{
    ebpo_haptic *hand;
    ebpo_haptic_options options = EBPO_HAPTIC_OPTIONS_INIT;
    ebpo_haptic_ball_result result;
    double way[EBPO_HAPTIC_PATH_MAX][3], at[3];
    options.faces = 64;
    for (int k = 0; k < 3; k++)
        at[k] = info->box_origin[k] - 0.01 * info->box_size[k];
    if (ebpo_haptic_new(model, &options, at, &hand, NULL) != EBPO_OK)
        return;
    for (int tick = 0; tick < 20; tick++) {
        for (int k = 0; k < 3; k++)
            at[k] += 0.05 * (1 + k) / 3 * info->box_size[k];
        ebpo_haptic_step_ball(hand, at, &result);
        uint32_t points = ebpo_haptic_ball_path(hand, way);
        fuzz_must(points >= 1 && points <= EBPO_HAPTIC_PATH_MAX);
    }
    (void)!ebpo_haptic_check(hand, NULL);
    ebpo_haptic_free(hand);
}

static void map(ebpo_model *model, const ebpo_info *info)
{
    double points[8][3], distances[8];
    ebpo_map_options options = EBPO_MAP_OPTIONS_INIT;
    ebpo_map_stats stats = EBPO_MAP_STATS_INIT;
    options.threads = 1;
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < 3; k++)
            points[i][k] = info->box_origin[k] + (0.1 + 0.8 * (i >> k & 1)) * info->box_size[k];
    if (ebpo_map_points(model, points[0], 8, &options, distances, NULL) == EBPO_OK)
        (void)!ebpo_map_describe(distances, 8, &stats, NULL);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    ebpo_file *file;
    ebpo_model *model;
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    if (ebpo_open_memory(data, size, "fuzzed", &file, NULL) != EBPO_OK)
        return 0;
    options.threads = 1;
    options.memory = 64 << 20;
    options.cut_level = size % 4 == 0 ? 1 : -1;
    if (ebpo_model_new(file, &options, &model, NULL) == EBPO_OK) {
        collide(model, ebpo_file_info(file));
        touch(model, ebpo_file_info(file));
        map(model, ebpo_file_info(file));
        ebpo_model_free(model);
    }
    ebpo_close(file);
    return 0;
}
