#include "mesh/stl_colours.h"

#include <stdio.h>
#include <string.h>

#include "mesh/attributes.h"
#include "core/workspace.h"
#include "core/endian.h"
#include "core/error.h"

enum { HEADER = 80, FIRST = 84, FACE = 50, WORD = 48, OWN = 0x8000 };

typedef struct stl_colours {
    const uint8_t *data;
    uint64_t faces;
    bool magics, words, coloured; /* some word is not 0; some face has a colour */
    uint8_t others[3];            /* of faces without one */
} stl_colours;

static uint16_t word_of(const stl_colours *s, uint64_t face)
{
    return ebpo_load16(s->data + FIRST + FACE * face + WORD);
}

static bool has_own(const stl_colours *s, uint16_t word)
{
    return s->magics ? !(word & OWN) : (word & OWN) != 0;
}

static void find_default(stl_colours *s)
{
    static const char mark[] = "COLOR=";
    enum { LENGTH = sizeof mark - 1 };
    memset(s->others, 255, sizeof s->others);
    for (unsigned i = 0; i + LENGTH + 4 <= HEADER && !s->magics; i++) {
        s->magics = memcmp(s->data + i, mark, LENGTH) == 0;
        if (s->magics)
            memcpy(s->others, s->data + i + LENGTH, sizeof s->others);
    }
}

static void look(stl_colours *s)
{
    find_default(s);
    s->coloured = s->magics;
    for (uint64_t f = 0; f < s->faces; f++) {
        uint16_t word = word_of(s, f);
        s->words |= word != 0;
        s->coloured |= has_own(s, word);
    }
}

/* Five bits as eight: 0 to 255 with equal steps, as far as there are. */
static uint8_t widen(unsigned five) { return (uint8_t)((five * 255 + 15) / 31); }

static void colour_of(const stl_colours *s, uint16_t word, uint8_t rgb[3])
{
    memcpy(rgb, s->others, 3);
    for (unsigned k = 0; k < 3 && has_own(s, word); k++)
        rgb[s->magics ? k : 2 - k] = widen(word >> 5 * k & 31);
}

static ebpo_status add(ebpo_mesh *mesh, const char *names, ebpo_attribute_type type,
                       uint32_t columns, uint8_t **values, ebpo_error *error)
{
    ebpo_attribute head = { .element = "face", .type = type, .columns = columns };
    head.list = EBPO_ATTRIBUTE_NO_LIST;
    head.rows = mesh->face_count;
    snprintf(head.names, sizeof head.names, "%s", names);
    ebpo_attribute *a = ebpo_attributes_add(mesh->attributes, &head);
    if (!a)
        return ebpo_fail_memory(error, sizeof *a);
    uint64_t bytes = ebpo_attribute_row_bytes(&head);
    *values = a->values = ebpo_array_alloc(mesh->workspace, head.rows, bytes);
    return *values ? EBPO_OK : ebpo_workspace_fail(mesh->workspace, head.rows * bytes, error);
}

static ebpo_status add_colours(ebpo_mesh *mesh, const stl_colours *s, ebpo_error *error)
{
    uint8_t *values = NULL;
    ebpo_status status = add(mesh, "red green blue", EBPO_ATTRIBUTE_UINT8, 3, &values, error);
    for (uint64_t f = 0; f < s->faces && status == EBPO_OK; f++)
        colour_of(s, word_of(s, f), values + 3 * f);
    return status;
}

static ebpo_status add_words(ebpo_mesh *mesh, const stl_colours *s, ebpo_error *error)
{
    uint8_t *values = NULL;
    ebpo_status status = add(mesh, "attribute", EBPO_ATTRIBUTE_UINT16, 1, &values, error);
    for (uint64_t f = 0; f < s->faces && status == EBPO_OK; f++) {
        uint16_t word = word_of(s, f);
        memcpy(values + f * sizeof word, &word, sizeof word);
    }
    return status;
}

ebpo_status ebpo_import_stl_colours(ebpo_mesh *mesh, const uint8_t *data, uint64_t size,
                                    ebpo_error *error)
{
    stl_colours s = { .data = data, .faces = mesh->face_count };
    if (size != FIRST + FACE * s.faces || ebpo_load32(data + HEADER) != s.faces)
        return EBPO_OK;
    look(&s);
    ebpo_status status = s.coloured ? add_colours(mesh, &s, error) : EBPO_OK;
    return status == EBPO_OK && s.words ? add_words(mesh, &s, error) : status;
}
