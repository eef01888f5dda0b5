/* Parses the header of a PLY file. Also contains the messages and the progress reports that the
 * parts of the PLY reader share. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/text.h"
#include "io/file_source.h"
#include "mesh/ply_parts.h"

enum {
    /* no statement has more than five words; a sixth word shows that the statement is invalid */
    MAX_WORDS = 6
};

typedef struct reader {
    ebpo_ply_header *header;
    const char *at, *end; /* the bytes of the header that have not been read */
    uint64_t line;        /* current line, from 1 */
    const char *name;     /* name of the file, for messages */
    bool format_seen;
    ebpo_error *error;
} reader;

static const struct {
    const char *word;
    ebpo_ply_type type;
} type_names[] = {
    { "char", EBPO_PLY_INT8 },       { "uchar", EBPO_PLY_UINT8 },
    { "short", EBPO_PLY_INT16 },     { "ushort", EBPO_PLY_UINT16 },
    { "int", EBPO_PLY_INT32 },       { "uint", EBPO_PLY_UINT32 },
    { "float", EBPO_PLY_FLOAT32 },   { "double", EBPO_PLY_FLOAT64 },
    { "int8", EBPO_PLY_INT8 },       { "uint8", EBPO_PLY_UINT8 },
    { "int16", EBPO_PLY_INT16 },     { "uint16", EBPO_PLY_UINT16 },
    { "int32", EBPO_PLY_INT32 },     { "uint32", EBPO_PLY_UINT32 },
    { "float32", EBPO_PLY_FLOAT32 }, { "float64", EBPO_PLY_FLOAT64 },
};

unsigned ebpo_ply_type_bytes(ebpo_ply_type type)
{
    static const unsigned char bytes[] = { 1, 1, 2, 2, 4, 4, 4, 8 };
    return bytes[type];
}

static bool word_is(ebpo_ply_word word, const char *text)
{
    return strlen(text) == word.n && memcmp(word.s, text, word.n) == 0;
}

static ebpo_status fail_in_line(const reader *r, const char *what, ebpo_ply_word word)
{
    char text[EBPO_IMPORT_WORD_TEXT];
    ebpo_import_word_text(text, word.s, word.n);
    return ebpo_fail_file(r->error, EBPO_E_FORMAT, r->name,
                          "line %" PRIu64 ": %s '%s'; this is not a valid PLY header", r->line,
                          what, text);
}

/* Returns the next line without its line end and without the '\r' of a DOS file. Returns false at
 * the end of the data. */
static bool next_line(reader *r, ebpo_ply_word *line)
{
    if (r->at == r->end)
        return false;
    const char *stop = memchr(r->at, r->header->line_end, (size_t)(r->end - r->at));
    if (!stop)
        return false;
    *line = (ebpo_ply_word){ r->at, (size_t)(stop - r->at) };
    if (line->n && line->s[line->n - 1] == '\r')
        line->n--;
    r->at = stop + 1;
    r->line++;
    return true;
}

/* Finds the words of a line. Returns their number, at most MAX_WORDS. */
static int split_line(ebpo_ply_word line, ebpo_ply_word words[MAX_WORDS])
{
    int n = 0;
    const char *s = line.s, *end = line.s + line.n;
    while (n < MAX_WORDS) {
        while (s < end && (*s == ' ' || *s == '\t'))
            s++;
        if (s == end)
            break;
        words[n].s = s;
        while (s < end && *s != ' ' && *s != '\t')
            s++;
        words[n].n = (size_t)(s - words[n].s);
        n++;
    }
    return n;
}

/* Parses a type. A name such as float32 counts as a note, because a new header would have float. */
static bool parse_type(reader *r, ebpo_ply_word word, ebpo_ply_type *type)
{
    for (size_t i = 0; i < sizeof type_names / sizeof *type_names; i++)
        if (word_is(word, type_names[i].word)) {
            *type = type_names[i].type;
            r->header->notes += i > EBPO_PLY_FLOAT64;
            return true;
        }
    return false;
}

static bool parse_count(ebpo_ply_word word, uint64_t *count)
{
    *count = 0;
    for (size_t i = 0; i < word.n; i++) {
        unsigned digit = (unsigned char)word.s[i] - (unsigned)'0';
        if (digit > 9 || __builtin_mul_overflow(*count, 10, count) ||
            __builtin_add_overflow(*count, digit, count))
            return false;
    }
    return word.n > 0;
}

/* Parses "format ascii 1.0". */
static ebpo_status format_statement(reader *r, const ebpo_ply_word *words, int n)
{
    if (n != 3 || r->format_seen)
        return fail_in_line(r, "unexpected statement", words[0]);
    if (word_is(words[1], "ascii"))
        r->header->encoding = EBPO_PLY_ASCII;
    else if (word_is(words[1], "binary_little_endian"))
        r->header->encoding = EBPO_PLY_LITTLE;
    else if (word_is(words[1], "binary_big_endian"))
        r->header->encoding = EBPO_PLY_BIG;
    else
        return fail_in_line(r, "unknown format", words[1]);
    if (!word_is(words[2], "1.0"))
        return fail_in_line(r, "unknown format version", words[2]);
    r->format_seen = true;
    return EBPO_OK;
}

/* Sets the kind of an element by its name, and records the element's index in the header. */
static ebpo_status record_kind(reader *r, ebpo_ply_element *element)
{
    ebpo_ply_header *h = r->header;
    int64_t *index;
    if (word_is(element->name, "vertex")) {
        element->kind = EBPO_PLY_KIND_VERTEX;
        index = &h->vertex;
    } else if (word_is(element->name, "face")) {
        element->kind = EBPO_PLY_KIND_FACE;
        index = &h->face;
    } else if (word_is(element->name, "tristrips")) {
        element->kind = EBPO_PLY_KIND_STRIPS;
        index = &h->strips;
    } else {
        return EBPO_OK;
    }
    if (*index >= 0)
        return fail_in_line(r, "duplicate element", element->name);
    *index = (int64_t)h->elements;
    return EBPO_OK;
}

/* Parses "element vertex 8". */
static ebpo_status element_statement(reader *r, const ebpo_ply_word *words, int n)
{
    ebpo_ply_header *h = r->header;
    ebpo_ply_element element = { .line = r->line, .first = h->properties };
    if (n != 3)
        return fail_in_line(r, "expected a name and a count after", words[0]);
    if (!parse_count(words[2], &element.count))
        return fail_in_line(r, "not a count:", words[2]);
    element.name = words[1];
    ebpo_status status = record_kind(r, &element);
    if (status != EBPO_OK)
        return status;
    if (!ebpo_grow(&h->element, &h->element_capacity, h->elements + 1, sizeof *h->element))
        return ebpo_fail_memory(r->error, sizeof element);
    h->element[h->elements++] = element;
    return EBPO_OK;
}

static ebpo_ply_role role_of(const ebpo_ply_element *element, const ebpo_ply_property *property)
{
    if (element->kind == EBPO_PLY_KIND_VERTEX && !property->list && property->name.n == 1) {
        char c = property->name.s[0];
        return c == 'x'   ? EBPO_PLY_ROLE_X
               : c == 'y' ? EBPO_PLY_ROLE_Y
               : c == 'z' ? EBPO_PLY_ROLE_Z
                          : EBPO_PLY_ROLE_NONE;
    }
    bool corners =
        word_is(property->name, "vertex_indices") || word_is(property->name, "vertex_index");
    if ((element->kind == EBPO_PLY_KIND_FACE || element->kind == EBPO_PLY_KIND_STRIPS) &&
        property->list && corners)
        return EBPO_PLY_ROLE_CORNERS;
    return EBPO_PLY_ROLE_NONE;
}

/* Returns true if the current element already has a property with this role. */
static bool role_taken(const ebpo_ply_header *h, const ebpo_ply_element *element,
                       ebpo_ply_role role)
{
    for (uint64_t i = element->first; i < h->properties; i++)
        if (role != EBPO_PLY_ROLE_NONE && h->property[i].role == role)
            return true;
    return false;
}

/* Parses "property float x" or "property list uchar int vertex_indices". */
static ebpo_status property_statement(reader *r, const ebpo_ply_word *words, int n)
{
    ebpo_ply_header *h = r->header;
    if (!h->elements)
        return fail_in_line(r, "no element before", words[0]);
    ebpo_ply_property property = { .list = n > 1 && word_is(words[1], "list"), .attribute = -1 };
    if (n != (property.list ? 5 : 3))
        return fail_in_line(r, "wrong number of words in", words[0]);
    if (!parse_type(r, words[n - 2], &property.type))
        return fail_in_line(r, "unknown type", words[n - 2]);
    if (property.list &&
        (!parse_type(r, words[2], &property.count_type) || property.count_type >= EBPO_PLY_FLOAT32))
        return fail_in_line(r, "invalid type for a list length:", words[2]);
    property.name = words[n - 1];
    ebpo_ply_element *element = &h->element[h->elements - 1];
    property.role = role_of(element, &property);
    if (property.role == EBPO_PLY_ROLE_CORNERS && property.type >= EBPO_PLY_FLOAT32)
        return fail_in_line(r, "invalid type for vertex indices:", words[n - 2]);
    if (role_taken(h, element, property.role))
        return fail_in_line(r, "duplicate property", property.name);
    if (!ebpo_grow(&h->property, &h->property_capacity, h->properties + 1, sizeof *h->property))
        return ebpo_fail_memory(r->error, sizeof property);
    h->property[h->properties++] = property;
    element->properties++;
    element->has_list = element->has_list || property.list;
    element->row_bytes += ebpo_ply_type_bytes(property.list ? property.count_type : property.type);
    return EBPO_OK;
}

static ebpo_status read_statement(reader *r, ebpo_ply_word line, bool *ended)
{
    ebpo_ply_word words[MAX_WORDS];
    int n = split_line(line, words);
    if (n == 0 || word_is(words[0], "comment") || word_is(words[0], "obj_info")) {
        r->header->notes++;
        return EBPO_OK;
    }
    if (word_is(words[0], "format"))
        return format_statement(r, words, n);
    if (word_is(words[0], "element"))
        return element_statement(r, words, n);
    if (word_is(words[0], "property"))
        return property_statement(r, words, n);
    if (word_is(words[0], "end_header")) {
        *ended = true;
        return EBPO_OK;
    }
    /* Blender 2.47 omitted the word "comment" in its first line, so unknown statements before the
     * first element are treated as comments. After the first element, unknown statements are
     * errors, because they could change the meaning of the body. */
    r->header->notes++;
    return r->header->elements ? fail_in_line(r, "unknown statement", words[0]) : EBPO_OK;
}

const char *ebpo_ply_first_line(const uint8_t *data, uint64_t size, char *line_end)
{
    const char *at = (const char *)data + ebpo_text_bom_length(data, size),
               *end = (const char *)data + size;
    if (end - at < 4 || memcmp(at, "ply", 3) != 0)
        return NULL;
    for (at += 3; at < end && (*at == ' ' || *at == '\t');)
        at++;
    *line_end = end - at > 1 && at[0] == '\r' && at[1] != '\n' ? '\r' : '\n';
    return at < end && (*at == '\n' || *at == '\r') ? at : NULL;
}

/* Reads the first line, "ply". */
static ebpo_status check_magic(reader *r, uint64_t size)
{
    ebpo_ply_word line;
    const char *end = ebpo_ply_first_line((const uint8_t *)r->at, size, &r->header->line_end);
    const char *foreign = end ? NULL : ebpo_wrong_kind_of_file((const uint8_t *)r->at, size);
    if (foreign)
        return ebpo_fail_at(r->error, EBPO_E_FORMAT, r->name, "", 0, "%s", foreign);
    r->at = end ? end : r->at;
    if (!end || !next_line(r, &line))
        return ebpo_fail_file(r->error, EBPO_E_FORMAT, r->name,
                              "line 1: not a PLY file: it does not begin with a line 'ply'");
    return EBPO_OK;
}

static ebpo_status read_statements(reader *r, bool whole)
{
    bool ended = false;
    ebpo_ply_word line = { "", 0 };
    while (!ended) {
        if (!next_line(r, &line))
            return ebpo_fail_file(r->error, EBPO_E_FORMAT, r->name,
                                  "line %" PRIu64
                                  ": %s before 'end_header'; the file is cut short or not a PLY "
                                  "file",
                                  r->line + 1,
                                  whole ? "the file ends" : "the header exceeds 1 MiB");
        ebpo_status status = read_statement(r, line, &ended);
        if (status != EBPO_OK)
            return status;
    }
    if (!r->format_seen)
        return fail_in_line(r, "no format statement before", line);
    return EBPO_OK;
}

static bool has_role(const ebpo_ply_header *h, const ebpo_ply_element *element, ebpo_ply_role role)
{
    for (uint64_t i = 0; i < element->properties; i++)
        if (h->property[element->first + i].role == role)
            return true;
    return false;
}

/* Checks that vertices have coordinates, and faces and strips have vertex indices. */
static ebpo_status check_roles(const reader *r)
{
    const ebpo_ply_header *h = r->header;
    if (h->vertex < 0)
        return ebpo_fail_file(r->error, EBPO_E_FORMAT, r->name,
                              "line %" PRIu64
                              ": the header has no element 'vertex'; the file contains no mesh",
                              r->line);
    for (uint64_t i = 0; i < h->elements; i++) {
        const ebpo_ply_element *e = &h->element[i];
        static const char *const missing[] = { "", "x", "y", "z", "vertex_indices" };
        ebpo_ply_role from =
            e->kind == EBPO_PLY_KIND_VERTEX ? EBPO_PLY_ROLE_X : EBPO_PLY_ROLE_CORNERS;
        ebpo_ply_role to =
            e->kind == EBPO_PLY_KIND_VERTEX ? EBPO_PLY_ROLE_Z : EBPO_PLY_ROLE_CORNERS;
        for (int role = (int)from; role <= (int)to && e->kind != EBPO_PLY_KIND_OTHER; role++)
            if (!has_role(h, e, (ebpo_ply_role)role))
                return ebpo_fail_file(r->error, EBPO_E_FORMAT, r->name,
                                      "line %" PRIu64
                                      ": this element has no %s '%s'; it is required",
                                      e->line, role == EBPO_PLY_ROLE_CORNERS ? "list" : "property",
                                      missing[role]);
    }
    return EBPO_OK;
}

ebpo_status ebpo_ply_header_parse(ebpo_ply_header *out, const uint8_t *data, uint64_t size,
                                  const char *name, ebpo_error *error)
{
    *out = (ebpo_ply_header){ .line_end = '\n', .vertex = -1, .face = -1, .strips = -1 };
    uint64_t visible = size < EBPO_PLY_HEADER_LONGEST ? size : EBPO_PLY_HEADER_LONGEST;
    reader r = { .header = out,
                 .at = (const char *)data,
                 .end = (const char *)data + visible,
                 .name = name,
                 .error = error };
    ebpo_status status = check_magic(&r, size);
    if (status == EBPO_OK)
        status = read_statements(&r, visible == size);
    if (status == EBPO_OK)
        status = check_roles(&r);
    out->body = (uint64_t)((const uint8_t *)r.at - data);
    out->body_line = r.line + 1;
    if (status != EBPO_OK)
        ebpo_ply_header_free(out);
    return status;
}

void ebpo_ply_header_free(ebpo_ply_header *header)
{
    free(header->element);
    free(header->property);
    header->element = NULL;
    header->property = NULL;
    header->elements = header->properties = 0;
}

/* --- messages and progress of the reader --- */

enum { REPORT_BYTES = 1 << 22 }; /* bytes of the file between two reports of progress */

ebpo_status ebpo_ply_fail(const ebpo_ply_parser *p, const char *format, ...)
{
    char text[320];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    if (p->header.encoding == EBPO_PLY_ASCII)
        return ebpo_fail_file(p->error, EBPO_E_FORMAT, p->name, "line %" PRIu64 ": %s", p->line,
                              text);
    return ebpo_fail_at(p->error, EBPO_E_FORMAT, p->name, "", (int64_t)p->at,
                        "byte %" PRIu64 ": %s", p->at, text);
}

const char *ebpo_ply_row_name(const ebpo_ply_element *element)
{
    static const char *const names[] = { "element", "vertex", "face", "strip" };
    return names[element->kind];
}

ebpo_status ebpo_ply_fail_end(const ebpo_ply_parser *p, const ebpo_ply_element *element,
                              uint64_t row)
{
    char name[EBPO_IMPORT_WORD_TEXT];
    ebpo_import_word_text(name, element->name.s, element->name.n);
    return ebpo_ply_fail(p,
                         "the file ends after %" PRIu64 " bytes within row %" PRIu64
                         " of the %" PRIu64 " of element '%s'; it is cut short, get it again",
                         p->size, row, element->count, name);
}

ebpo_status ebpo_ply_fail_stopped(const ebpo_ply_parser *p)
{
    return ebpo_fail(p->error, EBPO_E_CANCELLED, "stopped on request while reading %s", p->name);
}

ebpo_status ebpo_ply_report(ebpo_ply_parser *p)
{
    p->next_report = p->at + REPORT_BYTES;
    ebpo_release_pages(p->mesh->workspace);
    if (!p->progress || !p->progress->report ||
        p->progress->report(p->progress->user, "reading", p->at, p->size))
        return EBPO_OK;
    return ebpo_ply_fail_stopped(p);
}
