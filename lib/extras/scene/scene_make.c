/* Scenes as they are made: what is added. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "geometry/pose.h"
#include "extras/scene/scene_parts.h"

ebpo_status ebpo_scene_new(ebpo_scene **out, ebpo_error *error)
{
    *out = NULL;
    ebpo_scene *scene = ebpo_alloc_zero(1, sizeof *scene);
    if (!scene)
        return ebpo_fail_memory(error, sizeof *scene);
    scene->how = (ebpo_model_options)EBPO_MODEL_OPTIONS_INIT;
    scene->names = json_object();
    scene->folder = strdup("");
    ebpo_status status = EBPO_OK;
    if (!scene->names || !scene->folder)
        status = ebpo_fail_memory(error, 64);
    if (status == EBPO_OK)
        status = scene_add_set(scene, "", "*", NULL, error);
    if (status == EBPO_OK)
        *out = scene;
    else
        ebpo_scene_free(scene);
    return status;
}

static void free_parts(ebpo_scene *scene)
{
    for (uint64_t i = 0; i < scene->models_count; i++) {
        free(scene->models[i].name);
        free(scene->models[i].path);
    }
    for (uint64_t i = 0; i < scene->instances_count; i++) {
        free((char *)scene->instances[i].as.name);
        free(scene->instances[i].sets);
    }
    for (uint64_t i = 0; i < scene->routes_count; i++) {
        free(scene->routes[i].name);
        free(scene->routes[i].keys);
    }
    for (uint64_t i = 0; i < scene->cameras_count; i++)
        free((char *)scene->cameras[i].name);
    for (uint64_t i = 0; i < scene->sets_count; i++)
        free(scene->sets[i]);
}

static void close_files(ebpo_scene *scene)
{
    for (uint64_t i = 0; i < scene->files_count; i++) {
        ebpo_model_free(scene->files[i].model);
        ebpo_close(scene->files[i].file);
        free(scene->files[i].path);
    }
    ebpo_budget_free(scene->how.budget);
}

void ebpo_scene_free(ebpo_scene *scene)
{
    if (!scene)
        return;
    close_files(scene);
    free_parts(scene);
    free(scene->models);
    free(scene->instances);
    free(scene->routes);
    free(scene->cameras);
    free(scene->rules);
    free(scene->sets);
    free(scene->layers);
    free(scene->groups);
    free(scene->files);
    free(scene->folder);
    free(scene->text);
    json_decref(scene->names);
    free(scene);
}

/* Makes room for one more, sets *number to its number. */
#define ROOM(scene, list, number, error)                                             \
    (*(number) = (scene)->list##_count,                                              \
     ebpo_grow(&(scene)->list, &(scene)->list##_capacity, (scene)->list##_count + 1, \
               sizeof *(scene)->list)                                                \
         ? EBPO_OK                                                                   \
         : ebpo_fail_memory(error, ((scene)->list##_count + 1) * sizeof *(scene)->list))

ebpo_status ebpo_scene_add_model(ebpo_scene *scene, const char *name, const char *path,
                                 const uint8_t digest[32], uint64_t *number, ebpo_error *error)
{
    uint64_t n;
    ebpo_status status = scene_check_name(name, "a model", error);
    if (status == EBPO_OK)
        status = ROOM(scene, models, &n, error);
    if (status == EBPO_OK)
        status = scene_put_name(scene, SCENE_MODEL, name, n, error);
    if (status != EBPO_OK)
        return status;
    scene_model *m = &scene->models[n];
    *m = (scene_model){ .name = strdup(name), .path = strdup(path), .file = EBPO_SCENE_NONE };
    if (digest)
        memcpy(m->digest, digest, sizeof m->digest);
    scene->models_count++; /* freed with the scene, whole or not */
    if (!m->name || !m->path)
        return ebpo_fail_memory(error, strlen(name) + strlen(path));
    if (number)
        *number = n;
    return EBPO_OK;
}

static ebpo_status check_instance(const ebpo_scene *scene, const ebpo_scene_instance *i,
                                  ebpo_error *error)
{
    static const double nowhere[3] = { 0, 0, 0 };
    ebpo_posing posing;
    ebpo_status status = scene_check_name(i->name, "an instance", error);
    if (status != EBPO_OK)
        return status;
    if (i->model >= scene->models_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "there is no model %llu",
                         (unsigned long long)i->model);
    if (i->route != EBPO_SCENE_NONE && i->route >= scene->routes_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "there is no route %llu",
                         (unsigned long long)i->route);
    if (i->layer != EBPO_SCENE_NONE && i->layer >= scene->layers_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "there is no layer %llu",
                         (unsigned long long)i->layer);
    if (i->fixed && i->route != EBPO_SCENE_NONE)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "what is fixed has no route");
    return ebpo_posing_make(&posing, &i->pose, nowhere, error);
}

static ebpo_status own_sets(ebpo_scene *scene, uint64_t set, ebpo_error *error)
{
    const scene_instance *i = &scene->instances[scene->instances_count - 1];
    ebpo_status status = scene_join_set(scene, SCENE_ALL_SET, error);
    if (status == EBPO_OK && i->as.layer != EBPO_SCENE_NONE)
        status = scene_join_set(scene, scene->layers[i->as.layer], error);
    return status == EBPO_OK ? scene_join_set(scene, set, error) : status;
}

ebpo_status ebpo_scene_add_instance(ebpo_scene *scene, const ebpo_scene_instance *instance,
                                    uint64_t *number, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_scene_instance as = EBPO_SCENE_INSTANCE_INIT;
    uint64_t n, set;
    ebpo_status status = EBPO_TAKE(ebpo_scene_instance, &as, instance, error);
    if (status == EBPO_OK)
        status = check_instance(scene, &as, error);
    if (status == EBPO_OK)
        status = ROOM(scene, instances, &n, error);
    if (status == EBPO_OK)
        status = scene_add_set(scene, "", as.name, &set, error);
    if (status != EBPO_OK)
        return status;
    as.name = strdup(as.name);
    scene->instances[n] = (scene_instance){ .as = as };
    scene->instances_count++;
    if (!as.name)
        return ebpo_fail_memory(error, 1);
    scene->models[as.model].instances++;
    if (number)
        *number = n;
    return own_sets(scene, set, error);
}

ebpo_status scene_join_set(ebpo_scene *scene, uint64_t set, ebpo_error *error)
{
    scene_instance *i = &scene->instances[scene->instances_count - 1];
    uint64_t *sets = ebpo_realloc(i->sets, i->set_count + 1, sizeof *sets);
    if (!sets)
        return ebpo_fail_memory(error, (i->set_count + 1) * sizeof *sets);
    i->sets = sets;
    sets[i->set_count++] = set;
    return EBPO_OK;
}

ebpo_status scene_add_layer(ebpo_scene *scene, const char *name, ebpo_error *error)
{
    uint64_t n, set;
    ebpo_status status = scene_check_name(name, "a layer", error);
    if (status == EBPO_OK)
        status = ROOM(scene, layers, &n, error);
    if (status == EBPO_OK)
        status = scene_add_set(scene, "layer:", name, &set, error);
    if (status != EBPO_OK)
        return status;
    scene->layers[n] = set;
    scene->layers_count++;
    return scene_put_name(scene, SCENE_LAYER, name, n, error);
}

ebpo_status scene_add_group(ebpo_scene *scene, const char *name, ebpo_error *error)
{
    uint64_t n, set;
    ebpo_status status = scene_check_name(name, "a group", error);
    if (status == EBPO_OK)
        status = ROOM(scene, groups, &n, error);
    if (status == EBPO_OK)
        status = scene_add_set(scene, "group:", name, &set, error);
    if (status != EBPO_OK)
        return status;
    scene->groups[n] = set;
    scene->groups_count++;
    return EBPO_OK;
}

ebpo_status scene_add_route(ebpo_scene *scene, const char *name, uint64_t *number,
                            ebpo_error *error)
{
    ebpo_status status = scene_check_name(name, "a route", error);
    if (status == EBPO_OK)
        status = ROOM(scene, routes, number, error);
    if (status == EBPO_OK)
        status = scene_put_name(scene, SCENE_ROUTE, name, *number, error);
    if (status != EBPO_OK)
        return status;
    scene->routes[scene->routes_count++] = (scene_route){ .name = strdup(name) };
    return scene->routes[*number].name ? EBPO_OK : ebpo_fail_memory(error, strlen(name));
}

ebpo_status scene_add_camera(ebpo_scene *scene, const ebpo_scene_camera *camera, ebpo_error *error)
{
    uint64_t n;
    ebpo_status status = scene_check_name(camera->name, "a camera", error);
    if (status == EBPO_OK)
        status = ROOM(scene, cameras, &n, error);
    if (status == EBPO_OK)
        status = scene_put_name(scene, SCENE_CAMERA, camera->name, n, error);
    if (status != EBPO_OK)
        return status;
    ebpo_scene_camera *c = &scene->cameras[n];
    *c = *camera;
    c->name = strdup(camera->name);
    scene->cameras_count++;
    return c->name ? EBPO_OK : ebpo_fail_memory(error, strlen(camera->name));
}

ebpo_status scene_add_rule(ebpo_scene *scene, uint64_t a, uint64_t b, double clearance,
                           ebpo_error *error)
{
    uint64_t n;
    ebpo_status status = ROOM(scene, rules, &n, error);
    if (status != EBPO_OK)
        return status;
    scene->rules[scene->rules_count++] = (scene_rule){ a < b ? a : b, a < b ? b : a, clearance };
    scene->ignored += clearance < 0;
    scene->clearances += clearance >= 0;
    return EBPO_OK;
}
