/* Layers over the colours of vertices: format-spec/paint.md, section 5. */
#include "core/strict_fp.h"

#include <ebpo/paint.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/paint/paint_parts.h"
#include "extras/paint/reached.h"
#include "query/query_model.h"

/* A vertex that something covers. */
typedef struct dyed {
    double colour[3];   /* with the layers before */
    double paint[3], a; /* of the layer at hand */
    uint32_t vertex;
    uint32_t layer, stroke; /* the last ones that covered it, and 1 */
} dyed;

typedef struct bake {
    const ebpo_paint *p;
    const ebpo_mesh *mesh;
    const ebpo_progress *progress;
    uint8_t *rgba;
    ebpo_context *context;
    ebpo_reacher *reacher;
    uint32_t *numbers; /* the source's of the mesh's faces, ascending; NULL: 0, 1, 2, ... */
    uint32_t *slot;    /* [vertex_count] in `dyed`, and 1; 0: none */
    dyed *dyed;
    uint64_t count, capacity, done;
    ebpo_paint_baked baked;
} bake;

/* --- faces of the mesh --- */

static int by_value(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Of a mesh in the source's order whose numbers have gaps, or go beyond the source. */
static ebpo_status read_numbers(bake *b, ebpo_error *error)
{
    const ebpo_file *file = b->context->model->file;
    const ebpo_info *info = b->context->model->info;
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_maps maps;
    if (!b->p->source_numbers || info->face_count == info->source_face_count)
        return EBPO_OK;
    ebpo_status status = ebpo_file_read_maps(file, &read, &maps, error);
    if (status != EBPO_OK)
        return status;
    b->numbers = ebpo_alloc(info->face_count, sizeof *b->numbers);
    if (b->numbers) {
        memcpy(b->numbers, maps.face_source, info->face_count * sizeof *b->numbers);
        qsort(b->numbers, info->face_count, sizeof *b->numbers, by_value);
    } else {
        status = ebpo_fail_memory(error, info->face_count * sizeof *b->numbers);
    }
    ebpo_maps_free(&maps);
    return status;
}

/* The row of the mesh. */
static uint64_t row_of(const bake *b, uint64_t face)
{
    uint32_t number = (uint32_t)face;
    const uint32_t *found =
        b->numbers ? bsearch(&number, b->numbers, b->mesh->face_count, sizeof number, by_value)
                   : NULL;
    return found ? (uint64_t)(found - b->numbers) : face;
}

/* --- colours --- */

static ebpo_status find_dyed(bake *b, uint32_t vertex, dyed **out, ebpo_error *error)
{
    if (!b->slot[vertex]) {
        if (!ebpo_grow(&b->dyed, &b->capacity, b->count + 1, sizeof *b->dyed))
            return ebpo_fail_memory(error, b->count * sizeof *b->dyed);
        dyed *d = &b->dyed[b->count++];
        *d = (dyed){ .vertex = vertex };
        for (int k = 0; k < 3; k++)
            d->colour[k] = b->rgba[4 * (uint64_t)vertex + (unsigned)k];
        b->slot[vertex] = (uint32_t)b->count;
    }
    *out = &b->dyed[b->slot[vertex] - 1];
    return EBPO_OK;
}

/* A stroke covers it once. */
static void apply(dyed *d, const ebpo_stroke_held *s, uint32_t number)
{
    double share = s->rgba[3] / 255.0;
    if (d->layer != s->layer + 1) {
        d->layer = s->layer + 1;
        d->stroke = 0;
        d->paint[0] = d->paint[1] = d->paint[2] = d->a = 0;
    }
    if (d->stroke == number + 1)
        return;
    d->stroke = number + 1;
    bool erases = s->kind == EBPO_PAINT_ERASES;
    for (int k = 0; k < 3; k++)
        d->paint[k] = erases ? 0 : d->paint[k] * (1 - share) + s->rgba[k] * share;
    d->a = erases ? 0 : d->a * (1 - share) + share;
}

static ebpo_status dye_face(bake *b, const ebpo_reached_face *f, const ebpo_stroke_held *s,
                            uint32_t number, bool *any, ebpo_error *error)
{
    uint64_t row = row_of(b, f->face);
    if (row >= b->mesh->face_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "the mesh is not the model's");
    for (int k = 0; k < 3; k++) {
        dyed *d = NULL;
        if (!f->within[k])
            continue;
        uint32_t vertex = b->mesh->faces[3 * row + (unsigned)k];
        if (vertex >= b->mesh->vertex_count)
            return ebpo_fail(error, EBPO_E_ARGUMENT, "the mesh is not the model's");
        ebpo_status status = find_dyed(b, vertex, &d, error);
        if (status != EBPO_OK)
            return status;
        apply(d, s, number);
        *any = true;
    }
    return EBPO_OK;
}

static ebpo_status dye_stroke(bake *b, uint32_t number, ebpo_error *error)
{
    const ebpo_stroke_held *s = &b->p->stroke[number];
    ebpo_status status = EBPO_OK;
    for (uint32_t i = 0; i < s->count && status == EBPO_OK; i++, b->done++) {
        ebpo_reached reached;
        bool any = false;
        if (b->done % 256 == 0 &&
            !ebpo_progress_step(b->progress, "bake", b->done, b->p->point_count, error))
            return EBPO_E_CANCELLED;
        status = ebpo_reacher_find(b->reacher, number, i, &reached, error);
        if (status != EBPO_OK)
            return status;
        for (uint64_t k = 0; status == EBPO_OK && k < reached.count; k++)
            status = dye_face(b, &reached.face[k], s, number, &any, error);
        b->baked.points++;
        b->baked.elsewhere += !reached.here;
        b->baked.between += status == EBPO_OK && reached.here && !any;
    }
    return status;
}

/* The layer at hand over those before. */
static void put_layer_over(bake *b, uint32_t layer)
{
    double opacity = (double)b->p->layer[layer].opacity / 255.0;
    for (uint64_t i = 0; i < b->count; i++) {
        dyed *d = &b->dyed[i];
        if (d->layer != layer + 1)
            continue;
        for (int k = 0; k < 3; k++)
            d->colour[k] = d->colour[k] * (1 - d->a * opacity) + d->paint[k] * opacity;
    }
}

static ebpo_status dye_layers(bake *b, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint32_t layer = 0; layer < b->p->layer_count && status == EBPO_OK; layer++) {
        if (!b->p->layer[layer].visible)
            continue;
        for (uint32_t i = 0; i < b->p->stroke_count && status == EBPO_OK; i++)
            if (b->p->stroke[i].layer == layer)
                status = dye_stroke(b, i, error);
        put_layer_over(b, layer);
    }
    return status;
}

static void give_colours(const bake *b)
{
    for (uint64_t i = 0; i < b->count; i++)
        for (int k = 0; k < 3; k++)
            b->rgba[4 * (uint64_t)b->dyed[i].vertex + (unsigned)k] =
                (uint8_t)floor(b->dyed[i].colour[k] + 0.5);
}

static ebpo_status check_mesh(const ebpo_context *context, const ebpo_mesh *mesh, ebpo_error *error)
{
    const ebpo_info *info = context->model->info;
    return mesh->faces && mesh->face_count == info->face_count &&
                   mesh->vertex_count == info->vertex_count
               ? EBPO_OK
               : ebpo_fail(error, EBPO_E_ARGUMENT,
                           "the mesh is not the model's, as ebpo_file_read_source_mesh gives it");
}

ebpo_status ebpo_paint_bake(const ebpo_paint *p, ebpo_context *context, const ebpo_mesh *mesh,
                            const ebpo_paint_options *options, uint8_t *rgba,
                            ebpo_paint_baked *baked, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_paint_options wanted = EBPO_PAINT_OPTIONS_INIT;
    bake b = {
        .p = p, .mesh = mesh, .context = context, .progress = &wanted.progress, .rgba = rgba
    };
    b.baked.struct_size = sizeof b.baked;
    ebpo_status status = EBPO_TAKE(ebpo_paint_options, &wanted, options, error);
    if (status == EBPO_OK && baked)
        status = EBPO_CHECK_SIZED(ebpo_paint_baked, baked, error);
    if (status == EBPO_OK)
        status = ebpo_paint_check_context(p, context, error);
    if (status == EBPO_OK)
        status = check_mesh(context, mesh, error);
    if (status != EBPO_OK)
        return status;
    b.slot = ebpo_alloc_zero(mesh->vertex_count, sizeof *b.slot);
    status = b.slot ? read_numbers(&b, error)
                    : ebpo_fail_memory(error, mesh->vertex_count * sizeof *b.slot);
    if (status == EBPO_OK)
        status = ebpo_reacher_new(p, context, wanted.threads, &b.reacher, error);
    if (status == EBPO_OK)
        status = dye_layers(&b, error);
    if (status == EBPO_OK)
        give_colours(&b);
    b.baked.vertices = b.count;
    if (status == EBPO_OK && baked)
        EBPO_GIVE(ebpo_paint_baked, baked, &b.baked);
    ebpo_reacher_free(b.reacher);
    free(b.numbers);
    free(b.slot);
    free(b.dyed);
    return status;
}
