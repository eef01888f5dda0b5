/* The body of a binary PLY file, of either byte order. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <string.h>

#include "core/error.h"
#include "mesh/ply_attributes.h"
#include "mesh/ply_binary.h"
#include "mesh/ply_faces.h"
#include "mesh/ply_number.h"
#include "mesh/ply_plain.h"

#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
enum { FOREIGN = PLY_BIG };
#else
enum { FOREIGN = PLY_LITTLE };
#endif

typedef struct rows {
    ply_parser *p;
    const ply_element *element;
    uint64_t row;
    uint64_t to; /* of attributes: of a face that of its first triangle */
    bool swap;   /* the file's byte order is not the machine's */
    bool store;
} rows;

static ebpo_status store_corners(rows *r, const ply_property *property, uint64_t count)
{
    ply_parser *p = r->p;
    ebpo_status status = ebpo_ply_reserve_corners(p, count);
    if (status != EBPO_OK)
        return status;
    uint64_t vertices = p->header.element[p->header.vertex].count;
    bool strips = r->element->kind == PLY_KIND_STRIPS;
    unsigned bytes = ebpo_ply_type_bytes(property->type);
    for (uint64_t i = 0; i < count; i++) {
        int64_t index = ebpo_ply_load_integer(p->data + p->at + i * bytes, property->type, r->swap);
        if (strips && (index == -1 || index == UINT32_MAX)) {
            p->corners[i] = PLY_RESTART;
        } else if ((uint64_t)index >= vertices) {
            p->at += i * bytes;
            return ebpo_ply_fail_index(p, r->element, r->row, index);
        } else {
            p->corners[i] = (uint32_t)index;
        }
    }
    p->corner_count = count;
    return EBPO_OK;
}

static ebpo_status store_list(rows *r, const ply_property *property, uint64_t count)
{
    ply_parser *p = r->p;
    unsigned bytes = ebpo_ply_type_bytes(property->type);
    uint8_t *items;
    ebpo_status status = ebpo_ply_put_list(p, property, r->to, count, &items);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        ebpo_ply_store_bits(items + i * bytes, bytes,
                            ebpo_ply_load(p->data + p->at + i * bytes, bytes, r->swap));
    return status;
}

static ebpo_status read_list(rows *r, const ply_property *property)
{
    ply_parser *p = r->p;
    unsigned count_bytes = ebpo_ply_type_bytes(property->count_type),
             bytes = ebpo_ply_type_bytes(property->type);
    if (p->size - p->at < count_bytes)
        return ebpo_ply_fail_end(p, r->element, r->row);
    int64_t count = ebpo_ply_load_integer(p->data + p->at, property->count_type, r->swap);
    if (count < 0)
        return ebpo_ply_fail(p,
                             "%s %" PRIu64 " has a list of %" PRId64 " items; the file is damaged",
                             ebpo_ply_row_name(r->element), r->row, count);
    if ((uint64_t)count * bytes >
        p->size - p->at - count_bytes) /* no overflow: counts have 32 bits at most */
        return ebpo_ply_fail_end(p, r->element, r->row);
    p->at += count_bytes;
    ebpo_status status = EBPO_OK;
    if (r->store && property->role == PLY_ROLE_CORNERS)
        status = store_corners(r, property, (uint64_t)count);
    else if (r->store && ebpo_ply_is_attribute(property))
        status = store_list(r, property, (uint64_t)count);
    if (status == EBPO_OK)
        p->at += (uint64_t)count * bytes;
    return status;
}

/* The row's number among attributes, with room for it. */
static ebpo_status begin_row(rows *r)
{
    bool face = r->element->kind == PLY_KIND_FACE;
    r->to = face ? r->p->mesh->face_count : r->row;
    return face && r->store ? ebpo_ply_attributes_reserve(r->p, r->to + 1) : EBPO_OK;
}

static ebpo_status read_row(rows *r)
{
    ply_parser *p = r->p;
    const ply_property *property = p->header.property + r->element->first;
    ebpo_status begun = begin_row(r);
    if (begun != EBPO_OK)
        return begun;
    for (uint64_t i = 0; i < r->element->properties; i++, property++) {
        if (property->list) {
            ebpo_status status = read_list(r, property);
            if (status != EBPO_OK)
                return status;
            continue;
        }
        unsigned bytes = ebpo_ply_type_bytes(property->type);
        if (p->size - p->at < bytes)
            return ebpo_ply_fail_end(p, r->element, r->row);
        if (r->store && property->role != PLY_ROLE_NONE)
            ebpo_ply_store_coordinate(p->mesh, r->row, property, p->data + p->at, r->swap);
        else if (r->store && ebpo_ply_is_attribute(property))
            ebpo_ply_put_value(p, property, r->to, ebpo_ply_load(p->data + p->at, bytes, r->swap));
        p->at += bytes;
    }
    if (r->store && r->element->kind == PLY_KIND_FACE)
        return ebpo_ply_add_polygon(p, r->row);
    if (r->store && r->element->kind == PLY_KIND_STRIPS)
        return ebpo_ply_add_strip(p, r->row);
    return EBPO_OK;
}

/* Rows of one size need no reading to be stepped over. */
static ebpo_status step_over(rows *r)
{
    ply_parser *p = r->p;
    uint64_t bytes = r->element->row_bytes, count = r->element->count;
    if (bytes && count > (p->size - p->at) / bytes) {
        r->row = (p->size - p->at) / bytes;
        return ebpo_ply_fail_end(p, r->element, r->row);
    }
    p->at += count * bytes;
    return EBPO_OK;
}

ebpo_status ebpo_ply_binary_element(ply_parser *p, const ply_element *element, bool store)
{
    rows r = { .p = p,
               .element = element,
               .swap = (int)p->header.encoding == (int)FOREIGN,
               .store = store && (element->kind != PLY_KIND_OTHER || p->lost) };
    if (!element->properties || (!r.store && !element->has_list))
        return step_over(&r);
    ebpo_status status = EBPO_OK;
    if (r.store && (element->kind == PLY_KIND_VERTEX || element->kind == PLY_KIND_OTHER))
        status = ebpo_ply_plain_vertices(p, element, r.swap, &r.row);
    else if (r.store && element->kind == PLY_KIND_FACE)
        status = ebpo_ply_plain_faces(p, element, r.swap, &r.row);
    for (; r.row < element->count && status == EBPO_OK; r.row++) {
        status = read_row(&r);
        if (status == EBPO_OK && ebpo_ply_report_due(p))
            status = ebpo_ply_report(p);
    }
    return status;
}
