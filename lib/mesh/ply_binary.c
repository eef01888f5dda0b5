/* Reads the body of a binary PLY file, of either byte order. Rows of equal size are read on all
 * cores. Other rows are read one by one, which also locates errors. Positions go to the mesh, faces
 * are triangulated, and other properties go to the attributes.
 *
 * Source: Greg Turk, "The PLY Polygon File Format", 1994. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <string.h>

#include <ebpo/mesh.h>

#include "core/workspace.h"
#include "core/error.h"
#include "core/parallel.h"
#include "mesh/ply_parts.h"

/* --- numbers --- */

/* Reads the bits of a value. `swap`: reverses the byte order. */
static inline uint64_t load_raw(const uint8_t *at, unsigned bytes, bool swap)
{
    uint8_t b1;
    uint16_t b2;
    uint32_t b4;
    uint64_t b8;
    switch (bytes) {
    case 1: memcpy(&b1, at, 1); return b1;
    case 2: memcpy(&b2, at, 2); return swap ? __builtin_bswap16(b2) : b2;
    case 4: memcpy(&b4, at, 4); return swap ? __builtin_bswap32(b4) : b4;
    default: memcpy(&b8, at, 8); return swap ? __builtin_bswap64(b8) : b8;
    }
}

static inline int64_t load_integer(const uint8_t *at, ebpo_ply_type type, bool swap)
{
    uint64_t raw = load_raw(at, ebpo_ply_type_bytes(type), swap);
    switch (type) {
    case EBPO_PLY_INT8: return (int8_t)raw;
    case EBPO_PLY_INT16: return (int16_t)raw;
    case EBPO_PLY_INT32: return (int32_t)raw;
    default: return (int64_t)raw;
    }
}

static float load_float(const uint8_t *at, bool swap)
{
    uint32_t raw = (uint32_t)load_raw(at, 4, swap);
    float value;
    memcpy(&value, &raw, sizeof value);
    return value;
}

static double load_number(const uint8_t *at, ebpo_ply_type type, bool swap)
{
    if (type == EBPO_PLY_FLOAT32)
        return (double)load_float(at, swap);
    if (type != EBPO_PLY_FLOAT64)
        return (double)load_integer(at, type, swap);
    uint64_t raw = load_raw(at, 8, swap);
    double value;
    memcpy(&value, &raw, sizeof value);
    return value;
}

/* Copies floats as bits, so the payload of a NaN does not change. */
static void store_coordinate(ebpo_mesh *mesh, uint64_t row, const ebpo_ply_property *property,
                             const uint8_t *at, bool swap)
{
    uint64_t place = 3 * row + (uint64_t)(property->role - EBPO_PLY_ROLE_X);
    if (mesh->xyz64) {
        mesh->xyz64[place] = load_number(at, property->type, swap);
    } else {
        uint32_t raw = (uint32_t)load_raw(at, 4, swap);
        memcpy(&mesh->xyz32[place], &raw, sizeof raw);
    }
}

/* The encoding whose byte order is not the machine's. */
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
enum { FOREIGN = EBPO_PLY_BIG };
#else
enum { FOREIGN = EBPO_PLY_LITTLE };
#endif

/* The row-by-row reading of an element. */
typedef struct rows {
    ebpo_ply_parser *p;
    const ebpo_ply_element *element;
    uint64_t row; /* index of the current row */
    uint64_t to;  /* row in the attribute arrays; for a face, the row of its first triangle */
    bool swap;    /* the file's byte order differs from the machine's */
    bool store;   /* false: values are skipped */
} rows;

/* Reads the vertex indices of a face or strip into p->corners. On failure, p->at is the offset of
 * the invalid index. */
static ebpo_status store_corners(rows *r, const ebpo_ply_property *property, uint64_t count)
{
    ebpo_ply_parser *p = r->p;
    ebpo_status status = ebpo_ply_reserve_corners(p, count);
    if (status != EBPO_OK)
        return status;
    uint64_t vertices = p->header.element[p->header.vertex].count;
    bool strips = r->element->kind == EBPO_PLY_KIND_STRIPS;
    unsigned bytes = ebpo_ply_type_bytes(property->type);
    for (uint64_t i = 0; i < count; i++) {
        int64_t index = load_integer(p->data + p->at + i * bytes, property->type, r->swap);
        if (strips && (index == -1 || index == UINT32_MAX)) {
            p->corners[i] = EBPO_PLY_RESTART;
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

static ebpo_status store_list(rows *r, const ebpo_ply_property *property, uint64_t count)
{
    ebpo_ply_parser *p = r->p;
    unsigned bytes = ebpo_ply_type_bytes(property->type);
    uint8_t *items;
    ebpo_status status = ebpo_ply_put_list(p, property, r->to, count, &items);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        ebpo_ply_store_bits(items + i * bytes, bytes,
                            load_raw(p->data + p->at + i * bytes, bytes, r->swap));
    return status;
}

static ebpo_status read_list(rows *r, const ebpo_ply_property *property)
{
    ebpo_ply_parser *p = r->p;
    unsigned count_bytes = ebpo_ply_type_bytes(property->count_type),
             bytes = ebpo_ply_type_bytes(property->type);
    if (p->size - p->at < count_bytes)
        return ebpo_ply_fail_end(p, r->element, r->row);
    int64_t count = load_integer(p->data + p->at, property->count_type, r->swap);
    if (count < 0)
        return ebpo_ply_fail(p,
                             "%s %" PRIu64 " has a list of %" PRId64 " items; the file is damaged",
                             ebpo_ply_row_name(r->element), r->row, count);
    /* counts have at most 32 bits, so nothing overflows */
    if ((uint64_t)count * bytes > p->size - p->at - count_bytes)
        return ebpo_ply_fail_end(p, r->element, r->row);
    p->at += count_bytes;
    ebpo_status status = EBPO_OK;
    if (r->store && property->role == EBPO_PLY_ROLE_CORNERS)
        status = store_corners(r, property, (uint64_t)count);
    else if (r->store && ebpo_ply_is_attribute(property))
        status = store_list(r, property, (uint64_t)count);
    if (status == EBPO_OK)
        p->at += (uint64_t)count * bytes;
    return status;
}

/* Sets the row in the attribute arrays, and reserves space for this row. */
static ebpo_status begin_row(rows *r)
{
    bool face = r->element->kind == EBPO_PLY_KIND_FACE;
    r->to = face ? r->p->mesh->face_count : r->row;
    return face && r->store ? ebpo_ply_attributes_reserve(r->p, r->to + 1) : EBPO_OK;
}

static ebpo_status read_row(rows *r)
{
    ebpo_ply_parser *p = r->p;
    const ebpo_ply_property *property = p->header.property + r->element->first;
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
        if (r->store && property->role != EBPO_PLY_ROLE_NONE)
            store_coordinate(p->mesh, r->row, property, p->data + p->at, r->swap);
        else if (r->store && ebpo_ply_is_attribute(property))
            ebpo_ply_put_value(p, property, r->to, load_raw(p->data + p->at, bytes, r->swap));
        p->at += bytes;
    }
    if (r->store && r->element->kind == EBPO_PLY_KIND_FACE)
        return ebpo_ply_add_polygon(p, r->row);
    if (r->store && r->element->kind == EBPO_PLY_KIND_STRIPS)
        return ebpo_ply_add_strip(p, r->row);
    return EBPO_OK;
}

/* Skips rows of equal size without reading them. */
static ebpo_status step_over(rows *r)
{
    ebpo_ply_parser *p = r->p;
    uint64_t bytes = r->element->row_bytes, count = r->element->count;
    if (bytes && count > (p->size - p->at) / bytes) {
        r->row = (p->size - p->at) / bytes;
        return ebpo_ply_fail_end(p, r->element, r->row);
    }
    p->at += count * bytes;
    return EBPO_OK;
}

static ebpo_status read_plain_vertices(ebpo_ply_parser *p, const ebpo_ply_element *element,
                                       bool swap, uint64_t *done);
static ebpo_status read_plain_faces(ebpo_ply_parser *p, const ebpo_ply_element *element, bool swap,
                                    uint64_t *done);

ebpo_status ebpo_ply_binary_element(ebpo_ply_parser *p, const ebpo_ply_element *element, bool store)
{
    rows r = { .p = p,
               .element = element,
               .swap = (int)p->header.encoding == (int)FOREIGN,
               .store = store && (element->kind != EBPO_PLY_KIND_OTHER || p->lost) };
    if (!element->properties || (!r.store && !element->has_list))
        return step_over(&r);
    ebpo_status status = EBPO_OK;
    if (r.store && (element->kind == EBPO_PLY_KIND_VERTEX || element->kind == EBPO_PLY_KIND_OTHER))
        status = read_plain_vertices(p, element, r.swap, &r.row);
    else if (r.store && element->kind == EBPO_PLY_KIND_FACE)
        status = read_plain_faces(p, element, r.swap, &r.row);
    for (; r.row < element->count && status == EBPO_OK; r.row++) {
        status = read_row(&r);
        if (status == EBPO_OK && ebpo_ply_report_due(p))
            status = ebpo_ply_report(p);
    }
    return status;
}

/* --- rows of equal size, on all cores: vertices without lists, and triangles --- */

enum { GRAIN = 1 << 14 }; /* number of rows for each call of a thread's function */

typedef struct plain {
    ebpo_ply_parser *p;
    const ebpo_ply_element *element;
    const ebpo_ply_property *corners; /* for faces */
    uint64_t row_bytes, corners_at;   /* size of a row; offset of its corner list */
    uint64_t first;                   /* index in the mesh of the face in row 0 */
    uint64_t deviates;                /* first row that is not a triangle of existing vertices */
    ebpo_progress progress;
    bool swap;
} plain;

/* Reports progress in bytes of the file, as the row-by-row reader does. */
static bool report_bytes(void *user, const char *stage, uint64_t done, uint64_t total)
{
    const plain *t = user;
    (void)total;
    return t->p->progress->report(t->p->progress->user, stage, t->p->at + done * t->row_bytes,
                                  t->p->size);
}

static void put_value(const plain *t, const ebpo_ply_property *property, uint64_t row,
                      const uint8_t *at)
{
    if (ebpo_ply_is_attribute(property))
        ebpo_ply_put_value(t->p, property, row,
                           load_raw(at, ebpo_ply_type_bytes(property->type), t->swap));
}

static ebpo_status read_vertices(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    const plain *t = context;
    const ebpo_ply_property *property = t->p->header.property + t->element->first;
    (void)worker, (void)error;
    const uint8_t *at = t->p->data + t->p->at + begin * t->row_bytes;
    for (uint64_t row = begin; row < end; row++)
        for (uint64_t i = 0; i < t->element->properties; i++) {
            if (property[i].role != EBPO_PLY_ROLE_NONE)
                store_coordinate(t->p->mesh, row, &property[i], at, t->swap);
            else
                put_value(t, &property[i], row, at);
            at += ebpo_ply_type_bytes(property[i].type);
        }
    return EBPO_OK;
}

/* Lowers t->deviates to `row` if t->deviates is greater. Returns an error, which ends the calling
 * thread's range. */
static ebpo_status record_deviation(plain *t, uint64_t row)
{
    uint64_t lowest = __atomic_load_n(&t->deviates, __ATOMIC_RELAXED);
    while (row < lowest && !__atomic_compare_exchange_n(&t->deviates, &lowest, row, true,
                                                        __ATOMIC_RELAXED, __ATOMIC_RELAXED))
        ;
    return EBPO_E_FORMAT;
}

/* Stores the other properties of a triangle's row. */
static void put_face(const plain *t, uint64_t row, const uint8_t *at)
{
    const ebpo_ply_property *property = t->p->header.property + t->element->first;
    for (uint64_t i = 0; i < t->element->properties; i++) {
        put_value(t, &property[i], t->first + row, at);
        at += property[i].list ? ebpo_ply_type_bytes(property[i].count_type) +
                                     3 * ebpo_ply_type_bytes(property[i].type)
                               : ebpo_ply_type_bytes(property[i].type);
    }
}

/* Reads faces. After a row that deviates, the offsets are wrong. The row-by-row reader reads this
 * row and all later rows again. */
static ebpo_status read_faces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    plain *t = context;
    uint64_t count = t->p->header.element[t->p->header.vertex].count;
    unsigned count_bytes = ebpo_ply_type_bytes(t->corners->count_type),
             bytes = ebpo_ply_type_bytes(t->corners->type);
    (void)worker, (void)error;
    const uint8_t *at = t->p->data + t->p->at + begin * t->row_bytes + t->corners_at;
    uint32_t *face = t->p->mesh->faces + 3 * (t->first + begin);
    for (uint64_t row = begin; row < end; row++, at += t->row_bytes) {
        for (unsigned k = 0; k <= 3; k++) {
            int64_t value =
                k ? load_integer(at + count_bytes + (k - 1) * bytes, t->corners->type, t->swap)
                  : load_integer(at, t->corners->count_type, t->swap);
            if (k ? (uint64_t)value >= count : value != 3)
                return record_deviation(t, row);
            if (k)
                *face++ = (uint32_t)value;
        }
        if (t->p->lost && t->element->properties > 1)
            put_face(t, row, at - t->corners_at);
    }
    return EBPO_OK;
}

/* Computes the layout of rows that are triangles. Returns false if the rows have another list, or
 * if the file or the face array is too small for all of them. */
static bool describe_triangles(plain *t)
{
    uint64_t at = 0;
    for (uint64_t i = 0; i < t->element->properties; i++) {
        const ebpo_ply_property *property = t->p->header.property + t->element->first + i;
        if (!property->list) {
            at += ebpo_ply_type_bytes(property->type);
            continue;
        }
        if (property->role != EBPO_PLY_ROLE_CORNERS || t->corners)
            return false;
        t->corners = property;
        t->corners_at = at;
        at += ebpo_ply_type_bytes(property->count_type) + 3 * ebpo_ply_type_bytes(property->type);
    }
    t->row_bytes = at;
    t->first = t->p->mesh->face_count;
    return t->corners && t->element->count <= (t->p->size - t->p->at) / t->row_bytes &&
           t->element->count <= t->p->face_capacity - t->first;
}

/* Calls `task` for all rows, on all cores. */
static ebpo_status run_on_rows(plain *t, ebpo_task_fn task)
{
    ebpo_ply_parser *p = t->p;
    bool watched = p->progress && p->progress->report;
    t->progress = (ebpo_progress){ watched ? report_bytes : NULL, t };
    ebpo_status status = ebpo_parallel_for(p->threads, p->mesh->workspace, t->element->count, GRAIN,
                                           task, t, &t->progress, "reading", NULL);
    return status == EBPO_E_CANCELLED ? ebpo_ply_fail_stopped(p) : status;
}

/* read_plain_vertices and read_plain_faces read rows of equal size from p->at on, and set *done to
 * the number of rows that were read. read_plain_vertices reads all rows or none. read_plain_faces
 * reads the rows before the first face that is not a triangle or has an invalid vertex index. The
 * row-by-row reader reads the other rows and reports their errors. */
static ebpo_status read_plain_vertices(ebpo_ply_parser *p, const ebpo_ply_element *element,
                                       bool swap, uint64_t *done)
{
    plain t = { .p = p, .element = element, .row_bytes = element->row_bytes, .swap = swap };
    *done = 0;
    if (element->has_list || !element->row_bytes ||
        element->count > (p->size - p->at) / element->row_bytes)
        return EBPO_OK;
    ebpo_status status = run_on_rows(&t, read_vertices);
    if (status == EBPO_OK) {
        *done = element->count;
        p->at += element->count * t.row_bytes;
    }
    return status;
}

static ebpo_status read_plain_faces(ebpo_ply_parser *p, const ebpo_ply_element *element, bool swap,
                                    uint64_t *done)
{
    plain t = { .p = p, .element = element, .swap = swap, .deviates = element->count };
    *done = 0;
    if (!describe_triangles(&t))
        return EBPO_OK;
    ebpo_status status = run_on_rows(&t, read_faces);
    if (status != EBPO_OK && status != EBPO_E_FORMAT)
        return status;
    *done = t.deviates;
    p->at += t.deviates * t.row_bytes;
    p->mesh->face_count += t.deviates;
    return EBPO_OK;
}
