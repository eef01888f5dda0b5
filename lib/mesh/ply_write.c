/* Writing a mesh as a binary little-endian PLY file. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/endian.h"
#include "core/error.h"
#include "core/workspace.h"
#include "io/publish.h"
#include <ebpo/mesh.h>
#include "mesh/ply_layout.h"

enum { BUFFER = 1 << 16 };

static ebpo_status check(const ebpo_mesh *mesh, ebpo_error *error)
{
    if (mesh->vertex_count > UINT32_MAX - 1 || mesh->face_count > UINT32_MAX - 1)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "the mesh to write has %" PRIu64 " vertices and %" PRIu64
                         " faces, but 2^32 - 2 of each is the limit; split it",
                         mesh->vertex_count, mesh->face_count);
    if ((mesh->vertex_count && !mesh->xyz32 == !mesh->xyz64) || (mesh->face_count && !mesh->faces))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the mesh to write has counts without arrays, or positions of both kinds");
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, 3 * mesh->face_count)
        if (mesh->faces[i] >= mesh->vertex_count)
            return ebpo_fail(error, EBPO_E_ARGUMENT,
                             "face %" PRIu64 " of the mesh to write names vertex %" PRIu32
                             ", but there are %" PRIu64 " vertices",
                             i / 3, mesh->faces[i], mesh->vertex_count);
    return EBPO_OK;
}

typedef struct writing {
    FILE *f;
    const ebpo_mesh *mesh;
    const ply_layout *layout;
    const ply_out_element *element;
    uint8_t *buffer; /* BUFFER bytes */
    size_t used;
    bool failed;
} writing;

static void flush(writing *w)
{
    w->failed = w->failed || fwrite(w->buffer, 1, w->used, w->f) != w->used;
    w->used = 0;
}

/* The low bytes of a number, little-endian. */
static void put(writing *w, unsigned bytes, uint64_t bits)
{
    uint8_t *at = w->buffer + w->used;
    if (bytes == 1)
        *at = (uint8_t)bits;
    else if (bytes == 2)
        ebpo_store16(at, (uint16_t)bits);
    else if (bytes == 4)
        ebpo_store32(at, (uint32_t)bits);
    else
        ebpo_store64(at, bits);
    w->used += bytes;
    if (w->used > BUFFER - sizeof(uint64_t))
        flush(w);
}

static void put_position(writing *w, const ply_out_property *p, uint64_t row)
{
    uint64_t at = 3 * row + (uint64_t)(p->role - PLY_ROLE_X), bits = 0;
    float narrow = w->mesh->xyz32 ? w->mesh->xyz32[at] : (float)w->mesh->xyz64[at];
    if (p->type == PLY_FLOAT32) {
        memcpy(&bits, &narrow, sizeof narrow);
        bits = __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__ ? bits : bits >> 32;
    } else if (p->type == PLY_FLOAT64) {
        memcpy(&bits, &w->mesh->xyz64[at], sizeof bits);
    } else {
        bits = (uint64_t)(int64_t)w->mesh->xyz64[at]; /* the layout has seen that it is one */
    }
    put(w, ebpo_ply_type_bytes(p->type), bits);
}

static void put_corners(writing *w, const ply_out_property *p, uint64_t row)
{
    put(w, ebpo_ply_type_bytes(p->count_type), 3);
    for (uint64_t k = 0; k < 3; k++)
        put(w, ebpo_ply_type_bytes(p->type), w->mesh->faces[3 * row + k]);
}

static uint64_t native_bits(const uint8_t *at, unsigned bytes)
{
    uint16_t b2;
    uint32_t b4;
    uint64_t b8;
    switch (bytes) {
    case 1: return *at;
    case 2: memcpy(&b2, at, 2); return b2;
    case 4: memcpy(&b4, at, 4); return b4;
    default: memcpy(&b8, at, 8); return b8;
    }
}

static void put_attribute(writing *w, const ply_out_property *p, uint64_t row)
{
    const ebpo_attribute *a = &w->mesh->attributes->array[p->attribute];
    unsigned bytes = ebpo_attribute_bytes(a->type);
    uint64_t begin = row * a->columns + p->column, count = 1;
    if (a->list != EBPO_ATTRIBUTE_NO_LIST) {
        begin = !a->ends ? row * a->columns : row ? a->ends[row - 1] : 0;
        count = a->ends ? a->ends[row] - begin : a->columns;
        put(w, ebpo_ply_type_bytes(p->count_type), count);
    }
    for (uint64_t i = begin; i < begin + count; i++)
        put(w, bytes, native_bits(a->values + i * bytes, bytes));
}

static void put_row(writing *w, uint64_t row)
{
    const ply_out_property *p = w->layout->property + w->element->first;
    for (uint64_t i = 0; i < w->element->properties; i++, p++) {
        if (p->role == PLY_ROLE_NONE)
            put_attribute(w, p, row);
        else if (p->role == PLY_ROLE_CORNERS)
            put_corners(w, p, row);
        else
            put_position(w, p, row);
    }
}

static bool write_rows(writing *w)
{
    for (uint64_t i = 0; i < w->layout->elements && !w->failed; i++) {
        w->element = &w->layout->element[i];
        EBPO_FOR_ITEMS(w->mesh->workspace, row, 0, w->element->properties ? w->element->rows : 0) {
            put_row(w, row);
            if (w->failed)
                break;
        }
    }
    flush(w);
    return !w->failed;
}

ebpo_status ebpo_mesh_write_ply(const ebpo_mesh *mesh, const char *path, ebpo_error *error)
{
    ebpo_publish out = EBPO_PUBLISH_INIT;
    ply_layout layout = { .element = NULL };
    writing w = { .mesh = mesh, .layout = &layout };
    ebpo_status status = check(mesh, error);
    if (status == EBPO_OK)
        status = ebpo_ply_layout_make(&layout, mesh, error);
    if (status == EBPO_OK)
        status = ebpo_publish_begin(&out, path, error);
    if (status != EBPO_OK)
        goto done;
    w.buffer = ebpo_alloc(BUFFER, 1);
    w.f = ebpo_publish_stream(&out);
    if (!w.buffer || !w.f) {
        status = ebpo_fail_memory(error, BUFFER);
        goto done;
    }
    if (fwrite(layout.header, 1, layout.header_bytes, w.f) != layout.header_bytes ||
        !write_rows(&w)) {
        status = ebpo_fail_errno(error, path, "could not be written");
        goto done;
    }
    status = ebpo_publish_commit(&out, error);
done:
    ebpo_publish_abort(&out);
    ebpo_ply_layout_free(&layout);
    free(w.buffer);
    return status;
}
