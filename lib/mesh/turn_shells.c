/* Shells look outwards, or inwards where they bound a cavity. */
#include "core/strict_fp.h"

#include <ebpo/repair.h>

#include "core/workspace.h"
#include "core/error.h"
#include "mesh/shell_nesting.h"

static uint64_t turn_shell(const ebpo_components *c, uint32_t component)
{
    uint64_t begin = c->faces.begin[component], end = c->faces.begin[component + (uint64_t)1];
    EBPO_FOR_ITEMS_SCATTERED(c->mesh->workspace, i, begin, end)
        ebpo_face_turn(c->mesh->faces + 3 * (uint64_t)c->faces.of[i]);
    return end - begin;
}

ebpo_status ebpo_mesh_turn_shells(ebpo_mesh *mesh, uint32_t *closed, ebpo_mend_record *record,
                                  ebpo_error *error)
{
    nesting n = { .components = NULL };
    uint64_t turned = 0;
    if (mesh->face_count == 0)
        return EBPO_OK;
    ebpo_status status = ebpo_nesting_find(&n, mesh, closed, 0, NULL, error);
    for (uint64_t i = 0; i < n.count && status == EBPO_OK; i++)
        if (ebpo_shell_looks_inwards(&n, &n.shells[i]) != ebpo_shell_is_cavity(&n.shells[i]))
            turned += turn_shell(n.components, n.shells[i].component);
    ebpo_nesting_free(&n, mesh);
    if (record)
        record->flipped_faces += turned;
    return status;
}
