/* Arrays of attributes: making, naming and freeing them. */
#include "mesh/attributes.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"

static const char *const type_names[] = { "int8",  "uint8",  "int16",   "uint16",
                                          "int32", "uint32", "float32", "float64" };
enum { TYPES = sizeof type_names / sizeof type_names[0] };

unsigned ebpo_attribute_bytes(ebpo_attribute_type type)
{
    static const unsigned char bytes[TYPES] = { 1, 1, 2, 2, 4, 4, 4, 8 };
    return bytes[type];
}

const char *ebpo_attribute_type_name(ebpo_attribute_type type) { return type_names[type]; }

int ebpo_attribute_type_of(const char *name)
{
    for (int i = 0; i < TYPES; i++)
        if (strcmp(name, type_names[i]) == 0)
            return i;
    return -1;
}

bool ebpo_attribute_is_of(const ebpo_attribute *a, const char *element)
{
    return strcmp(a->element, element) == 0;
}

bool ebpo_attribute_is_of_mesh(const ebpo_attribute *a)
{
    return ebpo_attribute_is_of(a, "vertex") || ebpo_attribute_is_of(a, "face");
}

bool ebpo_attribute_is_of_textures(const ebpo_attribute *a)
{
    return ebpo_attribute_is_of(a, EBPO_TEXTURE_ELEMENT);
}

ebpo_attributes *ebpo_attributes_make(ebpo_workspace *workspace)
{
    ebpo_attributes *made = ebpo_alloc_zero(1, sizeof *made);
    if (made)
        made->workspace = workspace;
    return made;
}

static void clear(ebpo_workspace *workspace, ebpo_attribute *a)
{
    if (!a->borrowed) {
        ebpo_array_free(workspace, a->values);
        ebpo_array_free(workspace, a->ends);
    }
    a->values = NULL;
    a->ends = NULL;
}

void ebpo_attributes_free(ebpo_attributes *attributes)
{
    if (!attributes)
        return;
    for (uint64_t i = 0; i < attributes->count; i++)
        clear(attributes->workspace, &attributes->array[i]);
    free(attributes->array);
    free(attributes->header);
    free(attributes);
}

ebpo_attribute *ebpo_attributes_add(ebpo_attributes *to, const ebpo_attribute *like)
{
    if (to->count == EBPO_ATTRIBUTE_ARRAYS ||
        !ebpo_grow(&to->array, &to->capacity, to->count + 1, sizeof *to->array))
        return NULL;
    ebpo_attribute *a = &to->array[to->count++];
    *a = *like;
    a->values = NULL;
    a->ends = NULL;
    a->row_capacity = a->item_capacity = 0;
    a->borrowed = false;
    return a;
}

void ebpo_attributes_remove(ebpo_attributes *from, uint64_t index)
{
    clear(from->workspace, &from->array[index]);
    from->count--;
    memmove(from->array + index, from->array + index + 1,
            (from->count - index) * sizeof *from->array);
}

void ebpo_attributes_drop_others(ebpo_attributes *from)
{
    for (uint64_t i = from ? from->count : 0; i-- > 0;)
        if (!ebpo_attribute_is_of_mesh(&from->array[i]) &&
            !ebpo_attribute_is_of_textures(&from->array[i]))
            ebpo_attributes_remove(from, i);
}

bool ebpo_attribute_reserve(ebpo_workspace *workspace, ebpo_attribute *a, uint64_t rows,
                            uint64_t items)
{
    unsigned bytes = ebpo_attribute_bytes(a->type);
    if (a->list == EBPO_ATTRIBUTE_NO_LIST)
        return ebpo_array_grow(workspace, &a->values, &a->row_capacity, rows, bytes * a->columns);
    return ebpo_array_grow(workspace, &a->ends, &a->row_capacity, rows, sizeof *a->ends) &&
           ebpo_array_grow(workspace, &a->values, &a->item_capacity, items, bytes);
}

/* Into a text of `size` bytes, which says "and more" when it is full. */
static void append(char *to, size_t size, const char *format, va_list args) EBPO_PRINTF(3, 0);

static void append(char *to, size_t size, const char *format, va_list args)
{
    static const char more[] = "; and more";
    char text[200];
    size_t used = strlen(to);
    vsnprintf(text, sizeof text, format, args);
    if (used + strlen(text) + sizeof more + 2 <= size)
        snprintf(to + used, size - used, "%s%s", used ? "; " : "", text);
    else if (used < sizeof more || strcmp(to + used - (sizeof more - 1), more) != 0)
        memcpy(to + used, more, sizeof more);
}

void ebpo_attributes_lose(ebpo_attributes *attributes, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    append(attributes->lost, sizeof attributes->lost, format, args);
    va_end(args);
}

void ebpo_attributes_note_unread(ebpo_attributes *attributes, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    append(attributes->unread, sizeof attributes->unread, format, args);
    va_end(args);
}

void ebpo_attributes_count_unread(ebpo_attributes *attributes, const char *what, uint64_t count)
{
    if (count)
        ebpo_attributes_note_unread(attributes, "%s: %" PRIu64, what, count);
}

static ebpo_status borrow_array(ebpo_attributes *to, const ebpo_attribute *from, ebpo_error *error)
{
    ebpo_attribute *a = ebpo_attributes_add(to, from);
    if (!a)
        return ebpo_fail_memory(error, sizeof *a);
    a->values = from->values;
    a->ends = from->ends;
    a->borrowed = true;
    return EBPO_OK;
}

static ebpo_status copy_array(ebpo_attributes *to, const ebpo_attribute *from, ebpo_error *error)
{
    ebpo_attribute *a = ebpo_attributes_add(to, from);
    if (!a)
        return ebpo_fail_memory(error, sizeof *a);
    uint64_t bytes = ebpo_attribute_value_count(from) * ebpo_attribute_bytes(from->type);
    a->values = ebpo_array_alloc(to->workspace, bytes, 1);
    a->ends = from->ends ? ebpo_array_alloc(to->workspace, a->rows, sizeof *a->ends) : NULL;
    if (!a->values || (from->ends && !a->ends))
        return ebpo_workspace_fail(to->workspace, bytes + a->rows * sizeof *a->ends, error);
    ebpo_array_copy(to->workspace, a->values, from->values, bytes);
    if (from->ends)
        ebpo_array_copy(to->workspace, a->ends, from->ends, a->rows * sizeof *a->ends);
    return EBPO_OK;
}

static ebpo_status make_of(ebpo_attributes **out, const ebpo_attributes *from,
                           ebpo_workspace *workspace,
                           ebpo_status (*array)(ebpo_attributes *to, const ebpo_attribute *from,
                                                ebpo_error *error),
                           ebpo_error *error)
{
    *out = NULL;
    if (!from)
        return EBPO_OK;
    ebpo_attributes *made = ebpo_attributes_make(workspace);
    if (!made)
        return ebpo_fail_memory(error, sizeof *made);
    ebpo_status status = EBPO_OK;
    made->header = from->header ? ebpo_alloc(from->header_bytes, 1) : NULL;
    if (from->header && !made->header)
        status = ebpo_fail_memory(error, from->header_bytes);
    else if (from->header)
        memcpy(made->header, from->header, made->header_bytes = from->header_bytes);
    for (uint64_t i = 0; i < from->count && status == EBPO_OK; i++)
        status = array(made, &from->array[i], error);
    if (status == EBPO_OK)
        *out = made;
    else
        ebpo_attributes_free(made);
    return status;
}

ebpo_status ebpo_attributes_borrow(ebpo_attributes **out, const ebpo_attributes *from,
                                   ebpo_error *error)
{
    return make_of(out, from, from ? from->workspace : NULL, borrow_array, error);
}

ebpo_status ebpo_attributes_copy(ebpo_attributes **out, const ebpo_attributes *from,
                                 ebpo_workspace *workspace, ebpo_error *error)
{
    return make_of(out, from, workspace, copy_array, error);
}
