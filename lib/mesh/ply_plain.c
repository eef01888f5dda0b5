/* Rows of one size, on all cores: vertices without lists, and faces as long as each is a triangle.
 */
#include "core/strict_fp.h"

#include "core/parallel.h"
#include "core/workspace.h"
#include "mesh/ply_attributes.h"
#include "mesh/ply_number.h"
#include "mesh/ply_plain.h"

enum { GRAIN = 1 << 14 };

typedef struct plain {
    ply_parser *p;
    const ply_element *element;
    const ply_property *corners;    /* faces */
    uint64_t row_bytes, corners_at; /* in a row */
    uint64_t first;                 /* face of the mesh that row 0 becomes */
    uint64_t deviates;              /* the first row that is no triangle of vertices that exist */
    ebpo_progress progress;
    bool swap;
} plain;

/* Reports rows as bytes of the file, as the row-by-row reader does. */
static bool report(void *user, const char *stage, uint64_t done, uint64_t total)
{
    const plain *t = user;
    (void)total;
    return t->p->progress->report(t->p->progress->user, stage, t->p->at + done * t->row_bytes,
                                  t->p->size);
}

static void put(const plain *t, const ply_property *property, uint64_t row, const uint8_t *at)
{
    if (ebpo_ply_is_attribute(property))
        ebpo_ply_put_value(t->p, property, row,
                           ebpo_ply_load(at, ebpo_ply_type_bytes(property->type), t->swap));
}

static ebpo_status vertices(void *context, uint64_t begin, uint64_t end, unsigned worker,
                            ebpo_error *error)
{
    const plain *t = context;
    const ply_property *property = t->p->header.property + t->element->first;
    (void)worker, (void)error;
    const uint8_t *at = t->p->data + t->p->at + begin * t->row_bytes;
    for (uint64_t row = begin; row < end; row++)
        for (uint64_t i = 0; i < t->element->properties; i++) {
            if (property[i].role != PLY_ROLE_NONE)
                ebpo_ply_store_coordinate(t->p->mesh, row, &property[i], at, t->swap);
            else
                put(t, &property[i], row, at);
            at += ebpo_ply_type_bytes(property[i].type);
        }
    return EBPO_OK;
}

static ebpo_status deviate(plain *t, uint64_t row)
{
    uint64_t known = __atomic_load_n(&t->deviates, __ATOMIC_RELAXED);
    while (row < known && !__atomic_compare_exchange_n(&t->deviates, &known, row, true,
                                                       __ATOMIC_RELAXED, __ATOMIC_RELAXED))
        ;
    return EBPO_E_FORMAT;
}

/* The other properties of a row of a triangle. */
static void put_face(const plain *t, uint64_t row, const uint8_t *at)
{
    const ply_property *property = t->p->header.property + t->element->first;
    for (uint64_t i = 0; i < t->element->properties; i++) {
        put(t, &property[i], t->first + row, at);
        at += property[i].list ? ebpo_ply_type_bytes(property[i].count_type) +
                                     3 * ebpo_ply_type_bytes(property[i].type)
                               : ebpo_ply_type_bytes(property[i].type);
    }
}

/* After a row that deviates nothing is where it was expected; those rows are read again. */
static ebpo_status faces(void *context, uint64_t begin, uint64_t end, unsigned worker,
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
            int64_t value = k ? ebpo_ply_load_integer(at + count_bytes + (k - 1) * bytes,
                                                      t->corners->type, t->swap)
                              : ebpo_ply_load_integer(at, t->corners->count_type, t->swap);
            if (k ? (uint64_t)value >= count : value != 3)
                return deviate(t, row);
            if (k)
                *face++ = (uint32_t)value;
        }
        if (t->p->lost && t->element->properties > 1)
            put_face(t, row, at - t->corners_at);
    }
    return EBPO_OK;
}

/* Fills in what is known of rows of triangles; false when rows have another list, or would not fit.
 */
static bool describe_triangles(plain *t)
{
    uint64_t at = 0;
    for (uint64_t i = 0; i < t->element->properties; i++) {
        const ply_property *property = t->p->header.property + t->element->first + i;
        if (!property->list) {
            at += ebpo_ply_type_bytes(property->type);
            continue;
        }
        if (property->role != PLY_ROLE_CORNERS || t->corners)
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

static ebpo_status run(plain *t, ebpo_task_fn task)
{
    ply_parser *p = t->p;
    bool watched = p->progress && p->progress->report;
    t->progress = (ebpo_progress){ watched ? report : NULL, t };
    ebpo_status status = ebpo_parallel_for(p->threads, p->mesh->workspace, t->element->count, GRAIN,
                                           task, t, &t->progress, "reading", NULL);
    return status == EBPO_E_CANCELLED ? ebpo_ply_fail_stopped(p) : status;
}

ebpo_status ebpo_ply_plain_vertices(ply_parser *p, const ply_element *element, bool swap,
                                    uint64_t *done)
{
    plain t = { .p = p, .element = element, .row_bytes = element->row_bytes, .swap = swap };
    *done = 0;
    if (element->has_list || !element->row_bytes ||
        element->count > (p->size - p->at) / element->row_bytes)
        return EBPO_OK;
    ebpo_status status = run(&t, vertices);
    if (status == EBPO_OK) {
        *done = element->count;
        p->at += element->count * t.row_bytes;
    }
    return status;
}

ebpo_status ebpo_ply_plain_faces(ply_parser *p, const ply_element *element, bool swap,
                                 uint64_t *done)
{
    plain t = { .p = p, .element = element, .swap = swap, .deviates = element->count };
    *done = 0;
    if (!describe_triangles(&t))
        return EBPO_OK;
    ebpo_status status = run(&t, faces);
    if (status != EBPO_OK && status != EBPO_E_FORMAT)
        return status;
    *done = t.deviates;
    p->at += t.deviates * t.row_bytes;
    p->mesh->face_count += t.deviates;
    return EBPO_OK;
}
