#include "core/strict_fp.h"

#include "mesh/stl.h"

#include <inttypes.h>
#include <string.h>
#include <strings.h>

#include "mesh/attributes.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/text.h"
#include "geometry/decimal.h"
#include "mesh/stl_binary.h"
#include "mesh/stl_colours.h"

enum { HEAD = 84, RELEASE = 1 << 22, LOOK_AHEAD = 1 << 16 };

static bool is_blank(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

static bool begins_solid(const uint8_t *data, uint64_t size)
{
    uint64_t mark = ebpo_text_mark(data, size);
    data += mark;
    size -= mark;
    while (size && is_blank((char)*data)) {
        data++;
        size--;
    }
    return size >= 5 && strncasecmp((const char *)data, "solid", 5) == 0 &&
           (size == 5 || is_blank((char)data[5]));
}

bool ebpo_stl_recognise(const uint8_t *data, uint64_t size)
{
    return begins_solid(data, size) || ebpo_stl_fits_binary(data, size);
}

/* --- text --- */

typedef struct stl_text {
    import_build *build;
    const char *begin, *at, *end;
    uint64_t line;
    uint64_t loops, corners; /* so far; of this loop */
    uint64_t next_release;   /* byte */
    uint64_t solids;         /* that have facets */
    bool begun;              /* a solid without facets so far */
    uint64_t odd, odd_line;  /* words that mean nothing behind others; where the first one is */
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

static bool is(stl_word word, const char *text)
{
    return word.n == strlen(text) && strncasecmp(word.s, text, word.n) == 0;
}

static ebpo_status fail_word(const stl_text *t, const char *wanted, stl_word word)
{
    char text[IMPORT_WORD_TEXT];
    ebpo_import_word_text(text, word.s, word.n);
    return ebpo_fail_file(t->build->error, EBPO_E_FORMAT, t->build->name,
                          "line %" PRIu64 ": '%s' where %s should stand, in facet %" PRIu64
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

static void note_odd(stl_text *t) { t->odd_line = t->odd++ ? t->odd_line : t->line; }

/* Passes words behind one that takes none, and counts them. */
static void pass_odd(stl_text *t)
{
    static const char *const words[] = {
        "facet", "endfacet", "endloop", "solid", "endsolid", "end"
    };
    stl_text ahead = *t;
    stl_word word;
    while (next_word(&ahead, &word) && ahead.line == t->line) {
        for (size_t i = 0; i < sizeof words / sizeof *words; i++)
            if (is(word, words[i]))
                return;
        note_odd(t);
        t->at = ahead.at;
    }
}

/* Reads outer loop, vertices, endloop; passes the word normal and its three values before. */
static ebpo_status read_loop(stl_text *t)
{
    stl_word word;
    ebpo_status status = EBPO_OK;
    for (int passed = 0;; passed++) {
        if (!next_word(t, &word))
            return fail_end(t);
        if (is(word, "outer") || is(word, "vertex") || is(word, "endfacet"))
            break;
        if (passed > 3)
            note_odd(t);
    }
    if (is(word, "endfacet"))
        return fail_word(t, "outer loop", word);
    if (is(word, "outer") && next_word(t, &word) && !is(word, "loop"))
        return fail_word(t, "the word loop", word);
    if (is(word, "vertex"))
        status = read_vertex(t);
    for (t->corners = is(word, "vertex"); status == EBPO_OK;) {
        if (!next_word(t, &word))
            return fail_end(t);
        if (is(word, "endloop") || is(word, "endfacet"))
            break;
        status = is(word, "vertex") ? read_vertex(t) : fail_word(t, "vertex or endloop", word);
    }
    if (status == EBPO_OK && t->corners != 3)
        status = ebpo_fail_file(t->build->error, EBPO_E_FORMAT, t->build->name,
                                "line %" PRIu64 ": facet %" PRIu64 " has %" PRIu64
                                " vertices, not three; repair the file",
                                t->line, t->loops + 1, t->corners);
    t->loops++;
    pass_odd(t);
    return status;
}

/* True where a facet follows `t` that cannot be words of a name: up to its first coordinate. */
static bool holds_facet(const stl_text *t)
{
    stl_text ahead = *t;
    stl_word word;
    float x;
    bool more = next_word(&ahead, &word);
    for (int i = 0; more && i < 4 && !is(word, "outer") && (i || is(word, "normal")); i++)
        more = next_word(&ahead, &word);
    return more && is(word, "outer") && next_word(&ahead, &word) && is(word, "loop") &&
           next_word(&ahead, &word) && is(word, "vertex") && next_word(&ahead, &word) &&
           ebpo_number_float(&x, word.s, word.n, t->build->c_locale);
}

/* Passes the rest of a line that names a solid: any words, but files of one line exist. */
static void pass_name(stl_text *t)
{
    stl_text ahead = *t;
    stl_word word;
    while (next_word(&ahead, &word) && ahead.line == t->line &&
           !(is(word, "facet") && holds_facet(&ahead)))
        t->at = ahead.at;
}

static bool begins_facet(stl_text *t, stl_word word)
{
    stl_text ahead = *t;
    stl_word next;
    return is(word, "facet") &&
           (!next_word(&ahead, &next) || is(next, "normal") || is(next, "outer"));
}

static ebpo_status read_text(stl_text *t)
{
    bool between = true; /* solids: words may be of any kind */
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
        } else if (is(word, "solid") || is(word, "endsolid")) {
            between = t->begun = true;
            pass_name(t);
        } else if (between) {
            note_odd(t);
        } else if (is(word, "end")) {
            continue;
        } else if (is(word, "endfacet") || is(word, "endloop") || is(word, "color")) {
            pass_odd(t);
        } else {
            status = fail_word(t, "facet or endsolid", word);
        }
    }
    return status;
}

/* --- both --- */

static ebpo_status make_faces(import_build *b)
{
    ebpo_status status = ebpo_import_faces(b);
    for (uint64_t i = 0; i < b->vertices && status == EBPO_OK; i++) {
        import_corner *c = ebpo_import_corner(b);
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
    uint64_t look = size < LOOK_AHEAD ? size : LOOK_AHEAD;
    const uint8_t *at = data, *end = data + look;
    if (!begins_solid(data, size) || memchr(data, 0, size < HEAD ? size : HEAD) ||
        ebpo_stl_fits_binary(data, size))
        return false;
    for (; at + 5 <= end; at++)
        if (strncasecmp((const char *)at, "facet", 5) == 0)
            return true;
    return memchr(data, 0, look) == NULL;
}

ebpo_status ebpo_stl_read(import_build *b, const uint8_t *data, uint64_t size)
{
    const char *text = (const char *)data + ebpo_text_mark(data, size);
    stl_text t = {
        .build = b, .begin = text, .at = text, .end = (const char *)data + size, .line = 1
    };
    uint64_t plain = 0;
    ebpo_status status =
        is_text(data, size) ? read_text(&t) : ebpo_stl_read_binary(b, data, size, &plain);
    if (status == EBPO_OK)
        status = make_faces(b);
    if (status == EBPO_OK && t.odd)
        status = ebpo_import_notes(b);
    if (status == EBPO_OK && t.odd)
        ebpo_attributes_note_unread(b->mesh->attributes,
                                    "words that STL does not have: %" PRIu64
                                    ", the first in line %" PRIu64,
                                    t.odd, t.odd_line);
    if (status == EBPO_OK && b->attributes && plain)
        status = ebpo_import_stl_colours(b->mesh, data, plain, b->error);
    if (status == EBPO_OK && b->attributes && t.solids > 1)
        ebpo_attributes_lose(b->mesh->attributes, "names of solids");
    return status;
}
