#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "mesh/mesh_parts.h"

/* NULL when there is no room. */
static void *copy_of(ebpo_workspace *workspace, const void *from, uint64_t count, size_t size)
{
    void *to = ebpo_array_alloc(workspace, count, size);
    if (to)
        ebpo_array_copy(workspace, to, from, count * size);
    return to;
}

/* Without keys: the copy is to be mended. */
static struct ebpo_arrangement *copy_order(const ebpo_mesh *mesh)
{
    const struct ebpo_arrangement *from = mesh->arrangement;
    struct ebpo_arrangement *to = malloc(sizeof *to);
    if (!to)
        return NULL;
    *to = *from;
    to->key = NULL;
    to->vertex_source = copy_of(from->workspace, from->vertex_source, mesh->vertex_count,
                                sizeof *to->vertex_source);
    to->face_source =
        copy_of(from->workspace, from->face_source, mesh->face_count, sizeof *to->face_source);
    return to;
}

ebpo_status ebpo_mesh_copy(const ebpo_mesh *mesh, ebpo_mesh *out, ebpo_error *error)
{
    ebpo_workspace *w = mesh->workspace;
    *out = *mesh;
    out->attributes = NULL;
    out->faces = copy_of(w, mesh->faces, mesh->face_count, 3 * sizeof *mesh->faces);
    if (mesh->xyz32)
        out->xyz32 = copy_of(w, mesh->xyz32, mesh->vertex_count, 3 * sizeof *mesh->xyz32);
    else
        out->xyz64 = copy_of(w, mesh->xyz64, mesh->vertex_count, 3 * sizeof *mesh->xyz64);
    out->arrangement = mesh->arrangement ? copy_order(mesh) : NULL;
    const struct ebpo_arrangement *order = out->arrangement;
    if (out->faces && (out->xyz32 || out->xyz64) &&
        (!mesh->arrangement || (order && order->vertex_source && order->face_source)))
        return EBPO_OK;
    ebpo_mesh_free(out);
    return ebpo_workspace_fail(w, mesh->vertex_count * 28 + mesh->face_count * 16, error);
}
