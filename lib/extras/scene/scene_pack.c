/* A folder with what a scene needs: written beside its place, and put there whole. */
#include "core/strict_fp.h"

#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/alloc.h"
#include "core/error.h"
#include "format/file_in.h"
#include "core/fp_env.h"
#include "extras/scene/packed_text.h"
#include "extras/scene/planning.h"

typedef struct packing {
    scene_needs needs;
    ebpo_pack_options how;
    const char *folder;
    char *making; /* the folder until it is whole */
    ebpo_scene_packed *files;
    ebpo_error *error;
} packing;

/* ---- folders ---- */

static char *path_in(const char *folder, const char *name)
{
    size_t size = strlen(folder) + strlen(name) + 2;
    char *path = malloc(size);
    if (path)
        snprintf(path, size, "%s/%s", folder, name);
    return path;
}

static void remove_in(const char *folder, const char *name)
{
    char path[PATH_MAX];
    if (snprintf(path, sizeof path, "%s/%s", folder, name) < (int)sizeof path)
        unlink(path);
}

/* With all that may have been written, without asking for memory or opening anything. */
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
    ebpo_status status = ebpo_folder_publish(p->making, p->folder, p->error);
    if (status == EBPO_OK) {
        free(p->making);
        p->making = NULL;
    }
    return status;
}

/* ---- models ---- */

/* What is on the disk. */
static ebpo_status look_at(packing *p, const char *path, ebpo_scene_packed *out)
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

static ebpo_status write_file(packing *p, uint64_t number, uint64_t target)
{
    ebpo_scene_packed *out = &p->files[number];
    const ebpo_file *file = p->needs.scene->files[number].file;
    ebpo_subset_options o = scene_need_options(&p->needs, number);
    char name[40];
    scene_packed_name(number, name);
    char *path = path_in(p->making, name);
    if (!path)
        return ebpo_fail_memory(p->error, strlen(p->making));
    uint64_t before = bytes_read(file);
    o.target_bytes = target;
    o.threads = p->how.threads;
    o.progress = p->how.progress;
    ebpo_status status = ebpo_subset(file, path, &o, p->error);
    out->bytes_read = bytes_read(file) - before;
    out->source_bytes = ebpo_file_info(file)->file_bytes;
    memcpy(out->source_digest, ebpo_file_info(file)->content_sha256, sizeof out->source_digest);
    if (status == EBPO_OK)
        status = look_at(p, path, out);
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

/* Too large: each file gives way by the same share, those that nothing is asked of not at all. */
static ebpo_status shrink(packing *p)
{
    uint64_t fixed = 0, sum = sum_of_files(p), target = p->how.target_bytes;
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
    return status == EBPO_OK ? shrink(p) : status;
}

/* ---- all of it ---- */

static ebpo_status check(packing *p, const ebpo_pack_options *options)
{
    const ebpo_scene *scene = p->needs.scene;
    ebpo_plan_options plan = EBPO_PLAN_OPTIONS_INIT;
    p->how = (ebpo_pack_options)EBPO_PACK_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_pack_options, &p->how, options, p->error);
    if (status != EBPO_OK)
        return status;
    plan.progress = p->how.progress;
    plan.margin = p->how.margin;
    plan.purpose = p->how.purpose;
    if (!scene->text || scene->text_models != scene->models_count ||
        scene->text_instances != scene->instances_count)
        return ebpo_fail(p->error, EBPO_E_ARGUMENT,
                         "only a scene that was read from a file, and nothing else, is packed");
    return scene_plan_check(&p->needs, &plan);
}

/* Of each model. What is published may not fail any more. */
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
        list[i].answers = !(list[i].max_error > 0) || p->how.purpose == EBPO_SCENE_FOR_VIEW;
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
    ebpo_status status = check(&p, options);
    if (status == EBPO_OK)
        status = ebpo_folder_begin(folder, &p.making, error);
    if (status == EBPO_OK)
        status = scene_plan_needs(&p.needs);
    if (status == EBPO_OK)
        status = write_files(&p);
    if (status == EBPO_OK)
        status = scene_write_packed(scene, p.files, p.making, error);
    if (status == EBPO_OK)
        status = list_packed(&p, &list);
    if (status == EBPO_OK)
        status = publish_folder(&p);
    if (status == EBPO_OK && scene->models_count && take)
        (void)take(user, list, scene->models_count);
    if (p.making)
        remove_folder(scene, p.making);
    free(list);
    free(p.making);
    free(p.files);
    free(p.needs.files);
    return status;
}
