/* Implements the attributes of a mesh: numeric arrays for vertices, faces and other elements.
 * Creates, copies and frees arrays; selects, reorders and compares rows; finds ranges of values and
 * groups of names. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "mesh/attributes.h"

/* --- creating and freeing --- */

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

ebpo_status ebpo_mesh_need_attributes(ebpo_mesh *mesh, ebpo_error *error)
{
    if (!mesh->attributes)
        mesh->attributes = ebpo_attributes_make(mesh->workspace);
    return mesh->attributes ? EBPO_OK : ebpo_fail_memory(error, sizeof *mesh->attributes);
}

static void free_values(ebpo_workspace *workspace, ebpo_attribute *a)
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
        free_values(attributes->workspace, &attributes->array[i]);
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
    free_values(from->workspace, &from->array[index]);
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

/* Appends a note to the text `to`, an array of `size` bytes. If the note does not fit, appends "and
 * more" once. */
static void append_note(char *to, size_t size, const char *format, va_list args) EBPO_PRINTF(3, 0);

static void append_note(char *to, size_t size, const char *format, va_list args)
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
    append_note(attributes->lost, sizeof attributes->lost, format, args);
    va_end(args);
}

void ebpo_attributes_note_unread(ebpo_attributes *attributes, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    append_note(attributes->unread, sizeof attributes->unread, format, args);
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

/* Makes attributes with the arrays and the header of `from`. take_array: borrow_array or
 * copy_array. */
static ebpo_status make_from(
    ebpo_attributes **out, const ebpo_attributes *from, ebpo_workspace *workspace,
    ebpo_status (*take_array)(ebpo_attributes *to, const ebpo_attribute *from, ebpo_error *error),
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
        status = take_array(made, &from->array[i], error);
    if (status == EBPO_OK)
        *out = made;
    else
        ebpo_attributes_free(made);
    return status;
}

ebpo_status ebpo_attributes_borrow(ebpo_attributes **out, const ebpo_attributes *from,
                                   ebpo_error *error)
{
    return make_from(out, from, from ? from->workspace : NULL, borrow_array, error);
}

ebpo_status ebpo_attributes_copy(ebpo_attributes **out, const ebpo_attributes *from,
                                 ebpo_workspace *workspace, ebpo_error *error)
{
    return make_from(out, from, workspace, copy_array, error);
}

/* --- rows --- */

/* The selection of rows of an array into a new array. */
typedef struct picking {
    ebpo_workspace *workspace;
    const ebpo_attribute *from; /* the old array */
    const uint32_t *rows; /* [count] row of `from` for each row of `made`, which is zero if `from`
                             has no such row */
    uint64_t count;
    ebpo_attribute made; /* the new array */
} picking;

/* Copies the values of the selected rows, for an array without lists. */
static void pick_columns(picking *p)
{
    size_t bytes = ebpo_attribute_row_bytes(p->from);
    EBPO_FOR_ITEMS_SCATTERED(p->workspace, i, 0, p->count) {
        if (p->rows[i] < p->from->rows)
            memcpy(p->made.values + i * bytes, p->from->values + p->rows[i] * bytes, bytes);
        else
            memset(p->made.values + i * bytes, 0, bytes);
    }
}

/* Returns the index of the first item of a row's list. */
static uint64_t list_begin(const ebpo_attribute *a, uint64_t row)
{
    return row ? a->ends[row - 1] : 0;
}

/* Computes the ends of the lists of the selected rows. */
static void pick_ends(picking *p)
{
    uint64_t sum = 0;
    EBPO_FOR_ITEMS_SCATTERED(p->workspace, i, 0, p->count) {
        uint64_t row = p->rows[i];
        sum += row < p->from->rows ? p->from->ends[row] - list_begin(p->from, row) : 0;
        p->made.ends[i] = sum;
    }
}

/* Copies the items of the lists of the selected rows. */
static void pick_items(picking *p)
{
    size_t bytes = ebpo_attribute_bytes(p->from->type);
    uint64_t at = 0;
    EBPO_FOR_ITEMS_SCATTERED(p->workspace, i, 0, p->count) {
        uint64_t count = p->made.ends[i] - at;
        if (count)
            memcpy(p->made.values + at * bytes,
                   p->from->values + list_begin(p->from, p->rows[i]) * bytes, count * bytes);
        at += count;
    }
}

/* Writes the selected rows to p->made, which the caller frees. Returns false when out of memory.
 */
static bool pick_rows(picking *p)
{
    const ebpo_attribute *from = p->from;
    p->made = *from;
    p->made.ends = NULL;
    p->made.borrowed = false;
    p->made.rows = p->made.row_capacity = p->count;
    if (!from->ends) {
        p->made.values = ebpo_array_alloc(p->workspace, p->count, ebpo_attribute_row_bytes(from));
        if (p->made.values)
            pick_columns(p);
        return p->made.values != NULL;
    }
    p->made.values = NULL;
    p->made.ends = ebpo_array_alloc(p->workspace, p->count, sizeof *p->made.ends);
    if (!p->made.ends)
        return false;
    pick_ends(p);
    p->made.item_capacity = ebpo_attribute_value_count(&p->made);
    p->made.values =
        ebpo_array_alloc(p->workspace, p->made.item_capacity, ebpo_attribute_bytes(from->type));
    if (p->made.values)
        pick_items(p);
    return p->made.values != NULL;
}

ebpo_status ebpo_attributes_pick(ebpo_attributes *attributes, const char *element,
                                 const uint32_t *rows, uint64_t count, ebpo_error *error)
{
    for (uint64_t i = 0; attributes && i < attributes->count; i++) {
        ebpo_attribute *a = &attributes->array[i];
        if (!ebpo_attribute_is_of(a, element))
            continue;
        picking p = { attributes->workspace, a, rows, count, { .rows = 0 } };
        if (!pick_rows(&p)) {
            ebpo_array_free(attributes->workspace, p.made.ends);
            return ebpo_workspace_fail(attributes->workspace,
                                       count * (ebpo_attribute_row_bytes(a) + sizeof *a->ends),
                                       error);
        }
        if (!a->borrowed) {
            ebpo_array_free(attributes->workspace, a->values);
            ebpo_array_free(attributes->workspace, a->ends);
        }
        *a = p.made;
    }
    return EBPO_OK;
}

/* Moves row rows[i] to row i. Because rows[i] >= i, no row is overwritten before it is read. */
static void keep_columns(ebpo_workspace *workspace, ebpo_attribute *a, const uint32_t *rows,
                         uint64_t count)
{
    size_t bytes = ebpo_attribute_row_bytes(a);
    EBPO_FOR_ITEMS_SCATTERED(workspace, i, 0, count) {
        if (rows[i] != i)
            memcpy(a->values + i * bytes, a->values + rows[i] * bytes, bytes);
    }
}

/* Moves the lists of the selected rows to the beginning of the array; rows are ascending. */
static void keep_lists(ebpo_workspace *workspace, ebpo_attribute *a, const uint32_t *rows,
                       uint64_t count)
{
    size_t bytes = ebpo_attribute_bytes(a->type);
    uint64_t at = 0;
    EBPO_FOR_ITEMS_SCATTERED(workspace, i, 0, count) {
        uint64_t begin = list_begin(a, rows[i]), items = a->ends[rows[i]] - begin;
        memmove(a->values + at * bytes, a->values + begin * bytes, items * bytes);
        a->ends[i] = at += items;
    }
}

void ebpo_attributes_keep(ebpo_attributes *attributes, const char *element, const uint32_t *rows,
                          uint64_t count)
{
    for (uint64_t i = 0; i < attributes->count; i++) {
        ebpo_attribute *a = &attributes->array[i];
        if (!ebpo_attribute_is_of(a, element))
            continue;
        if (a->ends)
            keep_lists(attributes->workspace, a, rows, count);
        else
            keep_columns(attributes->workspace, a, rows, count);
        a->rows = count;
    }
}

/* Returns the number of items of a row, and sets *begin to the index of the first item. */
static uint64_t items_of(const ebpo_attribute *a, uint64_t row, uint64_t *begin)
{
    *begin = a->ends ? list_begin(a, row) : row * a->columns;
    return a->ends ? a->ends[row] - *begin : a->columns;
}

bool ebpo_attribute_same_row(const ebpo_attribute *a, uint64_t i, const ebpo_attribute *b,
                             uint64_t k)
{
    size_t bytes = ebpo_attribute_bytes(a->type);
    uint64_t x, y, count = items_of(a, i, &x);
    return items_of(b, k, &y) == count &&
           (!count || memcmp(a->values + x * bytes, b->values + y * bytes, count * bytes) == 0);
}

bool ebpo_attributes_equal_rows(const ebpo_attributes *attributes, const char *element, uint64_t a,
                                uint64_t b)
{
    for (uint64_t i = 0; i < attributes->count; i++)
        if (ebpo_attribute_is_of(&attributes->array[i], element) &&
            !ebpo_attribute_same_row(&attributes->array[i], a, &attributes->array[i], b))
            return false;
    return true;
}

void ebpo_attribute_even_out(ebpo_workspace *workspace, ebpo_attribute *a)
{
    uint64_t length = a->ends && a->rows ? a->ends[0] : 0;
    bool even = length >= 1 && length <= EBPO_ATTRIBUTE_COLUMNS;
    EBPO_FOR_ITEMS(workspace, i, 0, even ? a->rows : 0)
        if (a->ends[i] != (i + 1) * length) {
            even = false;
            break;
        }
    if (!even)
        return;
    ebpo_array_free(workspace, a->ends);
    a->ends = NULL;
    a->columns = (uint32_t)length;
}

/* --- ranges --- */

double ebpo_attribute_number(const uint8_t *at, ebpo_attribute_type type)
{
    union {
        int8_t i8;
        uint8_t u8;
        int16_t i16;
        uint16_t u16;
        int32_t i32;
        uint32_t u32;
        float f32;
        double f64;
    } v;
    memcpy(&v, at, ebpo_attribute_bytes(type));
    switch (type) {
    case EBPO_ATTRIBUTE_INT8: return v.i8;
    case EBPO_ATTRIBUTE_UINT8: return v.u8;
    case EBPO_ATTRIBUTE_INT16: return v.i16;
    case EBPO_ATTRIBUTE_UINT16: return v.u16;
    case EBPO_ATTRIBUTE_INT32: return v.i32;
    case EBPO_ATTRIBUTE_UINT32: return v.u32;
    case EBPO_ATTRIBUTE_FLOAT32: return (double)v.f32;
    case EBPO_ATTRIBUTE_FLOAT64: return v.f64;
    }
    return 0;
}

bool ebpo_attribute_range(const ebpo_attribute *a, ebpo_workspace *workspace, double range[2])
{
    bool found = false;
    size_t bytes = ebpo_attribute_bytes(a->type);
    uint64_t count = ebpo_attribute_value_count(a);
    EBPO_FOR_ITEMS(workspace, i, 0, count) {
        double v = ebpo_attribute_number(a->values + i * bytes, a->type);
        if (v != v)
            continue;
        if (!found || v < range[0])
            range[0] = v;
        if (!found || v > range[1])
            range[1] = v;
        found = true;
    }
    return found;
}

/* --- names --- */

/* Endings of names whose columns form a group, such as position.x, position.y, position.z. */
static const char *const group_endings[][4] = {
    { "x", "y", "z", NULL },          { "red", "green", "blue", "alpha" },
    { "red", "green", "blue", NULL }, { "r", "g", "b", "a" },
    { "r", "g", "b", NULL },          { "s", "t", NULL, NULL },
    { "u", "v", NULL, NULL },
};

/* Returns the length of the name before the ending `end`, or -1 if the name has another ending. */
static int length_before(const ebpo_attribute_name *name, const char *end)
{
    size_t n = strlen(end);
    return name->n >= n && memcmp(name->s + name->n - n, end, n) == 0 ? (int)(name->n - n) : -1;
}

/* Returns the number of endings if as many of the first names have these endings, in this order,
 * after the same beginning. Returns 1 otherwise. */
static unsigned count_matching(const char *const ends[4], const ebpo_attribute_name *names,
                               unsigned count)
{
    unsigned n = 0;
    int before = length_before(&names[0], ends[0]);
    for (; n < 4 && ends[n]; n++)
        if (before < 0 || n == count || length_before(&names[n], ends[n]) != before ||
            memcmp(names[n].s, names[0].s, (size_t)before) != 0)
            return 1;
    return n;
}

unsigned ebpo_attribute_names_together(const ebpo_attribute_name *names, unsigned count)
{
    for (size_t i = 0; i < sizeof group_endings / sizeof group_endings[0]; i++) {
        unsigned n = count_matching(group_endings[i], names, count);
        if (n > 1)
            return n;
    }
    return 1;
}
