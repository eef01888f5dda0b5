/* Converts properties of PLY elements other than positions and corners to attribute arrays: numbers
 * and lists, each in the type that the file declares (ply_parts.h). */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/text.h"
#include "geometry/decimal.h"
#include "mesh/ply_parts.h"

_Static_assert((int)EBPO_PLY_INT8 == (int)EBPO_ATTRIBUTE_INT8 &&
                   (int)EBPO_PLY_FLOAT64 == (int)EBPO_ATTRIBUTE_FLOAT64,
               "a property and its attribute have the same type");

static ebpo_status fail_rows(const ebpo_ply_parser *p, uint64_t bytes)
{
    return ebpo_workspace_fail(p->mesh->workspace, bytes, p->error);
}

/* --- which arrays --- */

/* Copies a word of the header. Returns false when it is too long or not valid text. */
static bool parse_word(char *to, size_t capacity, ebpo_ply_word word)
{
    if (word.n == 0 || word.n >= capacity)
        return false;
    memcpy(to, word.s, word.n);
    to[word.n] = 0;
    return strlen(to) == word.n && ebpo_text_ok(to);
}

/* Writes the names of the properties, separated by spaces. Returns false if they do not fit or are
 * not valid text. */
static bool keep_names(char *to, size_t capacity, const ebpo_ply_property *property, unsigned count)
{
    for (unsigned i = 0; i < count; i++) {
        if (!parse_word(to, capacity, property[i].name))
            return false;
        to += property[i].name.n;
        capacity -= property[i].name.n;
        if (i + 1 < count && capacity < 3)
            return false;
        if (i + 1 < count)
            *to++ = ' ', capacity--;
    }
    return true;
}

/* Returns the number of properties, from property[0] on, that have one type and whose names form a
 * group: at least 1, at most `limit` and 4. */
static unsigned group_length(const ebpo_ply_property *property, uint64_t limit)
{
    ebpo_attribute_name names[4];
    unsigned count = 0;
    while (count < 4 && count < limit && property[count].role == EBPO_PLY_ROLE_NONE &&
           !property[count].list && property[count].type == property[0].type) {
        names[count] = (ebpo_attribute_name){ property[count].name.s, property[count].name.n };
        count++;
    }
    return count ? ebpo_attribute_names_together(names, count) : 1;
}

/* Records that a property is not kept, and why. */
static void lose_property(const ebpo_ply_parser *p, const ebpo_ply_element *element,
                          const ebpo_ply_property *property, const char *why)
{
    char element_name[EBPO_IMPORT_WORD_TEXT], name[EBPO_IMPORT_WORD_TEXT];
    ebpo_import_word_text(element_name, element->name.s, element->name.n);
    ebpo_import_word_text(name, property->name.s, property->name.n);
    ebpo_attributes_lose(p->mesh->attributes, "property '%s' of '%s' (%s)", name, element_name,
                         why);
}

/* Returns true if an earlier element of the same name has another number of rows. The array `a`
 * cannot be kept in this case, because arrays are found by the names of their elements. */
static bool has_namesake(const ebpo_attributes *to, const ebpo_attribute *a, uint64_t rows)
{
    for (uint64_t i = 0; i < to->count; i++)
        if (ebpo_attribute_is_of(&to->array[i], a->element) && to->array[i].rows != rows)
            return true;
    return false;
}

/* Adds an array for `columns` properties from `property` on, and reserves space for its rows. If
 * the array cannot be kept, records the loss and succeeds. */
static ebpo_status plan_array(ebpo_ply_parser *p, const ebpo_ply_element *element,
                              ebpo_ply_property *property, unsigned columns)
{
    ebpo_attributes *to = p->mesh->attributes;
    ebpo_attribute a = { .type = (ebpo_attribute_type)property->type,
                         .list =
                             property->list ? (int)property->count_type : EBPO_ATTRIBUTE_NO_LIST,
                         .columns = columns };
    if (!parse_word(a.element, sizeof a.element, element->name) ||
        !keep_names(a.names, sizeof a.names, property, columns) ||
        to->count == EBPO_ATTRIBUTE_ARRAYS) {
        lose_property(p, element, property,
                      "the name is too long or not valid text, or there are too many "
                      "attributes");
        return EBPO_OK;
    }
    bool face = element->kind == EBPO_PLY_KIND_FACE;
    a.rows = face ? 0 : element->count;
    if (has_namesake(to, &a, a.rows)) {
        lose_property(p, element, property,
                      "another element has the same name and a different row count");
        return EBPO_OK;
    }
    ebpo_attribute *made = ebpo_attributes_add(to, &a);
    if (!made)
        return ebpo_fail_memory(p->error, sizeof a);
    for (unsigned i = 0; i < columns; i++) {
        property[i].attribute = (int)(to->count - 1);
        property[i].column = i;
    }
    uint64_t rows = face ? p->face_capacity : element->count;
    return ebpo_attribute_reserve(to->workspace, made, rows, 0) ? EBPO_OK
                                                                : fail_rows(p, rows * columns * 8);
}

static ebpo_status plan_element(ebpo_ply_parser *p, const ebpo_ply_element *element)
{
    ebpo_ply_property *property = p->header.property + element->first;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < element->properties && status == EBPO_OK;) {
        unsigned columns = 1;
        if (property[i].role == EBPO_PLY_ROLE_NONE && element->kind == EBPO_PLY_KIND_STRIPS) {
            lose_property(p, element, &property[i], "not supported for triangle strips");
        } else if (property[i].role == EBPO_PLY_ROLE_NONE && element->count) {
            columns = group_length(property + i, element->properties - i);
            status = plan_array(p, element, property + i, columns);
        }
        i += columns;
    }
    return status;
}

ebpo_status ebpo_ply_attributes_plan(ebpo_ply_parser *p)
{
    ebpo_status status = ebpo_mesh_need_attributes(p->mesh, p->error);
    if (status != EBPO_OK)
        return status;
    for (uint64_t i = 0; i < p->header.elements && status == EBPO_OK; i++)
        status = plan_element(p, &p->header.element[i]);
    p->lost = ebpo_alloc_zero(EBPO_ATTRIBUTE_ARRAYS, sizeof *p->lost);
    p->faces_reserved = p->face_capacity;
    return status != EBPO_OK || p->lost ? status
                                        : ebpo_fail_memory(p->error, EBPO_ATTRIBUTE_ARRAYS);
}

/* --- values --- */

ebpo_status ebpo_ply_attributes_reserve(ebpo_ply_parser *p, uint64_t faces)
{
    ebpo_attributes *to = p->mesh->attributes;
    if (!p->lost || faces <= p->faces_reserved)
        return EBPO_OK;
    uint64_t rows = faces < p->face_capacity ? p->face_capacity : faces;
    for (uint64_t i = 0; i < to->count; i++)
        if (ebpo_attribute_is_of(&to->array[i], "face") &&
            !ebpo_attribute_reserve(to->workspace, &to->array[i], rows, 0))
            return fail_rows(p, rows * 8);
    p->faces_reserved = rows;
    return EBPO_OK;
}

void ebpo_ply_store_bits(uint8_t *at, unsigned bytes, uint64_t bits)
{
    uint8_t b1 = (uint8_t)bits;
    uint16_t b2 = (uint16_t)bits;
    uint32_t b4 = (uint32_t)bits;
    switch (bytes) {
    case 1: memcpy(at, &b1, 1); break;
    case 2: memcpy(at, &b2, 2); break;
    case 4: memcpy(at, &b4, 4); break;
    default: memcpy(at, &bits, 8);
    }
}

void ebpo_ply_put_value(const ebpo_ply_parser *p, const ebpo_ply_property *property, uint64_t row,
                        uint64_t bits)
{
    ebpo_attribute *a = &p->mesh->attributes->array[property->attribute];
    unsigned bytes = ebpo_ply_type_bytes(property->type);
    ebpo_ply_store_bits(a->values + (row * a->columns + property->column) * bytes, bytes, bits);
}

ebpo_status ebpo_ply_put_list(ebpo_ply_parser *p, const ebpo_ply_property *property, uint64_t row,
                              uint64_t count, uint8_t **items)
{
    ebpo_attribute *a = &p->mesh->attributes->array[property->attribute];
    unsigned bytes = ebpo_ply_type_bytes(property->type);
    uint64_t begin = row ? a->ends[row - 1] : 0;
    if (!ebpo_attribute_reserve(p->mesh->workspace, a, row + 1, begin + count))
        return fail_rows(p, (begin + count) * bytes);
    a->ends[row] = begin + count;
    *items = a->values ? a->values + begin * bytes : NULL; /* NULL while all rows are empty */
    return EBPO_OK;
}

/* Returns true if an integer type can hold the value. */
static bool value_fits(int64_t value, ebpo_ply_type type)
{
    static const int64_t least[] = { INT8_MIN, 0, INT16_MIN, 0, INT32_MIN, 0 },
                         most[] = { INT8_MAX,   UINT8_MAX, INT16_MAX,
                                    UINT16_MAX, INT32_MAX, UINT32_MAX };
    return value >= least[type] && value <= most[type];
}

/* Converts text to the bits of a value, in the low bytes of *bits. Returns false if the text is not
 * a value of the type. */
static bool text_bits(ebpo_ply_parser *p, ebpo_ply_type type, ebpo_ply_word token, uint64_t *bits)
{
    int64_t whole;
    float narrow;
    uint32_t narrow_bits = 0;
    double wide;
    bool kept;
    switch (type) {
    case EBPO_PLY_FLOAT32:
        if (!ebpo_number_float_kept(&narrow, &kept, token.s, token.n, p->c_locale))
            return false;
        p->rounded += !kept;
        memcpy(&narrow_bits, &narrow, sizeof narrow);
        *bits = narrow_bits;
        return true;
    case EBPO_PLY_FLOAT64:
        if (!ebpo_number_double(&wide, token.s, token.n, p->c_locale))
            return false;
        memcpy(bits, &wide, sizeof wide);
        return true;
    default:
        if (!ebpo_number_integer(&whole, token.s, token.n) || !value_fits(whole, type))
            return false;
        *bits = (uint64_t)whole;
        return true;
    }
}

uint64_t ebpo_ply_text_bits(ebpo_ply_parser *p, const ebpo_ply_property *property,
                            ebpo_ply_word token, uint64_t row)
{
    uint64_t bits = 0;
    if (text_bits(p, property->type, token, &bits) || p->lost[property->attribute])
        return bits;
    char text[EBPO_IMPORT_WORD_TEXT], name[EBPO_IMPORT_WORD_TEXT];
    ebpo_import_word_text(text, token.s, token.n);
    ebpo_import_word_text(name, property->name.s, property->name.n);
    const ebpo_attribute *a = &p->mesh->attributes->array[property->attribute];
    ebpo_attributes_lose(p->mesh->attributes,
                         "property '%s' of '%s' (row %" PRIu64
                         " has '%s', which does not fit its type)",
                         name, a->element, row, text);
    p->lost[property->attribute] = true;
    return 0;
}

/* --- polygons --- */

/* Copies a row to the rows from row + 1 to end - 1: all triangles of a polygon have its values. */
static void repeat_columns(const ebpo_attribute *a, uint64_t row, uint64_t end)
{
    size_t bytes = a->columns * (size_t)ebpo_attribute_bytes(a->type);
    for (uint64_t i = row + 1; i < end; i++)
        memcpy(a->values + i * bytes, a->values + row * bytes, bytes);
}

/* Copies of lists take at most REPEATED_LEAST bytes, plus REPEATED_FACTOR times the size of the
 * file. Without this limit, a polygon of n corners with a list of n items could make n * n items of
 * a small file. */
#define REPEATED_LEAST  (UINT64_C(1) << 30)
#define REPEATED_FACTOR 64

/* Copies the list of a row to the rows from row + 1 to end - 1. If the copies exceed the limit, the
 * mesh will not have this attribute, which is recorded. */
static ebpo_status repeat_list(ebpo_ply_parser *p, uint64_t array, uint64_t row, uint64_t end)
{
    ebpo_attribute *a = &p->mesh->attributes->array[array];
    size_t bytes = ebpo_attribute_bytes(a->type);
    uint64_t begin = row ? a->ends[row - 1] : 0, count = a->ends[row] - begin;
    uint64_t left = REPEATED_LEAST + REPEATED_FACTOR * p->size - p->repeated_bytes;
    if (count && !p->lost[array] && end - row - 1 > left / bytes / count) {
        ebpo_attributes_lose(p->mesh->attributes,
                             "property '%s' of 'face' (copies for all triangles of the polygons "
                             "take more than 1 GiB and 64 times the file)",
                             a->names);
        p->lost[array] = true;
    }
    count = p->lost[array] ? 0 : count;
    p->repeated_bytes += (end - row - 1) * count * bytes;
    if (!ebpo_attribute_reserve(p->mesh->workspace, a, end, a->ends[row] + (end - row - 1) * count))
        return fail_rows(p, (end - row) * count * bytes);
    for (uint64_t i = row + 1; i < end; i++) {
        if (count)
            memcpy(a->values + a->ends[i - 1] * bytes, a->values + begin * bytes, count * bytes);
        a->ends[i] = a->ends[i - 1] + count;
    }
    return EBPO_OK;
}

ebpo_status ebpo_ply_repeat_face(ebpo_ply_parser *p, uint64_t row)
{
    uint64_t end = p->mesh->face_count;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; p->lost && end > row + 1 && i < p->mesh->attributes->count; i++) {
        ebpo_attribute *a = &p->mesh->attributes->array[i];
        if (!ebpo_attribute_is_of(a, "face") || status != EBPO_OK)
            continue;
        if (a->list == EBPO_ATTRIBUTE_NO_LIST)
            repeat_columns(a, row, end);
        else
            status = repeat_list(p, i, row, end);
    }
    return status;
}

/* --- strips --- */

void ebpo_ply_blank_faces(ebpo_ply_parser *p, uint64_t first)
{
    uint64_t end = p->mesh->face_count;
    for (uint64_t i = 0; p->lost && i < p->mesh->attributes->count; i++) {
        ebpo_attribute *a = &p->mesh->attributes->array[i];
        size_t bytes = a->columns * (size_t)ebpo_attribute_bytes(a->type);
        if (!ebpo_attribute_is_of(a, "face"))
            continue;
        if (a->list == EBPO_ATTRIBUTE_NO_LIST)
            ebpo_array_fill(p->mesh->workspace, a->values + first * bytes, 0,
                            (end - first) * bytes);
        for (uint64_t k = first; k < end && a->list != EBPO_ATTRIBUTE_NO_LIST; k++)
            a->ends[k] = k ? a->ends[k - 1] : 0;
    }
}

/* --- the end --- */

/* Returns true if the header has no information beyond the mesh. */
static bool is_plain(const ebpo_ply_header *h)
{
    static const char *const names[] = { "x", "y", "z", "vertex_indices" };
    if (h->notes || h->elements != 2 || h->vertex != 0 || h->face != 1 || h->properties != 4)
        return false;
    for (int i = 0; i < 4; i++) {
        const ebpo_ply_property *property = &h->property[i];
        bool type =
            i < 3 ? property->type == h->property[0].type && property->type >= EBPO_PLY_FLOAT32
                  : property->count_type == EBPO_PLY_UINT8 && property->type == EBPO_PLY_INT32;
        if (!type || property->name.n != strlen(names[i]) ||
            memcmp(property->name.s, names[i], property->name.n) != 0)
            return false;
    }
    return true;
}

/* Copies the header lines unchanged, each ended by one line feed. The first line is exactly "ply".
 */
static ebpo_status keep_header(ebpo_ply_parser *p)
{
    ebpo_attributes *to = p->mesh->attributes;
    to->header = ebpo_alloc(p->header.body, 1);
    if (!to->header)
        return ebpo_fail_memory(p->error, p->header.body);
    memcpy(to->header, "ply", to->header_bytes = 3);
    char unused;
    const char *first = ebpo_ply_first_line(p->data, p->size, &unused);
    for (uint64_t i = (uint64_t)(first - (const char *)p->data); i < p->header.body; i++) {
        char c = (char)p->data[i];
        bool end = c == p->header.line_end;
        if (end && p->header.line_end == '\n' && to->header_bytes &&
            to->header[to->header_bytes - 1] == '\r')
            to->header_bytes--;
        to->header[to->header_bytes++] = end ? '\n' : c;
    }
    return EBPO_OK;
}

ebpo_status ebpo_ply_attributes_end(ebpo_ply_parser *p)
{
    ebpo_attributes *to = p->mesh->attributes;
    if (!p->lost)
        return EBPO_OK;
    ebpo_status status = is_plain(&p->header) ? EBPO_OK : keep_header(p);
    if (p->header.encoding != EBPO_PLY_ASCII && p->at < p->size)
        ebpo_attributes_lose(to, "bytes after the last element: %" PRIu64, p->size - p->at);
    if (p->rounded)
        ebpo_attributes_lose(to, "digits of values that the header declares as float: %" PRIu64,
                             p->rounded);
    for (uint64_t i = to->count; i-- > 0;) {
        ebpo_attribute *a = &to->array[i];
        if (ebpo_attribute_is_of(a, "face"))
            a->rows = p->mesh->face_count;
        if (p->lost[i])
            ebpo_attributes_remove(to, i);
        else if (a->list != EBPO_ATTRIBUTE_NO_LIST)
            ebpo_attribute_even_out(to->workspace, a);
    }
    if (!to->header && !to->count && !to->lost[0]) {
        ebpo_attributes_free(to);
        p->mesh->attributes = NULL;
    }
    return status;
}
