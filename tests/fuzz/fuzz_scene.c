/* Fuzz target: any bytes as a scene file. A resulting scene must be valid: names, existing numbers,
 * cameras, and at any time poses that are rotations. */
#include "fuzz_support.h"

#include <float.h>
#include <math.h>

#include <ebpo/scene.h>

/* Uses only the bytes of the scene, with the limits of a small machine. */
static ebpo_scene *parse(const uint8_t *data, size_t size)
{
    ebpo_scene *scene = NULL;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_scene_options options = EBPO_SCENE_OPTIONS_INIT;
    options.max_values = 100000;
    options.max_pose_bytes = 1 << 20;
    ebpo_status status = ebpo_scene_parse((const char *)data, size, "fuzz.scene.json",
                                          "/nonexistent", &options, &scene, &error);
    fuzz_must((status == EBPO_OK) == (scene != NULL));
    fuzz_must(status == EBPO_OK || (error.status == status && error.message[0]));
    return scene;
}

static void check_pose(const ebpo_pose *pose)
{
    fuzz_must(pose->scale > 0 && pose->scale <= DBL_MAX);
    for (int i = 0; i < 3; i++) {
        double length = 0;
        fuzz_must(isfinite(pose->translation[i]));
        for (int k = 0; k < 3; k++)
            length += pose->rotation[i][k] * pose->rotation[i][k];
        fuzz_must(fabs(length - 1) < 1e-5);
    }
}

static void check_instance(const ebpo_scene *scene, const ebpo_scene_counts *counts, uint64_t i)
{
    ebpo_scene_instance at = EBPO_SCENE_INSTANCE_INIT;
    double clearance;
    fuzz_must(ebpo_scene_get_instance(scene, i, &at) == EBPO_OK);
    fuzz_must(at.name && at.name[0] && strlen(at.name) <= 255 && at.model < counts->models);
    fuzz_must(at.route == EBPO_SCENE_NONE || (at.route < counts->routes && !at.fixed));
    fuzz_must(at.layer == EBPO_SCENE_NONE || ebpo_scene_get_layer(scene, at.layer));
    for (int k = 0; k <= 4; k++) {
        ebpo_pose pose;
        ebpo_error error = EBPO_ERROR_INIT;
        double time = counts->begin + (counts->end - counts->begin) * (k / 4.);
        if (isfinite(time) && ebpo_scene_pose(scene, i, time, &pose, &error) == EBPO_OK)
            check_pose(&pose);
    }
    fuzz_must(!ebpo_scene_pair_rule(scene, i, i, &clearance));
    fuzz_must(!ebpo_scene_pair_rule(scene, i, counts->instances, &clearance));
    for (uint64_t j = 0; j < i && j < 8; j++)
        fuzz_must(!ebpo_scene_pair_rule(scene, i, j, &clearance) || clearance >= 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    ebpo_scene_counts counts = EBPO_SCENE_COUNTS_INIT;
    ebpo_scene *scene = parse(data, size);
    if (!scene)
        return 0;
    fuzz_must(ebpo_scene_get_counts(scene, &counts) == EBPO_OK && counts.begin <= counts.end);
    for (uint64_t i = 0; i < counts.models; i++) {
        ebpo_scene_model_facts facts = EBPO_SCENE_MODEL_FACTS_INIT;
        fuzz_must(ebpo_scene_get_model_facts(scene, i, &facts) == EBPO_OK);
        fuzz_must(facts.name && facts.path && !facts.loaded);
    }
    for (uint64_t i = 0; i < counts.instances; i++)
        check_instance(scene, &counts, i);
    for (uint64_t i = 0; i < counts.cameras; i++) {
        ebpo_scene_camera camera = EBPO_SCENE_CAMERA_INIT;
        fuzz_must(ebpo_scene_get_camera(scene, i, &camera) == EBPO_OK);
        fuzz_must(camera.name && camera.fov > 0 && camera.fov < 180 && camera.width &&
                  camera.height);
    }
    ebpo_scene_free(scene);
    return 0;
}
