/* Values at corners become attributes of vertices, of faces, or lists. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "mesh/attributes.h"
#include "core/workspace.h"
#include "core/error.h"
#include "mesh/import_build.h"

static const struct {
    const char *names, *list_name;
} sorts[IMPORT_SORTS] = { { "red green blue", "color" },
                          { "nx ny nz", "normal" },
                          { "s t", "texcoord" } };

typedef struct placing {
    const import_build *b;
    const import_table *table;
    import_sort sort;
    size_t bytes; /* of a row, as it is kept */
} placing;

static ebpo_attribute head_of(const placing *p, const char *element)
{
    ebpo_attribute head = { .list = EBPO_ATTRIBUTE_NO_LIST };
    head.type = p->table->bytes ? EBPO_ATTRIBUTE_UINT8 : EBPO_ATTRIBUTE_FLOAT32;
    head.columns = ebpo_import_columns(p->sort);
    snprintf(head.element, sizeof head.element, "%s", element);
    snprintf(head.names, sizeof head.names, "%s", sorts[p->sort].names);
    return head;
}

static ebpo_status add(const placing *p, ebpo_attribute *head, ebpo_attribute **out)
{
    const ebpo_mesh *mesh = p->b->mesh;
    size_t bytes = head->columns * (size_t)ebpo_attribute_bytes(head->type);
    head->rows = strcmp(head->element, "face") == 0 ? mesh->face_count : mesh->vertex_count;
    *out = ebpo_attributes_add(mesh->attributes, head);
    if (!*out)
        return ebpo_fail_memory(p->b->error, sizeof **out);
    (*out)->values = ebpo_array_alloc(mesh->workspace, head->rows, bytes);
    return (*out)->values ? EBPO_OK
                          : ebpo_workspace_fail(mesh->workspace, head->rows * bytes, p->b->error);
}

/* Takes away the last one again. */
static void drop(const placing *p)
{
    ebpo_attributes_remove(p->b->mesh->attributes, p->b->mesh->attributes->count - 1);
}

/* Zeros where a corner names none. */
static const void *value_at(const placing *p, uint64_t corner)
{
    static const float none[3] = { 0, 0, 0 };
    uint32_t row = p->table->index[corner];
    return row == IMPORT_NONE ? (const char *)none
                              : (const char *)p->table->values + row * p->bytes;
}

/* *fits: all corners at a vertex say the same. */
static ebpo_status place_on_vertices(const placing *p, bool *fits)
{
    const ebpo_mesh *mesh = p->b->mesh;
    ebpo_attribute head = head_of(p, "vertex"), *a;
    ebpo_status status = add(p, &head, &a);
    *fits = status == EBPO_OK;
    if (!*fits)
        return status;
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, 3 * mesh->face_count)
        memcpy(a->values + mesh->faces[i] * p->bytes, value_at(p, i), p->bytes);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, 3 * mesh->face_count) {
        *fits = memcmp(a->values + mesh->faces[i] * p->bytes, value_at(p, i), p->bytes) == 0;
        if (!*fits)
            break;
    }
    if (!*fits)
        drop(p);
    return EBPO_OK;
}

/* *fits: all corners of a face say the same. */
static ebpo_status place_on_faces(const placing *p, bool *fits)
{
    const ebpo_mesh *mesh = p->b->mesh;
    ebpo_attribute head = head_of(p, "face"), *a;
    ebpo_status status = add(p, &head, &a);
    *fits = status == EBPO_OK;
    for (uint64_t f = 0; f < mesh->face_count && *fits; f++) {
        const void *first = value_at(p, 3 * f);
        *fits = memcmp(first, value_at(p, 3 * f + 1), p->bytes) == 0 &&
                memcmp(first, value_at(p, 3 * f + 2), p->bytes) == 0;
        memcpy(a->values + f * p->bytes, first, p->bytes);
    }
    if (status == EBPO_OK && !*fits)
        drop(p);
    return status;
}

static ebpo_status place_in_lists(const placing *p)
{
    ebpo_attribute head = head_of(p, "face"), *a;
    head.columns *= 3;
    head.list = EBPO_ATTRIBUTE_UINT8;
    snprintf(head.names, sizeof head.names, "%s", sorts[p->sort].list_name);
    ebpo_status status = add(p, &head, &a);
    for (uint64_t i = 0; status == EBPO_OK && i < 3 * p->b->mesh->face_count; i++)
        memcpy(a->values + i * p->bytes, value_at(p, i), p->bytes);
    return status;
}

/* In place: what is written lies below what is still to be read. */
static void make_bytes(import_table *t, size_t columns)
{
    uint8_t *to = (uint8_t *)t->values;
    for (uint64_t i = 0; i < t->rows * columns; i++)
        to[i] = (uint8_t)t->values[i];
}

ebpo_status ebpo_import_attributes(import_build *b)
{
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < IMPORT_SORTS && status == EBPO_OK; i++) {
        placing p = { b, &b->table[i], (import_sort)i, 0 };
        bool fits = false;
        if (!p.table->index || !p.table->named)
            continue;
        p.bytes = ebpo_import_columns(p.sort);
        if (p.table->bytes)
            make_bytes(&b->table[i], p.bytes);
        else
            p.bytes *= sizeof(float);
        status = p.table->of_face ? EBPO_OK : place_on_vertices(&p, &fits);
        if (status == EBPO_OK && !fits)
            status = place_on_faces(&p, &fits);
        if (status == EBPO_OK && !fits)
            status = place_in_lists(&p);
    }
    if (b->rounded)
        ebpo_attributes_lose(b->mesh->attributes,
                             "digits of %" PRIu64 " colours, normals or texture coordinates, which "
                             "are floats",
                             b->rounded);
    return status;
}
