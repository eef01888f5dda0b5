/* Places while checking, a list for each worker. */
#include "core/workspace.h"
#include "mesh/mesh_check_parts.h"

void ebpo_found_add(const ebpo_check *check, unsigned worker, ebpo_found found)
{
    ebpo_found_list *list = &check->found[worker];
    const ebpo_mesh *mesh = check->mesh;
    if (!ebpo_array_grow(mesh->workspace, &list->item, &list->capacity, list->count + 1,
                         sizeof *list->item)) {
        list->short_of_memory = true;
        return;
    }
    if (ebpo_found_is_edge(found.kind) &&
        ebpo_mesh_source_vertex(mesh, found.b) < ebpo_mesh_source_vertex(mesh, found.a)) {
        uint32_t a = found.a;
        found.a = found.b;
        found.b = a;
    }
    list->item[list->count++] = found;
}
