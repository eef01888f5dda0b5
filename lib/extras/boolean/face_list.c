/* Lists the faces that are cut, and their neighbours.
 *
 * Pairs of intersecting faces are found first, in the hierarchies of the models. Then each operand
 * is read once to find which of its faces to list. So the size of the list depends on the cut, not
 * on the size of the models.
 *
 * The partners of a face are the faces with which it is paired. Faces without area bound nothing,
 * so they get no partners. No cut is lost: the edges of such a face are also edges of faces with an
 * area, whose pairs are found. */
#include "core/strict_fp.h"

#include "extras/boolean/face_list.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/workspace.h"
#include "extras/boolean/base_faces.h"
#include "extras/collide/collider.h"
#include "geometry/predicates.h"
#include "mesh/mesh_parts.h"

/* --- pairs --- */

typedef struct pair_search {
    ebpo_face_list *faces;
    uint8_t operand[2]; /* the operands of the two faces of each pair */
    bool full;          /* there was not enough memory for a pair */
} pair_search;

static bool take_pairs(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    pair_search *s = user;
    ebpo_face_list *f = s->faces;
    s->full = !ebpo_grow(&f->pair, &f->pair_capacity, f->pairs + count, sizeof *f->pair);
    for (uint64_t i = 0; i < count && !s->full; i++)
        f->pair[f->pairs++] = (ebpo_operand_pair){
            { (uint32_t)pairs[i].file_face_a, (uint32_t)pairs[i].file_face_b },
            { s->operand[0], s->operand[1] },
        };
    return !s->full;
}

/* Adds the pairs of intersecting faces of operands i and k; i == k: self-intersections. */
static ebpo_status search_operands(ebpo_face_list *faces, uint32_t i, uint32_t k,
                                   const ebpo_progress *progress, ebpo_error *error)
{
    const ebpo_boolean *b = faces->boolean;
    const double *x = b->solid[i].box, *y = b->solid[k].box;
    pair_search s = { .faces = faces, .operand = { (uint8_t)i, (uint8_t)k } };
    ebpo_collider *collider;
    ebpo_collider_options collider_options = EBPO_COLLIDER_OPTIONS_INIT;
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    if (ebpo_box_gap(x, x + 3, y, y + 3) > 0)
        return EBPO_OK;
    collider_options.threads = b->threads;
    options.pose_a = b->pose[i];
    options.pose_b = b->pose[k];
    options.progress = *progress;
    ebpo_status status = ebpo_collider_new(b->solid[i].model, b->solid[k].model, &collider_options,
                                           &collider, error);
    if (status != EBPO_OK)
        return status;
    status = i == k ? ebpo_collide_self_posed(collider, &options, take_pairs, &s, error)
                    : ebpo_collide_all(collider, &options, take_pairs, &s, error);
    ebpo_collider_free(collider);
    return s.full ? ebpo_fail_memory(error, faces->pairs * sizeof *faces->pair) : status;
}

static ebpo_status find_pairs(ebpo_face_list *faces, const ebpo_progress *progress,
                              ebpo_error *error)
{
    uint32_t count = faces->boolean->count;
    ebpo_status status = EBPO_OK;
    for (uint32_t i = 0; i < count && status == EBPO_OK; i++)
        for (uint32_t k = i; k < count && status == EBPO_OK; k++)
            if (faces->equal[i] && faces->equal[k] && !(i == k && ebpo_face_list_is_base(faces, i)))
                status = search_operands(faces, i, k, progress, error);
    return status;
}

/* --- listing --- */

/* Gives a corner a number, and notes which of its coordinates are -0. */
static bool number_corner(ebpo_face_list *faces, const double x[3], uint32_t *number)
{
    uint64_t known = faces->corners.count;
    if (!ebpo_corner_id(&faces->corners, x, number) ||
        !ebpo_grow(&faces->negative_zeros, &faces->negative_zeros_capacity, faces->corners.count,
                   sizeof *faces->negative_zeros))
        return false;
    if (*number < known)
        return true;
    faces->negative_zeros[*number] = 0;
    for (int k = 0; k < 3; k++)
        faces->negative_zeros[*number] |= (uint8_t)((x[k] == 0 && signbit(x[k]) ? 1u : 0u) << k);
    return true;
}

/* Adds face f of an operand's file to the list. p: its corners. Returns false without memory or
 * with 2^31 - 1 faces. */
static bool list_face(ebpo_face_list *faces, const double p[3][3], uint64_t f)
{
    if (!ebpo_grow(&faces->face, &faces->face_capacity, (uint64_t)faces->count + 1,
                   sizeof *faces->face) ||
        !ebpo_grow(&faces->file_face, &faces->file_face_capacity, (uint64_t)faces->count + 1,
                   sizeof *faces->file_face) ||
        faces->count >= INT32_MAX)
        return false;
    uint32_t *corner = faces->face[faces->count];
    faces->file_face[faces->count++] = (uint32_t)f;
    for (int i = 0; i < 3; i++)
        if (!number_corner(faces, p[i], &corner[i]))
            return false;
    if (ebpo_zero_area(p[0], p[1], p[2]))
        corner[0] = EBPO_NO_CORNER;
    return true;
}

static bool list_mesh_face(ebpo_face_list *faces, const ebpo_mesh *mesh, uint64_t f)
{
    double p[3][3];
    for (int i = 0; i < 3; i++)
        ebpo_mesh_position(mesh, mesh->faces[3 * f + (unsigned)i], p[i]);
    return list_face(faces, (const double(*)[3])p, f);
}

/* Makes a bit for each face of the operand: 1 if the face is in a pair. */
static uint64_t *mark_paired(const ebpo_face_list *faces, uint32_t operand, uint64_t count)
{
    uint64_t *paired = ebpo_alloc_zero(count / 64 + 1, sizeof *paired);
    for (uint64_t i = 0; i < 2 * faces->pairs && paired; i++)
        if (faces->pair[i / 2].operand[i % 2] == operand)
            ebpo_set_bit(paired, faces->pair[i / 2].face[i % 2]);
    return paired;
}

static ebpo_status list_faces(ebpo_face_list *faces, uint32_t operand, const ebpo_mesh *mesh,
                              const ebpo_progress *progress, ebpo_error *error)
{
    const ebpo_boolean *b = faces->boolean;
    ebpo_whole_faces *whole = &faces->whole[operand];
    ebpo_error cause = EBPO_ERROR_INIT;
    uint64_t *paired = mark_paired(faces, operand, mesh->face_count);
    ebpo_status status =
        paired ? ebpo_whole_faces_find(whole, mesh, paired, b->threads, progress, &cause)
               : ebpo_fail_memory(&cause, mesh->face_count / 8);
    free(paired);
    bool listed_all = true;
    EBPO_FOR_ITEMS(mesh->workspace, f, 0, status == EBPO_OK ? mesh->face_count : 0)
        listed_all =
            listed_all && (!ebpo_has_bit(whole->listed, f) || list_mesh_face(faces, mesh, f));
    if (!listed_all)
        status = ebpo_fail_memory(&cause, (uint64_t)faces->count * sizeof *faces->face);
    return status == EBPO_OK ? EBPO_OK
                             : ebpo_fail_operand(b->solid[operand].model, operand, &cause, error);
}

/* Lists the faces of the base near other operands. */
static ebpo_status list_base(ebpo_face_list *faces, const ebpo_progress *progress,
                             ebpo_error *error)
{
    const ebpo_boolean *b = faces->boolean;
    ebpo_base_faces near;
    faces->keeps_base = ebpo_boolean_holds(b, faces->equal[0]);
    ebpo_status status = ebpo_base_faces_find(b, faces->equal[0], progress, &near, error);
    if (status == EBPO_OK) {
        faces->base_source = ebpo_alloc(near.count, sizeof *faces->base_source);
        bool listed_all = faces->base_source != NULL;
        for (uint64_t i = 0; i < near.count && listed_all; i++) {
            const ebpo_base_face *f = &near.face[i];
            faces->base_source[i] = f->source;
            listed_all = list_face(faces, (const double(*)[3])f->corner, f->file_face);
        }
        if (!listed_all)
            status = ebpo_fail_memory(error, near.count * sizeof *near.face);
        faces->base_differs = near.differs;
        near.differs = NULL;
    }
    ebpo_base_faces_free(&near);
    return status;
}

static ebpo_status read_operands(ebpo_face_list *faces, const ebpo_progress *progress,
                                 ebpo_error *error)
{
    const ebpo_boolean *b = faces->boolean;
    ebpo_status status = EBPO_OK;
    for (uint32_t i = 0; i < b->count && status == EBPO_OK; i++) {
        ebpo_mesh mesh;
        faces->first[i] = faces->count;
        if (!faces->equal[i])
            continue;
        if (!ebpo_progress_stage(progress, "read faces", error))
            return EBPO_E_CANCELLED;
        if (ebpo_face_list_is_base(faces, i)) {
            status = list_base(faces, progress, error);
            continue;
        }
        status = ebpo_operand_mesh_read(&mesh, b, i, false, faces->workspace, error);
        if (status != EBPO_OK)
            return status;
        status = list_faces(faces, i, &mesh, progress, error);
        ebpo_mesh_free(&mesh);
    }
    faces->first[b->count] = faces->count;
    faces->given_corners = faces->corners.count;
    return status;
}

uint32_t ebpo_face_list_operand(const ebpo_face_list *faces, uint32_t face)
{
    uint32_t i = 0;
    while (face >= faces->first[i + 1])
        i++;
    return i;
}

/* --- partners --- */

/* Returns the index in the list of face `file_face` of an operand. The face must be listed; all
 * faces in pairs are. */
static uint32_t find_listed(const ebpo_face_list *faces, uint32_t operand, uint32_t file_face)
{
    uint32_t low = faces->first[operand], high = faces->first[operand + 1];
    while (high - low > 1) {
        uint32_t middle = low + (high - low) / 2;
        if (faces->file_face[middle] <= file_face)
            low = middle;
        else
            high = middle;
    }
    return low;
}

static int order_numbers(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Replaces the faces of pairs by their indices in the list. Drops pairs with a face without area.
 */
static void replace_by_listed(ebpo_face_list *faces)
{
    uint64_t kept = 0;
    for (uint64_t i = 0; i < faces->pairs; i++) {
        ebpo_operand_pair *p = &faces->pair[i];
        for (int k = 0; k < 2; k++)
            p->face[k] = find_listed(faces, p->operand[k], p->face[k]);
        if (faces->face[p->face[0]][0] != EBPO_NO_CORNER &&
            faces->face[p->face[1]][0] != EBPO_NO_CORNER)
            faces->pair[kept++] = *p;
    }
    faces->pairs = kept;
}

/* Lists the partners of each face: each face of a pair is a partner of the other face. */
static ebpo_status list_partners(ebpo_face_list *faces, ebpo_error *error)
{
    replace_by_listed(faces);
    faces->begin = ebpo_alloc_zero((uint64_t)faces->count + 2, sizeof *faces->begin);
    faces->partner = ebpo_alloc(2 * faces->pairs, sizeof *faces->partner);
    if (!faces->begin || !faces->partner)
        return ebpo_fail_memory(error, 8 * (faces->count + faces->pairs));
    uint64_t *end =
        faces->begin + 1; /* end[i]: first the start of face i's list; after filling, its end */
    for (uint64_t i = 0; i < 2 * faces->pairs; i++)
        end[faces->pair[i / 2].face[i % 2] + 1]++;
    for (uint32_t f = 0; f < faces->count; f++)
        end[f + 1] += end[f];
    for (uint64_t i = 0; i < 2 * faces->pairs; i++)
        faces->partner[end[faces->pair[i / 2].face[i % 2]]++] = faces->pair[i / 2].face[1 - i % 2];
    for (uint32_t f = 0; f < faces->count; f++)
        if (faces->begin[f + 1] - faces->begin[f] > 1)
            qsort(faces->partner + faces->begin[f], faces->begin[f + 1] - faces->begin[f],
                  sizeof *faces->partner, order_numbers);
    free(faces->pair);
    faces->pair = NULL;
    return EBPO_OK;
}

/* --- all of it --- */

ebpo_status ebpo_face_list_make(ebpo_face_list *out, const ebpo_boolean *b, bool changed_only,
                                ebpo_workspace *workspace, const ebpo_progress *progress,
                                ebpo_error *error)
{
    *out = (ebpo_face_list){ .boolean = b, .workspace = workspace, .changed_only = changed_only };
    ebpo_boolean_find_equal(b, out->equal);
    if (changed_only && !out->equal[0])
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the changes of operand 1 are wanted, but the expression does not use "
                         "this operand");
    for (uint32_t i = 0; i < b->count; i++)
        if (b->solid[i].model->info->face_count > INT32_MAX)
            return ebpo_fail(error, EBPO_E_LIMIT,
                             "operand %u has more than 2^31 - 1 faces; cut smaller models", i + 1);
    ebpo_status status = find_pairs(out, progress, error);
    if (status == EBPO_OK)
        status = read_operands(out, progress, error);
    return status == EBPO_OK ? list_partners(out, error) : status;
}

void ebpo_face_list_free(ebpo_face_list *faces)
{
    ebpo_corner_ids_free(&faces->corners);
    for (uint32_t i = 0; i < faces->boolean->count; i++)
        ebpo_whole_faces_free(&faces->whole[i]);
    free(faces->base_source);
    free(faces->base_differs);
    free(faces->negative_zeros);
    free(faces->face);
    free(faces->file_face);
    free(faces->pair);
    free(faces->begin);
    free(faces->partner);
}
