/* Opens scene files, and loads the models that they name.
 *
 * Models of the same path share one open file. If a scene file has a digest for a model, the
 * content_sha256 of the model's file must be equal to that digest. Loading sets the box of each
 * model. Bounds of motions are computed from this box. An ebpo_model for queries is made when it is
 * first needed. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/http.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "io/file_source.h"
#include "geometry/pose.h"
#include "extras/scene/scene_parts.h"

static ebpo_status copy_options(ebpo_scene_options *checked, const ebpo_scene_options *options,
                                ebpo_error *error)
{
    *checked = (ebpo_scene_options)EBPO_SCENE_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_scene_options, checked, options, error);
    if (!checked->max_bytes)
        checked->max_bytes = UINT64_C(64) << 20;
    if (!checked->max_pose_bytes)
        checked->max_pose_bytes = UINT64_C(256) << 20;
    if (!checked->max_values)
        checked->max_values = 4000000;
    return status;
}

/* Keeps the scene file's text, which ebpo_scene_pack writes with other paths. */
static ebpo_status keep_text(ebpo_scene *scene, const char *text, size_t size, ebpo_error *error)
{
    scene->text = malloc(size + 1);
    if (!scene->text)
        return ebpo_fail_memory(error, size + 1);
    memcpy(scene->text, text, size);
    scene->text_size = size;
    scene->text_models = scene->models_count;
    scene->text_instances = scene->instances_count;
    return EBPO_OK;
}

/* Makes a scene from the text of a scene file. Takes ownership of `folder`, the base of relative
 * paths; NULL: the allocation of `folder` has failed. */
static ebpo_status parse_scene(const char *text, size_t size, const char *name, char *folder,
                               const ebpo_scene_options *options, ebpo_scene **out,
                               ebpo_error *error)
{
    ebpo_scene *scene = NULL;
    size_t bom_length = ebpo_scene_bom_length(text, size);
    text += bom_length;
    size -= bom_length;
    ebpo_status status = folder ? ebpo_scene_new(&scene, error) : ebpo_fail_memory(error, 1);
    if (status == EBPO_OK) {
        free(scene->folder);
        scene->folder = folder;
        status = ebpo_scene_read_json(scene, text, size, name, options, error);
    } else {
        free(folder);
    }
    if (status == EBPO_OK) {
        scene->allow_outside = options->allow_outside;
        status = keep_text(scene, text, size, error);
    }
    if (status == EBPO_OK)
        *out = scene;
    else
        ebpo_scene_free(scene);
    return status;
}

static char *folder_with_slash(const char *folder)
{
    size_t size = folder ? strlen(folder) : 0;
    char *out = malloc(size + 2);
    if (!out)
        return NULL;
    if (size) /* memcpy requires non-NULL pointers */
        memcpy(out, folder, size);
    if (size && out[size - 1] != '/')
        out[size++] = '/';
    out[size] = 0;
    return out;
}

ebpo_status ebpo_scene_parse(const char *text, size_t size, const char *name, const char *folder,
                             const ebpo_scene_options *options, ebpo_scene **out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    *out = NULL;
    ebpo_scene_options checked;
    ebpo_status status = copy_options(&checked, options, error);
    if (status != EBPO_OK)
        return status;
    return parse_scene(text, size, name, folder_with_slash(folder), &checked, out, error);
}

ebpo_status ebpo_scene_open(const char *path, const ebpo_scene_options *options, ebpo_scene **out,
                            ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    *out = NULL;
    ebpo_scene_options checked;
    ebpo_whole_file file = EBPO_WHOLE_FILE_INIT;
    ebpo_status status = copy_options(&checked, options, error);
    if (status == EBPO_OK)
        status = ebpo_whole_file_open(&file, path, error);
    if (status == EBPO_OK && file.size > checked.max_bytes)
        status = ebpo_scene_too_long(path, &checked, error);
    if (status == EBPO_OK)
        status = ebpo_whole_file_load(&file, NULL, 1, NULL, path, error);
    if (status == EBPO_OK)
        status = parse_scene((const char *)file.data, file.size, path, ebpo_scene_folder_of(path),
                             &checked, out, error);
    if (status == EBPO_OK)
        status = ebpo_whole_file_unchanged(&file, path, error);
    if (status != EBPO_OK) {
        ebpo_scene_free(*out);
        *out = NULL;
    }
    ebpo_whole_file_close(&file);
    return status;
}

/* --- models --- */

/* Opens a file if it is not open yet, and sets *number to the file's index in scene->files. */
static ebpo_status open_file(ebpo_scene *scene, const char *path, uint64_t max_expansion,
                             uint64_t *number, ebpo_error *error)
{
    uint64_t n = 0;
    while (n < scene->files_count && strcmp(scene->files[n].path, path) != 0)
        n++;
    *number = n;
    if (n < scene->files_count)
        return EBPO_OK;
    if (!ebpo_grow(&scene->files, &scene->files_capacity, n + 1, sizeof *scene->files))
        return ebpo_fail_memory(error, (n + 1) * sizeof *scene->files);
    ebpo_scene_file_entry f = { .path = strdup(path) };
    ebpo_open_options options = EBPO_OPEN_OPTIONS_INIT;
    options.max_expansion = max_expansion;
    ebpo_status status =
        f.path ? ebpo_open_with(path, &options, &f.file, error) : ebpo_fail_memory(error, 1);
    if (status != EBPO_OK) {
        free(f.path);
        return status;
    }
    scene->files[scene->files_count++] = f;
    return EBPO_OK;
}

/* Sets the model's box. On each axis, the box has the range of the faces' coordinates that the file
 * states. If the stated range is not within the root cell, the box has the range of the root
 * cell. */
static void set_model_box(ebpo_scene_model_entry *m, const ebpo_info *info)
{
    for (int k = 0; k < 3; k++) {
        double low = info->box_origin[k], high = low + info->box_size[k];
        bool tight = info->report.min[k] >= low && info->report.max[k] <= high &&
                     info->report.min[k] <= info->report.max[k];
        m->min[k] = tight ? info->report.min[k] : low;
        m->max[k] = tight ? info->report.max[k] : high;
    }
}

static ebpo_status check_digest(const ebpo_scene_model_entry *m, const ebpo_info *info,
                                ebpo_error *error)
{
    static const uint8_t none[32];
    if (memcmp(m->digest, none, 32) == 0 || memcmp(m->digest, info->content_sha256, 32) == 0)
        return EBPO_OK;
    char shown[256];
    return ebpo_fail_file(error, EBPO_E_FORMAT, ebpo_url_redact(m->path, shown, sizeof shown),
                          "is not the file of model '%.80s': its content_sha256 differs from the "
                          "content_sha256 in the scene",
                          m->name);
}

static ebpo_status load_model(ebpo_scene *scene, ebpo_scene_model_entry *m, uint64_t max_expansion,
                              ebpo_error *error)
{
    char *path = ebpo_scene_join_path(scene->folder, m->path);
    uint64_t number = 0;
    /* true: the model was read from the scene file; false: the caller added it */
    bool from_text = (uint64_t)(m - scene->models) < scene->text_models;
    ebpo_status status = path ? EBPO_OK : ebpo_fail_memory(error, strlen(m->path));
    if (status == EBPO_OK && from_text && !scene->allow_outside)
        status = ebpo_scene_stays_within(scene->folder, path, error);
    if (status == EBPO_OK)
        status = open_file(scene, path, max_expansion, &number, error);
    free(path);
    if (status != EBPO_OK)
        return status;
    const ebpo_info *info = ebpo_file_info(scene->files[number].file);
    status = check_digest(m, info, error);
    if (status == EBPO_OK) {
        set_model_box(m, info);
        m->file = number;
    }
    return status;
}

/* Checks that the posed coordinates of the instance's model are in range. */
static ebpo_status check_range(const ebpo_scene *scene, const ebpo_scene_instance_entry *i,
                               ebpo_error *error)
{
    const ebpo_scene_model_entry *m = &scene->models[i->description.model];
    double greatest[3]; /* greatest absolute coordinates */
    ebpo_posing posing;
    ebpo_error why = EBPO_ERROR_INIT;
    for (int k = 0; k < 3; k++)
        greatest[k] = fmax(fabs(m->min[k]), fabs(m->max[k]));
    ebpo_status status = ebpo_posing_make(&posing, &i->description.pose, greatest, &why);
    return status == EBPO_OK ? EBPO_OK
                             : ebpo_fail(error, status, "instance '%.80s': %.300s",
                                         i->description.name, why.message);
}

ebpo_status ebpo_scene_load(ebpo_scene *scene, const ebpo_load_options *options, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_load_options checked = EBPO_LOAD_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_load_options, &checked, options, error);
    if (status == EBPO_OK && checked.memory && !scene->model_options.budget)
        status = ebpo_budget_new(checked.memory, &scene->model_options.budget, error);
    if (status == EBPO_OK) {
        scene->model_options.cut_level = checked.cut_level;
        scene->model_options.threads = checked.threads;
    }
    if (status == EBPO_OK && !ebpo_progress_stage(&checked.progress, "opening models", error))
        status = EBPO_E_CANCELLED;
    for (uint64_t i = 0; i < scene->models_count && status == EBPO_OK; i++) {
        if (scene->models[i].file == EBPO_SCENE_NONE)
            status = load_model(scene, &scene->models[i], checked.max_expansion, error);
        if (status == EBPO_OK && !ebpo_progress_step(&checked.progress, "opening models", i + 1,
                                                     scene->models_count, error))
            status = EBPO_E_CANCELLED;
    }
    for (uint64_t i = 0; i < scene->instances_count && status == EBPO_OK; i++)
        status = check_range(scene, &scene->instances[i], error);
    return status;
}

const ebpo_file *ebpo_scene_file(const ebpo_scene *scene, uint64_t model)
{
    bool loaded = model < scene->models_count && scene->models[model].file != EBPO_SCENE_NONE;
    return loaded ? scene->files[scene->models[model].file].file : NULL;
}

ebpo_status ebpo_scene_model(ebpo_scene *scene, uint64_t model, ebpo_model **out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    *out = NULL;
    if (!ebpo_scene_file(scene, model))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "model %llu has not been loaded",
                         (unsigned long long)model);
    ebpo_scene_file_entry *f = &scene->files[scene->models[model].file];
    ebpo_status status = EBPO_OK;
    if (!f->model)
        status = ebpo_model_new(f->file, &scene->model_options, &f->model, error);
    if (status == EBPO_OK)
        *out = f->model;
    return status;
}
