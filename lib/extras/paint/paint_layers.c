/* Adds and changes the content of a paint: its layers, strokes and notes. Checks that a model is
 * the model to which the paint belongs.
 *
 * Strokes are kept in the order in which they were made; the points of a stroke are consecutive.
 * Removing a layer removes its strokes and its notes. Texts are UTF-8 of limited size without
 * control characters. A paint belongs to the model with a given SHA-256 digest; queries with
 * another model fail.
 *
 * See format-spec/paint.md. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <ebpo/paint.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/os.h"
#include "core/text.h"
#include "extras/paint/paint_parts.h"
#include "format/file_in.h"
#include "query/query_model.h"

const char *ebpo_paint_point_wrong(const ebpo_paint_point *q)
{
    for (int i = 0; i < 3; i++)
        if (!(fabs(q->place[i]) <= EBPO_PAINT_MAX))
            return "a position is not finite, or beyond 2^200";
    if (q->face == UINT32_MAX)
        return "a point has no face";
    if ((uint64_t)q->weight[0] + q->weight[1] > EBPO_PAINT_WEIGHTS)
        return "the weights of a point are more than 2^30 in sum";
    if (q->size < 1 || q->size > EBPO_PAINT_FULL)
        return "the size of a point is not 1 to 2^15";
    return NULL;
}

const char *ebpo_paint_stroke_wrong(const ebpo_stroke_data *s, uint64_t layers)
{
    static const uint8_t none[4];
    if (s->layer >= layers)
        return "a stroke names a layer that does not exist";
    if (s->kind > EBPO_PAINT_ERASES)
        return "a stroke is of an unknown kind";
    if (s->kind == EBPO_PAINT_ERASES && memcmp(s->rgba, none, sizeof none) != 0)
        return "the colour of an erasing stroke must be 0";
    if (!(s->radius >= 1 / EBPO_PAINT_MAX && s->radius <= EBPO_PAINT_MAX))
        return "the radius of a stroke is not 2^-200 to 2^200";
    if (s->time > EBPO_PAINT_TIME_MAX)
        return "the time of a stroke is beyond 2^53";
    return s->count == 0 ? "a stroke has no point" : NULL;
}

ebpo_status ebpo_paint_get_stroke(const ebpo_paint *p, uint64_t number, ebpo_paint_stroke *out)
{
    ebpo_paint_stroke result = EBPO_PAINT_STROKE_INIT;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_paint_stroke, out, NULL);
    if (status != EBPO_OK || number >= p->stroke_count)
        return EBPO_E_ARGUMENT;
    const ebpo_stroke_data *s = &p->stroke[number];
    result.layer = s->layer;
    result.kind = (ebpo_paint_kind)s->kind;
    result.colour = ebpo_paint_pack(s->rgba);
    result.radius = s->radius;
    result.time = s->time;
    result.point_count = s->count;
    result.points = p->point + s->first;
    return EBPO_GIVE(ebpo_paint_stroke, out, &result);
}

/* Converts a stroke to *out, and checks it. */
static ebpo_status check_stroke(const ebpo_paint *p, const ebpo_paint_stroke *stroke,
                                ebpo_stroke_data *out, ebpo_error *error)
{
    *out = (ebpo_stroke_data){ .radius = stroke->radius,
                               .time = stroke->time,
                               .first = p->point_count,
                               .layer = stroke->layer < UINT32_MAX ? (uint32_t)stroke->layer
                                                                   : UINT32_MAX,
                               .kind = (uint32_t)stroke->kind };
    for (int i = 0; i < 4; i++)
        out->rgba[i] = (uint8_t)(stroke->colour >> (24 - 8 * i));
    if (p->stroke_count == EBPO_PAINT_STROKES ||
        stroke->point_count > EBPO_PAINT_POINTS - p->point_count)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "a paint has at most %d strokes, and %d points in all of them",
                         EBPO_PAINT_STROKES, EBPO_PAINT_POINTS);
    out->count = (uint32_t)stroke->point_count;
    const char *wrong = ebpo_paint_stroke_wrong(out, p->layer_count);
    for (uint64_t i = 0; i < stroke->point_count && !wrong; i++)
        wrong = ebpo_paint_point_wrong(&stroke->points[i]);
    return wrong ? ebpo_fail(error, EBPO_E_ARGUMENT, "%s", wrong) : EBPO_OK;
}

ebpo_status ebpo_paint_add_stroke(ebpo_paint *p, const ebpo_paint_stroke *given, ebpo_error *error)
{
    ebpo_stroke_data copy;
    ebpo_paint_stroke stroke = EBPO_PAINT_STROKE_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_paint_stroke, &stroke, given, error);
    if (status == EBPO_OK)
        status = check_stroke(p, &stroke, &copy, error);
    if (status != EBPO_OK)
        return status;
    if (!ebpo_grow(&p->stroke, &p->stroke_capacity, p->stroke_count + 1, sizeof *p->stroke) ||
        !ebpo_grow(&p->point, &p->point_capacity, p->point_count + copy.count, sizeof *p->point))
        return ebpo_fail_memory(error, copy.count * sizeof *p->point);
    memcpy(p->point + p->point_count, stroke.points, copy.count * sizeof *p->point);
    for (uint32_t i = 0; i < copy.count; i++)
        p->point[p->point_count + i].reserved = 0;
    p->stroke[p->stroke_count++] = copy;
    p->point_count += copy.count;
    return EBPO_OK;
}

ebpo_status ebpo_paint_remove_stroke(ebpo_paint *p, uint64_t number, ebpo_error *error)
{
    if (number >= p->stroke_count)
        return ebpo_fail(
            error, EBPO_E_ARGUMENT,
            "there is no stroke %llu: strokes are numbered from 0, and the paint has %llu",
            (unsigned long long)number, (unsigned long long)p->stroke_count);
    ebpo_stroke_data removed = p->stroke[number];
    uint64_t end = removed.first + removed.count;
    memmove(p->point + removed.first, p->point + end, (p->point_count - end) * sizeof *p->point);
    p->point_count -= removed.count;
    p->stroke_count--;
    memmove(p->stroke + number, p->stroke + number + 1,
            (p->stroke_count - number) * sizeof *p->stroke);
    for (uint64_t i = number; i < p->stroke_count; i++)
        p->stroke[i].first -= removed.count;
    return EBPO_OK;
}

/* --- layers and notes --- */

const ebpo_paint_text_kind ebpo_paint_layer_texts[EBPO_PAINT_TEXTS] = {
    { "title", 255 }, { "author", 255 }, { "date", 31 }, { "description", 4095 }
};
const ebpo_paint_text_kind ebpo_paint_note_texts[EBPO_PAINT_TEXTS] = {
    { "title", 255 }, { "author", 255 }, { "date", 31 }, { "body", EBPO_PAINT_TEXT_MAX }
};

/* --- texts --- */

static void free_texts(char *text[EBPO_PAINT_TEXTS])
{
    for (int i = 0; i < EBPO_PAINT_TEXTS; i++)
        free(text[i]);
}

static bool copy_texts(const char *const from[EBPO_PAINT_TEXTS], char *to[EBPO_PAINT_TEXTS])
{
    bool ok = true;
    for (int i = 0; i < EBPO_PAINT_TEXTS; i++) {
        to[i] = strdup(from[i] ? from[i] : "");
        ok = ok && to[i];
    }
    if (!ok)
        free_texts(to);
    return ok;
}

bool ebpo_paint_texts_begin(char *text[EBPO_PAINT_TEXTS])
{
    static const char *const none[EBPO_PAINT_TEXTS];
    return copy_texts(none, text);
}

/* Checks all texts, then copies them. known: the date that the layer has already. That date is
 * accepted without a check, so that a date from another program can be kept. owner: the object that
 * has these texts, for messages, such as "a layer". */
static ebpo_status check_texts(const char *const from[EBPO_PAINT_TEXTS],
                               const ebpo_paint_text_kind *kinds, const char *owner,
                               const char *known, char *to[EBPO_PAINT_TEXTS], ebpo_error *error)
{
    const char *date = from[EBPO_PAINT_DATE];
    size_t bytes = 0;
    for (int i = 0; i < EBPO_PAINT_TEXTS; i++) {
        size_t length = from[i] ? strlen(from[i]) : 0;
        bytes += length + 1;
        if (length > kinds[i].max_bytes)
            return ebpo_fail(error, EBPO_E_ARGUMENT, "%s: the %s is longer than %zu bytes", owner,
                             kinds[i].name, kinds[i].max_bytes);
        if (from[i] && !ebpo_text_ok(from[i]))
            return ebpo_fail(error, EBPO_E_ARGUMENT,
                             "%s: the %s is not UTF-8 without control characters; lines are "
                             "separated by U+2028",
                             owner, kinds[i].name);
    }
    if (date && *date && strcmp(date, known) != 0 && !ebpo_is_date(date))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "%s: the date is not a valid ISO 8601 date, such as 2026-11-26 or "
                         "2026-11-26T21:43:05Z",
                         owner);
    return copy_texts(from, to) ? EBPO_OK : ebpo_fail_memory(error, bytes);
}

/* --- layers --- */

static ebpo_status no_layer(const ebpo_paint *p, uint64_t number, ebpo_error *error)
{
    return ebpo_fail(error, EBPO_E_ARGUMENT,
                     "there is no layer %llu: layers are numbered from 0, and the paint has %llu",
                     (unsigned long long)number, (unsigned long long)p->layer_count);
}

/* Checks a layer and copies it. known: as in check_texts. */
static ebpo_status copy_layer(const ebpo_paint_layer *given, const char *known,
                              ebpo_layer_data *out, ebpo_error *error)
{
    ebpo_paint_layer layer = EBPO_PAINT_LAYER_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_paint_layer, &layer, given, error);
    if (status != EBPO_OK)
        return status;
    if (layer.opacity > 255 || layer.visible > 1)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "a layer's opacity must be 0 to 255, and `visible` must be 0 or 1");
    const char *texts[EBPO_PAINT_TEXTS] = { layer.title, layer.author, layer.date,
                                            layer.description };
    *out = (ebpo_layer_data){ .colour = layer.colour,
                              .opacity = layer.opacity,
                              .visible = layer.visible };
    return check_texts(texts, ebpo_paint_layer_texts, "a layer", known, out->text, error);
}

ebpo_status ebpo_paint_get_layer(const ebpo_paint *p, uint64_t number, ebpo_paint_layer *out)
{
    ebpo_paint_layer result = EBPO_PAINT_LAYER_INIT;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_paint_layer, out, NULL);
    if (status != EBPO_OK || number >= p->layer_count)
        return EBPO_E_ARGUMENT;
    const ebpo_layer_data *l = &p->layer[number];
    result.title = l->text[EBPO_PAINT_TITLE];
    result.author = l->text[EBPO_PAINT_AUTHOR];
    result.date = l->text[EBPO_PAINT_DATE];
    result.description = l->text[EBPO_PAINT_BODY];
    result.colour = (uint32_t)l->colour;
    result.opacity = (uint32_t)l->opacity;
    result.visible = l->visible;
    return EBPO_GIVE(ebpo_paint_layer, out, &result);
}

ebpo_status ebpo_paint_add_layer(ebpo_paint *p, const ebpo_paint_layer *layer, uint64_t *number,
                                 ebpo_error *error)
{
    if (p->layer_count == EBPO_PAINT_LAYERS)
        return ebpo_fail(error, EBPO_E_LIMIT, "a paint has at most %d layers", EBPO_PAINT_LAYERS);
    if (!ebpo_grow(&p->layer, &p->layer_capacity, p->layer_count + 1, sizeof *p->layer))
        return ebpo_fail_memory(error, sizeof *p->layer);
    ebpo_status status = copy_layer(layer, "", &p->layer[p->layer_count], error);
    if (status != EBPO_OK)
        return status;
    if (number)
        *number = p->layer_count;
    p->layer_count++;
    return EBPO_OK;
}

ebpo_status ebpo_paint_set_layer(ebpo_paint *p, uint64_t number, const ebpo_paint_layer *layer,
                                 ebpo_error *error)
{
    ebpo_layer_data copy;
    if (number >= p->layer_count)
        return no_layer(p, number, error);
    ebpo_status status = copy_layer(layer, p->layer[number].text[EBPO_PAINT_DATE], &copy, error);
    if (status != EBPO_OK)
        return status;
    free_texts(p->layer[number].text);
    p->layer[number] = copy;
    return EBPO_OK;
}

/* Removes the strokes of a layer with their points, and renumbers the layers of other strokes. */
static void drop_strokes(ebpo_paint *p, uint64_t layer)
{
    uint64_t strokes = 0, points = 0;
    for (uint64_t i = 0; i < p->stroke_count; i++) {
        ebpo_stroke_data s = p->stroke[i];
        if (s.layer == layer)
            continue;
        memmove(p->point + points, p->point + s.first, s.count * sizeof *p->point);
        s.first = points;
        s.layer -= s.layer > layer;
        p->stroke[strokes++] = s;
        points += s.count;
    }
    p->stroke_count = strokes;
    p->point_count = points;
}

/* Removes the notes of a layer, and renumbers the layers of other notes. */
static void drop_notes(ebpo_paint *p, uint64_t layer)
{
    uint64_t notes = 0;
    for (uint64_t i = 0; i < p->note_count; i++) {
        if (p->note[i].layer == layer) {
            free_texts(p->note[i].text);
            continue;
        }
        p->note[notes] = p->note[i];
        p->note[notes].layer -= p->note[notes].layer > layer;
        notes++;
    }
    p->note_count = notes;
}

ebpo_status ebpo_paint_remove_layer(ebpo_paint *p, uint64_t number, ebpo_error *error)
{
    if (number >= p->layer_count)
        return no_layer(p, number, error);
    drop_strokes(p, number);
    drop_notes(p, number);
    free_texts(p->layer[number].text);
    p->layer_count--;
    memmove(p->layer + number, p->layer + number + 1, (p->layer_count - number) * sizeof *p->layer);
    return EBPO_OK;
}

/* --- notes --- */

ebpo_status ebpo_paint_get_note(const ebpo_paint *p, uint64_t number, ebpo_paint_note *out)
{
    ebpo_paint_note result = EBPO_PAINT_NOTE_INIT;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_paint_note, out, NULL);
    if (status != EBPO_OK || number >= p->note_count)
        return EBPO_E_ARGUMENT;
    const ebpo_note_data *n = &p->note[number];
    result.title = n->text[EBPO_PAINT_TITLE];
    result.author = n->text[EBPO_PAINT_AUTHOR];
    result.date = n->text[EBPO_PAINT_DATE];
    result.body = n->text[EBPO_PAINT_BODY];
    result.layer = n->layer;
    result.at = n->at;
    return EBPO_GIVE(ebpo_paint_note, out, &result);
}

ebpo_status ebpo_paint_add_note(ebpo_paint *p, const ebpo_paint_note *given, ebpo_error *error)
{
    ebpo_paint_note note = EBPO_PAINT_NOTE_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_paint_note, &note, given, error);
    if (status != EBPO_OK)
        return status;
    note.at.size = EBPO_PAINT_FULL; /* notes do not use size, pressure and time */
    note.at.pressure = 0;
    note.at.time = note.at.reserved = 0;
    const char *wrong = ebpo_paint_point_wrong(&note.at);
    if (wrong)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "a note: %s", wrong);
    if (note.layer >= p->layer_count)
        return no_layer(p, note.layer, error);
    if (p->note_count == EBPO_PAINT_NOTES)
        return ebpo_fail(error, EBPO_E_LIMIT, "a paint has at most %d notes", EBPO_PAINT_NOTES);
    if (!ebpo_grow(&p->note, &p->note_capacity, p->note_count + 1, sizeof *p->note))
        return ebpo_fail_memory(error, sizeof *p->note);
    const char *texts[EBPO_PAINT_TEXTS] = { note.title, note.author, note.date, note.body };
    ebpo_note_data *copy = &p->note[p->note_count];
    *copy = (ebpo_note_data){ .layer = note.layer, .at = note.at };
    status = check_texts(texts, ebpo_paint_note_texts, "a note", "", copy->text, error);
    if (status == EBPO_OK)
        p->note_count++;
    return status;
}

ebpo_status ebpo_paint_remove_note(ebpo_paint *p, uint64_t number, ebpo_error *error)
{
    if (number >= p->note_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "there is no note %llu: notes are numbered from 0, and the paint has "
                         "%llu",
                         (unsigned long long)number, (unsigned long long)p->note_count);
    free_texts(p->note[number].text);
    p->note_count--;
    memmove(p->note + number, p->note + number + 1, (p->note_count - number) * sizeof *p->note);
    return EBPO_OK;
}

/* --- the object --- */

static void write_hex(const uint8_t digest[32], char out[65])
{
    for (int i = 0; i < 32; i++)
        snprintf(out + 2 * i, 3, "%02x", digest[i]);
}

/* Sets `out` to the digest by which a paint made on this file identifies its model
 * (format-spec/paint.md, section 2). */
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
                                "the file was written without its mesh, so it cannot be painted "
                                "on; build it again with that part");
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
    const char *name = ebpo_last_separator(model->in.shown);
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
        free_texts(p->layer[i].text);
    for (uint64_t i = 0; i < p->note_count; i++)
        free_texts(p->note[i].text);
    free_file(p->file);
    free(p->layer);
    free(p->note);
    free(p->stroke);
    free(p->point);
    free(p);
}

ebpo_status ebpo_paint_get_info(const ebpo_paint *p, ebpo_paint_info *out)
{
    ebpo_paint_info result = EBPO_PAINT_INFO_INIT;
    result.generator = p->generator;
    result.model_sha256 = p->model_sha256;
    result.model_name = p->model_name;
    result.unit = p->unit;
    result.source_numbers = p->source_numbers;
    result.layer_count = p->layer_count;
    result.note_count = p->note_count;
    result.stroke_count = p->stroke_count;
    result.point_count = p->point_count;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_paint_info, out, NULL);
    return status == EBPO_OK ? EBPO_GIVE(ebpo_paint_info, out, &result) : status;
}

ebpo_status ebpo_paint_check_model(const ebpo_paint *p, const ebpo_file *model, ebpo_error *error)
{
    char digest[65], whole[65]; /* digest: of this file; whole: result of name_model */
    bool maps = model->info.parts & EBPO_PART_MAPS;
    ebpo_status status = check_mesh(model, error);
    if (status != EBPO_OK)
        return status;
    write_hex(model->info.content_sha256, digest);
    name_model(&model->info, whole);
    bool named = strcmp(p->model_sha256, digest) == 0 || strcmp(p->model_sha256, whole) == 0;
    if (named && p->source_numbers && !maps)
        return ebpo_fail_file(error, EBPO_E_ABSENT, model->in.shown,
                              "the paint names faces by their indices in the source, which this "
                              "file does not contain; build it again with maps");
    if (strcmp(p->model_sha256, p->source_numbers ? digest : whole) == 0 ||
        (p->source_numbers && named))
        return p->source_numbers == maps
                   ? EBPO_OK
                   : ebpo_fail_file(error, EBPO_E_ARGUMENT, model->in.shown,
                                    "the paint names faces by their indices in the file, but this "
                                    "model has indices in the source, so the paint was made on "
                                    "another model; give that model");
    return ebpo_fail_file(error, EBPO_E_ARGUMENT, model->in.shown,
                          "the paint belongs to another model%s%s, with content_sha256 %s; this "
                          "model has %s: give the model on which the paint was made",
                          p->model_name[0] ? ", " : "", p->model_name, p->model_sha256, digest);
}

ebpo_status ebpo_paint_check_context(const ebpo_paint *p, const ebpo_context *context,
                                     ebpo_error *error)
{
    const ebpo_info *info = context->model->info;
    ebpo_status status = ebpo_paint_check_model(p, context->model->file, error);
    for (int i = 0; i < 3 && status == EBPO_OK; i++)
        if (!(fabs(info->box_origin[i]) <= EBPO_PAINT_MAX / 2 &&
              info->box_size[i] <= EBPO_PAINT_MAX / 2))
            status = ebpo_fail_file(error, EBPO_E_UNSUPPORTED, context->model->file->in.shown,
                                    "coordinates beyond 2^199 cannot be painted on; scale the "
                                    "model");
    return status;
}
