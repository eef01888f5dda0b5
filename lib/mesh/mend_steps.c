/* Mending in the one order that there is. */
#include "core/strict_fp.h"

#include "core/workspace.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "mesh/mesh_parts.h"

enum { GRAIN = 1 << 14 };

static ebpo_status turn(void *context, uint64_t begin, uint64_t end, unsigned worker,
                        ebpo_error *error)
{
    ebpo_mesh *mesh = context;
    (void)worker, (void)error;
    EBPO_FOR_ITEMS(mesh->workspace, f, begin, end)
        ebpo_face_turn(mesh->faces + 3 * f);
    return EBPO_OK;
}

ebpo_status ebpo_mesh_flip(ebpo_mesh *mesh, ebpo_mend_record *record, ebpo_error *error)
{
    ebpo_status status = ebpo_mesh_check_shape(mesh, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(0, NULL, mesh->face_count, GRAIN, turn, mesh, NULL, "", error);
    if (status == EBPO_OK && record)
        record->flipped_faces += mesh->face_count;
    return status;
}

ebpo_status ebpo_mesh_orient(ebpo_mesh *mesh, ebpo_mend_record *record, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    uint32_t *closed = NULL;
    ebpo_status status = ebpo_mesh_make_consistent(mesh, record, &closed, error);
    if (status == EBPO_OK)
        status = ebpo_mesh_turn_shells(mesh, closed, record, error);
    ebpo_array_free(mesh->workspace, closed);
    return status;
}

static ebpo_status orient(ebpo_mesh *mesh, unsigned steps, ebpo_mend_record *record,
                          ebpo_error *error)
{
    return steps & EBPO_MEND_EARLIER ? ebpo_mesh_make_consistent(mesh, record, NULL, error)
                                     : ebpo_mesh_orient(mesh, record, error);
}

ebpo_status ebpo_mesh_mend(ebpo_mesh *mesh, unsigned steps, double weld_distance,
                           ebpo_mend_record *record, ebpo_error *error)
{
    uint64_t filled = record->filled_holes, unorientable = record->unorientable_components;
    ebpo_status status = EBPO_OK;
    if (weld_distance > 0)
        status = ebpo_mesh_weld_within(mesh, weld_distance, record, error);
    else if (steps & EBPO_MEND_WELD)
        status = ebpo_mesh_weld(mesh, record, error);
    if (status == EBPO_OK && steps & EBPO_MEND_DROP)
        status = ebpo_mesh_drop_duplicates(mesh, record, error);
    if (status == EBPO_OK && steps & EBPO_MEND_ORIENT)
        status = orient(mesh, steps, record, error);
    if (status == EBPO_OK && steps & EBPO_MEND_FLIP)
        status = ebpo_mesh_flip(mesh, record, error);
    if (status == EBPO_OK && steps & EBPO_MEND_FILL)
        status = ebpo_mesh_fill_holes(mesh, record, error);
    /* what was open has an outside now */
    if (status == EBPO_OK && steps & EBPO_MEND_ORIENT && !(steps & EBPO_MEND_EARLIER) &&
        record->filled_holes > filled) {
        record->unorientable_components = unorientable;
        status = ebpo_mesh_orient(mesh, record, error);
    }
    return status;
}
