#include "cli/commands/haptic_scene.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "cli/command.h"
#include "cli/commands/haptic_device.h"
#include "cli/json.h"
#include "cli/words.h"

static ebpo_status fail_scene(ebpo_error *error, ebpo_status status, const char *name,
                              const char *what)
{
    *error = (ebpo_error){ .status = status, .offset = -1 };
    snprintf(error->message, sizeof error->message, "%.200s: %s", name, what);
    return status;
}

static ebpo_status fail_memory(ebpo_error *error, const haptic_scene *s)
{
    return fail_scene(error, EBPO_E_MEMORY, s->name, "not enough memory for the scene");
}

/* Sets *number to the index of the surface of a model. Adds the surface if it is new. */
static ebpo_status find_surface(haptic_scene *s, uint64_t model, uint64_t *number,
                                ebpo_error *error)
{
    const ebpo_file *file = ebpo_scene_file(s->scene, model);
    ebpo_scene_model_facts facts = EBPO_SCENE_MODEL_FACTS_INIT;
    for (*number = 0; *number < s->surface_count; ++*number)
        if (s->surfaces[*number].file == file)
            return EBPO_OK;
    (void)ebpo_scene_get_model_facts(s->scene, model, &facts);
    haptic_surface *surface = &s->surfaces[s->surface_count];
    *surface = (haptic_surface){ .name = facts.name, .file = file };
    ebpo_status status = ebpo_scene_model(s->scene, model, &surface->model, error);
    if (status != EBPO_OK)
        return status;
    s->paths[s->surface_count] = command_path_in_scene(s->name, facts.path);
    return s->paths[s->surface_count++] ? EBPO_OK : fail_memory(error, s);
}

/* Sets the poses and models of all instances at a time. */
static ebpo_status get_instances(haptic_scene *s, double time, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < s->instance_count && status == EBPO_OK; i++) {
        ebpo_scene_instance instance = EBPO_SCENE_INSTANCE_INIT;
        (void)ebpo_scene_get_instance(s->scene, i, &instance);
        status = find_surface(s, instance.model, &s->surface_of[i], error);
        if (status == EBPO_OK)
            status = ebpo_scene_pose(s->scene, i, time, &s->poses[i], error);
        if (status == EBPO_OK)
            s->instances[i] =
                (ebpo_haptic_instance){ s->surfaces[s->surface_of[i]].model, s->poses[i] };
    }
    return status;
}

ebpo_status haptic_scene_open(haptic_scene *s, const char *name, const ebpo_load_options *load,
                              ebpo_error *error)
{
    ebpo_scene_counts counts = EBPO_SCENE_COUNTS_INIT;
    *s = (haptic_scene){ .name = name };
    ebpo_status status = ebpo_scene_open(name, NULL, &s->scene, error);
    if (status == EBPO_OK)
        status = ebpo_scene_load(s->scene, load, error);
    if (status != EBPO_OK)
        return status;
    (void)ebpo_scene_get_counts(s->scene, &counts);
    if (counts.instances == 0)
        return fail_scene(error, EBPO_E_ARGUMENT, name, "the scene has no instances");
    s->instance_count = counts.instances;
    s->instances = calloc(counts.instances, sizeof *s->instances);
    s->poses = calloc(counts.instances, sizeof *s->poses);
    s->surface_of = calloc(counts.instances, sizeof *s->surface_of);
    s->surfaces = calloc(counts.models, sizeof *s->surfaces);
    s->paths = calloc(counts.models, sizeof *s->paths);
    s->paint_paths = calloc(counts.models, sizeof *s->paint_paths);
    if (!s->instances || !s->poses || !s->surface_of || !s->surfaces || !s->paths ||
        !s->paint_paths)
        return fail_memory(error, s);
    status = ebpo_scene_box(s->scene, counts.begin, counts.begin, s->low, s->size, error);
    for (int k = 0; k < 3; k++)
        s->size[k] -= s->low[k];
    return status == EBPO_OK ? get_instances(s, counts.begin, error) : status;
}

/* Returns false if a regular file has text that is not a record. All else is left to the function
 * that writes the record. */
static bool is_record(const char *path)
{
    char line[1024];
    struct stat st;
    haptic_pose pose;
    int count = 0;
    FILE *in = stat(path, &st) == 0 && S_ISREG(st.st_mode) ? fopen(path, "r") : NULL;
    while (in && count == 0 && fgets(line, sizeof line, in))
        count = haptic_pose_read(line, strlen(line), &pose);
    if (in)
        fclose(in);
    return count >= 0;
}

bool haptic_scene_overwrites(const haptic_scene *s, const char *record)
{
    ebpo_scene_counts counts = EBPO_SCENE_COUNTS_INIT;
    (void)ebpo_scene_get_counts(s->scene, &counts);
    for (uint64_t i = 0; i < counts.models; i++) {
        ebpo_scene_model_facts facts = EBPO_SCENE_MODEL_FACTS_INIT;
        (void)ebpo_scene_get_model_facts(s->scene, i, &facts);
        char *path = command_path_in_scene(s->name, facts.path);
        bool same = path && command_same_file(path, record);
        free(path);
        if (same) {
            fprintf(stderr,
                    "ebpo haptic: %s: is both a model of the scene and output; choose another "
                    "output\n",
                    record);
            return true;
        }
    }
    if (is_record(record))
        return false;
    fprintf(stderr,
            "ebpo haptic: %s: this file exists and is not a record, so it may have poses of the "
            "scene; choose another output\n",
            record);
    return true;
}

/* --- paint --- */

/* Sets the path of a model's paint file. */
static ebpo_status set_paint(haptic_scene *s, uint64_t number, const char *folder,
                             const char *record, ebpo_error *error)
{
    haptic_surface *surface = &s->surfaces[number];
    char *path = NULL;
    if (strpbrk(surface->name, "/\\:") || surface->name[0] == '.')
        return fail_scene(
            error, EBPO_E_ARGUMENT, surface->name,
            "this name of a model cannot be the name of its paint file, because it begins "
            "with '.' or has a '/', '\\' or ':'; rename the model in the scene");
    if (asprintf(&path, "%s/%s.paint.h5", folder, surface->name) < 0)
        return fail_scene(error, EBPO_E_MEMORY, folder,
                          "not enough memory for the paths of paint files");
    surface->paint = s->paint_paths[number] = path;
    if (record && (strcmp(path, record) == 0 || command_same_file(path, record)))
        return fail_scene(error, EBPO_E_ARGUMENT, record,
                          "is both the record and a paint file; choose another output");
    return EBPO_OK;
}

ebpo_status haptic_scene_paint_in(haptic_scene *s, const char *folder, const char *record,
                                  ebpo_error *error)
{
    struct stat st;
    ebpo_status status = EBPO_OK;
    if (s->surface_count > HAPTIC_PAINTS_MAX)
        return fail_scene(
            error, EBPO_E_LIMIT, s->name,
            "the scene has more than 64 models with instances, the most for --paint; make "
            "a scene of the models to be painted");
    for (uint64_t i = 0; i < s->surface_count && status == EBPO_OK; i++)
        status = set_paint(s, i, folder, record, error);
    if (status != EBPO_OK)
        return status;
    if (mkdir(folder, 0777) != 0 && errno != EEXIST)
        return fail_scene(error, EBPO_E_IO, folder, strerror(errno));
    if (stat(folder, &st) != 0 || !S_ISDIR(st.st_mode))
        return fail_scene(
            error, EBPO_E_ARGUMENT, folder,
            "is not a folder; with a scene, --paint names a folder, which gets a paint "
            "file for each model");
    return EBPO_OK;
}

/* --- the page --- */

/* Returns false without memory. */
static bool write_models(const haptic_scene *s, json *j)
{
    bool done = true;
    json_object(j, "models");
    for (uint64_t i = 0; i < s->surface_count; i++) {
        char *file = NULL;
        if (asprintf(&file, "models/%llu/%s", (unsigned long long)i, words_file_name(s->paths[i])) <
            0)
            file = NULL;
        done &= file != NULL;
        json_object(j, s->surfaces[i].name);
        json_text(j, "file", file ? file : "");
        json_end(j);
        free(file);
    }
    json_end(j);
    return done;
}

static void write_instances(const haptic_scene *s, json *j)
{
    json_array(j, "instances");
    for (uint64_t i = 0; i < s->instance_count; i++) {
        ebpo_scene_instance instance = EBPO_SCENE_INSTANCE_INIT;
        const ebpo_pose *pose = &s->poses[i];
        (void)ebpo_scene_get_instance(s->scene, i, &instance);
        json_object(j, NULL);
        json_text(j, "name", instance.name);
        json_text(j, "model", s->surfaces[s->surface_of[i]].name);
        json_object(j, "pose");
        json_reals(j, "rotation", &pose->rotation[0][0], 9);
        json_real(j, "scale", pose->scale);
        json_reals(j, "translation", pose->translation, 3);
        json_end(j);
        json_end(j);
    }
    json_end(j);
}

/* Writes the cameras that do not move; they also say which direction is up. */
static void write_cameras(const haptic_scene *s, json *j)
{
    ebpo_scene_counts counts = EBPO_SCENE_COUNTS_INIT;
    (void)ebpo_scene_get_counts(s->scene, &counts);
    json_array(j, "cameras");
    for (uint64_t i = 0; i < counts.cameras; i++) {
        ebpo_scene_camera camera = EBPO_SCENE_CAMERA_INIT;
        (void)ebpo_scene_get_camera(s->scene, i, &camera);
        if (camera.route != EBPO_SCENE_NONE)
            continue;
        json_object(j, NULL);
        json_text(j, "name", camera.name);
        json_reals(j, "eye", camera.eye, 3);
        json_reals(j, "target", camera.target, 3);
        json_reals(j, "up", camera.up, 3);
        json_end(j);
    }
    json_end(j);
}

char *haptic_scene_text(const haptic_scene *s)
{
    char *text = NULL;
    size_t size;
    json j;
    FILE *out = open_memstream(&text, &size);
    if (!out)
        return NULL;
    json_begin(&j, out);
    json_object(&j, NULL);
    json_text(&j, "ebpo_scene", "1.0");
    json_text(&j, "title", words_file_name(s->name));
    bool done = write_models(s, &j);
    write_instances(s, &j);
    write_cameras(s, &j);
    json_finish(&j);
    if (fclose(out) == 0 && done)
        return text;
    free(text);
    return NULL;
}

void haptic_scene_close(haptic_scene *s)
{
    for (uint64_t i = 0; i < s->surface_count; i++) {
        free(s->paint_paths[i]);
        free(s->paths[i]);
    }
    free(s->surfaces);
    free(s->paths);
    free(s->paint_paths);
    free(s->surface_of);
    free(s->poses);
    free(s->instances);
    ebpo_scene_free(s->scene);
}
