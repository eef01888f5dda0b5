/* What a scene tells of itself. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "core/error.h"
#include "extras/scene/scene_parts.h"

static void add_times(const ebpo_scene *scene, ebpo_scene_counts *c)
{
    double begin = INFINITY, end = -INFINITY;
    for (uint64_t i = 0; i < scene->routes_count; i++) {
        const scene_route *r = &scene->routes[i];
        c->poses += r->count;
        if (r->count) {
            begin = fmin(begin, r->keys[0].time);
            end = fmax(end, r->keys[r->count - 1].time);
        }
    }
    if (begin <= end) {
        c->begin = begin;
        c->end = end;
    }
}

ebpo_status ebpo_scene_get_counts(const ebpo_scene *scene, ebpo_scene_counts *out)
{
    ebpo_scene_counts c = EBPO_SCENE_COUNTS_INIT;
    c.models = scene->models_count;
    c.instances = scene->instances_count;
    c.layers = scene->layers_count;
    c.groups = scene->groups_count;
    c.routes = scene->routes_count;
    c.cameras = scene->cameras_count;
    c.ignored = scene->ignored;
    c.clearances = scene->clearances;
    for (uint64_t i = 0; i < scene->instances_count; i++)
        c.fixed += scene->instances[i].as.fixed;
    add_times(scene, &c);
    return EBPO_GIVE(ebpo_scene_counts, out, &c);
}

ebpo_status ebpo_scene_get_model(const ebpo_scene *scene, uint64_t model,
                                 ebpo_scene_model_facts *out)
{
    if (model >= scene->models_count)
        return EBPO_E_ARGUMENT;
    const scene_model *m = &scene->models[model];
    ebpo_scene_model_facts f = EBPO_SCENE_MODEL_FACTS_INIT;
    f.name = m->name;
    f.path = m->path;
    f.instances = m->instances;
    f.loaded = m->file != EBPO_SCENE_NONE;
    memcpy(f.digest, m->digest, sizeof f.digest);
    memcpy(f.min, m->min, sizeof f.min);
    memcpy(f.max, m->max, sizeof f.max);
    return EBPO_GIVE(ebpo_scene_model_facts, out, &f);
}

ebpo_status ebpo_scene_get_instance(const ebpo_scene *scene, uint64_t instance,
                                    ebpo_scene_instance *out)
{
    if (instance >= scene->instances_count)
        return EBPO_E_ARGUMENT;
    return EBPO_GIVE(ebpo_scene_instance, out, &scene->instances[instance].as);
}

const char *ebpo_scene_get_layer(const ebpo_scene *scene, uint64_t layer)
{
    return layer < scene->layers_count ? scene->sets[scene->layers[layer]] : NULL;
}

const char *ebpo_scene_get_group(const ebpo_scene *scene, uint64_t group)
{
    return group < scene->groups_count ? scene->sets[scene->groups[group]] : NULL;
}

/* EBPO_SCENE_NONE: the set is no group's. */
static uint64_t group_with(const ebpo_scene *scene, uint64_t set)
{
    uint64_t low = 0, high = scene->groups_count;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (scene->groups[middle] < set)
            low = middle + 1;
        else
            high = middle;
    }
    return low < scene->groups_count && scene->groups[low] == set ? low : EBPO_SCENE_NONE;
}

uint64_t ebpo_scene_group_of(const ebpo_scene *scene, uint64_t instance, uint64_t nth)
{
    uint64_t group = EBPO_SCENE_NONE;
    if (instance >= scene->instances_count)
        return group;
    const scene_instance *i = &scene->instances[instance];
    for (uint32_t n = 0; n < i->set_count; n++) {
        group = group_with(scene, i->sets[n]);
        if (group != EBPO_SCENE_NONE && nth-- == 0)
            return group;
    }
    return EBPO_SCENE_NONE;
}

ebpo_status ebpo_scene_get_camera(const ebpo_scene *scene, uint64_t camera, ebpo_scene_camera *out)
{
    if (camera >= scene->cameras_count)
        return EBPO_E_ARGUMENT;
    return EBPO_GIVE(ebpo_scene_camera, out, &scene->cameras[camera]);
}

ebpo_status ebpo_scene_get_stats(const ebpo_scene *scene, ebpo_scene_stats *out)
{
    ebpo_scene_stats s = EBPO_SCENE_STATS_INIT;
    for (uint64_t i = 0; i < scene->files_count; i++) {
        const scene_file *f = &scene->files[i];
        ebpo_file_stats read = EBPO_FILE_STATS_INIT;
        ebpo_model_stats model = EBPO_MODEL_STATS_INIT;
        if (!f->file)
            continue;
        (void)ebpo_file_get_stats(f->file, &read);
        s.files++;
        s.bytes_read += read.bytes_read;
        s.reads += read.reads;
        if (!f->model)
            continue;
        (void)ebpo_model_get_stats(f->model, &model);
        s.models++;
        s.memory += model.memory;
        s.loads += model.loads;
    }
    return EBPO_GIVE(ebpo_scene_stats, out, &s);
}
