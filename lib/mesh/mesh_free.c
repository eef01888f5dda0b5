#include <stdlib.h>
#include <string.h>

#include "mesh/attributes.h"
#include "core/workspace.h"
#include "mesh/mesh_parts.h"

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

const char *ebpo_mesh_unread(const ebpo_mesh *mesh)
{
    return mesh->attributes && mesh->attributes->unread[0] ? mesh->attributes->unread : NULL;
}

int ebpo_mesh_has_attributes(const ebpo_mesh *mesh)
{
    return ebpo_attributes_hold(mesh->attributes);
}
