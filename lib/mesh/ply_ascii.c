/* Reads the body of an ascii PLY file. White space separates values, so a long list may span
 * several lines. The end of a row is also the end of a line. Extra values at the end of a line,
 * such as MeshLab has written, are counted and skipped. Without skipping, all following rows would
 * be read wrongly. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>

#include "core/error.h"
#include "geometry/decimal.h"
#include "mesh/ply_parts.h"

/* The reading of the rows of an element. */
typedef struct rows {
    ebpo_ply_parser *p;
    const ebpo_ply_element *element;
    uint64_t row; /* index of the current row */
    uint64_t to;  /* row in the attribute arrays; for a face, the row of its first triangle */
    bool store;   /* false: values are skipped */
    /* true: extra values are counted. Elements that precede the vertices are read twice;
     * `count_surplus` is false in the first pass, so that nothing is counted twice */
    bool count_surplus;
    uint64_t line; /* line where the row begins */
} rows;

static bool is_blank(uint8_t c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

/* Reads the next token. Returns false at the end of the file. */
static bool next_token(ebpo_ply_parser *p, ebpo_ply_word *token)
{
    const uint8_t *at = p->data + p->at, *end = p->data + p->size;
    for (; at < end && is_blank(*at); at++)
        p->line += *at == (uint8_t)p->header.line_end;
    token->s = (const char *)at;
    while (at < end && !is_blank(*at))
        at++;
    token->n = (size_t)((const char *)at - token->s);
    p->at = (uint64_t)(at - p->data);
    return token->n > 0;
}

static ebpo_status fail_token(const rows *r, const char *what, ebpo_ply_word token)
{
    char text[EBPO_IMPORT_WORD_TEXT];
    ebpo_import_word_text(text, token.s, token.n);
    return ebpo_ply_fail(r->p, "%s '%s' in %s %" PRIu64 "; repair the file", what, text,
                         ebpo_ply_row_name(r->element), r->row);
}

static ebpo_status next_integer(rows *r, int64_t *value)
{
    ebpo_ply_word token;
    if (!next_token(r->p, &token))
        return ebpo_ply_fail_end(r->p, r->element, r->row);
    if (!ebpo_number_integer(value, token.s, token.n))
        return fail_token(r, "invalid integer", token);
    return EBPO_OK;
}

/* Reads a coordinate that the header declares as float. If the float differs from the text, records
 * the rounding error. Query points (p->strict) have no such record, so they keep the double.
 * Returns false if the text is not a number. */
static bool parse_float(ebpo_ply_parser *p, ebpo_ply_word token, double *value)
{
    float narrow;
    bool kept;
    double wide;
    if (!ebpo_number_float_kept(&narrow, &kept, token.s, token.n, p->c_locale))
        return false;
    *value = (double)narrow;
    if (kept || !ebpo_number_double(&wide, token.s, token.n, p->c_locale))
        return true;
    p->max_rounded = fmax(p->max_rounded, fabs(wide - *value));
    if (p->strict)
        *value = wide;
    return true;
}

/* Stores a coordinate. Returns false if the text is not a number of the declared type. */
static bool parse_coordinate(const rows *r, const ebpo_ply_property *property, ebpo_ply_word token)
{
    ebpo_ply_parser *p = r->p;
    ebpo_mesh *mesh = p->mesh;
    uint64_t place = 3 * r->row + (uint64_t)(property->role - EBPO_PLY_ROLE_X);
    double value = 0;
    int64_t whole = 0;
    bool good = property->type == EBPO_PLY_FLOAT32 ? parse_float(p, token, &value)
                : property->type == EBPO_PLY_FLOAT64
                    ? ebpo_number_double(&value, token.s, token.n, p->c_locale)
                    : ebpo_number_integer(&whole, token.s, token.n);
    if (property->type < EBPO_PLY_FLOAT32)
        value = (double)whole;
    if (mesh->xyz32)
        mesh->xyz32[place] = (float)value;
    else
        mesh->xyz64[place] = value;
    return good;
}

/* Reads the vertex indices of a face or strip into p->corners. */
static ebpo_status read_corners(rows *r, uint64_t count)
{
    ebpo_ply_parser *p = r->p;
    ebpo_status status = ebpo_ply_reserve_corners(p, count);
    uint64_t vertices = p->header.element[p->header.vertex].count;
    bool strips = r->element->kind == EBPO_PLY_KIND_STRIPS;
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        int64_t index;
        status = next_integer(r, &index);
        if (status != EBPO_OK)
            break;
        if (strips && (index == -1 || index == UINT32_MAX))
            p->corners[i] = EBPO_PLY_RESTART;
        else if ((uint64_t)index >= vertices)
            status = ebpo_ply_fail_index(p, r->element, r->row, index);
        else
            p->corners[i] = (uint32_t)index;
    }
    p->corner_count = count;
    return status;
}

static ebpo_status skip_tokens(rows *r, uint64_t count)
{
    ebpo_ply_word token;
    for (uint64_t i = 0; i < count; i++)
        if (!next_token(r->p, &token))
            return ebpo_ply_fail_end(r->p, r->element, r->row);
    return EBPO_OK;
}

static ebpo_status store_list(rows *r, const ebpo_ply_property *property, uint64_t count)
{
    unsigned bytes = ebpo_ply_type_bytes(property->type);
    uint8_t *items;
    ebpo_status status = ebpo_ply_put_list(r->p, property, r->to, count, &items);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        ebpo_ply_word token;
        if (!next_token(r->p, &token))
            return ebpo_ply_fail_end(r->p, r->element, r->row);
        ebpo_ply_store_bits(items + i * bytes, bytes,
                            ebpo_ply_text_bits(r->p, property, token, r->row));
    }
    return status;
}

static ebpo_status read_list(rows *r, const ebpo_ply_property *property)
{
    ebpo_ply_parser *p = r->p;
    int64_t count;
    ebpo_status status = next_integer(r, &count);
    if (status != EBPO_OK)
        return status;
    if (count < 0)
        return ebpo_ply_fail(p, "%s %" PRIu64 " has a list of %" PRId64 " items; repair the file",
                             ebpo_ply_row_name(r->element), r->row, count);
    if ((uint64_t)count > (p->size - p->at) / 2) { /* each item has at least a blank and a digit */
        return ebpo_ply_fail(
            p,
            "%s %" PRIu64 " has a list of %" PRId64
            " items, more than the rest of the file can hold; it is cut short or damaged",
            ebpo_ply_row_name(r->element), r->row, count);
    }
    if (r->store && property->role == EBPO_PLY_ROLE_CORNERS)
        return read_corners(r, (uint64_t)count);
    if (r->store && ebpo_ply_is_attribute(property))
        return store_list(r, property, (uint64_t)count);
    return skip_tokens(r, (uint64_t)count);
}

static ebpo_status read_property(rows *r, const ebpo_ply_property *property)
{
    if (property->list)
        return read_list(r, property);
    ebpo_ply_word token;
    if (!next_token(r->p, &token))
        return ebpo_ply_fail_end(r->p, r->element, r->row);
    if (r->store && property->role != EBPO_PLY_ROLE_NONE && !parse_coordinate(r, property, token))
        return fail_token(r,
                          property->type < EBPO_PLY_FLOAT32 ? "invalid integer" : "invalid number",
                          token);
    if (r->store && ebpo_ply_is_attribute(property))
        ebpo_ply_put_value(r->p, property, r->to,
                           ebpo_ply_text_bits(r->p, property, token, r->row));
    return EBPO_OK;
}

static bool ends_line(uint8_t c) { return c == '\n' || c == '\r'; }

/* Returns true if the line has more text. */
static bool more_here(ebpo_ply_parser *p)
{
    while (p->at < p->size && is_blank(p->data[p->at]) && !ends_line(p->data[p->at]))
        p->at++;
    return p->at < p->size && !ends_line(p->data[p->at]);
}

/* Counts extra values between the end of a row and the end of the line. If the row began in an
 * earlier line, this row or an earlier row has too few or too many values, which is an error. */
static ebpo_status end_row(rows *r)
{
    ebpo_ply_parser *p = r->p;
    ebpo_ply_word token;
    uint64_t before = p->surplus_values;
    while (more_here(p)) {
        next_token(p, &token);
        if (p->strict)
            return fail_token(r, "more values than the header describes:", token);
        if (p->line != r->line)
            return ebpo_ply_fail(p,
                                 "%s %" PRIu64 " began in line %" PRIu64
                                 " and ends within this line: a row has "
                                 "too few or too many values; repair the "
                                 "file",
                                 ebpo_ply_row_name(r->element), r->row, r->line);
        p->surplus_values += r->count_surplus;
    }
    p->surplus_rows += p->surplus_values > before;
    return EBPO_OK;
}

/* Skips white space before a row, and records the line where the row begins. */
static void begin_row(rows *r)
{
    ebpo_ply_parser *p = r->p;
    for (; p->at < p->size && is_blank(p->data[p->at]); p->at++)
        p->line += p->data[p->at] == (uint8_t)p->header.line_end;
    r->line = p->line;
}

static ebpo_status read_row(rows *r)
{
    const ebpo_ply_property *property = r->p->header.property + r->element->first;
    bool face = r->element->kind == EBPO_PLY_KIND_FACE;
    begin_row(r);
    r->to = face ? r->p->mesh->face_count : r->row;
    ebpo_status status = face && r->store ? ebpo_ply_attributes_reserve(r->p, r->to + 1) : EBPO_OK;
    for (uint64_t i = 0; i < r->element->properties && status == EBPO_OK; i++)
        status = read_property(r, property + i);
    if (status == EBPO_OK)
        status = end_row(r);
    if (status == EBPO_OK && r->store && r->element->kind == EBPO_PLY_KIND_FACE)
        return ebpo_ply_add_polygon(r->p, r->row);
    if (status == EBPO_OK && r->store && r->element->kind == EBPO_PLY_KIND_STRIPS)
        return ebpo_ply_add_strip(r->p, r->row);
    return status;
}

bool ebpo_ply_ascii_more(ebpo_ply_parser *p)
{
    ebpo_ply_word token;
    return next_token(p, &token);
}

ebpo_status ebpo_ply_ascii_element(ebpo_ply_parser *p, const ebpo_ply_element *element, bool store)
{
    rows r = { .p = p,
               .element = element,
               .count_surplus = store,
               .store = store && (element->kind != EBPO_PLY_KIND_OTHER || p->lost) };
    ebpo_status status = EBPO_OK;
    if (!element->properties) /* rows without values have no text */
        return EBPO_OK;
    for (; r.row < element->count && status == EBPO_OK; r.row++) {
        status = read_row(&r);
        if (status == EBPO_OK && ebpo_ply_report_due(p))
            status = ebpo_ply_report(p);
    }
    return status;
}
