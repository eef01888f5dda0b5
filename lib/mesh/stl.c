/* Reads STL files, text and binary. Source: "StereoLithography Interface Specification", 3D
 * Systems, 1989. A binary file has an 80-byte header, a count and facets of 50 bytes. According to
 * the format, the last two bytes of a facet are the number of bytes that follow the facet; most
 * programs store a colour there instead. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include <ebpo/mesh.h>

#include "core/endian.h"
#include "core/error.h"
#include "core/text.h"
#include "core/workspace.h"
#include "geometry/decimal.h"
#include "io/file_source.h"
#include "mesh/attributes.h"
#include "mesh/import_build.h"

/* Offsets and sizes in a binary STL file, in bytes. */
enum {
    COUNT_OFFSET = 80, /* offset of the number of facets */
    HEAD_BYTES = 84,   /* size of the text and the number of facets */
    FACET_BYTES = 50,  /* size of a facet */
    /* offset in a facet of its last two bytes, the attribute word: a byte count or a colour */
    WORD_OFFSET = 48
};

/* The meaning of the bytes of a file. */
typedef struct stl_bytes {
    uint64_t models;  /* number of concatenated models */
    uint64_t payload; /* bytes after facets, as their attribute words declare */
    uint64_t after;   /* bytes after the last facet, without a meaning */
} stl_bytes;

/* Returns the number of facets that the header declares. */
static uint64_t stated_faces(const uint8_t *head) { return ebpo_load32(head + COUNT_OFFSET); }

/* Returns the size of the header and these facets. */
static uint64_t stated_size(const uint8_t *head)
{
    return HEAD_BYTES + FACET_BYTES * stated_faces(head);
}

/* Returns the number of concatenated models if they fill the file exactly, otherwise 0. */
static uint64_t count_models(const uint8_t *data, uint64_t size)
{
    uint64_t models = 0, bytes;
    for (uint64_t at = 0; at < size; at += bytes, models++) {
        bytes = size - at < HEAD_BYTES ? UINT64_MAX : stated_size(data + at);
        if (bytes > size - at || (bytes == HEAD_BYTES && size > HEAD_BYTES))
            return 0;
    }
    return models;
}

/* Returns the offset of the end of the last facet if each facet is followed by as many bytes as its
 * attribute word declares. Returns UINT64_MAX if the facets do not fit into the file. */
static uint64_t end_with_payload(ebpo_workspace *workspace, const uint8_t *data, uint64_t size)
{
    uint64_t at = HEAD_BYTES;
    EBPO_FOR_ITEMS(workspace, i, 0, stated_faces(data)) {
        uint64_t next = size - at < FACET_BYTES
                            ? UINT64_MAX
                            : at + FACET_BYTES + ebpo_load16(data + at + WORD_OFFSET);
        if (next > size)
            return UINT64_MAX;
        at = next;
    }
    return at;
}

bool ebpo_stl_states_size(const uint8_t *data, uint64_t known, uint64_t size)
{
    return known >= HEAD_BYTES && size > HEAD_BYTES && stated_size(data) == size;
}

/* Returns true if the file consists of binary models: one model, with or without the bytes declared
 * by attribute byte counts, or several concatenated models. */
static bool fits_binary(const uint8_t *data, uint64_t size)
{
    return size >= HEAD_BYTES &&
           (count_models(data, size) ||
            (stated_size(data) < size && end_with_payload(NULL, data, size) == size &&
             stated_faces(data)));
}

static ebpo_status fail_ambiguous(const ebpo_import_build *b, const uint8_t *data, uint64_t size)
{
    return ebpo_fail_file(b->error, EBPO_E_FORMAT, b->name,
                          "states %" PRIu64 " faces, which take %" PRIu64 " of its %" PRIu64
                          " bytes; the other bytes may belong to faces (attribute byte counts) or "
                          "follow the last face; save the model as STL without attributes, or as "
                          "PLY",
                          stated_faces(data), stated_size(data), size);
}

/* Determines the meaning of the bytes beyond the declared facets. Returns EBPO_E_FORMAT when the
 * meaning is ambiguous. */
static ebpo_status explain_bytes(const ebpo_import_build *b, const uint8_t *data, uint64_t size,
                                 stl_bytes *bytes)
{
    uint64_t end = stated_size(data), facets_in_file = (size - HEAD_BYTES) / FACET_BYTES;
    *bytes = (stl_bytes){ .models = 1 };
    if (end == size)
        return EBPO_OK;
    uint64_t models = count_models(data, size),
             last = end_with_payload(b->mesh->workspace, data, size);
    bool payload = last == size && last > end;
    if (models && payload)
        return fail_ambiguous(b, data, size);
    if (models || payload) {
        bytes->models = models ? models : 1;
        bytes->payload = payload ? size - end : 0;
        return EBPO_OK;
    }
    if (facets_in_file && (!stated_faces(data) || (size - HEAD_BYTES) % FACET_BYTES == 0))
        return ebpo_fail_file(b->error, EBPO_E_FORMAT, b->name,
                              "states %" PRIu64 " faces, but its %" PRIu64 " bytes hold %" PRIu64
                              "; correct the count (bytes 80 to 83), or get the file again",
                              stated_faces(data), size, facets_in_file);
    if (last > end && last < size)
        return fail_ambiguous(b, data, size);
    bytes->after = size - end;
    return EBPO_OK;
}

/* Adds the corners of all facets of a model as vertices. payload: attribute words are byte counts.
 */
static ebpo_status read_facets(ebpo_import_build *b, const uint8_t *model, bool payload)
{
    const uint8_t *at = model + HEAD_BYTES;
    ebpo_status status = EBPO_OK;
    EBPO_FOR_ITEMS(b->mesh->workspace, i, 0, stated_faces(model)) {
        for (unsigned k = 0; k < 3 && status == EBPO_OK; k++) {
            const uint8_t *corner = at + 12 + 12 * k;
            uint32_t raw[3] = { ebpo_load32(corner), ebpo_load32(corner + 4),
                                ebpo_load32(corner + 8) };
            float xyz[3];
            memcpy(xyz, raw, sizeof xyz);
            status = ebpo_import_vertex(b, xyz);
        }
        if (status != EBPO_OK)
            return status;
        at += FACET_BYTES + (payload ? ebpo_load16(at + WORD_OFFSET) : 0);
    }
    return EBPO_OK;
}

/* Counts the facets of a model whose attribute word is not 0. */
static uint64_t count_words(const ebpo_import_build *b, const uint8_t *model)
{
    uint64_t words = 0;
    EBPO_FOR_ITEMS(b->mesh->workspace, i, 0, stated_faces(model))
        words += ebpo_load16(model + HEAD_BYTES + FACET_BYTES * i + WORD_OFFSET) != 0;
    return words;
}

static ebpo_status record_bytes(ebpo_import_build *b, const stl_bytes *bytes, uint64_t words)
{
    ebpo_status status = bytes->payload || bytes->after || words
                             ? ebpo_mesh_need_attributes(b->mesh, b->error)
                             : EBPO_OK;
    if (status != EBPO_OK || !b->mesh->attributes)
        return status;
    ebpo_attributes *to = b->mesh->attributes;
    ebpo_attributes_count_unread(to, "bytes after facets (attribute byte counts)", bytes->payload);
    ebpo_attributes_count_unread(to, "bytes after the last facet", bytes->after);
    if (words)
        ebpo_attributes_lose(to,
                             "the attribute bytes of facets (possibly colours), because the file "
                             "holds several models: %" PRIu64,
                             words);
    if (bytes->models > 1 && b->attributes)
        ebpo_attributes_lose(to, "the start of each of %" PRIu64 " models", bytes->models);
    return EBPO_OK;
}

static ebpo_status fail_head(const ebpo_import_build *b, const uint8_t *data, uint64_t size)
{
    char word[EBPO_IMPORT_WORD_TEXT];
    uint64_t at = 0, end;
    if (!ebpo_bytes_are_text(data, size))
        return ebpo_fail_file(b->error, EBPO_E_FORMAT, b->name,
                              "is not an STL file: it neither begins with the word solid nor has "
                              "the 84 bytes of a binary header");
    while (at < size && (data[at] == ' ' || (data[at] >= '\t' && data[at] <= '\r')))
        at++;
    for (end = at; end < size && data[end] > ' ';)
        end++;
    ebpo_import_word_text(word, (const char *)data + at, end - at);
    return ebpo_fail_file(b->error, EBPO_E_FORMAT, b->name,
                          "is not an STL file: it is text that begins with '%s'; an STL text "
                          "file begins with the word solid: remove the text before it, or rename "
                          "the file",
                          word);
}

/* Reads the facets as vertices, three for each, and records unread bytes. If the file has one model
 * and no bytes between facets, sets *plain to the size of this model, otherwise to 0. */
static ebpo_status read_binary(ebpo_import_build *b, const uint8_t *data, uint64_t size,
                               uint64_t *plain)
{
    *plain = 0;
    if (size < HEAD_BYTES || (ebpo_bytes_are_text(data, size) && !fits_binary(data, size)))
        return fail_head(b, data, size);
    uint64_t faces = stated_faces(data), words = 0;
    if (stated_size(data) > size)
        return ebpo_fail_file(b->error, EBPO_E_FORMAT, b->name,
                              "states %" PRIu64 " faces, but its %" PRIu64 " bytes hold %" PRIu64
                              "; it is cut short or not an STL file",
                              faces, size, (size - HEAD_BYTES) / FACET_BYTES);
    if (3 * faces > EBPO_IMPORT_MAX)
        return ebpo_fail_file(b->error, EBPO_E_LIMIT, b->name,
                              "states %" PRIu64 " faces of three corners each, more than 2^32 - 2 "
                              "corners; split the model",
                              faces);
    stl_bytes bytes;
    ebpo_status status = explain_bytes(b, data, size, &bytes);
    for (uint64_t m = 0, at = 0; status == EBPO_OK && m < bytes.models; m++) {
        status = read_facets(b, data + at, bytes.payload > 0);
        words += bytes.models > 1 ? count_words(b, data + at) : 0;
        at += stated_size(data + at);
    }
    *plain = bytes.models == 1 && !bytes.payload ? stated_size(data) : 0;
    return status == EBPO_OK ? record_bytes(b, &bytes, words) : status;
}

/* --- colours of a binary file --- */

enum { VALID_BIT = 0x8000 }; /* bit 15 of an attribute word, see keep_stl_colours */

typedef struct stl_colours {
    const uint8_t *data;
    uint64_t faces;
    /* magics: the header has COLOR=; words: some attribute word is not 0; coloured: some face has a
     * colour */
    bool magics, words, coloured;
    uint8_t fallback[3]; /* colour of faces whose word has no colour */
} stl_colours;

/* Returns the attribute word of a face. */
static uint16_t word_of(const stl_colours *s, uint64_t face)
{
    return ebpo_load16(s->data + HEAD_BYTES + FACET_BYTES * face + WORD_OFFSET);
}

/* Returns true if the attribute word has a colour for its face. */
static bool has_colour(const stl_colours *s, uint16_t word)
{
    return s->magics ? !(word & VALID_BIT) : (word & VALID_BIT) != 0;
}

/* Sets the fallback: the colour after COLOR= in the header, else white. */
static void find_fallback(stl_colours *s)
{
    static const char mark[] = "COLOR=";
    enum { LENGTH = sizeof mark - 1 };
    memset(s->fallback, 255, sizeof s->fallback);
    for (unsigned i = 0; i + LENGTH + 4 <= COUNT_OFFSET && !s->magics; i++) {
        s->magics = memcmp(s->data + i, mark, LENGTH) == 0;
        if (s->magics)
            memcpy(s->fallback, s->data + i + LENGTH, sizeof s->fallback);
    }
}

static void inspect_words(stl_colours *s)
{
    find_fallback(s);
    s->coloured = s->magics;
    for (uint64_t f = 0; f < s->faces; f++) {
        uint16_t word = word_of(s, f);
        s->words |= word != 0;
        s->coloured |= has_colour(s, word);
    }
}

/* Scales a five-bit value to 0..255 with steps as equal as possible. */
static uint8_t widen_five_bits(unsigned five) { return (uint8_t)((five * 255 + 15) / 31); }

static void colour_of(const stl_colours *s, uint16_t word, uint8_t rgb[3])
{
    memcpy(rgb, s->fallback, 3);
    for (unsigned k = 0; k < 3 && has_colour(s, word); k++)
        rgb[s->magics ? k : 2 - k] = widen_five_bits(word >> 5 * k & 31);
}

static ebpo_status add_array(ebpo_mesh *mesh, const char *names, ebpo_attribute_type type,
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
    ebpo_status status = add_array(mesh, "red green blue", EBPO_ATTRIBUTE_UINT8, 3, &values, error);
    for (uint64_t f = 0; f < s->faces && status == EBPO_OK; f++)
        colour_of(s, word_of(s, f), values + 3 * f);
    return status;
}

static ebpo_status add_words(ebpo_mesh *mesh, const stl_colours *s, ebpo_error *error)
{
    uint8_t *values = NULL;
    ebpo_status status = add_array(mesh, "attribute", EBPO_ATTRIBUTE_UINT16, 1, &values, error);
    for (uint64_t f = 0; f < s->faces && status == EBPO_OK; f++) {
        uint16_t word = word_of(s, f);
        memcpy(values + f * sizeof word, &word, sizeof word);
    }
    return status;
}

/* Adds the face attribute `attribute` (the attribute words) if some word is not 0, and the face
 * attribute `red green blue` if some face has a colour. A word has five bits for each channel. Two
 * kinds of files differ. If the first 80 bytes contain COLOR= (Magics), the lowest five bits are
 * red, and the word is a colour if bit 15 is 0. Other faces have the colour after COLOR=. Without
 * COLOR= (VisCAM), the lowest five bits are blue, and the word is a colour if bit 15 is 1. Other
 * faces are white. The mesh must have the faces of the file. EBPO_E_MEMORY, EBPO_E_IO. */
static ebpo_status keep_stl_colours(ebpo_mesh *mesh, const uint8_t *data, uint64_t size,
                                    ebpo_error *error)
{
    stl_colours s = { .data = data, .faces = mesh->face_count };
    if (size != HEAD_BYTES + FACET_BYTES * s.faces || ebpo_load32(data + COUNT_OFFSET) != s.faces)
        return EBPO_OK;
    inspect_words(&s);
    ebpo_status status = s.coloured ? add_colours(mesh, &s, error) : EBPO_OK;
    return status == EBPO_OK && s.words ? add_words(mesh, &s, error) : status;
}

enum {
    RELEASE = 1 << 22,      /* bytes, or vertices, between two releases of pages */
    CHECKED_BYTES = 1 << 16 /* number of bytes in which is_text searches */
};

static bool is_blank(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

static bool begins_solid(const uint8_t *data, uint64_t size)
{
    uint64_t bom = ebpo_text_bom_length(data, size);
    data += bom;
    size -= bom;
    while (size && is_blank((char)*data)) {
        data++;
        size--;
    }
    return size >= 5 && strncasecmp((const char *)data, "solid", 5) == 0 &&
           (size == 5 || is_blank((char)data[5]));
}

/* Returns true for the bytes of an STL file. A file is STL if it begins with the word solid, or if
 * it consists of binary models, regardless of its first bytes. */
static bool has_stl_signature(const uint8_t *data, uint64_t size)
{
    return begins_solid(data, size) || fits_binary(data, size);
}

/* --- text --- */

typedef struct stl_text {
    ebpo_import_build *build;
    const char *begin, *at, *end;
    uint64_t line;
    uint64_t loops, corners; /* number of loops so far, and of corners of the current loop */
    uint64_t next_release;   /* offset at which pages are released again */
    uint64_t solids;         /* number of solids that have facets */
    bool begun;              /* a solid has begun and has no facets so far */
    /* number of unexpected words, and the line of the first one */
    uint64_t odd, odd_line;
} stl_text;

typedef struct stl_word {
    const char *s;
    size_t n;
} stl_word;

static bool next_word(stl_text *t, stl_word *word)
{
    for (; t->at < t->end && is_blank(*t->at); t->at++)
        t->line += *t->at == '\n' || (*t->at == '\r' && (t->end - t->at < 2 || t->at[1] != '\n'));
    const char *s = t->at;
    while (t->at < t->end && !is_blank(*t->at))
        t->at++;
    *word = (stl_word){ s, (size_t)(t->at - s) };
    return word->n > 0;
}

static bool word_is(stl_word word, const char *text)
{
    return word.n == strlen(text) && strncasecmp(word.s, text, word.n) == 0;
}

static ebpo_status fail_word(const stl_text *t, const char *wanted, stl_word word)
{
    char text[EBPO_IMPORT_WORD_TEXT];
    ebpo_import_word_text(text, word.s, word.n);
    return ebpo_fail_file(t->build->error, EBPO_E_FORMAT, t->build->name,
                          "line %" PRIu64 ": '%s' instead of %s, in facet %" PRIu64
                          "; repair the file",
                          t->line, text, wanted, t->loops + 1);
}

static ebpo_status fail_end(const stl_text *t)
{
    return ebpo_fail_file(t->build->error, EBPO_E_FORMAT, t->build->name,
                          "the file ends within facet %" PRIu64 "; it is cut short, get it again",
                          t->loops + 1);
}

static ebpo_status read_vertex(stl_text *t)
{
    double xyz[3];
    stl_word word;
    for (int k = 0; k < 3; k++) {
        if (!next_word(t, &word))
            return fail_end(t);
        if (!ebpo_import_coordinate(t->build, &xyz[k], word.s, word.n))
            return fail_word(t, "a coordinate", word);
    }
    t->corners++;
    return ebpo_import_position(t->build, xyz);
}

static void record_odd(stl_text *t) { t->odd_line = t->odd++ ? t->odd_line : t->line; }

/* Skips and counts unexpected words up to the end of the line or the next statement. */
static void pass_odd(stl_text *t)
{
    static const char *const words[] = {
        "facet", "endfacet", "endloop", "solid", "endsolid", "end"
    };
    stl_text ahead = *t;
    stl_word word;
    while (next_word(&ahead, &word) && ahead.line == t->line) {
        for (size_t i = 0; i < sizeof words / sizeof *words; i++)
            if (word_is(word, words[i]))
                return;
        record_odd(t);
        t->at = ahead.at;
    }
}

/* Reads outer loop, vertices and endloop. Skips a preceding word normal and its three values. */
static ebpo_status read_loop(stl_text *t)
{
    stl_word word;
    ebpo_status status = EBPO_OK;
    for (int passed = 0;; passed++) {
        if (!next_word(t, &word))
            return fail_end(t);
        if (word_is(word, "outer") || word_is(word, "vertex") || word_is(word, "endfacet"))
            break;
        if (passed > 3)
            record_odd(t);
    }
    if (word_is(word, "endfacet"))
        return fail_word(t, "outer loop", word);
    if (word_is(word, "outer") && next_word(t, &word) && !word_is(word, "loop"))
        return fail_word(t, "the word loop", word);
    if (word_is(word, "vertex"))
        status = read_vertex(t);
    for (t->corners = word_is(word, "vertex"); status == EBPO_OK;) {
        if (!next_word(t, &word))
            return fail_end(t);
        if (word_is(word, "endloop") || word_is(word, "endfacet"))
            break;
        status = word_is(word, "vertex") ? read_vertex(t) : fail_word(t, "vertex or endloop", word);
    }
    if (status == EBPO_OK && t->corners != 3)
        status = ebpo_fail_file(t->build->error, EBPO_E_FORMAT, t->build->name,
                                "line %" PRIu64 ": facet %" PRIu64 " has %" PRIu64
                                " %s, expected 3; repair the file",
                                t->line, t->loops + 1, t->corners,
                                t->corners == 1 ? "vertex" : "vertices");
    t->loops++;
    pass_odd(t);
    return status;
}

/* Returns true if the text at t->at, after the word `facet`, continues like a facet up to its first
 * coordinate. Such text cannot be part of a name. */
static bool holds_facet(const stl_text *t)
{
    stl_text ahead = *t;
    stl_word word;
    float x;
    bool more = next_word(&ahead, &word);
    for (int i = 0; more && i < 4 && !word_is(word, "outer") && (i || word_is(word, "normal")); i++)
        more = next_word(&ahead, &word);
    return more && word_is(word, "outer") && next_word(&ahead, &word) && word_is(word, "loop") &&
           next_word(&ahead, &word) && word_is(word, "vertex") && next_word(&ahead, &word) &&
           ebpo_number_float(&x, word.s, word.n, t->build->c_locale);
}

/* Skips the rest of a line that names a solid. Names may contain any words, but some files have
 * only one line, so a name ends where a facet begins. */
static void pass_name(stl_text *t)
{
    stl_text ahead = *t;
    stl_word word;
    while (next_word(&ahead, &word) && ahead.line == t->line &&
           !(word_is(word, "facet") && holds_facet(&ahead)))
        t->at = ahead.at;
}

static bool begins_facet(stl_text *t, stl_word word)
{
    stl_text ahead = *t;
    stl_word next;
    return word_is(word, "facet") &&
           (!next_word(&ahead, &next) || word_is(next, "normal") || word_is(next, "outer"));
}

static ebpo_status read_text(stl_text *t)
{
    bool between = true; /* outside a solid, where any words are allowed */
    stl_word word;
    ebpo_status status = EBPO_OK;
    while (status == EBPO_OK && next_word(t, &word)) {
        if ((uint64_t)(t->at - t->begin) >= t->next_release) {
            ebpo_release_pages(t->build->mesh->workspace);
            t->next_release = (uint64_t)(t->at - t->begin) + RELEASE;
        }
        if (begins_facet(t, word)) {
            t->solids += t->begun;
            between = t->begun = false;
            status = read_loop(t);
        } else if (word_is(word, "solid") || word_is(word, "endsolid")) {
            between = t->begun = true;
            pass_name(t);
        } else if (between) {
            record_odd(t);
        } else if (word_is(word, "end")) {
            continue;
        } else if (word_is(word, "endfacet") || word_is(word, "endloop") ||
                   word_is(word, "color")) {
            pass_odd(t);
        } else {
            status = fail_word(t, "facet or endsolid", word);
        }
    }
    return status;
}

/* --- text and binary --- */

/* Makes a face of each three vertices. */
static ebpo_status make_faces(ebpo_import_build *b)
{
    ebpo_status status = ebpo_import_faces(b);
    for (uint64_t i = 0; i < b->vertices && status == EBPO_OK; i++) {
        ebpo_import_corner *c = ebpo_import_add_corner(b);
        if (!c)
            return ebpo_fail_memory(b->error, 3 * sizeof *c);
        memset(c, 0xff, sizeof *c);
        c->vertex = (uint32_t)i;
        if (i % 3 == 2)
            status = ebpo_import_polygon(b);
        if (i % RELEASE == 0)
            ebpo_release_pages(b->mesh->workspace);
    }
    return status == EBPO_OK ? ebpo_import_end(b) : status;
}

/* Returns true if the file is STL text: the file begins with `solid` and is not a valid binary
 * file. A binary file may also begin with `solid`, but is unlikely to contain the word `facet`, and
 * has zero bytes. */
static bool is_text(const uint8_t *data, uint64_t size)
{
    uint64_t checked = size < CHECKED_BYTES ? size : CHECKED_BYTES;
    const uint8_t *at = data, *end = data + checked;
    if (!begins_solid(data, size) || memchr(data, 0, size < HEAD_BYTES ? size : HEAD_BYTES) ||
        fits_binary(data, size))
        return false;
    for (; at + 5 <= end; at++)
        if (strncasecmp((const char *)at, "facet", 5) == 0)
            return true;
    return memchr(data, 0, checked) == NULL;
}

/* Builds the mesh. The function is_text decides if the file is text or binary. Normals are not
 * read, because they follow from the corners. */
static ebpo_status build_stl(ebpo_import_build *b, const ebpo_import_job *job)
{
    const uint8_t *data = job->data;
    uint64_t size = job->size;
    const char *text = (const char *)data + ebpo_text_bom_length(data, size);
    stl_text t = {
        .build = b, .begin = text, .at = text, .end = (const char *)data + size, .line = 1
    };
    uint64_t plain = 0;
    ebpo_status status = is_text(data, size) ? read_text(&t) : read_binary(b, data, size, &plain);
    if (status == EBPO_OK)
        status = make_faces(b);
    if (status == EBPO_OK && t.odd)
        status = ebpo_mesh_need_attributes(b->mesh, b->error);
    if (status == EBPO_OK && t.odd)
        ebpo_attributes_note_unread(b->mesh->attributes,
                                    "unknown words: %" PRIu64 ", the first in line %" PRIu64, t.odd,
                                    t.odd_line);
    if (status == EBPO_OK && b->attributes && plain)
        status = keep_stl_colours(b->mesh, data, plain, b->error);
    if (status == EBPO_OK && b->attributes && t.solids > 1)
        ebpo_attributes_lose(b->mesh->attributes, "names of solids");
    return status;
}

const ebpo_import_format ebpo_import_stl = { .called = "an STL",
                                             .ending = ".stl",
                                             .recognise = has_stl_signature,
                                             .build = EBPO_IMPORT_READER(build_stl) };
