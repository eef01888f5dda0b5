/* Attributes of objects. */
#include "core/strict_fp.h"

#include <stdio.h>
#include <string.h>

#include "core/error.h"
#include "core/text.h"
#include "hdf5_read/head_state.h"
#include "hdf5_read/head_types.h"

typedef struct attribute {
    ebpo_head_type type;
    ebpo_head_space space;
    const uint8_t *data; /* all values, or NULL */
} attribute;

static ebpo_status attribute_fails(const ebpo_head *head, const char *path, const char *name,
                                   const char *what, ebpo_error *error)
{
    char place[160];
    snprintf(place, sizeof place, "%s: attribute %s", path, name);
    return ebpo_fail_at(error, EBPO_E_FORMAT, head->shown, place, -1, "%s", what);
}

/* In messages of version 1 each part ends at a multiple of eight bytes. */
static ebpo_head_cursor part_of(ebpo_head_cursor *c, unsigned version, unsigned size)
{
    ebpo_head_cursor part = ebpo_cursor_part(c, size);
    if (version == 1 && size % 8)
        ebpo_cursor_take(c, 8 - size % 8);
    return part;
}

/* Whether a message is the attribute of this name; then what it says. */
static bool attribute_is(ebpo_head_cursor c, const char *name, attribute *a)
{
    unsigned version = ebpo_cursor_u8(&c), flags = ebpo_cursor_u8(&c);
    unsigned name_size = ebpo_cursor_u16(&c), type_size = ebpo_cursor_u16(&c),
             space_size = ebpo_cursor_u16(&c);
    if (version == 3)
        ebpo_cursor_u8(&c); /* character set of the name */
    ebpo_head_cursor text = part_of(&c, version, name_size);
    size_t length = strlen(name) + 1;
    if (version < 1 || version > 3 || text.cut || ebpo_cursor_left(&text) < length ||
        memcmp(text.at, name, length) != 0)
        return false;
    ebpo_head_cursor type = part_of(&c, version, type_size),
                     space = part_of(&c, version, space_size);
    uint64_t bytes;
    *a = (attribute){ ebpo_head_read_type(type), ebpo_head_read_space(space), NULL };
    if (version > 1 && flags & 1) /* the type stands elsewhere */
        a->type = (ebpo_head_type){ EBPO_CLASS_OTHER, 0, false };
    if (!__builtin_mul_overflow(a->space.values, (uint64_t)a->type.size, &bytes) &&
        bytes <= ebpo_cursor_left(&c) && !c.cut)
        a->data = c.at;
    return true;
}

/* EBPO_E_ABSENT when there is none of this name. `values`: how many it must have. */
static ebpo_status find_attribute(ebpo_head *head, ebpo_head_object object, const char *path,
                                  const char *name, uint64_t values, attribute *out,
                                  ebpo_error *error)
{
    unsigned found = 0;
    head->state->refusal = (ebpo_head_refusal){ NULL, false };
    const ebpo_head_header *h = ebpo_head_header_at(head->state, object);
    if (!h)
        return ebpo_head_fail(head, path, "its description is damaged", error);
    for (uint64_t i = 0; i < h->count; i++)
        if (h->message[i].type == EBPO_M_ATTRIBUTE && !(h->message[i].flags & 2))
            found += attribute_is(ebpo_head_message_cursor(h, &h->message[i]), name, out);
    if (found == 0)
        return EBPO_E_ABSENT;
    if (found == 1 && out->space.rank != UINT32_MAX && out->space.values == values && out->data)
        return EBPO_OK;
    return attribute_fails(head, path, name, "it is damaged or has the wrong number of values",
                           error);
}

ebpo_status ebpo_head_get_text(ebpo_head *head, ebpo_head_object object, const char *path,
                               const char *name, char *text, size_t size, ebpo_error *error)
{
    attribute a = { .data = NULL };
    memset(text, 0, size);
    ebpo_status status = find_attribute(head, object, path, name, 1, &a, error);
    if (status != EBPO_OK)
        return status;
    bool is_text = a.type.class == EBPO_CLASS_TEXT && a.type.size > 0;
    size_t length = is_text ? strnlen((const char *)a.data, a.type.size) : size;
    if (length < size)
        memcpy(text, a.data, length);
    if (length < size && ebpo_text_ok(text))
        return EBPO_OK;
    memset(text, 0, size);
    return attribute_fails(head, path, name,
                           "it is not a fixed-length UTF-8 text of a sensible length", error);
}

/* The eight bytes of each value. */
static ebpo_status get_numbers(ebpo_head *head, ebpo_head_object object, const char *path,
                               const char *name, ebpo_head_type type, uint64_t *values,
                               unsigned count, const char *what, ebpo_error *error)
{
    attribute a = { .data = NULL };
    count = count ? count : 1;
    ebpo_status status = find_attribute(head, object, path, name, count, &a, error);
    if (status != EBPO_OK)
        return status;
    if (a.type.class != type.class || a.type.size != type.size ||
        a.type.is_signed != type.is_signed)
        return attribute_fails(head, path, name, what, error);
    for (unsigned i = 0; i < count; i++)
        values[i] = ebpo_load64(a.data + 8 * (size_t)i);
    return EBPO_OK;
}

ebpo_status ebpo_head_get_int(ebpo_head *head, ebpo_head_object object, const char *path,
                              const char *name, int64_t *value, ebpo_error *error)
{
    static const ebpo_head_type type = { EBPO_CLASS_INTEGER, 8, true };
    uint64_t bits = 0;
    ebpo_status status =
        get_numbers(head, object, path, name, type, &bits, 0, "it is not an i64", error);
    if (status == EBPO_OK)
        memcpy(value, &bits, sizeof bits);
    return status;
}

ebpo_status ebpo_head_get_count(ebpo_head *head, ebpo_head_object object, const char *path,
                                const char *name, uint64_t *value, ebpo_error *error)
{
    static const ebpo_head_type type = { EBPO_CLASS_INTEGER, 8, false };
    return get_numbers(head, object, path, name, type, value, 0, "it is not a u64", error);
}

ebpo_status ebpo_head_get_real(ebpo_head *head, ebpo_head_object object, const char *path,
                               const char *name, double *values, unsigned count, ebpo_error *error)
{
    enum { MOST = 16 };
    static const ebpo_head_type type = { EBPO_CLASS_DOUBLE, 8, false };
    uint64_t bits[MOST];
    if (count > MOST)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "attributes have at most %d numbers", MOST);
    ebpo_status status =
        get_numbers(head, object, path, name, type, bits, count, "it is not of f64 numbers", error);
    if (status == EBPO_OK)
        memcpy(values, bits, (count ? count : 1) * sizeof bits[0]);
    return status;
}
