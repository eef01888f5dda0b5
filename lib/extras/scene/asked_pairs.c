/* Pairs of instances that are asked about one after the other, by any thread. */
#include "core/strict_fp.h"

#include "extras/scene/asked_pairs.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "extras/collide/of_parts.h"

static bool keep_pairs(void *user, const ebpo_scene_pair *pairs, uint64_t count)
{
    scene_pairs_list *list = user;
    list->pairs = ebpo_alloc(count, sizeof *pairs);
    list->count = count;
    if (list->pairs)
        memcpy(list->pairs, pairs, count * sizeof *pairs);
    return true;
}

ebpo_status scene_make_models(ebpo_scene *scene, const ebpo_scene_pair *pairs, uint64_t count,
                              ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    ebpo_model *model;
    for (uint64_t i = 0; i < 2 * count && status == EBPO_OK; i++) {
        uint64_t instance = i % 2 ? pairs[i / 2].b : pairs[i / 2].a;
        status = ebpo_scene_model(scene, scene->instances[instance].as.model, &model, error);
    }
    return status;
}

ebpo_status scene_keep_pairs(const ebpo_scene *scene, double from, double to, scene_pairs_list *out,
                             ebpo_error *error)
{
    *out = (scene_pairs_list){ 0 };
    ebpo_status status = ebpo_scene_pairs(scene, from, to, keep_pairs, out, error);
    if (status == EBPO_OK && out->count && !out->pairs)
        status = ebpo_fail_memory(error, out->count * sizeof *out->pairs);
    return status;
}

ebpo_status scene_list_pairs(ebpo_scene *scene, double from, double to, scene_pairs_list *out,
                             ebpo_error *error)
{
    ebpo_status status = scene_keep_pairs(scene, from, to, out, error);
    if (status == EBPO_OK)
        status = scene_make_models(scene, out->pairs, out->count, error);
    if (status != EBPO_OK) {
        free(out->pairs);
        *out = (scene_pairs_list){ 0 };
    }
    return status;
}

static ebpo_model *model_of(const ebpo_scene *scene, uint64_t instance)
{
    return scene->files[scene->models[scene->instances[instance].as.model].file].model;
}

static bool has_mesh(const ebpo_scene *scene, uint64_t instance)
{
    uint64_t model = scene->instances[instance].as.model;
    return ebpo_file_info(ebpo_scene_file(scene, model))->parts & EBPO_PART_MESH;
}

ebpo_status scene_collider(const ebpo_scene *scene, const ebpo_scene_pair *pair, unsigned threads,
                           ebpo_collider **out, ebpo_error *error)
{
    ebpo_collider_options how = EBPO_COLLIDER_OPTIONS_INIT;
    how.threads = threads;
    *out = NULL;
    if (!has_mesh(scene, pair->a) || !has_mesh(scene, pair->b))
        return EBPO_OK;
    return ebpo_collider_of_parts(model_of(scene, pair->a), model_of(scene, pair->b), &how, out,
                                  error);
}

ebpo_status scene_pose_pair(const ebpo_scene *scene, const ebpo_scene_pair *pair, double time,
                            ebpo_collide_options *out, ebpo_error *error)
{
    ebpo_status status = ebpo_scene_pose(scene, pair->a, time, &out->pose_a, error);
    return status == EBPO_OK ? ebpo_scene_pose(scene, pair->b, time, &out->pose_b, error) : status;
}
