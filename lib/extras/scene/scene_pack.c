/* Plans and packs a scene: finds the content of its models' files that is needed, and writes a
 * folder that has only this content.
 *
 * Packing writes a subset of each file (scene_needs.c), copies the files of poses, and writes a
 * scene file that differs from the original in its paths and digests. The folder is written under a
 * temporary name and renamed when it is complete, so that it appears atomically. After a failure
 * the folder is removed.
 *
 * A plan finds the same needs without writing anything. */
#include "core/strict_fp.h"

#include <fcntl.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/alloc.h"
#include "core/checksum.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "extras/scene/scene_needs.h"
#include "extras/scene/scene_parts.h"
#include "format/file_in.h"
#include "io/file_source.h"

/* Name of the scene file in the folder. */
#define SCENE_PACKED "packed.scene.json"

/* Sets needs->options from the options, and checks the options, the times and the scene. */
static ebpo_status check_plan_options(ebpo_scene_needs *needs, const ebpo_plan_options *options)
{
    const ebpo_scene *scene = needs->scene;
    ebpo_error *error = needs->error;
    needs->options = (ebpo_plan_options)EBPO_PLAN_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_plan_options, &needs->options, options, error);
    if (status != EBPO_OK)
        return status;
    if (needs->options.purpose < EBPO_SCENE_FOR_COLLIDE ||
        needs->options.purpose > EBPO_SCENE_FOR_RELATIONS)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "unknown purpose %d", (int)needs->options.purpose);
    if (!(needs->options.margin >= 0 && needs->options.margin < INFINITY))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "expected a margin that is a length of 0 or more, got %g",
                         needs->options.margin);
    if (!(isfinite(needs->from) && isfinite(needs->to) && needs->from <= needs->to))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "%g to %g is not an interval of time", needs->from,
                         needs->to);
    for (uint64_t i = 0; i < scene->models_count; i++)
        if (scene->models[i].file == EBPO_SCENE_NONE)
            return ebpo_fail(error, EBPO_E_ARGUMENT, "model '%.80s' has not been loaded",
                             scene->models[i].name);
    return EBPO_OK;
}

/* Finds the needed content of each file. The caller frees needs->files, also on failure. */
static ebpo_status find_needs(ebpo_scene_needs *needs)
{
    ebpo_status status = ebpo_scene_begin_needs(needs);
    if (status == EBPO_OK)
        status = needs->options.purpose == EBPO_SCENE_FOR_VIEW ? ebpo_scene_add_views(needs)
                                                               : ebpo_scene_add_near(needs);
    if (status == EBPO_OK)
        ebpo_scene_end_needs(needs);
    return status;
}

/* Sets *out to a list of the needs of all models. The caller frees *out, also on failure. */
static ebpo_status list_needs(const ebpo_scene_needs *needs, ebpo_scene_need **out)
{
    uint64_t count = needs->scene->models_count;
    ebpo_scene_need *list = ebpo_alloc(count, sizeof *list);
    ebpo_status status = list ? EBPO_OK : ebpo_fail_memory(needs->error, count * sizeof *list);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        status = ebpo_scene_report_need(needs, i, &list[i]);
    *out = list;
    return status;
}

ebpo_status ebpo_scene_plan(ebpo_scene *scene, double from, double to,
                            const ebpo_plan_options *options, ebpo_scene_needs_fn take, void *user,
                            ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_scene_needs needs = { .scene = scene, .from = from, .to = to, .error = error };
    ebpo_scene_need *list = NULL;
    ebpo_status status = check_plan_options(&needs, options);
    if (status == EBPO_OK)
        status = find_needs(&needs);
    if (status == EBPO_OK)
        status = list_needs(&needs, &list);
    if (status == EBPO_OK && scene->models_count)
        (void)take(user, list, scene->models_count);
    free(list);
    free(needs.files);
    return status;
}

/* Sets `name` to the name of a model's file in the folder. file: index in scene->files. */
static void scene_packed_name(uint64_t file, char name[40])
{
    snprintf(name, 40, "model-%" PRIu64 ".ebpo.h5", file);
}

/* Sets `name` to the name, in the folder, of the file of a route's poses. */
static void scene_packed_route(uint64_t route, char name[40])
{
    snprintf(name, 40, "route-%" PRIu64 ".csv", route);
}

static bool set_text(json_t *object, const char *key, const char *text)
{
    return json_object_set_new(object, key, json_string(text)) == 0;
}

/* Sets the paths and digests of models' files in the packed scene. */
static ebpo_status name_files(json_t *root, const ebpo_scene *scene, const ebpo_scene_packed *files,
                              ebpo_error *error)
{
    json_t *models = json_object_get(root, "models");
    bool set = true;
    for (uint64_t i = 0; i < scene->models_count; i++) {
        const ebpo_scene_model_entry *m = &scene->models[i];
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

static ebpo_status write_in_folder(const char *folder, const char *name, const void *data,
                                   size_t size, ebpo_error *error)
{
    char *path = malloc(strlen(folder) + strlen(name) + 2);
    if (!path)
        return ebpo_fail_memory(error, strlen(folder));
    sprintf(path, "%s/%s", folder, name);
    ebpo_status status = ebpo_write_file(path, data, size, error);
    free(path);
    return status;
}

/* Copies a CSV file of poses byte by byte, so that its numbers do not change. */
static ebpo_status copy_poses(const ebpo_scene *scene, const char *csv, const char *folder,
                              const char *name, ebpo_error *error)
{
    ebpo_whole_file file = EBPO_WHOLE_FILE_INIT;
    char *path = ebpo_scene_join_path(scene->folder, csv);
    ebpo_status status = path ? EBPO_OK : ebpo_fail_memory(error, strlen(csv));
    if (status == EBPO_OK && !scene->allow_outside)
        status = ebpo_scene_stays_within(scene->folder, path, error);
    if (status == EBPO_OK)
        status = ebpo_whole_file_open(&file, path, error);
    if (status == EBPO_OK)
        status = ebpo_whole_file_load(&file, NULL, 1, NULL, path, error);
    if (status == EBPO_OK)
        status = ebpo_whole_file_unchanged(&file, path, error);
    if (status == EBPO_OK)
        status = write_in_folder(folder, name, file.data, file.size, error);
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

/* Writes the scene file and the files of poses into the folder. files: [scene->files_count] */
static ebpo_status scene_write_packed(const ebpo_scene *scene, const ebpo_scene_packed *files,
                                      const char *folder, ebpo_error *error)
{
    /* NULL means too little memory, because the text has been parsed before */
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
        status = text ? write_in_folder(folder, SCENE_PACKED, text, strlen(text), error)
                      : ebpo_fail_memory(error, scene->text_size);
    free(text);
    json_decref(root);
    return status;
}

typedef struct packing {
    ebpo_scene_needs needs;
    ebpo_pack_options options;
    const char *folder;       /* the folder that the caller wants */
    char *partial_folder;     /* temporary name of the folder; NULL: renamed or not begun */
    ebpo_scene_packed *files; /* [needs.scene->files_count] the new files */
    ebpo_error *error;
} packing;

/* --- folders --- */

static char *path_in(const char *folder, const char *name)
{
    size_t size = strlen(folder) + strlen(name) + 2;
    char *path = malloc(size);
    if (path)
        snprintf(path, size, "%s/%s", folder, name);
    return path;
}

/* Removes a file in the folder, if it exists. */
static void remove_in(const char *folder, const char *name)
{
    char path[PATH_MAX];
    if (snprintf(path, sizeof path, "%s/%s", folder, name) < (int)sizeof path)
        unlink(path);
}

/* Removes the folder with all files that may have been written. Does not allocate memory or open
 * files, so that it works after any failure. */
static void remove_folder(const ebpo_scene *scene, const char *folder)
{
    char name[40];
    for (uint64_t i = 0; i < scene->files_count; i++) {
        scene_packed_name(i, name);
        remove_in(folder, name);
    }
    for (uint64_t i = 0; i < scene->routes_count; i++) {
        scene_packed_route(i, name);
        remove_in(folder, name);
    }
    remove_in(folder, SCENE_PACKED);
    rmdir(folder);
}

static ebpo_status publish_folder(packing *p)
{
    ebpo_status status = ebpo_folder_publish(p->partial_folder, p->folder, p->error);
    if (status == EBPO_OK) {
        free(p->partial_folder);
        p->partial_folder = NULL;
    }
    return status;
}

/* --- models --- */

/* Reads the size, the error bound and the digest of a file that was just written. */
static ebpo_status inspect_file(packing *p, const char *path, ebpo_scene_packed *out)
{
    ebpo_file *file = NULL;
    ebpo_status status = ebpo_open_own(path, &file, p->error);
    if (status != EBPO_OK)
        return status;
    const ebpo_info *info = ebpo_file_info(file);
    out->bytes = info->file_bytes;
    out->max_error = info->kept_error;
    memcpy(out->digest, info->content_sha256, sizeof out->digest);
    ebpo_close(file);
    return EBPO_OK;
}

static uint64_t bytes_read(const ebpo_file *file)
{
    ebpo_file_stats s = EBPO_FILE_STATS_INIT;
    (void)ebpo_file_get_stats(file, &s);
    return s.bytes_read;
}

/* Writes the needed content of a model's file, and adds what was read. target: greatest size in
 * bytes; 0: no limit. */
static ebpo_status write_file(packing *p, uint64_t number, uint64_t target)
{
    ebpo_scene_packed *out = &p->files[number];
    const ebpo_file *file = p->needs.scene->files[number].file;
    ebpo_subset_options o = ebpo_scene_need_options(&p->needs, number);
    char name[40];
    scene_packed_name(number, name);
    char *path = path_in(p->partial_folder, name);
    if (!path)
        return ebpo_fail_memory(p->error, strlen(p->partial_folder));
    uint64_t before = bytes_read(file);
    o.target_bytes = target;
    o.threads = p->options.threads;
    o.progress = p->options.progress;
    ebpo_status status = ebpo_subset(file, path, &o, p->error);
    out->bytes_read += bytes_read(file) - before;
    out->source_bytes = ebpo_file_info(file)->file_bytes;
    memcpy(out->source_digest, ebpo_file_info(file)->content_sha256, sizeof out->source_digest);
    if (status == EBPO_OK)
        status = inspect_file(p, path, out);
    free(path);
    return status;
}

static uint64_t sum_of_files(const packing *p)
{
    uint64_t sum = 0;
    for (uint64_t i = 0; i < p->needs.scene->files_count; i++)
        sum += p->files[i].bytes;
    return sum;
}

/* If the sum of the files' sizes is above the target size, writes files again, each of them smaller
 * by the same factor. A file of which only the root is needed is not written again. */
static ebpo_status shrink_to_target(packing *p)
{
    /* fixed: bytes of the files that are not reduced */
    uint64_t fixed = 0, sum = sum_of_files(p), target = p->options.target_bytes;
    ebpo_status status = EBPO_OK;
    if (!target || sum <= target)
        return EBPO_OK;
    for (uint64_t i = 0; i < p->needs.scene->files_count; i++)
        fixed += p->needs.files[i].any ? 0 : p->files[i].bytes;
    double share = target > fixed ? (double)(target - fixed) / (double)(sum - fixed) : 0;
    for (uint64_t i = 0; i < p->needs.scene->files_count && status == EBPO_OK; i++)
        if (p->needs.files[i].any)
            status = write_file(p, i, (uint64_t)(share * (double)p->files[i].bytes) + 1);
    return status;
}

static ebpo_status write_files(packing *p)
{
    uint64_t count = p->needs.scene->files_count;
    ebpo_status status = EBPO_OK;
    p->files = ebpo_alloc_zero(count, sizeof *p->files);
    if (!p->files)
        return ebpo_fail_memory(p->error, count * sizeof *p->files);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        status = write_file(p, i, 0);
    return status == EBPO_OK ? shrink_to_target(p) : status;
}

/* --- packing --- */

/* Sets p->options from the options, and checks the options and the scene. */
static ebpo_status check_pack_options(packing *p, const ebpo_pack_options *options)
{
    const ebpo_scene *scene = p->needs.scene;
    ebpo_plan_options plan = EBPO_PLAN_OPTIONS_INIT;
    p->options = (ebpo_pack_options)EBPO_PACK_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_pack_options, &p->options, options, p->error);
    if (status != EBPO_OK)
        return status;
    plan.progress = p->options.progress;
    plan.margin = p->options.margin;
    plan.purpose = p->options.purpose;
    if (!scene->text || scene->text_models != scene->models_count ||
        scene->text_instances != scene->instances_count)
        return ebpo_fail(p->error, EBPO_E_ARGUMENT,
                         "only a scene that was read from a file, without later additions, can "
                         "be packed");
    return check_plan_options(&p->needs, &plan);
}

/* Makes the list of packed files for the caller, with an entry for each model. The list is made
 * before the folder is published, because nothing may fail after the publication. */
static ebpo_status list_packed(const packing *p, ebpo_scene_packed **out)
{
    const ebpo_scene *scene = p->needs.scene;
    ebpo_scene_packed *list = ebpo_alloc(scene->models_count, sizeof *list);
    *out = list;
    if (!list)
        return ebpo_fail_memory(p->error, scene->models_count * sizeof *list);
    for (uint64_t i = 0; i < scene->models_count; i++) {
        list[i] = p->files[scene->models[i].file];
        list[i].struct_size = sizeof *list;
        list[i].model = i;
        list[i].complete = !(list[i].max_error > 0) || p->options.purpose == EBPO_SCENE_FOR_VIEW;
    }
    return EBPO_OK;
}

ebpo_status ebpo_scene_pack(ebpo_scene *scene, const char *folder, double from, double to,
                            const ebpo_pack_options *options, ebpo_scene_packs_fn take, void *user,
                            ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    packing p = { .needs = { .scene = scene, .from = from, .to = to, .error = error },
                  .folder = folder,
                  .error = error };
    ebpo_scene_packed *list = NULL;
    ebpo_status status = check_pack_options(&p, options);
    if (status == EBPO_OK)
        status = ebpo_folder_begin(folder, &p.partial_folder, error);
    if (status == EBPO_OK)
        status = find_needs(&p.needs);
    if (status == EBPO_OK)
        status = write_files(&p);
    if (status == EBPO_OK)
        status = scene_write_packed(scene, p.files, p.partial_folder, error);
    if (status == EBPO_OK)
        status = list_packed(&p, &list);
    if (status == EBPO_OK)
        status = publish_folder(&p);
    if (status == EBPO_OK && scene->models_count && take)
        (void)take(user, list, scene->models_count);
    if (p.partial_folder)
        remove_folder(scene, p.partial_folder);
    free(list);
    free(p.partial_folder);
    free(p.files);
    free(p.needs.files);
    return status;
}
