/* Reads OFF files by words: rows may span lines, and a line may hold several rows. Sources: the
 * manual of Geomview 1.9.4, "OFF Files"; CGAL and MeshLab, whose colours have three or four values.
 */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include <ebpo/base.h>

#include "core/workspace.h"
#include "core/error.h"
#include "core/text.h"
#include "geometry/decimal.h"
#include "mesh/attributes.h"
#include "mesh/import_build.h"

/* --- words --- */

typedef struct off_text {
    const char *at, *end;
    uint64_t line; /* line of `at`, from 1 */
} off_text;

typedef struct off_word {
    const char *s;
    size_t n;
} off_word;

static bool ends_line(char c) { return c == '\n' || c == '\r'; }

static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }

/* Returns true if a comment begins. A comment may follow a word without a blank. In 1.#INF and
 * 1.#IND, which older programs write for non-finite values, the character # begins no comment. */
static bool begins_comment(const char *word, const char *at, const char *end)
{
    return *at == '#' && !(at - word >= 2 && at[-2] == '1' && at[-1] == '.' && end - at > 1 &&
                           at[1] && strchr("IQS", at[1]));
}

/* Reads the next word of the line. Returns false at the end of the line. */
static bool next_word_here(off_text *t, off_word *word)
{
    while (t->at < t->end && is_blank(*t->at))
        t->at++;
    if (t->at < t->end && *t->at == '#')
        while (t->at < t->end && !ends_line(*t->at))
            t->at++;
    const char *s = t->at;
    while (t->at < t->end && !is_blank(*t->at) && !ends_line(*t->at) &&
           !begins_comment(s, t->at, t->end))
        t->at++;
    *word = (off_word){ s, (size_t)(t->at - s) };
    return word->n > 0;
}

/* Moves to the next line. Returns false at the end of the file. */
static bool next_line(off_text *t)
{
    if (t->at == t->end)
        return false;
    t->at += t->end - t->at > 1 && t->at[0] == '\r' && t->at[1] == '\n' ? 2 : 1;
    t->line++;
    return true;
}

/* Reads the next word, past comments and line ends. Returns false at the end of the file. */
static bool next_word(off_text *t, off_word *word)
{
    while (!next_word_here(t, word))
        if (!next_line(t))
            return false;
    return true;
}

/* Counts lines with a word, from the next line on. */
static uint64_t count_lines(const off_text *t)
{
    off_text ahead = *t;
    off_word word;
    uint64_t lines = 0;
    do {
        while (next_word_here(&ahead, &word))
            continue;
        if (!next_line(&ahead))
            return lines;
        off_text line = ahead;
        lines += next_word_here(&line, &word);
    } while (true);
}

enum {
    MAX_REST = 16,    /* stored words of off_reading.rest; a valid rest is shorter */
    RELEASE = 1 << 22 /* bytes between two releases of pages */
};

/* The arrangement of rows (vertices and faces) in lines, derived from the numbers of rows and
 * lines. */
typedef enum rows_in {
    ROW_A_LINE,      /* one row a line */
    ROWS_OVER_LINES, /* a row may continue on the next line; the next row begins on a new line */
    ROWS_ANYHOW      /* a line may contain several rows */
} rows_in;

typedef struct off_reading {
    ebpo_import_build *build;
    const char *begin;
    off_text text;
    uint64_t next_release; /* offset at which pages are released again */
    uint64_t size;         /* of the file, in bytes */
    uint64_t vertices, faces;
    bool normals, colours, texture, weights; /* values of each vertex that the header declares */
    rows_in rows;
    /* the *rest* of the current row: its words after the coordinates or the corners */
    off_word rest[MAX_REST];
    int rest_count;
    bool not_bytes;        /* a colour is not an integer from 0 to 255 */
    float greatest_colour; /* greatest colour value */
    /* numbers of: vertices with values that the header does not declare; faces with values that are
     * no colour; faces with an index of a colour; faces without a colour */
    uint64_t surplus_vertices, surplus_faces, indexed, uncoloured;
    uint64_t divided; /* number of vertices with a weight other than 1 */
    /* alpha: a colour has an opacity. both: both vertices and faces have colours. more: text
     * follows the last face */
    bool alpha, both, more;
} off_reading;

static ebpo_status fail_line(const off_reading *r, const char *format, ...) EBPO_PRINTF(2, 3);

static ebpo_status fail_line(const off_reading *r, const char *format, ...)
{
    char text[320];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    return ebpo_fail_file(r->build->error, EBPO_E_FORMAT, r->build->name, "line %" PRIu64 ": %s",
                          r->text.line, text);
}

/* --- head --- */

/* Reads the first word: the optional letters ST, C, N, 4 and n in this order, which declare the
 * vertex values, then OFF. Returns the length up to the end of OFF, or 0 if OFF is missing. (In
 * ModelNet's files, the first count follows OFF without a blank, as in OFF8.) If r is not NULL,
 * records the declared values in r. *dimension: true if the letter n is present. */
static size_t read_kind(off_word word, off_reading *r, bool *dimension)
{
    const char *s = word.s, *end = s + word.n;
    bool texture = end - s > 2 && s[0] == 'S' && s[1] == 'T';
    s += texture ? 2 : 0;
    bool colours = s < end && *s == 'C';
    s += colours;
    bool normals = s < end && *s == 'N';
    s += normals;
    bool weights = s < end && *s == '4';
    s += weights;
    *dimension = s < end && *s == 'n';
    s += *dimension;
    bool named = end - s >= 3 && strncasecmp(s, "OFF", 3) == 0;
    for (const char *digit = s + 3; named && digit < end; digit++)
        named = *digit >= '0' && *digit <= '9';
    if (r && named) {
        r->texture = texture;
        r->colours = colours;
        r->normals = normals;
        r->weights = weights;
    }
    return named ? (size_t)(s + 3 - word.s) : 0;
}

/* Returns true if the file begins with the word OFF, optionally prefixed by letters that declare
 * the vertex values. */
static bool has_off_word(const uint8_t *data, uint64_t size)
{
    off_text t = { (const char *)data + ebpo_text_bom_length(data, size), (const char *)data + size,
                   1 };
    off_word word;
    bool dimension, found = next_word(&t, &word) && t.at < t.end;
    size_t length = found ? read_kind(word, NULL, &dimension) : 0;
    return length && memcmp(word.s + length - 3, "OFF", 3) == 0;
}

/* Parses a count or an index. Returns false if the word is not a number of at most ten digits. */
static bool read_count(off_word word, uint64_t *value)
{
    *value = 0;
    for (size_t i = 0; i < word.n; i++) {
        if (word.s[i] < '0' || word.s[i] > '9')
            return false;
        *value = *value * 10 + (uint64_t)(word.s[i] - '0');
    }
    return word.n > 0 && word.n < 11;
}

static ebpo_status fail_counts(const off_reading *r)
{
    return fail_line(r,
                     "counts of vertices, faces and edges expected after the word OFF; repair the "
                     "file");
}

/* Skips the edge count, which is on the line of the face count, or alone on the next line. Some
 * programs omit the edge count. */
static void read_edges(off_reading *r)
{
    off_text ahead = r->text;
    off_word word, none;
    uint64_t edges;
    bool same_line = next_word_here(&ahead, &word);
    bool found = same_line || (next_word(&ahead, &word) && !(next_word_here(&ahead, &none)));
    if (found && read_count(word, &edges))
        r->text = ahead;
}

/* Determines the arrangement: as many lines as rows means one row per line; more lines mean that
 * rows span lines; fewer lines mean several rows per line. */
static ebpo_status find_rows(off_reading *r)
{
    off_text after_counts = r->text;
    off_word word;
    uint64_t lines = count_lines(&r->text), rows = r->vertices + r->faces;
    r->rows = lines == rows ? ROW_A_LINE : lines > rows ? ROWS_OVER_LINES : ROWS_ANYHOW;
    if (r->rows != ROWS_ANYHOW && next_word_here(&after_counts, &word))
        return fail_counts(r);
    return EBPO_OK;
}

/* Reads the header: the first word and the counts. */
static ebpo_status read_head(off_reading *r)
{
    off_word word;
    bool dimension = false;
    if (!next_word(&r->text, &word))
        return fail_line(r, "the file is empty and contains no mesh");
    off_text after_word = r->text;
    size_t named = read_kind(word, r, &dimension);
    if (named) {
        off_word next;
        r->text.at = word.s + named;
        bool more = next_word(&r->text, &next);
        if (more && next.n == 6 && strncasecmp(next.s, "BINARY", 6) == 0)
            return ebpo_fail_file(r->build->error, EBPO_E_UNSUPPORTED, r->build->name,
                                  "is a binary OFF file; save it as text, or as PLY");
        if (dimension)
            return ebpo_fail_file(r->build->error, EBPO_E_UNSUPPORTED, r->build->name,
                                  "line %" PRIu64 ": the word nOFF declares another number of "
                                  "dimensions than three; save the model with three "
                                  "dimensions",
                                  after_word.line);
        word = next;
        if (!more)
            return fail_counts(r);
    }
    if (!read_count(word, &r->vertices))
        return named ? fail_counts(r)
                     : fail_line(r, "expected the word OFF or counts; this is not a readable OFF "
                                    "file");
    if (!next_word(&r->text, &word) || !read_count(word, &r->faces))
        return fail_counts(r);
    read_edges(r);
    if (r->vertices > r->size / 6 || r->faces > r->size / 2)
        return ebpo_fail_file(r->build->error, EBPO_E_FORMAT, r->build->name,
                              "%" PRIu64 " vertices and %" PRIu64
                              " faces do not fit into a file of %" PRIu64 " bytes; it is damaged",
                              r->vertices, r->faces, r->size);
    return find_rows(r);
}

/* --- rows --- */

static void release_pages(off_reading *r)
{
    uint64_t at = (uint64_t)(r->text.at - r->begin);
    if (at < r->next_release)
        return;
    ebpo_release_pages(r->build->mesh->workspace);
    r->next_release = at + RELEASE;
}

/* Reads a required word of the row. `first`: the first word, which may be on a new line. */
static bool next_needed(off_reading *r, bool first, off_word *word)
{
    return first || r->rows != ROW_A_LINE ? next_word(&r->text, word)
                                          : next_word_here(&r->text, word);
}

/* Reads the rest of the line. With several rows per line, the remaining words belong to the next
 * rows, and r->rest becomes empty. */
static void read_rest(off_reading *r)
{
    off_word word;
    r->rest_count = 0;
    while (r->rows != ROWS_ANYHOW && next_word_here(&r->text, &word))
        if (r->rest_count < MAX_REST)
            r->rest[r->rest_count++] = word;
}

/* Stores the numbers of the rest, from word `first` on, in a row of a table. *good: false if words
 * are missing or are no numbers. */
static ebpo_status keep_values(off_reading *r, ebpo_import_sort sort, int first, bool *good)
{
    float value[3] = { 0, 0, 0 };
    int columns = (int)ebpo_import_columns(sort);
    *good = first + columns <= r->rest_count;
    for (int k = 0; k < columns && *good; k++) {
        off_word word = r->rest[first + k];
        *good = ebpo_import_value(r->build, &value[k], word.s, word.n);
        if (sort != EBPO_IMPORT_COLOURS)
            continue;
        /* checks the range first: converting NaN to int is undefined */
        bool byte = value[k] >= 0 && value[k] <= 255;
        r->not_bytes |= memchr(word.s, '.', word.n) || !byte || value[k] != (float)(int)value[k];
        r->greatest_colour = value[k] > r->greatest_colour ? value[k] : r->greatest_colour;
    }
    return r->build->attributes ? ebpo_import_row(r->build, sort, value) : EBPO_OK;
}

/* Stores the rest of a vertex: the normal, then a colour of three or four values, then texture
 * coordinates. */
static ebpo_status keep_rest(off_reading *r)
{
    int at = r->normals ? 3 : 0, colour_values = r->rest_count - at - (r->texture ? 2 : 0);
    bool as_declared = colour_values >= 0, good;
    ebpo_status status = EBPO_OK;
    if (r->normals) {
        status = keep_values(r, EBPO_IMPORT_NORMALS, 0, &good);
        as_declared &= good;
    }
    if (r->colours && status == EBPO_OK) {
        status = keep_values(r, EBPO_IMPORT_COLOURS, at, &good);
        as_declared &= good && (colour_values == 3 || colour_values == 4);
        r->alpha |= colour_values == 4;
    } else {
        as_declared &= colour_values == 0;
    }
    if (r->texture && status == EBPO_OK) {
        status = keep_values(r, EBPO_IMPORT_TEXTURE, r->rest_count - 2 > 0 ? r->rest_count - 2 : 0,
                             &good);
        as_declared &= good;
    }
    r->surplus_vertices += !as_declared;
    return status;
}

static ebpo_status fail_end(const off_reading *r, const char *what, uint64_t row)
{
    return ebpo_fail_file(r->build->error, EBPO_E_FORMAT, r->build->name,
                          "the file ends before %s %" PRIu64 "; it is cut short, get it again",
                          what, row);
}

/* Reads the rest of a vertex. With several rows per line, reads as many words as the header
 * declares. */
static ebpo_status read_vertex_rest(off_reading *r, uint64_t row)
{
    int wanted = (r->normals ? 3 : 0) + (r->colours ? 4 : 0) + (r->texture ? 2 : 0);
    if (r->rows != ROWS_ANYHOW) {
        read_rest(r);
        return EBPO_OK;
    }
    for (r->rest_count = 0; r->rest_count < wanted; r->rest_count++)
        if (!next_word(&r->text, &r->rest[r->rest_count]))
            return fail_end(r, "vertex", row + 1);
    return EBPO_OK;
}

static ebpo_status fail_number(const off_reading *r, off_word word, uint64_t row)
{
    char text[EBPO_IMPORT_WORD_TEXT];
    ebpo_import_word_text(text, word.s, word.n);
    return fail_line(r, "invalid number '%s' in vertex %" PRIu64 "; repair the file", text, row);
}

static ebpo_status read_vertex(off_reading *r, uint64_t row)
{
    double xyz[3], w = 1;
    off_word word[4];
    for (int k = 0; k < 3 + r->weights; k++) {
        if (!next_needed(r, k == 0, &word[k])) {
            if (k == 0 || r->text.at == r->text.end)
                return fail_end(r, "vertex", row + (k > 0));
            return fail_line(r,
                             "vertex %" PRIu64 " has fewer than three coordinates; repair the file",
                             row);
        }
        const char *s = word[k].s;
        size_t n = word[k].n;
        bool good = k < 3
                        ? ebpo_import_coordinate(r->build, &xyz[k], s, n)
                        : ebpo_number_double(&w, s, n, r->build->c_locale) && w != 0 && isfinite(w);
        if (!good)
            return fail_number(r, word[k], row);
    }
    for (int k = 0; k < 3 && w != 1; k++)
        ebpo_import_quotient(r->build, &xyz[k], word[k].s, word[k].n, w);
    r->divided += w != 1;
    ebpo_status status = read_vertex_rest(r, row);
    if (status == EBPO_OK)
        status = ebpo_import_position(r->build, xyz);
    return status == EBPO_OK ? keep_rest(r) : status;
}

/* Stores the colour of a face if r->rest is a colour. *row: the colour's row in the table of
 * colours, or EBPO_IMPORT_NONE. A rest of a single value is an index into a colour table of another
 * program. */
static ebpo_status keep_face(off_reading *r, uint32_t *row)
{
    ebpo_import_table *t = &r->build->table[EBPO_IMPORT_COLOURS];
    bool good = true;
    *row = EBPO_IMPORT_NONE;
    r->indexed += r->rest_count == 1;
    r->surplus_faces += r->rest_count == 2 || r->rest_count > 4;
    if (r->rest_count != 3 && r->rest_count != 4) {
        r->uncoloured++;
        return EBPO_OK;
    }
    if (r->colours) {
        r->both = true;
        return EBPO_OK;
    }
    r->alpha |= r->rest_count == 4;
    t->of_face = true;
    ebpo_status status = keep_values(r, EBPO_IMPORT_COLOURS, 0, &good);
    r->surplus_faces += !good;
    if (t->rows)
        *row = (uint32_t)(t->rows - 1);
    return status;
}

static ebpo_status read_corner(off_reading *r, uint64_t row, uint64_t corners)
{
    ebpo_import_corner *c = ebpo_import_add_corner(r->build);
    off_word word;
    uint64_t index;
    if (!c)
        return ebpo_fail_memory(r->build->error, r->build->corners * sizeof *c);
    if (!next_needed(r, false, &word) || !read_count(word, &index))
        return fail_line(r,
                         "face %" PRIu64 " names fewer than its %" PRIu64
                         " vertices; repair the file",
                         row, corners);
    if (index >= r->vertices)
        return fail_line(r,
                         "face %" PRIu64 " names vertex %" PRIu64 ", but there are %" PRIu64
                         " vertices; repair the file or drop the face",
                         row, index, r->vertices);
    c->vertex = (uint32_t)index;
    c->row[EBPO_IMPORT_COLOURS] = r->colours ? c->vertex : EBPO_IMPORT_NONE;
    c->row[EBPO_IMPORT_NORMALS] = r->normals ? c->vertex : EBPO_IMPORT_NONE;
    c->row[EBPO_IMPORT_TEXTURE] = r->texture ? c->vertex : EBPO_IMPORT_NONE;
    return EBPO_OK;
}

static ebpo_status read_face(off_reading *r, uint64_t row)
{
    ebpo_import_build *b = r->build;
    uint64_t corners;
    uint32_t colour;
    off_word word;
    if (!next_needed(r, true, &word))
        return fail_end(r, "face", row);
    if (!read_count(word, &corners) || !corners)
        return fail_line(r, "face %" PRIu64 " has no corner count; repair the file", row);
    if (corners > r->size / 2)
        return fail_line(r,
                         "face %" PRIu64 " has %" PRIu64 " corners, more than the file can hold; "
                         "repair the file",
                         row, corners);
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < corners && status == EBPO_OK; i++)
        status = read_corner(r, row, corners);
    if (status != EBPO_OK)
        return status;
    read_rest(r);
    status = keep_face(r, &colour);
    for (uint64_t i = 0; i < corners && colour != EBPO_IMPORT_NONE; i++)
        b->corner[i].row[EBPO_IMPORT_COLOURS] = colour;
    return status == EBPO_OK ? ebpo_import_polygon(b) : status;
}

/* --- the file --- */

static ebpo_status record_unread(off_reading *r)
{
    ebpo_mesh *mesh = r->build->mesh;
    bool any = r->divided || r->surplus_vertices || r->surplus_faces || r->more;
    ebpo_status status = any ? ebpo_mesh_need_attributes(r->build->mesh, r->build->error) : EBPO_OK;
    if (!any || status != EBPO_OK)
        return status;
    ebpo_attributes_count_unread(mesh->attributes,
                                 "weights of vertices (coordinates are divided by them)",
                                 r->divided);
    ebpo_attributes_count_unread(mesh->attributes,
                                 "vertex values that the file's first word does not declare",
                                 r->surplus_vertices);
    ebpo_attributes_count_unread(mesh->attributes, "face values that are not colours",
                                 r->surplus_faces);
    if (r->more)
        ebpo_attributes_note_unread(mesh->attributes, "text after the last face");
    return EBPO_OK;
}

static void record_losses(const off_reading *r, ebpo_attributes *to)
{
    if (r->alpha)
        ebpo_attributes_lose(to, "opacity of colours");
    if (r->both)
        ebpo_attributes_lose(to, "colours of faces (vertices also have colours)");
    if (r->uncoloured && r->build->table[EBPO_IMPORT_COLOURS].of_face)
        ebpo_attributes_lose(to, "missing colours of faces (stored as black): %" PRIu64,
                             r->uncoloured);
    if (r->indexed)
        ebpo_attributes_lose(to, "colours of faces that are indices into a table");
}

static ebpo_status read_rows(off_reading *r)
{
    off_word word;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < r->vertices && status == EBPO_OK; i++, release_pages(r))
        status = read_vertex(r, i);
    if (status == EBPO_OK)
        status = ebpo_import_faces(r->build);
    for (uint64_t i = 0; i < r->faces && status == EBPO_OK; i++, release_pages(r))
        status = read_face(r, i);
    if (status == EBPO_OK)
        r->more = next_word(&r->text, &word);
    if (status == EBPO_OK && r->more && r->rows == ROWS_ANYHOW)
        status = fail_line(r, "there is text after the last face, though lines hold several rows; "
                              "repair the counts");
    return status;
}

static ebpo_status build_off(ebpo_import_build *b, const ebpo_import_job *job)
{
    off_reading r = { .build = b, .begin = (const char *)job->data, .size = job->size };
    r.text = (off_text){ r.begin + ebpo_text_bom_length(job->data, r.size), r.begin + r.size, 1 };
    ebpo_status status = read_head(&r);
    if (status == EBPO_OK)
        status = read_rows(&r);
    if (status == EBPO_OK)
        status = ebpo_import_end(b);
    b->table[EBPO_IMPORT_COLOURS].bytes = !r.not_bytes && r.greatest_colour > 1;
    if (status == EBPO_OK && b->attributes)
        status = ebpo_import_attributes(b);
    if (status == EBPO_OK && b->attributes)
        record_losses(&r, b->mesh->attributes);
    return status == EBPO_OK ? record_unread(&r) : status;
}

const ebpo_import_format ebpo_import_off = { .called = "an OFF",
                                             .ending = ".off",
                                             .recognise = has_off_word,
                                             .build = EBPO_IMPORT_READER(build_off) };
