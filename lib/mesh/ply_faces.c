/* Faces and strips of a PLY file become triangles. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/workspace.h"
#include "geometry/polygon.h"
#include "mesh/ply_attributes.h"
#include "mesh/ply_faces.h"

#define MOST_FACES (UINT64_C(0xfffffffe))

ebpo_status ebpo_ply_reserve_corners(ply_parser *p, uint64_t count)
{
    p->corner_count = 0;
    if (!ebpo_grow(&p->corners, &p->corner_capacity, count, sizeof *p->corners))
        return ebpo_fail_memory(p->error, count * sizeof *p->corners);
    return EBPO_OK;
}

ebpo_status ebpo_ply_fail_index(const ply_parser *p, const ply_element *element, uint64_t row,
                                int64_t index)
{
    return ebpo_ply_fail(p,
                         "%s %" PRIu64 " names vertex %" PRId64 ", but there are %" PRIu64
                         " vertices; repair the file or drop the %s",
                         ebpo_ply_row_name(element), row, index,
                         p->header.element[p->header.vertex].count, ebpo_ply_row_name(element));
}

static ebpo_status face_capacity(ply_parser *p, uint64_t more)
{
    ebpo_mesh *mesh = p->mesh;
    if (more > MOST_FACES - mesh->face_count)
        return ebpo_fail_file(p->error, EBPO_E_LIMIT, p->name,
                              "more than 2^32 - 2 triangles; split the model");
    if (!ebpo_array_grow(mesh->workspace, &mesh->faces, &p->face_capacity, mesh->face_count + more,
                         3 * sizeof *mesh->faces))
        return ebpo_workspace_fail(mesh->workspace,
                                   (mesh->face_count + more) * 3 * sizeof *mesh->faces, p->error);
    return ebpo_ply_attributes_reserve(p, mesh->face_count + more);
}

static void add_triangle(ebpo_mesh *mesh, uint32_t a, uint32_t b, uint32_t c)
{
    uint32_t *face = mesh->faces + 3 * mesh->face_count++;
    face[0] = a;
    face[1] = b;
    face[2] = c;
}

/* Scratch holds, one behind the other: corner positions, triangles, and what the triangulation asks
 * for. */
static ebpo_status scratch_capacity(ply_parser *p, uint64_t n)
{
    uint64_t each = 3 * sizeof(double) + 3 * sizeof(uint32_t) + sizeof(uint32_t), bytes;
    if (!ebpo_mul_ok(n, each, &bytes) ||
        __builtin_add_overflow(bytes, ebpo_polygon_scratch_bytes(n), &bytes))
        return ebpo_fail_memory(p->error, UINT64_MAX);
    if (!ebpo_grow(&p->scratch, &p->scratch_capacity, bytes, 1))
        return ebpo_fail_memory(p->error, bytes);
    return EBPO_OK;
}

static void corner_position(const ebpo_mesh *mesh, uint32_t vertex, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = mesh->xyz64 ? mesh->xyz64[3 * (uint64_t)vertex + k]
                             : (double)mesh->xyz32[3 * (uint64_t)vertex + k];
}

static ebpo_status triangulate(ply_parser *p, uint32_t n, uint64_t row)
{
    ebpo_status status = scratch_capacity(p, n);
    if (status == EBPO_OK)
        status = face_capacity(p, n - 2);
    if (status != EBPO_OK)
        return status;
    double(*position)[3] = p->scratch;
    uint32_t(*triangle)[3] = (uint32_t(*)[3])(position + n);
    void *scratch = triangle + n + (n & 1); /* stays aligned for doubles */
    for (uint32_t i = 0; i < n; i++)
        corner_position(p->mesh, p->corners[i], position[i]);
    ebpo_polygon_kind kind =
        ebpo_polygon_triangulate(triangle, (const double(*)[3])position, n, scratch);
    if (kind == EBPO_POLYGON_NO_MEMORY)
        return ebpo_fail_memory(p->error, n * sizeof *position);
    if (kind == EBPO_POLYGON_TOO_LARGE)
        return ebpo_fail_file(
            p->error, EBPO_E_LIMIT, p->name,
            "face %" PRIu64 " is a concave polygon of %" PRIu32
            " corners, too intricate to be cut into triangles here; triangulate it in the source",
            row, n);
    p->mesh->polygons_triangulated++;
    p->mesh->polygons_concave += kind == EBPO_POLYGON_CONCAVE;
    if (kind == EBPO_POLYGON_GUESSED && p->mesh->polygons_guessed++ == 0)
        p->mesh->first_guessed_face = p->mesh->face_count;
    uint64_t first = p->mesh->face_count;
    for (uint32_t i = 0; i < n - 2; i++)
        add_triangle(p->mesh, p->corners[triangle[i][0]], p->corners[triangle[i][1]],
                     p->corners[triangle[i][2]]);
    return ebpo_ply_repeat_face(p, first);
}

ebpo_status ebpo_ply_add_polygon(ply_parser *p, uint64_t row)
{
    if (p->corner_count < 3) {
        p->mesh->polygons_dropped++;
        return EBPO_OK;
    }
    if (p->corner_count > 3)
        return p->corner_count > MOST_FACES
                   ? ebpo_fail_file(p->error, EBPO_E_LIMIT, p->name,
                                    "face %" PRIu64 " has more than 2^32 - 2 corners", row)
                   : triangulate(p, (uint32_t)p->corner_count, row);
    ebpo_status status = face_capacity(p, 1);
    if (status == EBPO_OK)
        add_triangle(p->mesh, p->corners[0], p->corners[1], p->corners[2]);
    return status;
}

/* Every second triangle of a strip runs the other way. Triangles that repeat a vertex are the glue
 * between parts of a strip, not faces. */
static void unroll(ebpo_mesh *mesh, const uint32_t *v, uint64_t n)
{
    mesh->strips++;
    for (uint64_t i = 0; i + 2 < n; i++) {
        uint32_t a = v[i], b = v[i + 1], c = v[i + 2];
        if (a == b || b == c || a == c)
            continue;
        if (i & 1)
            add_triangle(mesh, b, a, c);
        else
            add_triangle(mesh, a, b, c);
    }
}

ebpo_status ebpo_ply_add_strip(ply_parser *p, uint64_t row)
{
    (void)row;
    uint64_t n = p->corner_count;
    uint64_t first = p->mesh->face_count;
    ebpo_status status = n < 3 ? EBPO_OK : face_capacity(p, n - 2);
    for (uint64_t begin = 0; begin < n && status == EBPO_OK;) {
        uint64_t end = begin;
        while (end < n && p->corners[end] != PLY_RESTART)
            end++;
        if (end - begin >= 3)
            unroll(p->mesh, p->corners + begin, end - begin);
        begin = end + 1;
    }
    if (status == EBPO_OK)
        ebpo_ply_blank_faces(p, first);
    return status;
}
