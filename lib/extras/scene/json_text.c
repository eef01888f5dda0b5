/* The text of a scene file: whether it may be parsed, and on which line its members are. */
#include <string.h>

#include "core/error.h"
#include "core/text.h"
#include "extras/scene/scene_parts.h"

size_t scene_text_mark(const char *text, size_t size) { return (size_t)ebpo_text_mark(text, size); }

/* Behind the string that begins at text[i], or `size`. */
static size_t skip_string(const char *text, size_t size, size_t i)
{
    for (i++; i < size && text[i] != '"'; i++)
        i += text[i] == '\\';
    return i + 1 < size ? i + 1 : size;
}

ebpo_status scene_text_fits(const char *text, size_t size, uint64_t most_values, ebpo_error *error)
{
    uint64_t values = 1, depth = 0;
    for (size_t i = 0; i < size;) {
        char c = text[i];
        i = c == '"' ? skip_string(text, size, i) : i + 1;
        bool opens = c == '{' || c == '[';
        values += opens || c == ',' || c == ':';
        if (opens && ++depth > SCENE_DEPTH)
            return ebpo_fail(error, EBPO_E_LIMIT, "byte %zu: more than %d levels of brackets", i,
                             SCENE_DEPTH);
        depth -= (c == '}' || c == ']') && depth > 0;
        if (values > most_values)
            return ebpo_fail(error, EBPO_E_LIMIT,
                             "byte %zu: more than %llu values, the limit that was given", i,
                             (unsigned long long)most_values);
    }
    return EBPO_OK;
}

/* A place in valid JSON, and the lines before it. */
typedef struct cursor {
    const char *at;
    uint64_t line;
} cursor;

static void blanks(cursor *c)
{
    for (; *c->at && strchr(" \t\r\n", *c->at); c->at++)
        c->line += *c->at == '\n';
}

static void string(cursor *c)
{
    for (c->at++; *c->at && *c->at != '"'; c->at++)
        c->at += *c->at == '\\' && c->at[1];
    c->at += *c->at == '"';
}

/* Over a value, and blanks before it. */
static void value(cursor *c)
{
    int depth = 0;
    do {
        blanks(c);
        char first = *c->at;
        if (first == '"') {
            string(c);
        } else if (first == '{' || first == '[') {
            depth++;
            c->at++;
        } else if (first == '}' || first == ']') {
            depth--;
            c->at++;
        } else if (first == ',' || first == ':') {
            c->at++;
        } else {
            c->at += strcspn(c->at, " \t\r\n,:]}[{\"");
        }
        blanks(c);
    } while (*c->at && depth > 0);
}

static bool key_is(const cursor *c, const char *key)
{
    size_t size = strlen(key);
    return *c->at == '"' && strncmp(c->at + 1, key, size) == 0 && c->at[1 + size] == '"';
}

/* From the bracket that `c` is at to the value in it that `at` names. */
static bool enter(cursor *c, const scene_at *at)
{
    bool object = *c->at == '{';
    uint64_t item = 0;
    for (c->at++; blanks(c), *c->at && *c->at != '}' && *c->at != ']'; item++) {
        bool found = object ? at->key && key_is(c, at->key) : !at->key && item == at->item;
        if (object) {
            string(c);
            blanks(c);
            c->at += *c->at == ':';
        }
        blanks(c);
        if (found)
            return true;
        value(c);
        blanks(c);
        c->at += *c->at == ',';
    }
    return false;
}

uint64_t scene_line_of(const char *text, const scene_at *path, int count)
{
    cursor c = { text, 1 };
    uint64_t line = 1;
    blanks(&c);
    line = c.line;
    for (int i = 0; i < count && (*c.at == '{' || *c.at == '['); i++) {
        if (!enter(&c, &path[i]))
            break;
        line = c.line;
    }
    return line;
}
