/* Reads the faces of all operands and finds the pairs that intersect.
 *
 * Faces without area are not listed in pairs: they bound nothing, and the points of their edges are
 * corners of faces with an area, which touch the faces beside them and are found as pairs. */
#include "core/strict_fp.h"

#include "extras/boolean/face_list.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "extras/collide/collider.h"
#include "geometry/predicates.h"

/* --- faces --- */

static ebpo_status count_faces(ebpo_face_list *faces, ebpo_error *error)
{
    const ebpo_boolean *b = faces->boolean;
    uint64_t count = 0;
    for (uint32_t i = 0; i < b->count; i++) {
        faces->first[i] = (uint32_t)count;
        count += faces->same[i] ? b->solid[i].model->info->face_count : 0;
        if (count > INT32_MAX)
            return ebpo_fail(error, EBPO_E_LIMIT,
                             "the operands have more than 2^31 - 1 faces; cut smaller models");
    }
    faces->count = faces->first[b->count] = (uint32_t)count;
    faces->face = ebpo_alloc(count, sizeof *faces->face);
    return faces->face ? EBPO_OK : ebpo_fail_memory(error, count * sizeof *faces->face);
}

static bool number_vertices(ebpo_face_list *faces, const ebpo_mesh *mesh, const ebpo_posing *posing,
                            uint32_t *number)
{
    for (uint64_t v = 0; v < mesh->vertex_count; v++) {
        double x[3], posed[3];
        for (unsigned k = 0; k < 3; k++)
            x[k] = mesh->xyz64 ? mesh->xyz64[3 * v + k] : (double)mesh->xyz32[3 * v + k];
        ebpo_posing_apply(posing, x, posed);
        if (!ebpo_corner_id(&faces->corners, posed, &number[v]))
            return false;
    }
    return true;
}

static void list_faces(ebpo_face_list *faces, uint32_t operand, const ebpo_mesh *mesh,
                       const uint32_t *number)
{
    for (uint64_t f = 0; f < mesh->face_count; f++) {
        uint32_t *corner = faces->face[faces->first[operand] + f];
        for (unsigned i = 0; i < 3; i++)
            corner[i] = number[mesh->faces[3 * f + i]];
        const double(*at)[3] = (const double(*)[3])faces->corners.at;
        if (ebpo_zero_area(at[corner[0]], at[corner[1]], at[corner[2]]))
            corner[0] = EBPO_NO_CORNER;
    }
}

static ebpo_status read_operand(ebpo_face_list *faces, uint32_t operand, ebpo_error *error)
{
    const ebpo_posed_solid *solid = &faces->boolean->solid[operand];
    ebpo_read_options how = EBPO_READ_OPTIONS_INIT;
    ebpo_mesh mesh;
    how.threads = faces->boolean->threads;
    ebpo_status status = ebpo_file_read_mesh(solid->model->file, &how, &mesh, error);
    if (status != EBPO_OK)
        return status;
    uint32_t *number = ebpo_alloc(mesh.vertex_count, sizeof *number);
    if (number && number_vertices(faces, &mesh, &solid->posing, number))
        list_faces(faces, operand, &mesh, number);
    else
        status = ebpo_fail_memory(error, mesh.vertex_count * (sizeof *number + 40));
    faces->floats = faces->floats && mesh.xyz32;
    free(number);
    ebpo_mesh_free(&mesh);
    return status;
}

ebpo_status ebpo_face_list_read(ebpo_face_list *out, const ebpo_boolean *b,
                                const ebpo_progress *progress, ebpo_error *error)
{
    *out = (ebpo_face_list){ .boolean = b, .floats = true };
    ebpo_boolean_find_equal(b, out->same);
    if (!ebpo_progress_stage(progress, "read faces", error))
        return EBPO_E_CANCELLED;
    ebpo_status status = count_faces(out, error);
    for (uint32_t i = 0; i < b->count && status == EBPO_OK; i++) {
        ebpo_error cause = EBPO_ERROR_INIT;
        if (out->same[i] && read_operand(out, i, &cause) != EBPO_OK)
            status = ebpo_fail_operand(b->solid[i].model, i, &cause, error);
    }
    out->given_corners = out->corners.count;
    return status;
}

uint32_t ebpo_face_list_operand(const ebpo_face_list *faces, uint32_t face)
{
    uint32_t i = 0;
    while (face >= faces->first[i + 1])
        i++;
    return i;
}

void ebpo_face_list_free(ebpo_face_list *faces)
{
    ebpo_corner_ids_free(&faces->corners);
    free(faces->face);
    free(faces->begin);
    free(faces->partner);
}

/* --- pairs --- */

typedef struct pair_search {
    ebpo_face_list *faces;
    uint32_t first, second; /* first faces of the two operands */
    uint32_t (*pair)[2];
    uint64_t count, capacity;
    bool full;
} pair_search;

static bool take_pairs(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    pair_search *s = user;
    s->full = !ebpo_grow(&s->pair, &s->capacity, s->count + count, sizeof *s->pair);
    for (uint64_t i = 0; i < count && !s->full; i++) {
        uint32_t a = s->first + (uint32_t)pairs[i].file_face_a,
                 b = s->second + (uint32_t)pairs[i].file_face_b;
        if (s->faces->face[a][0] == EBPO_NO_CORNER || s->faces->face[b][0] == EBPO_NO_CORNER)
            continue;
        s->pair[s->count][0] = a;
        s->pair[s->count++][1] = b;
    }
    return !s->full;
}

static ebpo_status search_operands(pair_search *s, uint32_t i, uint32_t k,
                                   const ebpo_progress *progress, ebpo_error *error)
{
    const ebpo_boolean *b = s->faces->boolean;
    const double *x = b->solid[i].box, *y = b->solid[k].box;
    ebpo_collider *collider;
    ebpo_collider_options how = EBPO_COLLIDER_OPTIONS_INIT;
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    if (ebpo_box_gap(x, x + 3, y, y + 3) > 0)
        return EBPO_OK;
    s->first = s->faces->first[i];
    s->second = s->faces->first[k];
    how.threads = b->threads;
    options.pose_a = b->pose[i];
    options.pose_b = b->pose[k];
    options.progress = *progress;
    ebpo_status status =
        ebpo_collider_new(b->solid[i].model, b->solid[k].model, &how, &collider, error);
    if (status != EBPO_OK)
        return status;
    status = i == k ? ebpo_collide_self_posed(collider, &options, take_pairs, s, error)
                    : ebpo_collide_all(collider, &options, take_pairs, s, error);
    ebpo_collider_free(collider);
    return s->full ? ebpo_fail_memory(error, s->count * sizeof *s->pair) : status;
}

static int order_numbers(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Lists each pair at both of its faces. */
static ebpo_status list_partners(pair_search *s, ebpo_error *error)
{
    ebpo_face_list *faces = s->faces;
    faces->begin = ebpo_alloc_zero((uint64_t)faces->count + 2, sizeof *faces->begin);
    faces->partner = ebpo_alloc(2 * s->count, sizeof *faces->partner);
    if (!faces->begin || !faces->partner)
        return ebpo_fail_memory(error, 8 * (faces->count + s->count));
    uint64_t *end = faces->begin + 1; /* while filling: end[i + 1] is the end of face i's list */
    for (uint64_t i = 0; i < 2 * s->count; i++)
        end[s->pair[i / 2][i % 2] + 1]++;
    for (uint32_t f = 0; f < faces->count; f++)
        end[f + 1] += end[f];
    for (uint64_t i = 0; i < 2 * s->count; i++)
        faces->partner[end[s->pair[i / 2][i % 2]]++] = s->pair[i / 2][1 - i % 2];
    for (uint32_t f = 0; f < faces->count; f++)
        if (faces->begin[f + 1] - faces->begin[f] > 1)
            qsort(faces->partner + faces->begin[f], faces->begin[f + 1] - faces->begin[f],
                  sizeof *faces->partner, order_numbers);
    return EBPO_OK;
}

ebpo_status ebpo_face_list_find_pairs(ebpo_face_list *faces, const ebpo_progress *progress,
                                      ebpo_error *error)
{
    pair_search s = { .faces = faces };
    ebpo_status status = EBPO_OK;
    for (uint32_t i = 0; i < faces->boolean->count && status == EBPO_OK; i++)
        for (uint32_t k = i; k < faces->boolean->count && status == EBPO_OK; k++)
            if (faces->same[i] && faces->same[k])
                status = search_operands(&s, i, k, progress, error);
    if (status == EBPO_OK)
        status = list_partners(&s, error);
    free(s.pair);
    return status;
}
