/* Shells look outwards, or inwards where they bound a cavity. */
#include "geom/strict_fp.h"

#include <ebpo/repair.h>

#include "base/arrays.h"
#include "base/error.h"
#include "base/fp_env.h"
#include "base/sized.h"
#include "mesh/shell_nesting.h"

static bool looks_inwards(const nesting *n, const shell *one)
{
    return n->components->list[one->component].volume < 0;
}

static bool is_cavity(const shell *one) { return one->depth % 2 != 0; }

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
        if (looks_inwards(&n, &n.shells[i]) != is_cavity(&n.shells[i]))
            turned += turn_shell(n.components, n.shells[i].component);
    ebpo_nesting_free(&n, mesh);
    if (record)
        record->flipped_faces += turned;
    return status;
}

ebpo_status ebpo_mesh_count_shells(const ebpo_mesh *mesh, unsigned threads, ebpo_progress progress,
                                   ebpo_shells *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    static const ebpo_shells nothing = EBPO_SHELLS_INIT;
    ebpo_shells made = EBPO_SHELLS_INIT;
    nesting n = { .components = NULL };
    uint32_t *closed = NULL;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_shells, out, error);
    if (status == EBPO_OK)
        status = ebpo_components_check(mesh, error);
    if (status == EBPO_OK)
        status = ebpo_mesh_find_shells(mesh, threads, &closed, error);
    if (status == EBPO_OK)
        status = ebpo_nesting_find(&n, mesh, closed, threads, &progress, error);
    for (uint64_t i = 0; i < n.count && status == EBPO_OK; i++) {
        bool inwards = looks_inwards(&n, &n.shells[i]), cavity = is_cavity(&n.shells[i]);
        made.inside_out += inwards && !cavity;
        made.cavities += inwards && cavity;
        made.nested += !inwards && cavity;
    }
    made.closed = n.count;
    ebpo_nesting_free(&n, mesh);
    ebpo_array_free(mesh->workspace, closed);
    EBPO_GIVE(ebpo_shells, out, status == EBPO_OK ? &made : &nothing);
    return status;
}
