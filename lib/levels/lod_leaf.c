/* Envelopes of leaves. */
#include "core/strict_fp.h"

#include "core/alloc.h"
#include "core/error.h"
#include "geometry/plane_clip.h"
#include "levels/lod_model.h"
#include "geometry/rule.h"

static bool take_face(const ebpo_mesh *mesh, uint64_t face, ebpo_triangle *out)
{
    if (face >= mesh->face_count)
        return false;
    for (int i = 0; i < 3; i++) {
        uint64_t v = mesh->faces[3 * face + (uint64_t)i];
        if (v >= mesh->vertex_count)
            return false;
        for (uint64_t k = 0; k < 3; k++)
            out->corner[i][k] =
                mesh->xyz32 ? (double)mesh->xyz32[3 * v + k] : mesh->xyz64[3 * v + k];
    }
    return true;
}

/* The leaf's faces in the order in which the builder saw them: ascending numbers, so references
 * before new ones. */
ebpo_status ebpo_lod_leaf_faces(const ebpo_lod_model *model, ebpo_cell cell, uint64_t leaf,
                                ebpo_leaf_scratch *scratch, uint64_t *count, ebpo_error *error)
{
    const ebpo_level *level = &model->level[cell.level];
    if (!level->leaf_first || !level->leaf_new || !model->ranks[cell.level].ref_first)
        return ebpo_fail(error, EBPO_E_FORMAT,
                         "level %d: its leaves have no face lists; run ebpo verify", cell.level);
    uint64_t refs = level->leaf_ref_count[leaf], fresh = level->leaf_new[leaf];
    if (!ebpo_grow(&scratch->faces, &scratch->capacity, refs + fresh, sizeof *scratch->faces))
        return ebpo_fail_memory(error, (refs + fresh) * sizeof *scratch->faces);
    const uint32_t *ref =
        level->leaf_refs ? level->leaf_refs + model->ranks[cell.level].ref_first[leaf] : NULL;
    bool fine = true;
    for (uint64_t i = 0; i < refs && fine; i++)
        fine = take_face(&model->mesh, ref[i], &scratch->faces[i]);
    for (uint64_t i = 0; i < fresh && fine; i++)
        fine = take_face(&model->mesh, level->leaf_first[leaf] + i, &scratch->faces[refs + i]);
    if (!fine)
        return ebpo_fail(error, EBPO_E_FORMAT,
                         "level %d: leaf %llu names a face or vertex that the mesh does not have; "
                         "run ebpo verify",
                         cell.level, (unsigned long long)leaf);
    *count = refs + fresh;
    return EBPO_OK;
}

unsigned ebpo_lod_inside_corners(const ebpo_box *box, ebpo_cell cell, ebpo_rule rule,
                                 int32_t winding, const ebpo_triangle *faces, uint64_t count)
{
    int32_t delta[8];
    ebpo_corner_windings(box, cell, faces, count, delta);
    unsigned inside = 0;
    for (unsigned i = 0; i < 8; i++)
        inside |= (unsigned)ebpo_rule_inside(rule, winding + delta[i]) << i;
    return inside;
}

ebpo_status ebpo_lod_leaf_planes(const ebpo_lod_model *model, ebpo_cell cell, uint64_t leaf,
                                 ebpo_leaf_scratch *scratch, ebpo_polytope *envelope,
                                 uint32_t codes[EBPO_PLANES_MAX], int *plane_count,
                                 ebpo_error *error)
{
    uint64_t count = 0;
    ebpo_status status = ebpo_lod_leaf_faces(model, cell, leaf, scratch, &count, error);
    if (status != EBPO_OK)
        return status;
    const int32_t *winding = model->level[cell.level].leaf_winding;
    unsigned inside = model->info->solid && winding
                          ? ebpo_lod_inside_corners(&model->box, cell, model->info->rule,
                                                    winding[leaf], scratch->faces, count)
                          : 0;
    /* Derived planes cost no bytes: each that removes anything is taken, as in the volumes that the
     * file states. */
    *plane_count =
        ebpo_leaf_planes(&model->box, cell, scratch->faces, count, inside, 0, envelope, codes);
    return EBPO_OK;
}

ebpo_status ebpo_lod_leaf(const ebpo_lod_model *model, ebpo_cell cell, uint64_t leaf,
                          ebpo_leaf_scratch *scratch, ebpo_polytope *envelope, ebpo_error *error)
{
    const ebpo_level *level = &model->level[cell.level];
    const ebpo_level_ranks *ranks = &model->ranks[cell.level];
    if (model->leaf_source == EBPO_LEAF_STORED && ranks->leaf_plane_first &&
        level->leaf_plane_counts[leaf])
        ebpo_planes_cut(envelope, level->leaf_planes + ranks->leaf_plane_first[leaf],
                        level->leaf_plane_counts[leaf]);
    uint32_t codes[EBPO_PLANES_MAX];
    int count;
    if (model->leaf_source != EBPO_LEAF_DERIVED)
        return EBPO_OK;
    return ebpo_lod_leaf_planes(model, cell, leaf, scratch, envelope, codes, &count, error);
}
