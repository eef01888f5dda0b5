/* What `ebpo paint` changes, and what it bakes. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/words.h"
#include "cli/commands/paint_job.h"

static ebpo_status fail(ebpo_error *error, ebpo_status status, const char *what)
{
    *error = (ebpo_error){ .status = status, .offset = -1 };
    snprintf(error->message, sizeof error->message, "%s", what);
    return status;
}

static ebpo_paint_info info_of(const paint_job *j)
{
    ebpo_paint_info info = EBPO_PAINT_INFO_INIT;
    ebpo_paint_get_info(j->paint, &info);
    return info;
}

ebpo_status paint_layer(const paint_job *j, uint64_t *layer, ebpo_error *error)
{
    ebpo_paint_info info = info_of(j);
    *layer = j->v->layer >= 0 ? (uint64_t)j->v->layer : info.layer_count - 1;
    if (info.layer_count == 0)
        return fail(error, EBPO_E_ARGUMENT, "the paint has no layer; add one with --new-layer");
    if (*layer < info.layer_count)
        return EBPO_OK;
    char what[120];
    snprintf(what, sizeof what,
             "there is no layer %llu: layers are counted from 0, and the paint has %llu",
             (unsigned long long)*layer, (unsigned long long)info.layer_count);
    return fail(error, EBPO_E_ARGUMENT, what);
}

/* --- layers and notes --- */

/* What of a layer is said on the command line. */
static void say(const paint_values *v, ebpo_paint_layer *layer)
{
    layer->title = v->new_layer ? v->new_layer : v->title ? v->title : layer->title;
    layer->author = v->author ? v->author : layer->author;
    layer->date = v->date ? v->date : layer->date;
    layer->description = v->description ? v->description : layer->description;
    if (v->colour)
        (void)paint_read_colour(v->colour, &layer->colour); /* which was checked */
    if (v->opacity >= 0)
        layer->opacity = (uint32_t)v->opacity;
    if (v->show || v->hide)
        layer->visible = v->show;
}

static ebpo_status add_layer(paint_job *j, ebpo_error *error)
{
    ebpo_paint_layer layer = EBPO_PAINT_LAYER_INIT;
    say(j->v, &layer);
    return ebpo_paint_add_layer(j->paint, &layer, NULL, error);
}

static ebpo_status set_layer(paint_job *j, ebpo_error *error)
{
    ebpo_paint_layer layer = EBPO_PAINT_LAYER_INIT;
    uint64_t number;
    ebpo_status status = paint_layer(j, &number, error);
    if (status != EBPO_OK)
        return status;
    ebpo_paint_get_layer(j->paint, number, &layer);
    say(j->v, &layer);
    return ebpo_paint_set_layer(j->paint, number, &layer, error);
}

/* Lines are separated by U+2028 in files. The caller frees it. */
static char *as_lines(const char *text)
{
    char *out = malloc(3 * strlen(text) + 1), *to = out;
    for (; out && *text; text++) {
        if (*text == '\n') {
            memcpy(to, "\xe2\x80\xa8", 3);
            to += 3;
        } else {
            *to++ = *text;
        }
    }
    if (out)
        *to = 0;
    return out;
}

static ebpo_status add_note(paint_job *j, ebpo_error *error)
{
    ebpo_paint_note note = EBPO_PAINT_NOTE_INIT;
    double place[3] = { 0, 0, 0 };
    (void)paint_read_place(j->v->at, place); /* which was checked */
    ebpo_status status = paint_layer(j, &note.layer, error);
    if (status == EBPO_OK)
        status = ebpo_paint_place(j->paint, j->context, place, &note.at, error);
    if (status != EBPO_OK)
        return status;
    char *body = as_lines(j->v->note);
    if (!body)
        return fail(error, EBPO_E_MEMORY, "not enough memory for the note");
    note.title = j->v->title;
    note.author = j->v->author;
    note.date = j->v->date;
    note.body = body;
    status = ebpo_paint_add_note(j->paint, &note, error);
    free(body);
    return status;
}

/* --- strokes --- */

static ebpo_status lay(paint_job *j, const ebpo_paint_hand *hand, uint64_t count, ebpo_error *error)
{
    const paint_values *v = j->v;
    ebpo_paint_pen pen = EBPO_PAINT_PEN_INIT;
    ebpo_paint_layer layer = EBPO_PAINT_LAYER_INIT;
    ebpo_status status = paint_layer(j, &pen.layer, error);
    if (status != EBPO_OK)
        return status;
    ebpo_paint_get_layer(j->paint, pen.layer, &layer);
    pen.kind = v->erase ? EBPO_PAINT_ERASES : EBPO_PAINT_PAINTS;
    pen.colour = v->erase ? 0 : layer.colour;
    if (v->colour)
        (void)paint_read_colour(v->colour, &pen.colour);
    pen.radius = v->radius;
    pen.spread = v->spread;
    pen.density = (uint32_t)v->density;
    pen.size_least = v->thin;
    pen.step = v->step;
    pen.within = v->within;
    pen.seed = (uint64_t)v->seed;
    pen.progress = j->progress;
    status = ebpo_paint_lay(j->paint, j->context, hand, count, &pen, &j->laid, error);
    return status != EBPO_OK || j->laid.points
               ? status
               : fail(error, EBPO_E_ARGUMENT,
                      "the pen was nowhere on the surface: give a greater --within or a path that "
                      "is closer");
}

static ebpo_status undo(paint_job *j, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    uint64_t strokes = info_of(j).stroke_count;
    if ((uint64_t)j->v->undo > strokes) {
        char what[80];
        snprintf(what, sizeof what, "--undo %lld: the paint has not so many strokes, but %llu",
                 (long long)j->v->undo, (unsigned long long)strokes);
        return fail(error, EBPO_E_ARGUMENT, what);
    }
    for (int64_t i = 0; i < j->v->undo && status == EBPO_OK; i++)
        status = ebpo_paint_remove_stroke(j->paint, info_of(j).stroke_count - 1, error);
    return status;
}

ebpo_status paint_change(paint_job *j, const ebpo_paint_hand *hand, uint64_t count,
                         ebpo_error *error)
{
    const paint_values *v = j->v;
    ebpo_status status = EBPO_OK;
    if (v->new_layer)
        status = add_layer(j, error);
    else if (hand || v->note)
        ;
    else if (v->undo)
        status = undo(j, error);
    else if (v->remove_stroke >= 0)
        status = ebpo_paint_remove_stroke(j->paint, (uint64_t)v->remove_stroke, error);
    else if (v->remove_note >= 0)
        status = ebpo_paint_remove_note(j->paint, (uint64_t)v->remove_note, error);
    else if (v->remove_layer >= 0)
        status = ebpo_paint_remove_layer(j->paint, (uint64_t)v->remove_layer, error);
    else
        status = set_layer(j, error);
    if (status == EBPO_OK && hand)
        status = lay(j, hand, count, error);
    if (status == EBPO_OK && v->note)
        status = add_note(j, error);
    return status == EBPO_OK ? ebpo_paint_save(j->paint, v->out ? v->out : j->paint_path, error)
                             : status;
}

/* --- baking --- */

/* [vertex_count][4], the model's own colours, or the base. NULL: no memory. */
static uint8_t *own_colours(paint_job *j, const ebpo_mesh *mesh, ebpo_error *error)
{
    ebpo_colours colours;
    uint32_t base = 0xe6e6e6ff;
    if (j->v->base)
        (void)paint_read_colour(j->v->base, &base);
    if (ebpo_mesh_colours(mesh, &colours, error) != EBPO_OK)
        return NULL;
    uint8_t *rgba = colours.vertex;
    colours.vertex = NULL;
    ebpo_colours_free(&colours);
    j->colours_of_own = rgba != NULL;
    if (rgba)
        return rgba;
    rgba = malloc(4 * mesh->vertex_count);
    if (!rgba)
        (void)fail(error, EBPO_E_MEMORY, "not enough memory for the colours of all vertices");
    for (uint64_t i = 0; rgba && i < 4 * mesh->vertex_count; i++)
        rgba[i] = (uint8_t)(base >> (24 - 8 * (i % 4)));
    return rgba;
}

static ebpo_status write_baked(paint_job *j, ebpo_mesh *mesh, const uint8_t *rgba,
                               ebpo_error *error)
{
    const char *out = j->v->bake;
    if (words_end_with(out, ".ply")) {
        ebpo_status status = ebpo_paint_dye_mesh(mesh, rgba, error);
        return status == EBPO_OK ? ebpo_mesh_write_ply(mesh, out, error) : status;
    }
    ebpo_export_options o = EBPO_EXPORT_OPTIONS_INIT;
    o.threads = (unsigned)j->v->threads;
    o.progress = j->progress;
    o.vertex_colours = rgba;
    ebpo_mesh_free(mesh); /* the export reads its own */
    return ebpo_export(j->file, out,
                       words_end_with(out, ".glb")    ? EBPO_EXPORT_GLB
                       : words_end_with(out, ".gltf") ? EBPO_EXPORT_GLTF
                                                      : EBPO_EXPORT_OBJ,
                       &o, NULL, error);
}

ebpo_status paint_bake(paint_job *j, ebpo_error *error)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_paint_options options = EBPO_PAINT_OPTIONS_INIT;
    ebpo_mesh mesh;
    read.threads = (unsigned)j->v->threads;
    read.attributes = 1;
    options.threads = (unsigned)j->v->threads;
    options.progress = j->progress;
    ebpo_status status = ebpo_check_output(j->v->bake, error);
    if (status == EBPO_OK)
        status = ebpo_file_read_source_mesh(j->file, &read, &mesh, NULL, error);
    if (status != EBPO_OK)
        return status;
    uint8_t *rgba = own_colours(j, &mesh, error);
    status = rgba ? ebpo_paint_bake(j->paint, j->context, &mesh, &options, rgba, &j->baked, error)
                  : EBPO_E_MEMORY;
    if (status == EBPO_OK)
        status = write_baked(j, &mesh, rgba, error);
    free(rgba);
    ebpo_mesh_free(&mesh);
    return status;
}
