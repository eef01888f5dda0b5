/* Makes a scene: adds and returns its members, and checks names and the paths of files.
 *
 * Models, routes and cameras each have a separate name space. A rule applies to the pairs of an
 * instance of one set and an instance of another set. The rule requires a clearance of these pairs,
 * or ignores them. The rule names each of the two sets by a selector: "*", the name of an instance,
 * or the name of a layer or a group with the prefix "layer:" or "group:". Every instance belongs to
 * the set of all instances, to a set that has only this instance, to the set of its layer and to
 * the sets of its groups.
 *
 * A scene file is untrusted input. If the options do not allow other files, it may name only files
 * in its folder or in folders below its folder. Symbolic links that lead out of the folder are
 * rejected. */
#include "core/strict_fp.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/http.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/os.h"
#include "extras/scene/scene_parts.h"
#include "geometry/pose.h"

enum { NAME_MAX = 255, KIND_MAX = 8 };

/* Returns true if the name is valid UTF-8 without control characters. */
static bool is_plain(const char *name)
{
    for (const unsigned char *c = (const unsigned char *)name; *c; c++)
        if (*c < 0x20 || *c == 0x7f)
            return false;
    json_t *text = json_string(name); /* NULL if it is not UTF-8 */
    json_decref(text);
    return text != NULL;
}

/* Checks a name: 1 to 255 bytes of UTF-8 without control characters. It must not be "*", nor begin
 * with "layer:" or "group:". what: for messages, such as "a model". */
static ebpo_status check_name(const char *name, const char *what, ebpo_error *error)
{
    size_t size = name ? strnlen(name, NAME_MAX + 1) : 0;
    if (size == 0 || size > NAME_MAX || !is_plain(name))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "expected a name of %s, 1 to %d bytes of UTF-8 without control characters",
                         what, NAME_MAX);
    if (strcmp(name, "*") == 0 || strncmp(name, "layer:", 6) == 0 ||
        strncmp(name, "group:", 6) == 0)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "'%.80s' cannot be a name of %s: '*', 'layer:' and 'group:' are "
                         "selectors",
                         name, what);
    return EBPO_OK;
}

/* Writes the key of a name in scene->names: its kind, then the name. */
static void join_name(char *out, size_t space, const char *kind, const char *name)
{
    size_t begin = strlen(kind), size = strnlen(name, space - begin - 1);
    memcpy(out, kind, begin);
    memcpy(out + begin, name, size);
    out[begin + size] = 0;
}

uint64_t ebpo_scene_find_name(const ebpo_scene *scene, const char *kind, const char *name)
{
    char key[KIND_MAX + NAME_MAX + 2];
    join_name(key, sizeof key, kind, name);
    const json_t *number = json_object_get(scene->names, key);
    return number ? (uint64_t)json_integer_value(number) : EBPO_SCENE_NONE;
}

/* Stores the index of the object with this kind and name in scene->names. Fails with
 * EBPO_E_ARGUMENT if the name exists already. */
static ebpo_status put_name(ebpo_scene *scene, const char *kind, const char *name, uint64_t number,
                            ebpo_error *error)
{
    char key[KIND_MAX + NAME_MAX + 2];
    join_name(key, sizeof key, kind, name);
    if (json_object_get(scene->names, key))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "the name '%.80s' exists already", name);
    if (json_object_set_new(scene->names, key, json_integer((json_int_t)number)) != 0)
        return ebpo_fail_memory(error, sizeof key);
    return EBPO_OK;
}

/* Adds a set. If `set` is not NULL, sets *set to the index of the new set. kind: "", "layer:" or
 * "group:". */
static ebpo_status add_set(ebpo_scene *scene, const char *kind, const char *name, uint64_t *set,
                           ebpo_error *error)
{
    uint64_t number = scene->sets_count;
    if (!ebpo_grow(&scene->sets, &scene->sets_capacity, number + 1, sizeof *scene->sets))
        return ebpo_fail_memory(error, (number + 1) * sizeof *scene->sets);
    ebpo_status status = put_name(scene, kind, name, number, error);
    if (status != EBPO_OK)
        return status;
    scene->sets[number] = strdup(name);
    if (!scene->sets[number])
        return ebpo_fail_memory(error, strlen(name));
    scene->sets_count++;
    if (set)
        *set = number;
    return EBPO_OK;
}

/* --- files that a scene names --- */

/* Returns true if one of the names in the path is "..". */
static bool goes_up(const char *path)
{
    for (const char *name = path; name; name = strchr(name, '/')) {
        name += *name == '/';
        if (strncmp(name, "..", 2) == 0 && (name[2] == '/' || name[2] == 0))
            return true;
    }
    return false;
}

const char *ebpo_scene_path_refused(const char *path, const ebpo_scene_options *options,
                                    bool has_digest)
{
    if (!*path)
        return "is not a path";
    if (ebpo_is_url(path) && !options->remote)
        return "is on a server; to allow files on servers, use ebpo scene --remote";
    if (ebpo_is_url(path) && !has_digest)
        return "is on a server; add its content_sha256 to the model in the scene";
    if (!ebpo_is_url(path) && !options->allow_outside &&
        (ebpo_path_is_absolute(path) || goes_up(path)))
        return "is outside the scene's folder; move it there, or use ebpo scene --allow-outside";
    return NULL;
}

char *ebpo_scene_join_path(const char *folder, const char *path)
{
    bool is_absolute = ebpo_path_is_absolute(path) || ebpo_is_url(path);
    size_t begin = is_absolute ? 0 : strlen(folder), size = strlen(path);
    char *joined = malloc(begin + size + 1);
    if (joined) {
        memcpy(joined, folder, begin);
        memcpy(joined + begin, path, size + 1);
    }
    return joined;
}

/* Returns true if the path is in the folder or in a folder below it. Neither path may contain
 * symbolic links. */
static bool is_below(const char *folder, const char *path)
{
    size_t size = strlen(folder);
    size -= size && folder[size - 1] == '/'; /* realpath returns a final slash only for "/" */
    return strncmp(folder, path, size) == 0 && path[size] == '/';
}

/* Checks that a file is in the folder. real: the file's path without symbolic links. path: the path
 * that the scene names, for the message. */
static ebpo_status check_real(const char *folder, const char *real, const char *path,
                              ebpo_error *error)
{
    if (is_below(folder, real))
        return EBPO_OK;
    return ebpo_fail_file(error, EBPO_E_FORMAT, path,
                          "leads by a link to the file %.160s, outside the scene's folder %.160s; "
                          "move it there, or use ebpo scene --allow-outside",
                          real, folder);
}

ebpo_status ebpo_scene_stays_within(const char *folder, const char *path, ebpo_error *error)
{
    if (ebpo_is_url(path))
        return EBPO_OK;
    char *top = realpath(*folder ? folder : ".", NULL), *real = realpath(path, NULL);
    ebpo_status status = EBPO_OK;
    if (top && real)
        status = check_real(top, real, path, error);
    else if (errno == ENOMEM)
        status = ebpo_fail_memory(error, strlen(path));
    else
        status = ebpo_fail_errno(error, path, "cannot be opened");
    free(top);
    free(real);
    return status;
}

char *ebpo_scene_folder_of(const char *path)
{
    const char *last = ebpo_last_separator(path);
    return strndup(path, last ? (size_t)(last - path) + 1 : 0);
}

/* --- adding --- */

ebpo_status ebpo_scene_new(ebpo_scene **out, ebpo_error *error)
{
    *out = NULL;
    ebpo_scene *scene = ebpo_alloc_zero(1, sizeof *scene);
    if (!scene)
        return ebpo_fail_memory(error, sizeof *scene);
    scene->model_options = (ebpo_model_options)EBPO_MODEL_OPTIONS_INIT;
    scene->names = json_object();
    scene->folder = strdup("");
    ebpo_status status = EBPO_OK;
    if (!scene->names || !scene->folder)
        status = ebpo_fail_memory(error, 64);
    if (status == EBPO_OK)
        status = add_set(scene, "", "*", NULL, error);
    if (status == EBPO_OK)
        *out = scene;
    else
        ebpo_scene_free(scene);
    return status;
}

static void free_members(ebpo_scene *scene)
{
    for (uint64_t i = 0; i < scene->models_count; i++) {
        free(scene->models[i].name);
        free(scene->models[i].path);
    }
    for (uint64_t i = 0; i < scene->instances_count; i++) {
        free((char *)scene->instances[i].description.name);
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
    ebpo_budget_free(scene->model_options.budget);
}

void ebpo_scene_free(ebpo_scene *scene)
{
    if (!scene)
        return;
    close_files(scene);
    free_members(scene);
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

/* Makes space for one more item of a list of the scene, and sets *number to the item's index. */
#define SPACE(scene, list, number, error)                                            \
    (*(number) = (scene)->list##_count,                                              \
     ebpo_grow(&(scene)->list, &(scene)->list##_capacity, (scene)->list##_count + 1, \
               sizeof *(scene)->list)                                                \
         ? EBPO_OK                                                                   \
         : ebpo_fail_memory(error, ((scene)->list##_count + 1) * sizeof *(scene)->list))

ebpo_status ebpo_scene_add_model(ebpo_scene *scene, const char *name, const char *path,
                                 const uint8_t digest[32], uint64_t *number, ebpo_error *error)
{
    uint64_t n;
    ebpo_status status = check_name(name, "a model", error);
    if (status == EBPO_OK)
        status = SPACE(scene, models, &n, error);
    if (status == EBPO_OK)
        status = put_name(scene, EBPO_SCENE_MODEL, name, n, error);
    if (status != EBPO_OK)
        return status;
    ebpo_scene_model_entry *m = &scene->models[n];
    *m = (ebpo_scene_model_entry){ .name = strdup(name),
                                   .path = strdup(path),
                                   .file = EBPO_SCENE_NONE };
    if (digest)
        memcpy(m->digest, digest, sizeof m->digest);
    scene->models_count++; /* from here on the model is freed with the scene, complete or not */
    if (!m->name || !m->path)
        return ebpo_fail_memory(error, strlen(name) + strlen(path));
    if (number)
        *number = n;
    return EBPO_OK;
}

static ebpo_status check_instance(const ebpo_scene *scene, const ebpo_scene_instance *i,
                                  ebpo_error *error)
{
    static const double origin[3] = { 0, 0, 0 };
    ebpo_posing posing;
    ebpo_status status = check_name(i->name, "an instance", error);
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
        return ebpo_fail(
            error, EBPO_E_ARGUMENT,
            "a fixed instance must not have a route; set fixed to false or remove the route");
    return ebpo_posing_make(&posing, &i->pose, origin, error); /* only checks the pose */
}

/* Puts the newest instance into three sets: the set of all instances, the set of its layer, and
 * `set`, which has only this instance. */
static ebpo_status put_newest_into_sets(ebpo_scene *scene, uint64_t set, ebpo_error *error)
{
    const ebpo_scene_instance_entry *newest = &scene->instances[scene->instances_count - 1];
    ebpo_status status = ebpo_scene_put_newest_into(scene, EBPO_SCENE_ALL_SET, error);
    if (status == EBPO_OK && newest->description.layer != EBPO_SCENE_NONE)
        status = ebpo_scene_put_newest_into(scene, scene->layers[newest->description.layer], error);
    return status == EBPO_OK ? ebpo_scene_put_newest_into(scene, set, error) : status;
}

ebpo_status ebpo_scene_add_instance(ebpo_scene *scene, const ebpo_scene_instance *instance,
                                    uint64_t *number, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_scene_instance description = EBPO_SCENE_INSTANCE_INIT;
    uint64_t n, set;
    ebpo_status status = EBPO_TAKE(ebpo_scene_instance, &description, instance, error);
    if (status == EBPO_OK)
        status = check_instance(scene, &description, error);
    if (status == EBPO_OK)
        status = SPACE(scene, instances, &n, error);
    if (status == EBPO_OK)
        status = add_set(scene, "", description.name, &set, error);
    if (status != EBPO_OK)
        return status;
    description.name = strdup(description.name);
    scene->instances[n] = (ebpo_scene_instance_entry){ .description = description };
    scene->instances_count++;
    if (!description.name)
        return ebpo_fail_memory(error, 1);
    scene->models[description.model].instances++;
    if (number)
        *number = n;
    return put_newest_into_sets(scene, set, error);
}

ebpo_status ebpo_scene_put_newest_into(ebpo_scene *scene, uint64_t set, ebpo_error *error)
{
    ebpo_scene_instance_entry *i = &scene->instances[scene->instances_count - 1];
    uint64_t *sets = ebpo_realloc(i->sets, i->set_count + 1, sizeof *sets);
    if (!sets)
        return ebpo_fail_memory(error, (i->set_count + 1) * sizeof *sets);
    i->sets = sets;
    sets[i->set_count++] = set;
    return EBPO_OK;
}

ebpo_status ebpo_scene_add_layer(ebpo_scene *scene, const char *name, ebpo_error *error)
{
    uint64_t n, set;
    ebpo_status status = check_name(name, "a layer", error);
    if (status == EBPO_OK)
        status = SPACE(scene, layers, &n, error);
    if (status == EBPO_OK)
        status = add_set(scene, "layer:", name, &set, error);
    if (status != EBPO_OK)
        return status;
    scene->layers[n] = set;
    scene->layers_count++;
    return put_name(scene, EBPO_SCENE_LAYER, name, n, error);
}

ebpo_status ebpo_scene_add_group(ebpo_scene *scene, const char *name, ebpo_error *error)
{
    uint64_t n, set;
    ebpo_status status = check_name(name, "a group", error);
    if (status == EBPO_OK)
        status = SPACE(scene, groups, &n, error);
    if (status == EBPO_OK)
        status = add_set(scene, "group:", name, &set, error);
    if (status != EBPO_OK)
        return status;
    scene->groups[n] = set;
    scene->groups_count++;
    return EBPO_OK;
}

ebpo_status ebpo_scene_add_route(ebpo_scene *scene, const char *name, uint64_t *number,
                                 ebpo_error *error)
{
    ebpo_status status = check_name(name, "a route", error);
    if (status == EBPO_OK)
        status = SPACE(scene, routes, number, error);
    if (status == EBPO_OK)
        status = put_name(scene, EBPO_SCENE_ROUTE, name, *number, error);
    if (status != EBPO_OK)
        return status;
    scene->routes[scene->routes_count++] = (ebpo_scene_route){ .name = strdup(name) };
    return scene->routes[*number].name ? EBPO_OK : ebpo_fail_memory(error, strlen(name));
}

ebpo_status ebpo_scene_add_camera(ebpo_scene *scene, const ebpo_scene_camera *camera,
                                  ebpo_error *error)
{
    uint64_t n;
    ebpo_status status = check_name(camera->name, "a camera", error);
    if (status == EBPO_OK)
        status = SPACE(scene, cameras, &n, error);
    if (status == EBPO_OK)
        status = put_name(scene, EBPO_SCENE_CAMERA, camera->name, n, error);
    if (status != EBPO_OK)
        return status;
    ebpo_scene_camera *c = &scene->cameras[n];
    *c = *camera;
    c->name = strdup(camera->name);
    scene->cameras_count++;
    return c->name ? EBPO_OK : ebpo_fail_memory(error, strlen(camera->name));
}

ebpo_status ebpo_scene_add_rule(ebpo_scene *scene, uint64_t a, uint64_t b, double clearance,
                                ebpo_error *error)
{
    uint64_t n;
    ebpo_status status = SPACE(scene, rules, &n, error);
    if (status != EBPO_OK)
        return status;
    scene->rules[scene->rules_count++] =
        (ebpo_scene_rule_entry){ a < b ? a : b, a < b ? b : a, clearance };
    scene->ignored_count += clearance < 0; /* below 0: the pairs are ignored */
    scene->clearance_count += clearance >= 0;
    return EBPO_OK;
}

/* --- returning members --- */

/* Adds the number of poses of all routes, and sets the first and the last time. */
static void add_times(const ebpo_scene *scene, ebpo_scene_counts *c)
{
    double begin = INFINITY, end = -INFINITY;
    for (uint64_t i = 0; i < scene->routes_count; i++) {
        const ebpo_scene_route *r = &scene->routes[i];
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
    c.ignored = scene->ignored_count;
    c.clearances = scene->clearance_count;
    for (uint64_t i = 0; i < scene->instances_count; i++)
        c.fixed += scene->instances[i].description.fixed;
    add_times(scene, &c);
    return EBPO_GIVE(ebpo_scene_counts, out, &c);
}

ebpo_status ebpo_scene_get_model_facts(const ebpo_scene *scene, uint64_t model,
                                       ebpo_scene_model_facts *out)
{
    if (model >= scene->models_count)
        return EBPO_E_ARGUMENT;
    const ebpo_scene_model_entry *m = &scene->models[model];
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
    return EBPO_GIVE(ebpo_scene_instance, out, &scene->instances[instance].description);
}

const char *ebpo_scene_get_layer(const ebpo_scene *scene, uint64_t layer)
{
    return layer < scene->layers_count ? scene->sets[scene->layers[layer]] : NULL;
}

const char *ebpo_scene_get_group(const ebpo_scene *scene, uint64_t group)
{
    return group < scene->groups_count ? scene->sets[scene->groups[group]] : NULL;
}

/* Returns the group to which a set belongs; EBPO_SCENE_NONE if it is not the set of a group. */
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
    const ebpo_scene_instance_entry *i = &scene->instances[instance];
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
        const ebpo_scene_file_entry *f = &scene->files[i];
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
