/* Turns paint into colours of a mesh's vertices, and finds the faces that a stroke covers.
 *
 * A stroke covers the faces and vertices in the reaches of its points (paint_reach.h). The strokes
 * of a layer are applied in order. Then the layers are blended in order over the original colours
 * of the vertices. Colours are stored in the mesh's existing columns, in the columns' types; a mesh
 * without colours gets new columns.
 *
 * Source: format-spec/paint.md, section 5. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/colours.h>
#include <ebpo/paint.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/paint/paint_parts.h"
#include "extras/paint/paint_reach.h"
#include "mesh/attributes.h"
#include "query/query_model.h"

/* Stores a byte: the inverse of ebpo_colour_byte. */
static void put_byte(const ebpo_colour_column *c, uint64_t row, uint8_t value)
{
    uint8_t *to = c->of->values + row * ebpo_attribute_row_bytes(c->of) +
                  (uint64_t)c->column * ebpo_attribute_bytes(c->of->type);
    const uint16_t full = (uint16_t)(257 * value), two = value;
    const uint32_t four = value;
    const float share = (float)(value / 255.0);
    const double exact = value / 255.0;
    switch (c->of->type) {
    case EBPO_ATTRIBUTE_INT8: *to = value < 127 ? value : 127; break; /* maximum of the type */
    case EBPO_ATTRIBUTE_UINT8: *to = value; break;
    case EBPO_ATTRIBUTE_INT16: memcpy(to, &two, sizeof two); break;
    case EBPO_ATTRIBUTE_UINT16: memcpy(to, &full, sizeof full); break;
    case EBPO_ATTRIBUTE_INT32:
    case EBPO_ATTRIBUTE_UINT32: memcpy(to, &four, sizeof four); break;
    case EBPO_ATTRIBUTE_FLOAT32: memcpy(to, &share, sizeof share); break;
    case EBPO_ATTRIBUTE_FLOAT64: memcpy(to, &exact, sizeof exact); break;
    }
}

/* Adds three new properties of all vertices. */
static ebpo_status add_colours(ebpo_mesh *mesh, const uint8_t *rgba, ebpo_error *error)
{
    ebpo_attribute like = { .element = "vertex",
                            .names = "red green blue",
                            .type = EBPO_ATTRIBUTE_UINT8,
                            .list = EBPO_ATTRIBUTE_NO_LIST,
                            .columns = 3,
                            .rows = mesh->vertex_count };
    if (!mesh->attributes)
        mesh->attributes = ebpo_attributes_make(mesh->workspace);
    if (mesh->attributes && mesh->attributes->count >= EBPO_ATTRIBUTE_ARRAYS)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the mesh has too many attributes to add more; omit some");
    ebpo_attribute *a = mesh->attributes ? ebpo_attributes_add(mesh->attributes, &like) : NULL;
    if (a && !ebpo_attribute_reserve(mesh->attributes->workspace, a, mesh->vertex_count, 0)) {
        ebpo_attributes_remove(mesh->attributes, mesh->attributes->count - 1);
        a = NULL;
    }
    if (!a)
        return ebpo_fail_memory(error, 3 * mesh->vertex_count);
    for (uint64_t i = 0; i < mesh->vertex_count; i++)
        memcpy(a->values + 3 * i, rgba + 4 * i, 3);
    return EBPO_OK;
}

ebpo_status ebpo_paint_colour_mesh(ebpo_mesh *mesh, const uint8_t *rgba, ebpo_error *error)
{
    ebpo_colour_column channels[EBPO_COLOUR_CHANNELS];
    if (!ebpo_colour_columns(mesh->attributes, "vertex", channels))
        return add_colours(mesh, rgba, error);
    for (int k = 0; k < 3; k++)
        for (uint64_t i = 0; i < mesh->vertex_count && i < channels[k].of->rows; i++)
            if (ebpo_colour_byte(&channels[k], i) != rgba[4 * i + (unsigned)k])
                put_byte(&channels[k], i, rgba[4 * i + (unsigned)k]);
    return EBPO_OK;
}

/* --- faces that a stroke covers --- */

static int by_file_face(const void *a, const void *b)
{
    const ebpo_found_face *x = a, *y = b;
    return (x->file_face > y->file_face) - (x->file_face < y->file_face);
}

static ebpo_status add_point(ebpo_found_faces *found_faces, ebpo_reach *reach, ebpo_error *error)
{
    for (uint64_t i = 0; i < reach->count; i++) {
        const ebpo_reach_face *f = &reach->face[i];
        uint32_t number;
        ebpo_status status = ebpo_found_faces_add(found_faces, f, &number, error);
        if (status != EBPO_OK)
            return status;
        for (int k = 0; k < 3; k++)
            found_faces->face[number].covered[k] |= f->within[k];
    }
    return EBPO_OK;
}

static void cover_give(const ebpo_found_faces *found_faces, ebpo_paint_face_fn take, void *user)
{
    qsort(found_faces->face, found_faces->count, sizeof *found_faces->face, by_file_face);
    for (uint64_t i = 0; i < found_faces->count; i++) {
        const ebpo_found_face *f = &found_faces->face[i];
        ebpo_paint_face out = { .face = f->face, .file_face = f->file_face };
        memcpy(out.corner, f->corner, sizeof out.corner);
        for (int k = 0; k < 3; k++)
            out.covered[k] = f->covered[k];
        if (!take(user, &out))
            return;
    }
}

ebpo_status ebpo_paint_cover(const ebpo_paint *p, ebpo_context *context, uint64_t stroke,
                             ebpo_paint_face_fn take, void *user, uint64_t *elsewhere,
                             ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_found_faces found_faces = { 0 };
    ebpo_reach reach;
    uint64_t absent = 0;
    ebpo_status status = ebpo_paint_check_context(p, context, error);
    if (status == EBPO_OK && stroke >= p->stroke_count)
        status = ebpo_fail(error, EBPO_E_ARGUMENT, "there is no stroke %llu",
                           (unsigned long long)stroke);
    if (status != EBPO_OK)
        return status;
    ebpo_reach_begin(&reach, context);
    for (uint32_t i = 0; i < p->stroke[stroke].count && status == EBPO_OK; i++) {
        bool complete;
        status = ebpo_paint_reach(&reach, p, stroke, i, &complete, error);
        if (status == EBPO_OK && complete)
            status = add_point(&found_faces, &reach, error);
        absent += status == EBPO_OK && !complete;
    }
    ebpo_reach_end(&reach);
    if (status == EBPO_OK && elsewhere)
        *elsewhere = absent;
    if (status == EBPO_OK)
        cover_give(&found_faces, take, user);
    ebpo_found_faces_free(&found_faces);
    return status;
}

/* --- all points --- */

static ebpo_status check_point(ebpo_reach *reach, const ebpo_paint_point *q, const char *what,
                               uint64_t number, ebpo_error *error)
{
    bool fits;
    ebpo_status status = ebpo_reach_check(reach, q->place, q->face, &fits, error);
    return status != EBPO_OK || fits
               ? status
               : ebpo_fail_file(
                     error, EBPO_E_FORMAT, reach->context->model->file->in.shown,
                     "%s %llu of the paint is not on its face %lu: the paint does not fit the "
                     "model; give the model that it was made on, or remove that %s without "
                     "naming a model",
                     what, (unsigned long long)number, (unsigned long)q->face, what);
}

ebpo_status ebpo_paint_check_points(const ebpo_paint *p, ebpo_context *context,
                                    const ebpo_progress *progress, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    enum { STEP = 1024 };
    ebpo_reach reach;
    uint64_t done = 0;
    ebpo_status status = ebpo_paint_check_context(p, context, error);
    if (status != EBPO_OK)
        return status;
    ebpo_reach_begin(&reach, context);
    for (uint64_t i = 0; i < p->stroke_count && status == EBPO_OK; i++)
        for (uint32_t k = 0; k < p->stroke[i].count && status == EBPO_OK; k++, done++) {
            if (done % STEP == 0 &&
                !ebpo_progress_step(progress, "checking", done, p->point_count, error))
                status = EBPO_E_CANCELLED;
            else
                status = check_point(&reach, &p->point[p->stroke[i].first + k], "stroke", i, error);
        }
    for (uint64_t i = 0; i < p->note_count && status == EBPO_OK; i++)
        status = check_point(&reach, &p->note[i].at, "note", i, error);
    ebpo_reach_end(&reach);
    return status;
}

/* --- layers over colours --- */

/* A vertex that a stroke covers. */
typedef struct dyed {
    double colour[3];   /* colour with the previous layers */
    double paint[3], a; /* colour and opacity of the current layer */
    uint32_t vertex;
    uint32_t layer, stroke; /* numbers of the last layer and stroke that covered it, plus 1 */
} dyed;

typedef struct bake {
    const ebpo_paint *p;
    const ebpo_mesh *mesh;
    const ebpo_progress *progress;
    uint8_t *rgba;
    ebpo_context *context;
    ebpo_reacher *reacher;
    uint32_t
        *numbers;   /* source indices of the mesh's faces, in ascending order; NULL: 0, 1, 2, ... */
    uint32_t *slot; /* [vertex_count] index in `dyed`, plus 1; 0: none */
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

/* Reads the source indices of the mesh's faces, if the numbers have gaps or exceed the mesh's
 * number of faces. The mesh is in the source's order. */
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

/* Returns the row of a face in the mesh. */
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

/* Applies a stroke to a vertex; each stroke covers a vertex once. */
static void bake_apply(dyed *d, const ebpo_stroke_held *s, uint32_t number)
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
        bake_apply(d, s, number);
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
        b->baked.elsewhere += !reached.complete;
        b->baked.between += status == EBPO_OK && reached.complete && !any;
    }
    return status;
}

/* Blends the current layer over the previous ones. */
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
                           "the mesh is not that of the model, from ebpo_file_read_source_mesh");
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
