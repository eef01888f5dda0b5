#include "import/off_check.h"

#include <inttypes.h>
#include <string.h>

#include "base/error.h"

enum { MOST_CORNERS = 9 };

typedef struct lines {
    const char *at, *end;        /* what is left of the file */
    const char *word, *line_end; /* what is left of the line */
    uint64_t number;
    bool more; /* some line has more than positions or corners */
} lines;

/* To the next line that is neither blank nor a comment. */
static bool next_line(lines *l)
{
    while (l->at < l->end) {
        const char *stop = memchr(l->at, '\n', (size_t)(l->end - l->at));
        l->word = l->at;
        l->line_end = stop ? stop : l->end;
        l->at = stop ? stop + 1 : l->end;
        l->number++;
        while (l->word < l->line_end && strchr(" \t\r", *l->word) && *l->word)
            l->word++;
        if (l->word < l->line_end && *l->word != '#')
            return true;
    }
    return false;
}

/* The next word of the line; its length, 0 at the end. */
static size_t next_word(lines *l, const char **word)
{
    while (l->word < l->line_end && (*l->word == ' ' || *l->word == '\t' || *l->word == '\r'))
        l->word++;
    *word = l->word;
    while (l->word < l->line_end && *l->word != ' ' && *l->word != '\t' && *l->word != '\r')
        l->word++;
    return (size_t)(l->word - *word);
}

static bool next_count(lines *l, uint64_t *value)
{
    const char *word;
    size_t n = next_word(l, &word);
    *value = 0;
    for (size_t i = 0; i < n; i++) {
        if (word[i] < '0' || word[i] > '9')
            return false;
        *value = *value * 10 + (uint64_t)(word[i] - '0');
    }
    return n > 0 && n < 11;
}

static void look_for_more(lines *l)
{
    const char *word;
    l->more = l->more || (next_word(l, &word) && *word != '#');
}

/* A decimal number, judged by its characters; assimp parses it. */
static bool next_number(lines *l)
{
    const char *word;
    size_t n = next_word(l, &word), digits = 0;
    for (size_t i = 0; i < n; i++) {
        if (!word[i] || !strchr("0123456789+-.eE", word[i]))
            return false;
        digits += word[i] >= '0' && word[i] <= '9';
    }
    return digits > 0 && n < 100;
}

static ebpo_status check_counts(lines *l, uint64_t count[2], uint64_t size, const char *name,
                                ebpo_error *error)
{
    const char *word;
    uint64_t edges;
    size_t n = next_line(l) ? next_word(l, &word) : 0;
    if (n < 3 || memcmp(word + n - 3, "OFF", 3) != 0 || next_word(l, &word))
        return ebpo_fail_file(
            error, EBPO_E_FORMAT, name,
            "line %" PRIu64
            ": the word OFF is not alone there; this is not an OFF file that can be read",
            l->number);
    if (!next_line(l) || !next_count(l, &count[0]) || !next_count(l, &count[1]) ||
        !next_count(l, &edges) || next_word(l, &word))
        return ebpo_fail_file(
            error, EBPO_E_FORMAT, name,
            "line %" PRIu64
            ": no counts of vertices, faces and edges follow the word OFF; repair the file",
            l->number);
    if (count[0] > size / 6 || count[1] > size / 2)
        return ebpo_fail_file(error, EBPO_E_FORMAT, name,
                              "%" PRIu64 " vertices and %" PRIu64
                              " faces do not fit into a file of %" PRIu64 " bytes; it is damaged",
                              count[0], count[1], size);
    return EBPO_OK;
}

static ebpo_status check_vertex(lines *l, uint64_t row, const char *name, ebpo_error *error)
{
    if (!next_line(l))
        return ebpo_fail_file(error, EBPO_E_FORMAT, name,
                              "the file ends before vertex %" PRIu64
                              "; it is cut short, get it again",
                              row);
    if (!next_number(l) || !next_number(l) || !next_number(l))
        return ebpo_fail_file(error, EBPO_E_FORMAT, name,
                              "line %" PRIu64 ": vertex %" PRIu64
                              " has no three coordinates; repair the file",
                              l->number, row);
    look_for_more(l);
    return EBPO_OK;
}

static ebpo_status check_face(lines *l, uint64_t row, uint64_t vertices, const char *name,
                              ebpo_error *error)
{
    uint64_t corners, index;
    if (!next_line(l))
        return ebpo_fail_file(error, EBPO_E_FORMAT, name,
                              "the file ends before face %" PRIu64
                              "; it is cut short, get it again",
                              row);
    if (!next_count(l, &corners) || !corners)
        return ebpo_fail_file(error, EBPO_E_FORMAT, name,
                              "line %" PRIu64 ": face %" PRIu64
                              " has no number of corners; repair the file",
                              l->number, row);
    if (corners > MOST_CORNERS)
        return ebpo_fail_file(
            error, EBPO_E_UNSUPPORTED, name,
            "line %" PRIu64 ": face %" PRIu64 " has %" PRIu64
            " corners and assimp reads no OFF face of more than %d; convert the file to PLY",
            l->number, row, corners, MOST_CORNERS);
    for (uint64_t i = 0; i < corners; i++) {
        if (!next_count(l, &index))
            return ebpo_fail_file(error, EBPO_E_FORMAT, name,
                                  "line %" PRIu64 ": face %" PRIu64 " names fewer than its %" PRIu64
                                  " vertices; repair the file",
                                  l->number, row, corners);
        if (index >= vertices)
            return ebpo_fail_file(error, EBPO_E_FORMAT, name,
                                  "line %" PRIu64 ": face %" PRIu64 " names vertex %" PRIu64
                                  ", but there are %" PRIu64
                                  " vertices; repair the file or drop the face",
                                  l->number, row, index, vertices);
    }
    look_for_more(l);
    return EBPO_OK;
}

ebpo_status ebpo_import_check_off(const uint8_t *data, uint64_t size, const char *name, bool *more,
                                  ebpo_error *error)
{
    lines l = { .at = (const char *)data, .end = (const char *)data + size };
    uint64_t count[2];
    ebpo_status status = check_counts(&l, count, size, name, error);
    for (uint64_t i = 0; status == EBPO_OK && i < count[0]; i++)
        status = check_vertex(&l, i, name, error);
    for (uint64_t i = 0; status == EBPO_OK && i < count[1]; i++)
        status = check_face(&l, i, count[0], name, error);
    *more = l.more;
    return status;
}
