/* Computes colours of a mesh's vertices from paint, and finds the faces that a stroke covers.
 *
 * Each point of a stroke has a ball. The reach of the point is the set of faces that are connected
 * with the point's face within this ball (paint_reach.h). A stroke covers the faces and vertices in
 * the reaches of its points. The strokes of a layer are applied in order. The layers are then
 * blended in order over the original colours of the vertices. Colours are stored in the mesh's
 * existing columns of colours, and converted to the types of these columns; a mesh without colours
 * gets new columns.
 *
 * See format-spec/paint.md, section 5. */
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

/* Stores a colour value 0 to 255 in the column's type: the inverse of ebpo_colour_byte. */
static void put_byte(const ebpo_colour_column *c, uint64_t row, uint8_t value)
{
    uint8_t *to = c->of->values + row * ebpo_attribute_row_bytes(c->of) +
                  (uint64_t)c->column * ebpo_attribute_bytes(c->of->type);
    const uint16_t scaled16 = (uint16_t)(257 * value), value16 = value;
    const uint32_t value32 = value;
    const float as_float = (float)(value / 255.0);
    const double as_double = value / 255.0;
    switch (c->of->type) {
    case EBPO_ATTRIBUTE_INT8: *to = value < 127 ? value : 127; break; /* 127: the type's maximum */
    case EBPO_ATTRIBUTE_UINT8: *to = value; break;
    case EBPO_ATTRIBUTE_INT16: memcpy(to, &value16, sizeof value16); break;
    case EBPO_ATTRIBUTE_UINT16: memcpy(to, &scaled16, sizeof scaled16); break;
    case EBPO_ATTRIBUTE_INT32:
    case EBPO_ATTRIBUTE_UINT32: memcpy(to, &value32, sizeof value32); break;
    case EBPO_ATTRIBUTE_FLOAT32: memcpy(to, &as_float, sizeof as_float); break;
    case EBPO_ATTRIBUTE_FLOAT64: memcpy(to, &as_double, sizeof as_double); break;
    }
}

/* Adds columns red, green and blue of all vertices. */
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

static ebpo_status add_point(ebpo_found_faces *found_faces, ebpo_reach_search *reach,
                             ebpo_error *error)
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

static void pass_faces(const ebpo_found_faces *found_faces, ebpo_paint_face_fn take, void *user)
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
                             ebpo_paint_face_fn take, void *user, uint64_t *points_outside_subset,
                             ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_found_faces found_faces = { 0 };
    ebpo_reach_search reach;
    uint64_t outside = 0;
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
        outside += status == EBPO_OK && !complete;
    }
    ebpo_reach_end(&reach);
    if (status == EBPO_OK && points_outside_subset)
        *points_outside_subset = outside;
    if (status == EBPO_OK)
        pass_faces(&found_faces, take, user);
    ebpo_found_faces_free(&found_faces);
    return status;
}

/* --- all points --- */

static ebpo_status check_point(ebpo_reach_search *reach, const ebpo_paint_point *q,
                               const char *what, uint64_t number, ebpo_error *error)
{
    bool fits;
    ebpo_status status = ebpo_reach_check(reach, q->place, q->face, &fits, error);
    return status != EBPO_OK || fits
               ? status
               : ebpo_fail_file(
                     error, EBPO_E_FORMAT, reach->context->model->file->in.shown,
                     "a point of %s %llu is not on its face %lu: the paint was made on another "
                     "model; give that model, or remove the %s: ebpo paint PAINT --remove-%s N",
                     what, (unsigned long long)number, (unsigned long)q->face, what, what);
}

ebpo_status ebpo_paint_check_points(const ebpo_paint *p, ebpo_context *context,
                                    const ebpo_progress *progress, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    enum { STEP = 1024 };
    ebpo_reach_search reach;
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

/* A vertex that a stroke covers, and its colour. */
typedef struct coloured_vertex {
    double colour[3];   /* colour with the previous layers */
    double paint[3], a; /* colour and opacity of the current layer */
    uint32_t vertex;
    uint32_t layer, stroke; /* indices, plus 1, of the last layer and the last stroke that covered
                             * the vertex; 0: none */
} coloured_vertex;

typedef struct bake {
    const ebpo_paint *p;
    const ebpo_mesh *mesh;
    const ebpo_progress *progress;
    uint8_t *rgba;
    ebpo_context *context;
    ebpo_reach_pool *reach_pool;
    uint32_t *numbers; /* [face] source index of each face of the mesh, ascending; NULL: a
                        * face's source index is its index in the mesh */
    uint32_t *slot;    /* [vertex_count] the vertex's index in `vertices`, plus 1; 0: not covered */
    coloured_vertex *vertices; /* [count] */
    uint64_t count, capacity;  /* of `vertices` */
    uint64_t done;             /* number of points that have been evaluated */
    ebpo_paint_baked baked;
} bake;

/* --- faces of the mesh --- */

static int by_value(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Sets b->numbers if the paint uses indices in the source and the model does not have all faces of
 * the source. The faces of the mesh are in the order of the source. */
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

/* Returns the index, in the mesh, of a face of the paint. */
static uint64_t row_of(const bake *b, uint64_t face)
{
    uint32_t number = (uint32_t)face;
    const uint32_t *found =
        b->numbers ? bsearch(&number, b->numbers, b->mesh->face_count, sizeof number, by_value)
                   : NULL;
    return found ? (uint64_t)(found - b->numbers) : face;
}

/* --- colours --- */

/* Finds or adds the entry of a vertex. */
static ebpo_status find_vertex(bake *b, uint32_t vertex, coloured_vertex **out, ebpo_error *error)
{
    if (!b->slot[vertex]) {
        if (!ebpo_grow(&b->vertices, &b->capacity, b->count + 1, sizeof *b->vertices))
            return ebpo_fail_memory(error, b->count * sizeof *b->vertices);
        coloured_vertex *d = &b->vertices[b->count++];
        *d = (coloured_vertex){ .vertex = vertex };
        for (int k = 0; k < 3; k++)
            d->colour[k] = b->rgba[4 * (uint64_t)vertex + (unsigned)k];
        b->slot[vertex] = (uint32_t)b->count;
    }
    *out = &b->vertices[b->slot[vertex] - 1];
    return EBPO_OK;
}

/* Applies a stroke to a vertex, but only once. number: index of the stroke. */
static void colour_vertex(coloured_vertex *d, const ebpo_stroke_data *s, uint32_t number)
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

/* Applies a stroke to the vertices of a face that are within a point's ball. Sets *any to true if
 * there is such a vertex. */
static ebpo_status colour_face(bake *b, const ebpo_reach_result_face *f, const ebpo_stroke_data *s,
                               uint32_t number, bool *any, ebpo_error *error)
{
    uint64_t row = row_of(b, f->face);
    if (row >= b->mesh->face_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the mesh does not belong to the model; read it with "
                         "ebpo_file_read_source_mesh");
    for (int k = 0; k < 3; k++) {
        coloured_vertex *d = NULL;
        if (!f->within[k])
            continue;
        uint32_t vertex = b->mesh->faces[3 * row + (unsigned)k];
        if (vertex >= b->mesh->vertex_count)
            return ebpo_fail(error, EBPO_E_ARGUMENT,
                             "the mesh does not belong to the model; read it with "
                             "ebpo_file_read_source_mesh");
        ebpo_status status = find_vertex(b, vertex, &d, error);
        if (status != EBPO_OK)
            return status;
        colour_vertex(d, s, number);
        *any = true;
    }
    return EBPO_OK;
}

static ebpo_status apply_stroke(bake *b, uint32_t number, ebpo_error *error)
{
    const ebpo_stroke_data *s = &b->p->stroke[number];
    ebpo_status status = EBPO_OK;
    for (uint32_t i = 0; i < s->count && status == EBPO_OK; i++, b->done++) {
        ebpo_reach_result reached;
        bool any = false;
        if (b->done % 256 == 0 &&
            !ebpo_progress_step(b->progress, "bake", b->done, b->p->point_count, error))
            return EBPO_E_CANCELLED;
        status = ebpo_reach_pool_find(b->reach_pool, number, i, &reached, error);
        if (status != EBPO_OK)
            return status;
        for (uint64_t k = 0; status == EBPO_OK && k < reached.count; k++)
            status = colour_face(b, &reached.face[k], s, number, &any, error);
        b->baked.points++;
        b->baked.points_outside_subset += !reached.complete;
        b->baked.points_without_vertex += status == EBPO_OK && reached.complete && !any;
    }
    return status;
}

/* Blends a layer over the previous layers. */
static void blend_layer(bake *b, uint32_t layer)
{
    double opacity = (double)b->p->layer[layer].opacity / 255.0;
    for (uint64_t i = 0; i < b->count; i++) {
        coloured_vertex *d = &b->vertices[i];
        if (d->layer != layer + 1)
            continue;
        for (int k = 0; k < 3; k++)
            d->colour[k] = d->colour[k] * (1 - d->a * opacity) + d->paint[k] * opacity;
    }
}

static ebpo_status apply_layers(bake *b, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint32_t layer = 0; layer < b->p->layer_count && status == EBPO_OK; layer++) {
        if (!b->p->layer[layer].visible)
            continue;
        for (uint32_t i = 0; i < b->p->stroke_count && status == EBPO_OK; i++)
            if (b->p->stroke[i].layer == layer)
                status = apply_stroke(b, i, error);
        blend_layer(b, layer);
    }
    return status;
}

static void store_colours(const bake *b)
{
    for (uint64_t i = 0; i < b->count; i++)
        for (int k = 0; k < 3; k++)
            b->rgba[4 * (uint64_t)b->vertices[i].vertex + (unsigned)k] =
                (uint8_t)floor(b->vertices[i].colour[k] + 0.5);
}

static ebpo_status check_mesh(const ebpo_context *context, const ebpo_mesh *mesh, ebpo_error *error)
{
    const ebpo_info *info = context->model->info;
    return mesh->faces && mesh->face_count == info->face_count &&
                   mesh->vertex_count == info->vertex_count
               ? EBPO_OK
               : ebpo_fail(error, EBPO_E_ARGUMENT,
                           "the mesh does not belong to the model; read it with "
                           "ebpo_file_read_source_mesh");
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
        status = ebpo_reach_pool_new(p, context, wanted.threads, &b.reach_pool, error);
    if (status == EBPO_OK)
        status = apply_layers(&b, error);
    if (status == EBPO_OK)
        store_colours(&b);
    b.baked.vertices = b.count;
    if (status == EBPO_OK && baked)
        EBPO_GIVE(ebpo_paint_baked, baked, &b.baked);
    ebpo_reach_pool_free(b.reach_pool);
    free(b.numbers);
    free(b.slot);
    free(b.vertices);
    return status;
}
