/* Named groups in the form of components: a vertex may be in several. */
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "mesh/component_parts.h"

/* Each group's vertices once, as its faces name them; counted only where `of` is NULL. `seen`:
 * [vertex_count] the group that has named it last. */
static void list_vertices(ebpo_components *c, uint32_t *seen)
{
    const ebpo_mesh *mesh = c->mesh;
    uint64_t count = 0;
    ebpo_array_fill(mesh->workspace, seen, 0xff, mesh->vertex_count * sizeof *seen);
    for (uint64_t n = 0; n < c->count; n++) {
        c->vertices.begin[n] = count;
        EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, c->faces.begin[n], c->faces.begin[n + 1])
            for (uint64_t k = 0; k < 3; k++) {
                uint32_t v = mesh->faces[3 * (uint64_t)c->faces.of[i] + k];
                if (seen[v] == (uint32_t)n)
                    continue;
                seen[v] = (uint32_t)n;
                if (c->vertices.of)
                    c->vertices.of[count] = v;
                count++;
            }
    }
    c->vertices.begin[c->count] = count;
}

static int ascending(const void *x, const void *y)
{
    uint32_t a = *(const uint32_t *)x, b = *(const uint32_t *)y;
    return a < b ? -1 : a > b;
}

static ebpo_status gather_vertices(ebpo_components *c, ebpo_error *error)
{
    ebpo_workspace *workspace = c->mesh->workspace;
    mesh_groups *v = &c->vertices;
    uint32_t *seen = ebpo_array_alloc(workspace, c->mesh->vertex_count, sizeof *seen);
    v->begin = ebpo_array_alloc(workspace, c->count + 1, sizeof *v->begin);
    if (seen && v->begin) {
        list_vertices(c, seen);
        v->of = ebpo_array_alloc(workspace, v->begin[c->count], sizeof *v->of);
    }
    if (v->of)
        list_vertices(c, seen);
    ebpo_array_free(workspace, seen);
    if (!v->of)
        return ebpo_workspace_fail(workspace, c->mesh->vertex_count * sizeof *v->of, error);
    for (uint64_t n = 0; n < c->count; n++)
        qsort(v->of + v->begin[n], v->begin[n + 1] - v->begin[n], sizeof *v->of, ascending);
    return EBPO_OK;
}

static ebpo_status list_groups(ebpo_components *c, ebpo_error *error)
{
    c->facts = ebpo_array_alloc(c->mesh->workspace, c->count, sizeof *c->facts);
    if (!c->facts)
        return ebpo_workspace_fail(c->mesh->workspace, c->count * sizeof *c->facts, error);
    for (uint64_t n = 0; n < c->count; n++)
        c->facts[n] =
            (ebpo_component){ .struct_size = sizeof *c->facts,
                              .first_face = c->named->list[n].first_face,
                              .face_count = c->faces.begin[n + 1] - c->faces.begin[n],
                              .vertex_count = c->vertices.begin[n + 1] - c->vertices.begin[n] };
    return EBPO_OK;
}

static ebpo_status check(const ebpo_mesh *mesh, const ebpo_mesh_groups *groups, ebpo_error *error)
{
    ebpo_status status = ebpo_components_check(mesh, error);
    if (status != EBPO_OK)
        return status;
    if (!groups || groups->face_count != mesh->face_count ||
        ebpo_mesh_whole_faces(mesh) != mesh->face_count)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, ebpo_mesh_label(mesh),
                              "these are not the groups of its %llu faces; fill holes in the file "
                              "of a group, not before",
                              (unsigned long long)mesh->face_count);
    return EBPO_OK;
}

ebpo_status ebpo_components_of_groups(const ebpo_mesh *mesh, const ebpo_mesh_groups *groups,
                                      ebpo_components **out, ebpo_error *error)
{
    *out = NULL;
    ebpo_status status = check(mesh, groups, error);
    if (status != EBPO_OK)
        return status;
    ebpo_components *c = ebpo_alloc_zero(1, sizeof *c);
    if (!c)
        return ebpo_fail_memory(error, sizeof *c);
    c->mesh = mesh;
    c->named = groups;
    c->count = groups->with_faces;
    status = ebpo_components_group(c, true, &c->faces, error);
    if (status == EBPO_OK)
        status = gather_vertices(c, error);
    if (status == EBPO_OK)
        status = list_groups(c, error);
    if (status == EBPO_OK)
        *out = c;
    else
        ebpo_components_free(c);
    return status;
}
