/* Reads members of a scene file. Every error names the line, the path of the value and the expected
 * value.
 *
 * A scene file is untrusted input. Before jansson parses the text, one pass compares the number and
 * the depth of its values with the limits, so that parsing takes bounded memory. jansson stores no
 * positions. So, after an error, another pass over the text follows the path of the value to find
 * its line.
 *
 * A reader stores the path of the current value: ebpo_json_enter must be called before a value is
 * evaluated, and ebpo_json_leave afterwards. Unknown members are errors, except private members,
 * whose names begin with "x-".
 *
 * See format-spec/scene.md. */
#include "core/strict_fp.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "core/error.h"
#include "core/text.h"
#include "extras/scene/json_reader.h"
#include "extras/scene/scene_parts.h"

size_t ebpo_scene_bom_length(const char *text, size_t size)
{
    return (size_t)ebpo_text_bom_length(text, size);
}

/* Returns the index after the string that begins at text[i]; `size` if the string does not end. */
static size_t skip_string(const char *text, size_t size, size_t i)
{
    for (i++; i < size && text[i] != '"'; i++)
        i += text[i] == '\\';
    return i + 1 < size ? i + 1 : size;
}

ebpo_status ebpo_scene_text_fits(const char *text, size_t size, uint64_t max_values,
                                 ebpo_error *error)
{
    uint64_t values = 1, depth = 0;
    for (size_t i = 0; i < size;) {
        char c = text[i];
        i = c == '"' ? skip_string(text, size, i) : i + 1;
        bool opens = c == '{' || c == '[';
        values += opens || c == ',' || c == ':';
        if (opens && ++depth > EBPO_SCENE_DEPTH)
            return ebpo_fail(error, EBPO_E_LIMIT, "byte %zu: more than %d levels of brackets", i,
                             EBPO_SCENE_DEPTH);
        depth -= (c == '}' || c == ']') && depth > 0;
        if (values > max_values)
            return ebpo_fail(error, EBPO_E_LIMIT,
                             "byte %zu: more than %llu values, the limit (max_values)", i,
                             (unsigned long long)max_values);
    }
    return EBPO_OK;
}

/* A position in valid JSON, and the number of its line; the first line has number 1. */
typedef struct cursor {
    const char *at;
    uint64_t line;
} cursor;

/* Skips blanks, and counts lines. */
static void json_text_blanks(cursor *c)
{
    for (; *c->at && strchr(" \t\r\n", *c->at); c->at++)
        c->line += *c->at == '\n';
}

/* Skips a string; the cursor is at its first quotation mark. */
static void json_text_string(cursor *c)
{
    for (c->at++; *c->at && *c->at != '"'; c->at++)
        c->at += *c->at == '\\' && c->at[1];
    c->at += *c->at == '"';
}

/* Skips a value, and blanks before it. */
static void json_text_value(cursor *c)
{
    int depth = 0;
    do {
        json_text_blanks(c);
        char first = *c->at;
        if (first == '"') {
            json_text_string(c);
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
        json_text_blanks(c);
    } while (*c->at && depth > 0);
}

static bool key_is(const cursor *c, const char *key)
{
    size_t size = strlen(key);
    return *c->at == '"' && strncmp(c->at + 1, key, size) == 0 && c->at[1 + size] == '"';
}

/* Moves from an opening bracket at `c` to the value with the key or index `at` in these brackets.
 * Returns false if there is no such value. */
static bool json_text_enter(cursor *c, const ebpo_scene_at *at)
{
    bool object = *c->at == '{';
    uint64_t item = 0;
    for (c->at++; json_text_blanks(c), *c->at && *c->at != '}' && *c->at != ']'; item++) {
        bool found = object ? at->key && key_is(c, at->key) : !at->key && item == at->item;
        if (object) {
            json_text_string(c);
            json_text_blanks(c);
            c->at += *c->at == ':';
        }
        json_text_blanks(c);
        if (found)
            return true;
        json_text_value(c);
        json_text_blanks(c);
        c->at += *c->at == ',';
    }
    return false;
}

/* Returns the number of the line on which a value of valid JSON begins; the first line has number
 * 1. path[count] are the keys and indices that lead from the outermost value to this value. If the
 * value does not exist, returns the line of the last existing value on its path. */
static uint64_t find_line(const char *text, const ebpo_scene_at *path, int count)
{
    cursor c = { text, 1 };
    uint64_t line = 1;
    json_text_blanks(&c);
    line = c.line;
    for (int i = 0; i < count && (*c.at == '{' || *c.at == '['); i++) {
        if (!json_text_enter(&c, &path[i]))
            break;
        line = c.line;
    }
    return line;
}

/* --- members --- */

void ebpo_json_enter(ebpo_json_reader *r, const char *key, uint64_t item)
{
    r->path[r->depth++] = (ebpo_scene_at){ key, item };
}

void ebpo_json_leave(ebpo_json_reader *r) { r->depth--; }

/* Writes the path of the current value, such as "instances[3].pose", truncated to `space` bytes. */
static void show_path(const ebpo_json_reader *r, char *out, size_t space)
{
    size_t used = 0;
    out[0] = 0;
    for (int i = 0; i < r->depth && used < space; i++) {
        const ebpo_scene_at *at = &r->path[i];
        int n = at->key
                    ? snprintf(out + used, space - used, "%s%.60s", i ? "." : "", at->key)
                    : snprintf(out + used, space - used, "[%llu]", (unsigned long long)at->item);
        used += n > 0 ? (size_t)n : 0;
    }
    for (char *c = out; *c; c++)
        if ((unsigned char)*c < 0x20)
            *c = '?';
}

ebpo_status ebpo_json_bad(ebpo_json_reader *r, const char *format, ...)
{
    char what[256], path[200];
    va_list args;
    va_start(args, format);
    vsnprintf(what, sizeof what, format, args);
    va_end(args);
    show_path(r, path, sizeof path);
    return ebpo_fail_file(r->error, EBPO_E_FORMAT, r->name, "line %llu: %s%s%s",
                          (unsigned long long)find_line(r->text, r->path, r->depth), path,
                          *path ? ": " : "", what);
}

ebpo_status ebpo_json_bad_at(ebpo_json_reader *r, const char *key, const char *what)
{
    ebpo_json_enter(r, key, 0);
    ebpo_status status = ebpo_json_bad(r, "%s", what);
    ebpo_json_leave(r);
    return status;
}

ebpo_status ebpo_json_locate_error(ebpo_json_reader *r, ebpo_status status, const ebpo_error *why)
{
    if (status == EBPO_OK)
        return status;
    return status == EBPO_E_ARGUMENT ? ebpo_json_bad(r, "%.250s", why->message)
                                     : ebpo_fail_with(r->error, why);
}

ebpo_status ebpo_json_members(ebpo_json_reader *r, const json_t *value, const char *const *known)
{
    const char *key;
    json_t *member;
    if (!json_is_object(value))
        return ebpo_json_bad(r, "is not an object");
    json_object_foreach((json_t *)value, key, member)
    {
        const char *const *k = known;
        while (*k && strcmp(*k, key) != 0)
            k++;
        if (!*k && strncmp(key, "x-", 2) != 0)
            return ebpo_json_bad_at(r, key, "is not a known member; private members begin with x-");
    }
    return EBPO_OK;
}

/* Returns EBPO_OK for a missing member, or fails if the member is needed. */
static ebpo_status json_reader_missing(ebpo_json_reader *r, const char *key, bool needed)
{
    return needed ? ebpo_json_bad(r, "has no member %s", key) : EBPO_OK;
}

ebpo_status ebpo_json_get_text(ebpo_json_reader *r, const json_t *object, const char *key,
                               bool needed, const char **out)
{
    const json_t *value = json_object_get(object, key);
    if (!value)
        return json_reader_missing(r, key, needed);
    if (!json_is_string(value))
        return ebpo_json_bad_at(r, key, "is not a string");
    *out = json_string_value(value);
    return EBPO_OK;
}

ebpo_status ebpo_json_get_flag(ebpo_json_reader *r, const json_t *object, const char *key,
                               bool *out)
{
    const json_t *value = json_object_get(object, key);
    if (!value)
        return EBPO_OK;
    if (!json_is_boolean(value))
        return ebpo_json_bad_at(r, key, "is neither true nor false");
    *out = json_is_true(value);
    return EBPO_OK;
}

ebpo_status ebpo_json_get_real(ebpo_json_reader *r, const json_t *object, const char *key,
                               bool needed, double *out)
{
    const json_t *value = json_object_get(object, key);
    if (!value)
        return json_reader_missing(r, key, needed);
    if (!json_is_number(value))
        return ebpo_json_bad_at(r, key, "is not a number");
    *out = json_number_value(value);
    return EBPO_OK;
}

ebpo_status ebpo_json_get_reals(ebpo_json_reader *r, const json_t *object, const char *key,
                                bool needed, double *out, size_t count)
{
    char what[64];
    const json_t *value = json_object_get(object, key);
    if (!value)
        return json_reader_missing(r, key, needed);
    bool fits = json_is_array(value) && json_array_size(value) == count;
    for (size_t i = 0; i < count && fits; i++) {
        fits = json_is_number(json_array_get(value, i));
        out[i] = json_number_value(json_array_get(value, i));
    }
    snprintf(what, sizeof what, "is not an array of %zu numbers", count);
    return fits ? EBPO_OK : ebpo_json_bad_at(r, key, what);
}

ebpo_status ebpo_json_each_member(ebpo_json_reader *r, const json_t *object, const char *key,
                                  ebpo_json_each_fn each)
{
    json_t *members = json_object_get(object, key), *value;
    const char *name;
    ebpo_status status = EBPO_OK;
    if (!members)
        return status;
    if (!json_is_object(members))
        return ebpo_json_bad_at(r, key, "is not an object");
    ebpo_json_enter(r, key, 0);
    json_object_foreach(members, name, value)
    {
        ebpo_json_enter(r, name, 0);
        status = each(r, name, value);
        ebpo_json_leave(r);
        if (status != EBPO_OK)
            break;
    }
    ebpo_json_leave(r);
    return status;
}

ebpo_status ebpo_json_each_item(ebpo_json_reader *r, const json_t *object, const char *key,
                                ebpo_json_each_fn each)
{
    const json_t *items = json_object_get(object, key);
    ebpo_status status = EBPO_OK;
    if (!items)
        return status;
    if (!json_is_array(items))
        return ebpo_json_bad_at(r, key, "is not an array");
    ebpo_json_enter(r, key, 0);
    for (size_t i = 0; i < json_array_size(items) && status == EBPO_OK; i++) {
        ebpo_json_enter(r, NULL, i);
        status = each(r, NULL, json_array_get(items, i));
        ebpo_json_leave(r);
    }
    ebpo_json_leave(r);
    return status;
}
