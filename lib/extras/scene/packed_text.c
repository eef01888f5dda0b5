#include "extras/scene/packed_text.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/error.h"
#include "core/checksum.h"
#include "io/file_source.h"

void scene_packed_name(uint64_t file, char name[40])
{
    snprintf(name, 40, "model-%" PRIu64 ".ebpo.h5", file);
}

void scene_packed_route(uint64_t route, char name[40])
{
    snprintf(name, 40, "route-%" PRIu64 ".csv", route);
}

static bool set_text(json_t *object, const char *key, const char *text)
{
    return json_object_set_new(object, key, json_string(text)) == 0;
}

/* What the scene says of its models' files. */
static ebpo_status name_files(json_t *root, const ebpo_scene *scene, const ebpo_scene_packed *files,
                              ebpo_error *error)
{
    json_t *models = json_object_get(root, "models");
    bool set = true;
    for (uint64_t i = 0; i < scene->models_count; i++) {
        const scene_model *m = &scene->models[i];
        json_t *model = json_object_get(models, m->name);
        char name[40], digest[65], source[65];
        scene_packed_name(m->file, name);
        ebpo_sha256_hex(files[m->file].digest, digest);
        ebpo_sha256_hex(files[m->file].source_digest, source);
        set = set && set_text(model, "file", name) && set_text(model, "content_sha256", digest) &&
              set_text(model, "subset_of", source);
    }
    return set ? EBPO_OK : ebpo_fail_memory(error, 1);
}

static ebpo_status write_in(const char *folder, const char *name, const void *data, size_t size,
                            ebpo_error *error)
{
    char *path = malloc(strlen(folder) + strlen(name) + 2);
    if (!path)
        return ebpo_fail_memory(error, strlen(folder));
    sprintf(path, "%s/%s", folder, name);
    ebpo_status status = ebpo_write_file(path, data, size, error);
    free(path);
    return status;
}

/* Byte for byte: poses stay what they are. */
static ebpo_status copy_poses(const ebpo_scene *scene, const char *csv, const char *folder,
                              const char *name, ebpo_error *error)
{
    ebpo_whole_file file = EBPO_WHOLE_FILE_INIT;
    char *path = scene_join_path(scene->folder, csv);
    ebpo_status status = path ? EBPO_OK : ebpo_fail_memory(error, strlen(csv));
    if (status == EBPO_OK && !scene->outside)
        status = scene_stays_within(scene->folder, path, error);
    if (status == EBPO_OK)
        status = ebpo_whole_file_open(&file, path, error);
    if (status == EBPO_OK)
        status = ebpo_whole_file_load(&file, NULL, 1, NULL, path, error);
    if (status == EBPO_OK)
        status = ebpo_whole_file_unchanged(&file, path, error);
    if (status == EBPO_OK)
        status = write_in(folder, name, file.data, file.size, error);
    ebpo_whole_file_close(&file);
    free(path);
    return status;
}

static ebpo_status copy_routes(json_t *root, const ebpo_scene *scene, const char *folder,
                               ebpo_error *error)
{
    json_t *routes = json_object_get(root, "routes");
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < scene->routes_count && status == EBPO_OK; i++) {
        json_t *route = json_object_get(routes, scene->routes[i].name);
        const char *csv = json_string_value(json_object_get(route, "csv"));
        char name[40];
        scene_packed_route(i, name);
        if (csv)
            status = copy_poses(scene, csv, folder, name, error);
        if (csv && status == EBPO_OK && !set_text(route, "csv", name))
            status = ebpo_fail_memory(error, 1);
    }
    return status;
}

ebpo_status scene_write_packed(const ebpo_scene *scene, const ebpo_scene_packed *files,
                               const char *folder, ebpo_error *error)
{
    /* it has been read once already */
    json_t *root = json_loadb(scene->text, scene->text_size,
                              JSON_REJECT_DUPLICATES | JSON_DECODE_INT_AS_REAL, NULL);
    if (!root)
        return ebpo_fail_memory(error, scene->text_size);
    ebpo_status status = name_files(root, scene, files, error);
    if (status == EBPO_OK)
        status = copy_routes(root, scene, folder, error);
    char *text =
        status == EBPO_OK ? json_dumps(root, JSON_INDENT(1) | JSON_REAL_PRECISION(17)) : NULL;
    if (status == EBPO_OK)
        status = text ? write_in(folder, SCENE_PACKED, text, strlen(text), error)
                      : ebpo_fail_memory(error, scene->text_size);
    free(text);
    json_decref(root);
    return status;
}
