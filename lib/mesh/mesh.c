/* Handles complete meshes: the name in messages, the check of counts and arrays, copying, freeing,
 * and the frame in which coordinates can be multiplied without overflow. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "mesh/attributes.h"
#include "mesh/mesh_parts.h"

const char *ebpo_mesh_label(const ebpo_mesh *mesh)
{
    return mesh->source_name[0] ? mesh->source_name : "mesh";
}

ebpo_status ebpo_mesh_check_shape(const ebpo_mesh *mesh, ebpo_error *error)
{
    if (!mesh)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "no mesh was given; pass one that was read or filled in");
    if (mesh->vertex_count > UINT32_MAX - 1 || mesh->face_count > UINT32_MAX - 1)
        return ebpo_fail_file(error, EBPO_E_LIMIT, ebpo_mesh_label(mesh),
                              "%llu vertices and %llu faces, but 2^32 - 2 of each is the limit; "
                              "split the mesh",
                              (unsigned long long)mesh->vertex_count,
                              (unsigned long long)mesh->face_count);
    if (mesh->xyz32 && mesh->xyz64)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, ebpo_mesh_label(mesh),
                              "xyz32 and xyz64 are both set; set exactly one");
    if ((mesh->vertex_count && !mesh->xyz32 && !mesh->xyz64) || (mesh->face_count && !mesh->faces))
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, ebpo_mesh_label(mesh),
                              "an array that the counts require is NULL; allocate it");
    return EBPO_OK;
}

ebpo_status ebpo_mesh_check_whole(const ebpo_mesh *mesh, ebpo_error *error)
{
    if (!mesh->arrangement || !mesh->arrangement->whole_faces)
        return EBPO_OK;
    return ebpo_fail_file(error, EBPO_E_ARGUMENT, ebpo_mesh_label(mesh),
                          "a component cannot be repaired; repair the mesh that contains it");
}

/* Copies an array; returns NULL when there is no space. */
static void *copy_of(ebpo_workspace *workspace, const void *from, uint64_t count, size_t size)
{
    void *to = ebpo_array_alloc(workspace, count, size);
    if (to)
        ebpo_array_copy(workspace, to, from, count * size);
    return to;
}

/* Copies the arrangement (source indices), but not its keys, because the copy will be repaired. */
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
    /* with double positions: 24 + 4 bytes a vertex, 12 + 4 bytes a face */
    return ebpo_workspace_fail(w, mesh->vertex_count * 28 + mesh->face_count * 16, error);
}

void ebpo_arrangement_free(struct ebpo_arrangement *arrangement)
{
    if (!arrangement)
        return;
    ebpo_array_free(arrangement->workspace, arrangement->key);
    ebpo_array_free(arrangement->workspace, arrangement->vertex_source);
    ebpo_array_free(arrangement->workspace, arrangement->face_source);
    free(arrangement);
}

void ebpo_mesh_free(ebpo_mesh *mesh)
{
    if (!mesh)
        return;
    ebpo_array_free(mesh->workspace, mesh->xyz32);
    ebpo_array_free(mesh->workspace, mesh->xyz64);
    ebpo_array_free(mesh->workspace, mesh->faces);
    ebpo_arrangement_free(mesh->arrangement);
    ebpo_attributes_free(mesh->attributes);
    memset(mesh, 0, sizeof *mesh);
}

const char *ebpo_mesh_attributes_lost(const ebpo_mesh *mesh)
{
    return mesh->attributes && mesh->attributes->lost[0] ? mesh->attributes->lost : NULL;
}

const char *ebpo_mesh_ignored(const ebpo_mesh *mesh)
{
    return mesh->attributes && mesh->attributes->unread[0] ? mesh->attributes->unread : NULL;
}

int ebpo_mesh_has_attributes(const ebpo_mesh *mesh)
{
    return ebpo_attributes_hold(mesh->attributes);
}

/* Raises greatest[k] to the absolute value of the vertex's coordinate along axis k, if this value
 * is greater. */
static void include_vertex(double greatest[3], const ebpo_mesh *mesh, uint64_t vertex)
{
    double p[3];
    ebpo_mesh_position(mesh, vertex, p);
    for (int k = 0; k < 3; k++)
        greatest[k] = fmax(greatest[k], fabs(p[k]));
}

/* Returns the frame for coordinates up to greatest[3]. */
static ebpo_mesh_frame frame_of(const double greatest[3])
{
    ebpo_mesh_frame frame = { .scaled = false };
    for (int k = 0; k < 3; k++) {
        frexp(greatest[k], &frame.exponent[k]); /* 0 for 0 */
        frame.scaled |= ebpo_exponent_is_far(frame.exponent[k]);
    }
    return frame;
}

/* Examines all vertices first, which is fast. If the coordinates of some vertex are far from 1,
 * which is rare, this vertex may be unused. So only the corners of faces decide in this case. */
ebpo_mesh_frame ebpo_mesh_frame_of(const ebpo_mesh *mesh)
{
    double greatest[3] = { 0, 0, 0 }, greatest_used[3] = { 0, 0, 0 };
    if (mesh->xyz32) /* exponents of floats are from -148 to 128 */
        return (ebpo_mesh_frame){ .scaled = false };
    EBPO_FOR_ITEMS(mesh->workspace, v, 0, mesh->vertex_count)
        include_vertex(greatest, mesh, v);
    if (!frame_of(greatest).scaled)
        return (ebpo_mesh_frame){ .scaled = false };
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, f, 0, mesh->face_count)
        for (uint64_t k = 0; k < 3; k++)
            include_vertex(greatest_used, mesh, mesh->faces[3 * f + k]);
    return frame_of(greatest_used);
}
