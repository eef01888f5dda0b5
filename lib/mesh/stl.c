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

/* Sizes and offsets in a binary STL file. The last two bytes of a facet, the attribute bytes, are
 * read here because assimp treats them as colours even where Magics means "no colour". */

enum { COUNT = 80, STL_BINARY_HEAD = 84, RECORD = 50, STL_BINARY_WORD = 48 };

/* Classification of the bytes of a file. */
typedef struct stl_bytes {
    uint64_t models;  /* concatenated models */
    uint64_t payload; /* bytes after facets, as their last two bytes declare */
    uint64_t behind;  /* bytes after the last facet */
} stl_bytes;

static uint64_t stated_faces(const uint8_t *head) { return ebpo_load32(head + COUNT); }

static uint64_t stated_size(const uint8_t *head)
{
    return STL_BINARY_HEAD + RECORD * stated_faces(head);
}

/* Returns the number of concatenated models if they fill the file exactly, otherwise 0. */
static uint64_t count_models(const uint8_t *data, uint64_t size)
{
    uint64_t models = 0, bytes;
    for (uint64_t at = 0; at < size; at += bytes, models++) {
        bytes = size - at < STL_BINARY_HEAD ? UINT64_MAX : stated_size(data + at);
        if (bytes > size - at || (bytes == STL_BINARY_HEAD && size > STL_BINARY_HEAD))
            return 0;
    }
    return models;
}

/* Returns the end of the last facet if each facet is followed by the bytes that its last two bytes
 * declare. Returns UINT64_MAX if the facets do not fit into the file. */
static uint64_t end_with_payload(ebpo_workspace *workspace, const uint8_t *data, uint64_t size)
{
    uint64_t at = STL_BINARY_HEAD;
    EBPO_FOR_ITEMS(workspace, i, 0, stated_faces(data)) {
        uint64_t next = size - at < RECORD ? UINT64_MAX
                                           : at + RECORD + ebpo_load16(data + at + STL_BINARY_WORD);
        if (next > size)
            return UINT64_MAX;
        at = next;
    }
    return at;
}

bool ebpo_stl_states_size(const uint8_t *data, uint64_t known, uint64_t size)
{
    return known >= STL_BINARY_HEAD && size > STL_BINARY_HEAD && stated_size(data) == size;
}

/* Returns true if the file consists of binary models: one model, with or without the bytes declared
 * by attribute byte counts, or several concatenated models. */
static bool fits_binary(const uint8_t *data, uint64_t size)
{
    return size >= STL_BINARY_HEAD &&
           (count_models(data, size) ||
            (stated_size(data) < size && end_with_payload(NULL, data, size) == size &&
             stated_faces(data)));
}

static ebpo_status fail_ambiguous(const ebpo_import_build *b, const uint8_t *data, uint64_t size)
{
    return ebpo_fail_file(b->error, EBPO_E_FORMAT, b->name,
                          "states %" PRIu64 " faces, which take %" PRIu64 " of its %" PRIu64
                          " bytes; the others may belong to faces (attribute byte counts) or "
                          "follow them; save it as STL without attributes, or as PLY",
                          stated_faces(data), stated_size(data), size);
}

/* Determines the meaning of the bytes beyond the declared facets. Returns EBPO_E_FORMAT when the
 * meaning is ambiguous. */
static ebpo_status explain_bytes(const ebpo_import_build *b, const uint8_t *data, uint64_t size,
                                 stl_bytes *is)
{
    uint64_t end = stated_size(data), held = (size - STL_BINARY_HEAD) / RECORD;
    *is = (stl_bytes){ .models = 1 };
    if (end == size)
        return EBPO_OK;
    uint64_t models = count_models(data, size),
             last = end_with_payload(b->mesh->workspace, data, size);
    bool payload = last == size && last > end;
    if (models && payload)
        return fail_ambiguous(b, data, size);
    if (models || payload) {
        is->models = models ? models : 1;
        is->payload = payload ? size - end : 0;
        return EBPO_OK;
    }
    if (held && (!stated_faces(data) || (size - STL_BINARY_HEAD) % RECORD == 0))
        return ebpo_fail_file(b->error, EBPO_E_FORMAT, b->name,
                              "states %" PRIu64 " faces, but its %" PRIu64 " bytes hold %" PRIu64
                              "; correct the count (bytes 80 to 83), or get the file again",
                              stated_faces(data), size, held);
    if (last > end && last < size)
        return fail_ambiguous(b, data, size);
    is->behind = size - end;
    return EBPO_OK;
}

static ebpo_status read_facets(ebpo_import_build *b, const uint8_t *model, bool payload)
{
    const uint8_t *at = model + STL_BINARY_HEAD;
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
        at += RECORD + (payload ? ebpo_load16(at + STL_BINARY_WORD) : 0);
    }
    return EBPO_OK;
}

/* Counts the facets of a model whose last two bytes are not zero. */
static uint64_t count_words(const ebpo_import_build *b, const uint8_t *model)
{
    uint64_t words = 0;
    EBPO_FOR_ITEMS(b->mesh->workspace, i, 0, stated_faces(model))
        words += ebpo_load16(model + STL_BINARY_HEAD + RECORD * i + STL_BINARY_WORD) != 0;
    return words;
}

static ebpo_status record_bytes(ebpo_import_build *b, const stl_bytes *is, uint64_t words)
{
    ebpo_status status =
        is->payload || is->behind || words ? ebpo_mesh_need_attributes(b->mesh, b->error) : EBPO_OK;
    if (status != EBPO_OK || !b->mesh->attributes)
        return status;
    ebpo_attributes *to = b->mesh->attributes;
    ebpo_attributes_count_unread(to, "bytes after facets (attribute byte counts)", is->payload);
    ebpo_attributes_count_unread(to, "bytes after the last facet", is->behind);
    if (words)
        ebpo_attributes_lose(to,
                             "the attribute bytes of facets (possibly colours), because the file "
                             "holds several models: %" PRIu64,
                             words);
    if (is->models > 1 && b->attributes)
        ebpo_attributes_lose(to, "the start of each of %" PRIu64 " models", is->models);
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

/* Reads the facets as vertices, three for each, and records unread bytes. If the file has one
 * model, whose facets may have attribute bytes, sets *plain to the size of this model, otherwise to
 * 0. */
static ebpo_status read_binary(ebpo_import_build *b, const uint8_t *data, uint64_t size,
                               uint64_t *plain)
{
    *plain = 0;
    if (size < STL_BINARY_HEAD || (ebpo_bytes_are_text(data, size) && !fits_binary(data, size)))
        return fail_head(b, data, size);
    uint64_t faces = stated_faces(data), words = 0;
    if (stated_size(data) > size)
        return ebpo_fail_file(b->error, EBPO_E_FORMAT, b->name,
                              "states %" PRIu64 " faces, but its %" PRIu64 " bytes hold %" PRIu64
                              "; it is cut short or not an STL file",
                              faces, size, (size - STL_BINARY_HEAD) / RECORD);
    if (3 * faces > EBPO_IMPORT_MAX)
        return ebpo_fail_file(b->error, EBPO_E_LIMIT, b->name,
                              "states %" PRIu64 " faces of three corners each, more than 2^32 - 2 "
                              "corners; split the model",
                              faces);
    stl_bytes is;
    ebpo_status status = explain_bytes(b, data, size, &is);
    for (uint64_t m = 0, at = 0; status == EBPO_OK && m < is.models; m++) {
        status = read_facets(b, data + at, is.payload > 0);
        words += is.models > 1 ? count_words(b, data + at) : 0;
        at += stated_size(data + at);
    }
    *plain = is.models == 1 && !is.payload ? stated_size(data) : 0;
    return status == EBPO_OK ? record_bytes(b, &is, words) : status;
}

enum { HEADER = 80, FIRST = 84, FACE = 50, STL_COLOURS_WORD = 48, OWN = 0x8000 };

typedef struct stl_colours {
    const uint8_t *data;
    uint64_t faces;
    /* magics: the header has COLOR=; words: some attribute bytes are not 0; coloured: some face has
     * a colour */
    bool magics, words, coloured;
    uint8_t others[3]; /* colour of faces without one */
} stl_colours;

static uint16_t word_of(const stl_colours *s, uint64_t face)
{
    return ebpo_load16(s->data + FIRST + FACE * face + STL_COLOURS_WORD);
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

static void inspect_words(stl_colours *s)
{
    find_default(s);
    s->coloured = s->magics;
    for (uint64_t f = 0; f < s->faces; f++) {
        uint16_t word = word_of(s, f);
        s->words |= word != 0;
        s->coloured |= has_own(s, word);
    }
}

/* Scales a five-bit value to 0..255 with steps as equal as possible. */
static uint8_t widen_five_bits(unsigned five) { return (uint8_t)((five * 255 + 15) / 31); }

static void colour_of(const stl_colours *s, uint16_t word, uint8_t rgb[3])
{
    memcpy(rgb, s->others, 3);
    for (unsigned k = 0; k < 3 && has_own(s, word); k++)
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

/* Adds the face attributes `attribute` (unchanged) and `red green blue` (five bits each) unless all
 * their values are empty. Files with COLOR= in the first 80 bytes (Magics): red first, valid where
 * bit 15 is 0, otherwise the face has the colour stated behind COLOR=. Other files (VisCAM): blue
 * first, valid where bit 15 is 1, otherwise white. Text files have no colours. The faces of the
 * mesh must be those of the file. EBPO_E_MEMORY, EBPO_E_IO. */
static ebpo_status keep_stl_colours(ebpo_mesh *mesh, const uint8_t *data, uint64_t size,
                                    ebpo_error *error)
{
    stl_colours s = { .data = data, .faces = mesh->face_count };
    if (size != FIRST + FACE * s.faces || ebpo_load32(data + HEADER) != s.faces)
        return EBPO_OK;
    inspect_words(&s);
    ebpo_status status = s.coloured ? add_colours(mesh, &s, error) : EBPO_OK;
    return status == EBPO_OK && s.words ? add_words(mesh, &s, error) : status;
}

enum { STL_HEAD = 84, RELEASE = 1 << 22, CHECKED_BYTES = 1 << 16 };

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

/* Returns true for the bytes of an STL file: binary if the declared faces fill the file, regardless
 * of its first bytes; otherwise text that begins with the word solid. */
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
    uint64_t next_release;   /* byte offset */
    uint64_t solids;         /* solids that have facets */
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

/* Returns true if the words of a facet, up to its first coordinate, follow `t`. They cannot be part
 * of a name. */
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

static bool is_text(const uint8_t *data, uint64_t size)
{
    uint64_t checked = size < CHECKED_BYTES ? size : CHECKED_BYTES;
    const uint8_t *at = data, *end = data + checked;
    if (!begins_solid(data, size) || memchr(data, 0, size < STL_HEAD ? size : STL_HEAD) ||
        fits_binary(data, size))
        return false;
    for (; at + 5 <= end; at++)
        if (strncasecmp((const char *)at, "facet", 5) == 0)
            return true;
    return memchr(data, 0, checked) == NULL;
}

/* Builds the mesh. A file named .stl is text if it begins with the word solid and contains the word
 * facet. Normals are not read, because they follow from the corners. */
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
