#include "mesh/mesh_parts.h"

#include <stdlib.h>

#include "core/error.h"
#include "core/workspace.h"

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
                              "an array that the counts promise is NULL; allocate it");
    return EBPO_OK;
}

ebpo_status ebpo_mesh_check_whole(const ebpo_mesh *mesh, ebpo_error *error)
{
    if (!mesh->arrangement || !mesh->arrangement->whole_faces)
        return EBPO_OK;
    return ebpo_fail_file(error, EBPO_E_ARGUMENT, ebpo_mesh_label(mesh),
                          "a component cannot be mended; mend the mesh that it comes from");
}
