#include "core/strict_fp.h"

#include "levels/view_faces.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "geometry/octcode.h"

ebpo_status ebpo_view_leaves_new(ebpo_view_leaves **out, const ebpo_file *file, ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    *out = NULL;
    if (!(info->parts & EBPO_PART_MESH))
        return ebpo_fail(error, EBPO_E_ABSENT,
                         "view options: faces are asked for, and the file was written without its "
                         "mesh; build it again with it");
    ebpo_view_leaves *l = ebpo_alloc_zero(1, sizeof *l);
    if (l)
        l->given = ebpo_alloc_zero(info->face_count / 8 + 1, 1);
    if (!l || !l->given) {
        free(l);
        return ebpo_fail_memory(error, sizeof *l + info->face_count / 8 + 1);
    }
    l->info = info;
    *out = l;
    return EBPO_OK;
}

static void drop_slices(ebpo_view_leaves *l)
{
    for (unsigned octant = 0; octant < 8; octant++)
        ebpo_slice_free(&l->slice[octant]);
}

void ebpo_view_leaves_free(ebpo_view_leaves *l)
{
    if (!l)
        return;
    drop_slices(l);
    free(l->given);
    free(l->corners);
    free(l->numbers);
    free(l->repeated);
    free(l);
}

bool ebpo_view_leaf_of(const ebpo_view_group *group, const ebpo_group *read, unsigned octant,
                       ebpo_node *out)
{
    if (ebpo_group_type(read->types, octant) != EBPO_LEAF ||
        octant >= ebpo_group_octants(group->number.level))
        return false;
    uint64_t octcode = group->parent ? ebpo_octcode_child(group->parent, octant) : 1;
    *out = (ebpo_node){ .cell = ebpo_cell_of_octcode(octcode),
                        .type = EBPO_LEAF,
                        .rank = read->rank[EBPO_LEAF] +
                                ebpo_group_count(read->types, EBPO_LEAF, octant) };
    return true;
}

/* --- reading --- */

static ebpo_status make_room(ebpo_view_leaves *l, uint64_t faces, ebpo_error *error)
{
    bool fine = ebpo_grow(&l->corners, &l->capacity[0], faces, sizeof *l->corners) &&
                ebpo_grow(&l->numbers, &l->capacity[1], faces, sizeof *l->numbers) &&
                ebpo_grow(&l->repeated, &l->capacity[2], faces, sizeof *l->repeated);
    return fine ? EBPO_OK
                : ebpo_fail_memory(error, faces * (sizeof *l->corners + sizeof *l->numbers + 1));
}

ebpo_status ebpo_view_leaves_read(ebpo_view_leaves *l, ebpo_chunks *chunks,
                                  const ebpo_view_group *group, const ebpo_group *read,
                                  ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    ebpo_node leaf;
    drop_slices(l);
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++)
        if (ebpo_view_leaf_of(group, read, octant, &leaf)) {
            status = ebpo_slice_read_parts(&l->slice[octant], chunks, &leaf, 0, error);
            if (status == EBPO_OK)
                status = make_room(l, l->slice[octant].mesh.face_count, error);
        }
    if (status != EBPO_OK)
        drop_slices(l);
    return status;
}

/* --- giving --- */

void ebpo_view_leaves_give_none(ebpo_view_leaves *l)
{
    l->now = (ebpo_view_faces)EBPO_VIEW_FACES_INIT;
}

static void take_face(ebpo_view_leaves *l, const ebpo_slice *slice, uint32_t face)
{
    const ebpo_mesh *mesh = &slice->mesh;
    uint64_t number = ebpo_slice_file_face(slice, face);
    for (uint64_t i = 0; i < 9; i++) {
        uint64_t at = 3 * (uint64_t)mesh->faces[3 * (uint64_t)face + i / 3] + i % 3;
        l->corners[face][i / 3][i % 3] = mesh->xyz32 ? (double)mesh->xyz32[at] : mesh->xyz64[at];
    }
    l->numbers[face] = (uint32_t)number;
    l->repeated[face] = l->given[number / 8] >> number % 8 & 1;
    l->given[number / 8] |= (uint8_t)(1u << number % 8);
    l->now.new_count += !l->repeated[face];
}

void ebpo_view_leaves_give(ebpo_view_leaves *l, unsigned octant)
{
    const ebpo_slice *slice = &l->slice[octant];
    ebpo_view_leaves_give_none(l);
    l->now.face_count = slice->mesh.face_count;
    l->now.corners = (const double(*)[3][3])l->corners;
    l->now.numbers = l->numbers;
    l->now.repeated = l->repeated;
    for (uint32_t face = 0; face < slice->mesh.face_count; face++)
        take_face(l, slice, face);
}
