#include "geom/strict_fp.h"

#include "import/stl.h"

#include <inttypes.h>
#include <string.h>
#include <strings.h>

#include "attributes/attributes.h"
#include "base/arrays.h"
#include "base/endian.h"
#include "base/error.h"

enum { HEAD = 84, RECORD = 50, RELEASE = 1 << 22, LOOK_AHEAD = 1 << 16, SHOWN = 40 };

static bool is_blank(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

static bool fits_binary(const uint8_t *data, uint64_t size)
{
    return size >= HEAD && size == HEAD + RECORD * (uint64_t)ebpo_load32(data + HEAD - 4);
}

static bool begins_solid(const uint8_t *data, uint64_t size)
{
    while (size && is_blank((char)*data)) {
        data++;
        size--;
    }
    return size > 5 && strncasecmp((const char *)data, "solid", 5) == 0 && is_blank((char)data[5]);
}

bool ebpo_stl_recognise(const uint8_t *data, uint64_t size)
{
    return fits_binary(data, size) || begins_solid(data, size);
}

/* --- binary --- */

static ebpo_status read_binary(import_build *b, const uint8_t *data, uint64_t size)
{
    uint64_t faces = size < HEAD ? 0 : ebpo_load32(data + HEAD - 4);
    if (size < HEAD)
        return ebpo_fail_file(b->error, EBPO_E_FORMAT, b->name,
                              "is no STL file: neither the word solid stands first, nor are there "
                              "the 84 bytes that binary ones begin with");
    if (faces > (size - HEAD) / RECORD)
        return ebpo_fail_file(b->error, EBPO_E_FORMAT, b->name,
                              "states %" PRIu64 " faces, but its %" PRIu64 " bytes hold %" PRIu64
                              "; it is cut short or no STL file",
                              faces, size, (size - HEAD) / RECORD);
    if (3 * faces > IMPORT_MOST)
        return ebpo_fail_file(b->error, EBPO_E_LIMIT, b->name,
                              "states %" PRIu64 " faces of three corners each, more than 2^32 - 2 "
                              "corners; split the model",
                              faces);
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < 3 * faces && status == EBPO_OK; i++) {
        const uint8_t *at = data + HEAD + RECORD * (i / 3) + 12 + 12 * (i % 3);
        uint32_t raw[3] = { ebpo_load32(at), ebpo_load32(at + 4), ebpo_load32(at + 8) };
        float xyz[3];
        memcpy(xyz, raw, sizeof xyz);
        status = ebpo_import_vertex(b, xyz);
        if (i % RELEASE == 0)
            ebpo_release_pages(b->mesh->workspace);
    }
    return status;
}

/* --- text --- */

typedef struct stl_text {
    import_build *build;
    const char *begin, *at, *end;
    uint64_t line;
    uint64_t loops, corners; /* so far; of this loop */
    uint64_t next_release;   /* byte */
    uint64_t solids;
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
    char text[SHOWN + 1] = "";
    for (size_t i = 0; i < word.n && i < SHOWN; i++)
        text[i] = word.s[i] < ' ' || word.s[i] > '~' ? '?' : word.s[i];
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

/* outer loop, vertices, endloop; the normal's numbers before, of whatever kind, are passed. */
static ebpo_status read_loop(stl_text *t)
{
    stl_word word;
    ebpo_status status = EBPO_OK;
    do {
        if (!next_word(t, &word))
            return fail_end(t);
    } while (!is(word, "outer") && !is(word, "vertex") && !is(word, "endfacet"));
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
    return status;
}

/* A solid's name goes up to the first facet, or to the end of this solid. */
static bool begins_facet(stl_text *t, stl_word word)
{
    stl_text ahead = *t;
    stl_word next;
    return is(word, "facet") &&
           (!next_word(&ahead, &next) || is(next, "normal") || is(next, "outer"));
}

static ebpo_status read_text(stl_text *t)
{
    bool named = true; /* words are a solid's name */
    stl_word word;
    ebpo_status status = EBPO_OK;
    while (status == EBPO_OK && next_word(t, &word)) {
        if ((uint64_t)(t->at - t->begin) >= t->next_release) {
            ebpo_release_pages(t->build->mesh->workspace);
            t->next_release = (uint64_t)(t->at - t->begin) + RELEASE;
        }
        if (begins_facet(t, word)) {
            named = false;
            status = read_loop(t);
        } else if (is(word, "solid") || is(word, "endsolid")) {
            named = true;
            t->solids += is(word, "solid");
        } else if (is(word, "endfacet") || is(word, "end") || is(word, "color") || named) {
            continue;
        } else if (!is(word, "endloop")) {
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
    if (fits_binary(data, size) || !begins_solid(data, size))
        return false;
    for (; at + 5 <= end; at++)
        if (strncasecmp((const char *)at, "facet", 5) == 0)
            return true;
    return memchr(data, 0, look) == NULL;
}

ebpo_status ebpo_stl_read(import_build *b, const uint8_t *data, uint64_t size)
{
    const char *text = (const char *)data;
    stl_text t = { .build = b, .begin = text, .at = text, .end = text + size, .line = 1 };
    ebpo_status status = is_text(data, size) ? read_text(&t) : read_binary(b, data, size);
    if (status == EBPO_OK)
        status = make_faces(b);
    if (status == EBPO_OK && b->attributes && t.solids > 1)
        ebpo_attributes_lose(b->mesh->attributes, "names of solids");
    return status;
}
