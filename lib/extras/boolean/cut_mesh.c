/* Cuts the listed faces of all operands. Equal points become one vertex.
 *
 * Threads cut faces separately. The pieces of a face are its triangles and points (face_cut.h).
 * Then points get vertex indices in the order of the faces, so the result does not depend on the
 * number of threads. */
#include "core/strict_fp.h"

#include "extras/boolean/cut_mesh.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "geometry/integer_vectors.h"

static const char stage[] = "cut faces";

enum { FACES_AT_ONCE = 1 << 14, GRAIN = 16 };

/* Bit of a provisional vertex index: the other bits are the index of a new point in
 * ebpo_cut_mesh.set. The final indices of new points follow those of the faces' corners. So
 * number_vertices replaces provisional indices when all corners have been counted. */
#define NEW_POINT (UINT32_C(1) << 31)

typedef struct cutting {
    ebpo_cut_mesh *cut;
    const ebpo_face_list *faces;
    const uint32_t *face;     /* the faces that are cut in parallel now */
    ebpo_face_cutter *cutter; /* [threads] */
    ebpo_face_pieces *pieces; /* [FACES_AT_ONCE] */
} cutting;

static bool has_partners(const ebpo_face_list *faces, uint32_t face)
{
    return faces->begin[face + 1] > faces->begin[face];
}

/* Returns the greatest u for which all coordinates of faces with partners are multiples of 2^u. */
static int find_unit(const ebpo_face_list *faces)
{
    int unit = EBPO_UNIT_OF_ZEROS;
    for (uint32_t f = 0; f < faces->count; f++)
        for (int i = 0; i < 3 && has_partners(faces, f); i++)
            unit = ebpo_common_unit(ebpo_face_list_corner(faces, f, i), 3, unit);
    return unit == EBPO_UNIT_OF_ZEROS ? 0 : unit;
}

static ebpo_status cut_some(void *context, uint64_t begin, uint64_t end, unsigned worker,
                            ebpo_error *error)
{
    cutting *c = context;
    for (uint64_t i = begin; i < end; i++)
        if (!ebpo_face_cut(&c->cutter[worker], c->face[i], &c->pieces[i]))
            return ebpo_fail_memory(error, 1 << 20);
    return EBPO_OK;
}

/* --- numbers of points --- */

static bool add_triangle(ebpo_cut_mesh *cut, uint32_t face, const uint32_t corner[3])
{
    if (cut->count >= INT32_MAX ||
        !ebpo_grow(&cut->triangle, &cut->triangle_capacity, cut->count + 1,
                   sizeof *cut->triangle) ||
        !ebpo_grow(&cut->face, &cut->face_capacity, cut->count + 1, sizeof *cut->face))
        return false;
    memcpy(cut->triangle[cut->count], corner, sizeof cut->triangle[0]);
    cut->face[cut->count++] = face;
    return true;
}

static bool number_points(ebpo_cut_mesh *cut, ebpo_face_pieces *pieces, uint32_t *number)
{
    for (uint32_t i = 0; i < pieces->points; i++) {
        ebpo_exact_point *p = &pieces->point[i];
        bool exact = p->exact; /* read first, because ebpo_point_set_add may swap the contents */
        if (exact ? !ebpo_corner_id(&cut->faces->corners, p->at, &number[i])
                  : !ebpo_point_set_add(&cut->set, p, &number[i]))
            return false;
        number[i] |= exact ? 0 : NEW_POINT;
    }
    return true;
}

static bool add_pieces(ebpo_cut_mesh *cut, uint32_t face, const ebpo_face_pieces *pieces,
                       const uint32_t *number)
{
    uint32_t first = (uint32_t)cut->count;
    for (uint32_t i = 0; i < pieces->triangles; i++) {
        uint32_t corner[3];
        for (int k = 0; k < 3; k++)
            corner[k] = number[pieces->triangle[i][k]];
        if (!add_triangle(cut, face, pieces->points == 3 ? cut->faces->face[face] : corner))
            return false;
    }
    if (!ebpo_grow(&cut->cover, &cut->cover_capacity, cut->covers + pieces->covers,
                   sizeof *cut->cover))
        return false;
    for (uint32_t i = 0; i < pieces->covers; i++) {
        ebpo_cover *cover = &cut->cover[cut->covers++];
        *cover = pieces->cover[i];
        cover->triangle += first;
    }
    cut->faces_cut += pieces->points > 3;
    return true;
}

static bool merge_pieces(ebpo_cut_mesh *cut, uint32_t face, ebpo_face_pieces *pieces)
{
    uint32_t *number = ebpo_alloc(pieces->points, sizeof *number);
    bool done =
        number && number_points(cut, pieces, number) && add_pieces(cut, face, pieces, number);
    free(number);
    ebpo_face_pieces_free(pieces);
    return done;
}

/* --- all faces --- */

/* Adds the triangles of the faces [begin, end). The pieces of the faces that were cut are in
 * c->pieces; a face without partners is one triangle. */
static bool merge_faces(cutting *c, uint32_t begin, uint32_t end)
{
    uint64_t at = 0;
    for (uint32_t f = begin; f < end; f++) {
        if (has_partners(c->faces, f) ? !merge_pieces(c->cut, f, &c->pieces[at++])
                                      : c->faces->face[f][0] != EBPO_NO_CORNER &&
                                            !add_triangle(c->cut, f, c->faces->face[f]))
            return false;
    }
    return true;
}

static ebpo_status cut_all(cutting *c, const ebpo_progress *progress, ebpo_error *error)
{
    const ebpo_face_list *faces = c->faces;
    uint32_t *list = ebpo_alloc(FACES_AT_ONCE, sizeof *list);
    ebpo_status status = list ? EBPO_OK : ebpo_fail_memory(error, FACES_AT_ONCE * sizeof *list);
    c->face = list;
    for (uint32_t begin = 0, end = 0; end < faces->count && status == EBPO_OK; begin = end) {
        uint64_t count = 0;
        for (; end < faces->count && count < FACES_AT_ONCE; end++)
            if (has_partners(faces, end))
                list[count++] = end;
        if (!ebpo_progress_step(progress, stage, begin, faces->count, error))
            status = EBPO_E_CANCELLED;
        else
            status = ebpo_parallel_for(faces->boolean->threads, NULL, count, GRAIN, cut_some, c,
                                       NULL, stage, error);
        if (status == EBPO_OK && !merge_faces(c, begin, end))
            status = c->cut->count >= INT32_MAX || c->cut->set.count > INT32_MAX
                         ? ebpo_fail(error, EBPO_E_LIMIT,
                                     "the cut faces have more than 2^31 - 1 parts or points")
                         : ebpo_fail_memory(error, c->cut->count * sizeof *c->cut->triangle);
        for (uint64_t i = 0; i < count; i++)
            ebpo_face_pieces_free(&c->pieces[i]);
    }
    free(list);
    return status;
}

static ebpo_status number_vertices(ebpo_cut_mesh *cut, ebpo_error *error)
{
    uint64_t corners = cut->faces->corners.count;
    if (ebpo_cut_mesh_vertices(cut) >= UINT32_MAX || corners > NEW_POINT)
        return ebpo_fail(error, EBPO_E_LIMIT, "the cut faces have more than 2^31 vertices");
    for (uint64_t i = 0; i < 3 * cut->count; i++) {
        uint32_t *v = &cut->triangle[i / 3][i % 3];
        if (*v & NEW_POINT)
            *v = (*v & ~NEW_POINT) + (uint32_t)corners;
    }
    return EBPO_OK;
}

ebpo_status ebpo_cut_mesh_make(ebpo_cut_mesh *out, ebpo_face_list *faces,
                               const ebpo_progress *progress, ebpo_error *error)
{
    unsigned threads = faces->boolean->threads;
    *out = (ebpo_cut_mesh){ .faces = faces, .unit = find_unit(faces) };
    cutting c = { .cut = out, .faces = faces };
    c.cutter = ebpo_alloc_zero(threads, sizeof *c.cutter);
    c.pieces = ebpo_alloc_zero(FACES_AT_ONCE, sizeof *c.pieces);
    ebpo_status status =
        c.cutter && c.pieces ? EBPO_OK : ebpo_fail_memory(error, FACES_AT_ONCE * sizeof *c.pieces);
    for (unsigned i = 0; i < threads && status == EBPO_OK; i++)
        ebpo_face_cutter_init(&c.cutter[i], faces, out->unit);
    if (status == EBPO_OK) {
        status = cut_all(&c, progress, error);
        for (unsigned i = 0; i < threads; i++)
            ebpo_face_cutter_free(&c.cutter[i]);
    }
    free(c.cutter);
    free(c.pieces);
    return status == EBPO_OK ? number_vertices(out, error) : status;
}

void ebpo_cut_mesh_coordinate(const ebpo_cut_mesh *cut, uint32_t vertex, int k, mpq_t out)
{
    uint64_t corners = cut->faces->corners.count;
    if (vertex < corners) {
        mpq_set_d(out, cut->faces->corners.at[vertex][k]);
        return;
    }
    const ebpo_exact_point *p = &cut->set.point[vertex - corners];
    mpq_set_num(out, p->x[k]);
    mpq_set_den(out, p->x[3]);
    mpq_canonicalize(out);
    if (cut->unit < 0)
        mpq_div_2exp(out, out, (mp_bitcnt_t)-cut->unit);
    else
        mpq_mul_2exp(out, out, (mp_bitcnt_t)cut->unit);
}

void ebpo_cut_mesh_free(ebpo_cut_mesh *cut)
{
    ebpo_point_set_free(&cut->set);
    free(cut->triangle);
    free(cut->face);
    free(cut->cover);
}
