/* Paints as objects, and whose they are. */
#include "core/strict_fp.h"

#include <ebpo/paint.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/alloc.h"
#include "core/error.h"
#include "format/file_in.h"
#include "extras/paint/paint_parts.h"
#include "query/query_model.h"

static void write_hex(const uint8_t digest[32], char out[65])
{
    for (int i = 0; i < 32; i++)
        snprintf(out + 2 * i, 3, "%02x", digest[i]);
}

/* Which model a paint made on this file is for: format-spec/paint.md, section 2. */
static void name_model(const ebpo_info *info, char out[65])
{
    bool whole = info->pruned && info->parts & EBPO_PART_MAPS;
    write_hex(whole ? info->subset_of : info->content_sha256, out);
}

static ebpo_status check_mesh(const ebpo_file *model, ebpo_error *error)
{
    return model->info.parts & EBPO_PART_MESH
               ? EBPO_OK
               : ebpo_fail_file(error, EBPO_E_ABSENT, model->in.shown,
                                "the file was written without its mesh, so there is nothing to "
                                "paint on; build it again with that part");
}

ebpo_paint *ebpo_paint_begin(void)
{
    ebpo_paint *p = ebpo_alloc_zero(1, sizeof *p);
    ebpo_paint_file *file = p ? ebpo_alloc_zero(1, sizeof *file) : NULL;
    if (!file) {
        free(p);
        return NULL;
    }
    file->fd = -1;
    file->lock = (ebpo_file_lock)EBPO_FILE_LOCK_INIT;
    pthread_mutex_init(&file->mutex, NULL);
    p->file = file;
    return p;
}

static void free_file(ebpo_paint_file *file)
{
    ebpo_file_lock_release(&file->lock);
    if (file->fd >= 0)
        close(file->fd);
    pthread_mutex_destroy(&file->mutex);
    free(file->path);
    free(file);
}

ebpo_status ebpo_paint_new(const ebpo_file *model, ebpo_paint **out, ebpo_error *error)
{
    *out = NULL;
    ebpo_status status = check_mesh(model, error);
    if (status != EBPO_OK)
        return status;
    ebpo_paint *p = ebpo_paint_begin();
    if (!p)
        return ebpo_fail_memory(error, sizeof *p);
    const char *name = strrchr(model->in.shown, '/');
    name_model(&model->info, p->model_sha256);
    p->source_numbers = model->info.parts & EBPO_PART_MAPS;
    snprintf(p->generator, sizeof p->generator, "ebpo %s", ebpo_version());
    snprintf(p->unit, sizeof p->unit, "%s", model->info.unit);
    name = name ? name + 1 : model->in.shown;
    if (strlen(name) < sizeof p->model_name)
        snprintf(p->model_name, sizeof p->model_name, "%s", name);
    *out = p;
    return EBPO_OK;
}

void ebpo_paint_free(ebpo_paint *p)
{
    if (!p)
        return;
    for (uint64_t i = 0; i < p->layer_count; i++)
        ebpo_paint_texts_free(p->layer[i].text);
    for (uint64_t i = 0; i < p->note_count; i++)
        ebpo_paint_texts_free(p->note[i].text);
    free_file(p->file);
    free(p->layer);
    free(p->note);
    free(p->stroke);
    free(p->point);
    free(p);
}

ebpo_status ebpo_paint_get_info(const ebpo_paint *p, ebpo_paint_info *out)
{
    ebpo_paint_info own = EBPO_PAINT_INFO_INIT;
    own.generator = p->generator;
    own.model_sha256 = p->model_sha256;
    own.model_name = p->model_name;
    own.unit = p->unit;
    own.source_numbers = p->source_numbers;
    own.layer_count = p->layer_count;
    own.note_count = p->note_count;
    own.stroke_count = p->stroke_count;
    own.point_count = p->point_count;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_paint_info, out, NULL);
    return status == EBPO_OK ? EBPO_GIVE(ebpo_paint_info, out, &own) : status;
}

ebpo_status ebpo_paint_check_model(const ebpo_paint *p, const ebpo_file *model, ebpo_error *error)
{
    char own[65], whole[65];
    bool maps = model->info.parts & EBPO_PART_MAPS;
    ebpo_status status = check_mesh(model, error);
    if (status != EBPO_OK)
        return status;
    write_hex(model->info.content_sha256, own);
    name_model(&model->info, whole);
    bool named = strcmp(p->model_sha256, own) == 0 || strcmp(p->model_sha256, whole) == 0;
    if (named && p->source_numbers && !maps)
        return ebpo_fail_file(error, EBPO_E_ABSENT, model->in.shown,
                              "the paint names faces by their numbers in the source, which this "
                              "file was written without; build it again with maps");
    if (strcmp(p->model_sha256, p->source_numbers ? own : whole) == 0 ||
        (p->source_numbers && named))
        return p->source_numbers == maps
                   ? EBPO_OK
                   : ebpo_fail_file(error, EBPO_E_ARGUMENT, model->in.shown,
                                    "the paint names faces by their rows in the file, where this "
                                    "model has numbers of the source: it was not made for it");
    return ebpo_fail_file(error, EBPO_E_ARGUMENT, model->in.shown,
                          "the paint belongs to another model%s%s, with content_sha256 %s; this "
                          "one has %s: give the model that it was made on",
                          p->model_name[0] ? ", " : "", p->model_name, p->model_sha256, own);
}

ebpo_status ebpo_paint_check_context(const ebpo_paint *p, const ebpo_context *context,
                                     ebpo_error *error)
{
    const ebpo_info *info = context->model->info;
    ebpo_status status = ebpo_paint_check_model(p, context->model->file, error);
    for (int i = 0; i < 3 && status == EBPO_OK; i++)
        if (!(fabs(info->box_origin[i]) <= EBPO_PAINT_MOST / 2 &&
              info->box_size[i] <= EBPO_PAINT_MOST / 2))
            status = ebpo_fail_file(error, EBPO_E_UNSUPPORTED, context->model->file->in.shown,
                                    "coordinates beyond 2^199 cannot be painted on; scale the "
                                    "model");
    return status;
}
