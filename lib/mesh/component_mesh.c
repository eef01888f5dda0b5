/* A component as a mesh of its own, which knows the numbers of the source. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "mesh/attributes.h"
#include "mesh/textures_named.h"
#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "mesh/component_parts.h"

static void copy_vertices(const ebpo_components *c, uint64_t number, ebpo_mesh *out)
{
    const ebpo_mesh *mesh = c->mesh;
    const uint32_t *from = c->vertices.of + c->vertices.begin[number];
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, out->vertex_count) {
        if (mesh->xyz32)
            memcpy(out->xyz32 + 3 * i, mesh->xyz32 + 3 * (uint64_t)from[i], 3 * sizeof(float));
        else
            memcpy(out->xyz64 + 3 * i, mesh->xyz64 + 3 * (uint64_t)from[i], 3 * sizeof(double));
        out->arrangement->vertex_source[i] = (uint32_t)ebpo_mesh_source_vertex(mesh, from[i]);
    }
}

/* Where vertex v is among those of the part. */
static uint32_t place_of(const ebpo_components *c, uint64_t number, uint32_t v)
{
    if (c->place)
        return c->place[v];
    const uint32_t *of = c->vertices.of + c->vertices.begin[number];
    uint64_t low = 0, high = c->vertices.begin[number + 1] - c->vertices.begin[number];
    while (high - low > 1) {
        uint64_t middle = low + (high - low) / 2;
        if (of[middle] <= v)
            low = middle;
        else
            high = middle;
    }
    return (uint32_t)low;
}

static void copy_faces(const ebpo_components *c, uint64_t number, ebpo_mesh *out)
{
    const ebpo_mesh *mesh = c->mesh;
    const uint32_t *from = c->faces.of + c->faces.begin[number];
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, out->face_count) {
        for (uint64_t k = 0; k < 3; k++)
            out->faces[3 * i + k] = place_of(c, number, mesh->faces[3 * (uint64_t)from[i] + k]);
        out->arrangement->face_source[i] = (uint32_t)ebpo_mesh_source_face(mesh, from[i]);
    }
}

/* With the source's numbers, and how many there are; in no order that could be built from. */
static bool make_arrangement(const ebpo_mesh *whole, ebpo_mesh *out)
{
    struct ebpo_arrangement *a = ebpo_alloc_zero(1, sizeof *a);
    out->arrangement = a;
    if (!a)
        return false;
    a->workspace = whole->workspace;
    a->referenced = out->vertex_count;
    a->level = -1;
    a->whole_vertices = ebpo_mesh_whole_vertices(whole);
    a->whole_faces = ebpo_mesh_whole_faces(whole);
    a->vertex_source = ebpo_array_alloc(a->workspace, out->vertex_count, sizeof *a->vertex_source);
    a->face_source = ebpo_array_alloc(a->workspace, out->face_count, sizeof *a->face_source);
    return a->vertex_source && a->face_source;
}

static bool make_arrays(const ebpo_mesh *whole, ebpo_mesh *out)
{
    if (whole->xyz32)
        out->xyz32 = ebpo_array_alloc(whole->workspace, out->vertex_count, 3 * sizeof *out->xyz32);
    else
        out->xyz64 = ebpo_array_alloc(whole->workspace, out->vertex_count, 3 * sizeof *out->xyz64);
    out->faces = ebpo_array_alloc(whole->workspace, out->face_count, 3 * sizeof *out->faces);
    return (out->xyz32 || out->xyz64) && out->faces;
}

ebpo_status ebpo_components_mesh(const ebpo_components *c, uint64_t number, ebpo_mesh *out,
                                 ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    ebpo_component facts = EBPO_COMPONENT_INIT;
    ebpo_status status = ebpo_components_get(c, number, &facts, error);
    if (status != EBPO_OK)
        return status;
    *out = *c->mesh;
    out->xyz32 = NULL;
    out->xyz64 = NULL;
    out->faces = NULL;
    out->arrangement = NULL;
    out->attributes = NULL;
    out->vertex_count = facts.vertex_count;
    out->face_count = facts.face_count;
    if (!make_arrangement(c->mesh, out) || !make_arrays(c->mesh, out)) {
        status = ebpo_workspace_fail(out->workspace,
                                     28 * facts.vertex_count + 16 * facts.face_count, error);
    }
    if (status == EBPO_OK) /* by numbers of the source, as building picks them */
        status = ebpo_attributes_borrow(&out->attributes, c->mesh->attributes, error);
    if (status != EBPO_OK) {
        ebpo_mesh_free(out);
        return status;
    }
    copy_vertices(c, number, out);
    copy_faces(c, number, out);
    status = ebpo_textures_keep_named(out->attributes, out->arrangement->face_source,
                                      out->face_count, error);
    if (status != EBPO_OK)
        ebpo_mesh_free(out);
    return status;
}
