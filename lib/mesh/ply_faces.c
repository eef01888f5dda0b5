/* Converts faces and strips of a PLY file to triangles. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/parallel.h"
#include "geometry/polygon.h"
#include "mesh/ply_parts.h"

#define MAX_FACES (UINT64_C(0xfffffffe))

ebpo_status ebpo_ply_reserve_corners(ebpo_ply_parser *p, uint64_t count)
{
    p->corner_count = 0;
    if (!ebpo_grow(&p->corners, &p->corner_capacity, count, sizeof *p->corners))
        return ebpo_fail_memory(p->error, count * sizeof *p->corners);
    return EBPO_OK;
}

ebpo_status ebpo_ply_fail_index(const ebpo_ply_parser *p, const ebpo_ply_element *element,
                                uint64_t row, int64_t index)
{
    return ebpo_ply_fail(p,
                         "%s %" PRIu64 " names vertex %" PRId64 ", but there are %" PRIu64
                         " vertices; repair the file or drop the %s",
                         ebpo_ply_row_name(element), row, index,
                         p->header.element[p->header.vertex].count, ebpo_ply_row_name(element));
}

static ebpo_status reserve_faces(ebpo_ply_parser *p, uint64_t more)
{
    ebpo_mesh *mesh = p->mesh;
    if (more > MAX_FACES - mesh->face_count)
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

/* Reserves scratch memory for corner positions, triangles and the workspace of the triangulation,
 * in this order. */
static ebpo_status reserve_scratch(ebpo_ply_parser *p, uint64_t n)
{
    uint64_t corner_bytes = 3 * sizeof(double) + 3 * sizeof(uint32_t) + sizeof(uint32_t), bytes;
    if (!ebpo_mul_ok(n, corner_bytes, &bytes) ||
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

/* Adds the triangles of p->corners, a polygon of n > 3 corners. */
static ebpo_status triangulate_face(ebpo_ply_parser *p, uint32_t n, uint64_t row)
{
    ebpo_status status = reserve_scratch(p, n);
    if (status == EBPO_OK)
        status = reserve_faces(p, n - 2);
    if (status != EBPO_OK)
        return status;
    double(*position)[3] = p->scratch;
    uint32_t(*triangle)[3] = (uint32_t(*)[3])(position + n);
    void *scratch = triangle + n + (n & 1); /* keeps doubles aligned */
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
            " corners that could not be triangulated; triangulate it in the source",
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

ebpo_status ebpo_ply_add_polygon(ebpo_ply_parser *p, uint64_t row)
{
    if (p->corner_count < 3) {
        p->mesh->polygons_dropped++;
        return EBPO_OK;
    }
    if (p->corner_count > 3)
        return p->corner_count > MAX_FACES
                   ? ebpo_fail_file(p->error, EBPO_E_LIMIT, p->name,
                                    "face %" PRIu64 " has more than 2^32 - 2 corners", row)
                   : triangulate_face(p, (uint32_t)p->corner_count, row);
    ebpo_status status = reserve_faces(p, 1);
    if (status == EBPO_OK)
        add_triangle(p->mesh, p->corners[0], p->corners[1], p->corners[2]);
    return status;
}

/* Adds the triangles of a strip. Every second triangle has the opposite orientation. Triangles that
 * repeat a vertex only connect parts of a strip and are skipped. */
static void add_strip(ebpo_mesh *mesh, const uint32_t *v, uint64_t n)
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

ebpo_status ebpo_ply_add_strip(ebpo_ply_parser *p, uint64_t row)
{
    (void)row;
    uint64_t n = p->corner_count;
    uint64_t first = p->mesh->face_count;
    ebpo_status status = n < 3 ? EBPO_OK : reserve_faces(p, n - 2);
    for (uint64_t begin = 0; begin < n && status == EBPO_OK;) {
        uint64_t end = begin;
        while (end < n && p->corners[end] != EBPO_PLY_RESTART)
            end++;
        if (end - begin >= 3)
            add_strip(p->mesh, p->corners + begin, end - begin);
        begin = end + 1;
    }
    if (status == EBPO_OK)
        ebpo_ply_blank_faces(p, first);
    return status;
}

/* --- removal of vertices that no face uses and whose coordinates are not finite ---
 *
 * Scanners write such vertices for directions without a measured point. (The OBJ and OFF readers
 * omit all unused vertices.) */

enum {
    GRAIN = 1 << 15, /* number of vertices for each call of a thread's function */
    WORD = 64        /* bits of a word of vertex_removal.used */
};

typedef struct vertex_removal {
    ebpo_ply_parser *p;
    bool found; /* a coordinate is not finite */
    /* a face uses a vertex that is not finite: nothing is removed, so that the mesh check reports
     * this vertex with its index in the file */
    bool refused;
    uint64_t *used; /* bit v: a face uses vertex v */
    uint32_t *from; /* [kept] old indices of the kept vertices */
    uint32_t *to;   /* [vertices] new index of each kept vertex */
    uint64_t kept;  /* number of kept vertices */
} vertex_removal;

static bool is_finite(const ebpo_mesh *mesh, uint64_t v)
{
    bool finite = true;
    for (uint64_t i = 3 * v; i < 3 * v + 3; i++)
        finite &= mesh->xyz32 ? isfinite(mesh->xyz32[i]) : isfinite(mesh->xyz64[i]);
    return finite;
}

/* Sets l->found if a vertex of a range is not finite. */
static ebpo_status find_non_finite(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                   ebpo_error *error)
{
    vertex_removal *l = context;
    (void)worker, (void)error;
    bool finite = true;
    for (uint64_t v = begin; v < end; v++)
        finite &= is_finite(l->p->mesh, v);
    if (!finite)
        __atomic_store_n(&l->found, true, __ATOMIC_RELAXED);
    return EBPO_OK;
}

/* Chooses the vertices to be kept: those that are finite or used by a face. Sets l->refused if a
 * face uses a vertex that is not finite. */
static ebpo_status choose_kept(vertex_removal *l)
{
    ebpo_mesh *mesh = l->p->mesh;
    ebpo_workspace *workspace = mesh->workspace;
    uint64_t n = mesh->vertex_count, words = n / WORD + 1;
    l->used = ebpo_array_zero(workspace, words, sizeof *l->used);
    l->from = ebpo_array_alloc(workspace, n, sizeof *l->from);
    l->to = ebpo_array_alloc(workspace, n, sizeof *l->to);
    if (!l->used || !l->from || !l->to)
        return ebpo_workspace_fail(workspace, n * 2 * sizeof *l->to + words * sizeof *l->used,
                                   l->p->error);
    EBPO_FOR_ITEMS_SCATTERED(workspace, f, 0, mesh->face_count) {
        for (uint64_t i = 3 * f; i < 3 * f + 3; i++)
            l->used[mesh->faces[i] / WORD] |= UINT64_C(1) << mesh->faces[i] % WORD;
    }
    EBPO_FOR_ITEMS(workspace, v, 0, n) {
        bool used = l->used[v / WORD] >> v % WORD & 1, finite = is_finite(mesh, v);
        l->to[v] = (uint32_t)l->kept;
        l->refused |= used && !finite;
        if (used || finite)
            l->from[l->kept++] = (uint32_t)v;
    }
    return EBPO_OK;
}

/* Moves the kept vertices to the beginning, and renames the corners of faces. */
static void move_vertices(const vertex_removal *l)
{
    ebpo_mesh *mesh = l->p->mesh;
    size_t size = 3 * (mesh->xyz32 ? sizeof *mesh->xyz32 : sizeof *mesh->xyz64);
    char *xyz = mesh->xyz32 ? (char *)mesh->xyz32 : (char *)mesh->xyz64;
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, l->kept) {
        if (l->from[i] != i)
            memcpy(xyz + i * size, xyz + l->from[i] * size, size);
    }
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, f, 0, mesh->face_count) {
        for (uint64_t i = 3 * f; i < 3 * f + 3; i++)
            mesh->faces[i] = l->to[mesh->faces[i]];
    }
}

/* Keeps the attributes of kept vertices. If vertex indices have changed, drops the elements other
 * than vertices and faces, because these elements may contain vertex indices. */
static void move_attributes(const vertex_removal *l)
{
    ebpo_attributes *attributes = l->p->mesh->attributes;
    uint64_t count = attributes ? attributes->count : 0;
    bool renumbered = l->from[l->kept - 1] != l->kept - 1;
    if (!attributes)
        return;
    ebpo_attributes_keep(attributes, "vertex", l->from, l->kept);
    if (renumbered)
        ebpo_attributes_drop_others(attributes);
    if (attributes->count < count)
        ebpo_attributes_lose(attributes, "elements other than vertices and faces, which may use "
                                         "vertex indices that have changed");
}

static ebpo_status record_removed(const vertex_removal *l, uint64_t count)
{
    ebpo_status status = ebpo_mesh_need_attributes(l->p->mesh, l->p->error);
    if (status == EBPO_OK)
        ebpo_attributes_count_unread(l->p->mesh->attributes,
                                     "vertices with non-finite coordinates that no face uses",
                                     count);
    return status;
}

ebpo_status ebpo_ply_remove_unused(ebpo_ply_parser *p)
{
    vertex_removal l = { .p = p };
    ebpo_mesh *mesh = p->mesh;
    uint64_t count = mesh->vertex_count;
    ebpo_status status = ebpo_parallel_for(p->threads, mesh->workspace, count, GRAIN,
                                           find_non_finite, &l, NULL, "", p->error);
    if (status == EBPO_OK && l.found)
        status = choose_kept(&l);
    if (status == EBPO_OK && l.found && !l.refused && l.kept < count) {
        move_vertices(&l);
        move_attributes(&l);
        mesh->vertex_count = l.kept;
        status = record_removed(&l, count - l.kept);
    }
    ebpo_array_free(mesh->workspace, l.used);
    ebpo_array_free(mesh->workspace, l.from);
    ebpo_array_free(mesh->workspace, l.to);
    return status;
}
