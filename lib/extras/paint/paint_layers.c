/* Layers and notes. */
#include "core/strict_fp.h"

#include <ebpo/paint.h>

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/text.h"
#include "extras/paint/paint_parts.h"

const ebpo_paint_text_kind ebpo_paint_layer_texts[EBPO_PAINT_TEXTS] = {
    { "title", 255 }, { "author", 255 }, { "date", 31 }, { "description", 4095 }
};
const ebpo_paint_text_kind ebpo_paint_note_texts[EBPO_PAINT_TEXTS] = {
    { "title", 255 }, { "author", 255 }, { "date", 31 }, { "body", EBPO_PAINT_TEXT_MOST }
};

/* --- texts --- */

void ebpo_paint_texts_free(char *text[EBPO_PAINT_TEXTS])
{
    for (int i = 0; i < EBPO_PAINT_TEXTS; i++)
        free(text[i]);
}

static bool copy_texts(const char *const from[EBPO_PAINT_TEXTS], char *to[EBPO_PAINT_TEXTS])
{
    bool fine = true;
    for (int i = 0; i < EBPO_PAINT_TEXTS; i++) {
        to[i] = strdup(from[i] ? from[i] : "");
        fine = fine && to[i];
    }
    if (!fine)
        ebpo_paint_texts_free(to);
    return fine;
}

bool ebpo_paint_texts_begin(char *text[EBPO_PAINT_TEXTS])
{
    static const char *const none[EBPO_PAINT_TEXTS];
    return copy_texts(none, text);
}

/* Checks texts before anything is changed, and copies them. `known` is a date that need not be one:
 * what other programs have written stays. */
static ebpo_status take_texts(const char *const from[EBPO_PAINT_TEXTS],
                              const ebpo_paint_text_kind *kinds, const char *of, const char *known,
                              char *to[EBPO_PAINT_TEXTS], ebpo_error *error)
{
    const char *date = from[EBPO_PAINT_DATE];
    size_t bytes = 0;
    for (int i = 0; i < EBPO_PAINT_TEXTS; i++) {
        size_t length = from[i] ? strlen(from[i]) : 0;
        bytes += length + 1;
        if (length > kinds[i].most)
            return ebpo_fail(error, EBPO_E_ARGUMENT, "%s: the %s is longer than %zu bytes", of,
                             kinds[i].name, kinds[i].most);
        if (from[i] && !ebpo_text_ok(from[i]))
            return ebpo_fail(error, EBPO_E_ARGUMENT,
                             "%s: the %s is not UTF-8 without control characters; lines are "
                             "separated by U+2028",
                             of, kinds[i].name);
    }
    if (date && *date && strcmp(date, known) != 0 && !ebpo_is_date(date))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "%s: the date is not one as in ISO 8601 and in the calendar, such as "
                         "2026-11-26 or 2026-11-26T21:43:05Z",
                         of);
    return copy_texts(from, to) ? EBPO_OK : ebpo_fail_memory(error, bytes);
}

/* --- layers --- */

static ebpo_status no_layer(const ebpo_paint *p, uint64_t number, ebpo_error *error)
{
    return ebpo_fail(error, EBPO_E_ARGUMENT,
                     "there is no layer %llu: layers are counted from 0, and the paint has %llu",
                     (unsigned long long)number, (unsigned long long)p->layer_count);
}

static ebpo_status take_layer(const ebpo_paint_layer *given, const char *known,
                              ebpo_layer_held *out, ebpo_error *error)
{
    ebpo_paint_layer layer = EBPO_PAINT_LAYER_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_paint_layer, &layer, given, error);
    if (status != EBPO_OK)
        return status;
    if (layer.opacity > 255 || layer.visible > 1)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "a layer's opacity is 0 to 255, and it is visible or not: 0 or 1");
    const char *texts[EBPO_PAINT_TEXTS] = { layer.title, layer.author, layer.date,
                                            layer.description };
    *out = (ebpo_layer_held){ .colour = layer.colour,
                              .opacity = layer.opacity,
                              .visible = layer.visible };
    return take_texts(texts, ebpo_paint_layer_texts, "a layer", known, out->text, error);
}

ebpo_status ebpo_paint_get_layer(const ebpo_paint *p, uint64_t number, ebpo_paint_layer *out)
{
    ebpo_paint_layer own = EBPO_PAINT_LAYER_INIT;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_paint_layer, out, NULL);
    if (status != EBPO_OK || number >= p->layer_count)
        return EBPO_E_ARGUMENT;
    const ebpo_layer_held *l = &p->layer[number];
    own.title = l->text[EBPO_PAINT_TITLE];
    own.author = l->text[EBPO_PAINT_AUTHOR];
    own.date = l->text[EBPO_PAINT_DATE];
    own.description = l->text[EBPO_PAINT_BODY];
    own.colour = (uint32_t)l->colour;
    own.opacity = (uint32_t)l->opacity;
    own.visible = l->visible;
    return EBPO_GIVE(ebpo_paint_layer, out, &own);
}

ebpo_status ebpo_paint_add_layer(ebpo_paint *p, const ebpo_paint_layer *layer, uint64_t *number,
                                 ebpo_error *error)
{
    if (p->layer_count == EBPO_PAINT_LAYERS)
        return ebpo_fail(error, EBPO_E_LIMIT, "a paint has at most %d layers", EBPO_PAINT_LAYERS);
    if (!ebpo_grow(&p->layer, &p->layer_capacity, p->layer_count + 1, sizeof *p->layer))
        return ebpo_fail_memory(error, sizeof *p->layer);
    ebpo_status status = take_layer(layer, "", &p->layer[p->layer_count], error);
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
    ebpo_layer_held held;
    if (number >= p->layer_count)
        return no_layer(p, number, error);
    ebpo_status status = take_layer(layer, p->layer[number].text[EBPO_PAINT_DATE], &held, error);
    if (status != EBPO_OK)
        return status;
    ebpo_paint_texts_free(p->layer[number].text);
    p->layer[number] = held;
    return EBPO_OK;
}

/* Keeps strokes of other layers, with their points. */
static void drop_strokes(ebpo_paint *p, uint64_t layer)
{
    uint64_t strokes = 0, points = 0;
    for (uint64_t i = 0; i < p->stroke_count; i++) {
        ebpo_stroke_held s = p->stroke[i];
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

static void drop_notes(ebpo_paint *p, uint64_t layer)
{
    uint64_t notes = 0;
    for (uint64_t i = 0; i < p->note_count; i++) {
        if (p->note[i].layer == layer) {
            ebpo_paint_texts_free(p->note[i].text);
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
    ebpo_paint_texts_free(p->layer[number].text);
    p->layer_count--;
    memmove(p->layer + number, p->layer + number + 1, (p->layer_count - number) * sizeof *p->layer);
    return EBPO_OK;
}

/* --- notes --- */

ebpo_status ebpo_paint_get_note(const ebpo_paint *p, uint64_t number, ebpo_paint_note *out)
{
    ebpo_paint_note own = EBPO_PAINT_NOTE_INIT;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_paint_note, out, NULL);
    if (status != EBPO_OK || number >= p->note_count)
        return EBPO_E_ARGUMENT;
    const ebpo_note_held *n = &p->note[number];
    own.title = n->text[EBPO_PAINT_TITLE];
    own.author = n->text[EBPO_PAINT_AUTHOR];
    own.date = n->text[EBPO_PAINT_DATE];
    own.body = n->text[EBPO_PAINT_BODY];
    own.layer = n->layer;
    own.at = n->at;
    return EBPO_GIVE(ebpo_paint_note, out, &own);
}

ebpo_status ebpo_paint_add_note(ebpo_paint *p, const ebpo_paint_note *given, ebpo_error *error)
{
    ebpo_paint_note note = EBPO_PAINT_NOTE_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_paint_note, &note, given, error);
    if (status != EBPO_OK)
        return status;
    note.at.size = EBPO_PAINT_FULL; /* they do not count */
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
    ebpo_note_held *held = &p->note[p->note_count];
    *held = (ebpo_note_held){ .layer = note.layer, .at = note.at };
    status = take_texts(texts, ebpo_paint_note_texts, "a note", "", held->text, error);
    if (status == EBPO_OK)
        p->note_count++;
    return status;
}

ebpo_status ebpo_paint_remove_note(ebpo_paint *p, uint64_t number, ebpo_error *error)
{
    if (number >= p->note_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "there is no note %llu: notes are counted from 0, and the paint has %llu",
                         (unsigned long long)number, (unsigned long long)p->note_count);
    ebpo_paint_texts_free(p->note[number].text);
    p->note_count--;
    memmove(p->note + number, p->note + number + 1, (p->note_count - number) * sizeof *p->note);
    return EBPO_OK;
}
