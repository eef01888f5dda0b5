#include "core/strict_fp.h"

#include "mesh/mesh_frame.h"

#include "core/workspace.h"

static void include(double most[3], const ebpo_mesh *mesh, uint64_t vertex)
{
    double p[3];
    ebpo_mesh_position(mesh, vertex, p);
    for (int k = 0; k < 3; k++)
        most[k] = fmax(most[k], fabs(p[k]));
}

static ebpo_mesh_frame frame_of(const double most[3])
{
    ebpo_mesh_frame frame = { .scaled = false };
    for (int k = 0; k < 3; k++) {
        frexp(most[k], &frame.exponent[k]); /* 0 for 0 */
        frame.scaled |= ebpo_exponent_is_far(frame.exponent[k]);
    }
    return frame;
}

/* Vertices are looked at first, which is quicker: few meshes are far from 1, and then some vertex
 * that no face uses may be what is. */
ebpo_mesh_frame ebpo_mesh_frame_of(const ebpo_mesh *mesh)
{
    double most[3] = { 0, 0, 0 }, used[3] = { 0, 0, 0 };
    if (mesh->xyz32) /* whose exponents are from -148 to 128 */
        return (ebpo_mesh_frame){ .scaled = false };
    EBPO_FOR_ITEMS(mesh->workspace, v, 0, mesh->vertex_count)
        include(most, mesh, v);
    if (!frame_of(most).scaled)
        return (ebpo_mesh_frame){ .scaled = false };
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, f, 0, mesh->face_count)
        for (uint64_t k = 0; k < 3; k++)
            include(used, mesh, mesh->faces[3 * f + k]);
    return frame_of(used);
}
