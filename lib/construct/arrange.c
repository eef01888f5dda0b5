/* Sorts a mesh's vertices and faces along a Morton curve. Afterwards, the vertices of every cell
 * are one contiguous range, and neighbours in space are mostly neighbours in memory.
 *
 * First the root box of the grid is chosen. At every level in use, the coordinates of cell faces
 * must be doubles without rounding. Vertices are sorted by the octcode of their cell (the cell's
 * position on the curve) and, within a cell, by position, so that equal positions are neighbours.
 * Vertices without faces ("unreferenced") come after all other vertices. Faces are sorted by the
 * least of their vertices' new indices. Sorting uses the mesh's workspace (arrays in memory or in
 * temporary files), so that a mesh may be larger than memory. The mesh's arrangement stores the
 * source index of each vertex and face. The result depends on the mesh alone, not on the number of
 * threads. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "construct/arrange.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "core/sort.h"
#include "geometry/cells.h"
#include "mesh/mesh_parts.h"

enum { GRAIN = 1 << 15 }; /* number of vertices or faces of a parallel task */

/* bit 63 of a vertex's sort key: vertices with this bit come after all vertices without it */
#define UNREFERENCED (UINT64_C(1) << 63)

typedef struct arranging {
    ebpo_mesh *mesh;
    unsigned threads;
    /* false: unreferenced vertices come after all others; true: unreferenced vertices are sorted
     * among the others */
    bool all_by_position;
    const ebpo_progress *progress;
    uint8_t *referenced; /* bit v: a face uses vertex v */
    /* [block of GRAIN vertices] least and greatest coordinates of its referenced vertices */
    double (*bounds)[2][3];
    struct ebpo_arrangement *to; /* result */
    /* sorted coordinates, as floats in xyz32 or as doubles in xyz64; the other array is NULL */
    float *xyz32;
    double *xyz64;
    uint32_t *corners; /* faces in their old order, with the vertices' new indices */
    uint32_t *faces;   /* sorted faces */
    /* [rank_count] new indices of the vertices with the old indices rank_first to rank_first +
     * rank_count - 1 */
    uint32_t *rank;
    uint64_t rank_first, rank_count;
} arranging;

static bool is_referenced(const arranging *a, uint64_t v)
{
    return a->referenced[v / 8] >> v % 8 & 1;
}

/* --- marking referenced vertices, choosing the box --- */

static ebpo_status mark_vertices(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    arranging *a = context;
    (void)worker;
    for (uint64_t i = 3 * begin; i < 3 * end; i++) {
        uint32_t v = a->mesh->faces[i];
        if (v >= a->mesh->vertex_count)
            return ebpo_fail_file(error, EBPO_E_FORMAT, ebpo_mesh_label(a->mesh),
                                  "face %llu names vertex %lu, but there are %llu vertices; repair "
                                  "the file or drop the face",
                                  (unsigned long long)ebpo_mesh_source_face(a->mesh, i / 3),
                                  (unsigned long)v, (unsigned long long)a->mesh->vertex_count);
        uint8_t bit = (uint8_t)(1u << v % 8);
        if (!(__atomic_load_n(&a->referenced[v / 8], __ATOMIC_RELAXED) & bit))
            __atomic_fetch_or(&a->referenced[v / 8], bit, __ATOMIC_RELAXED);
    }
    return EBPO_OK;
}

static ebpo_status find_bounds(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    arranging *a = context;
    (void)worker;
    double(*b)[3] = a->bounds[begin / GRAIN];
    for (int k = 0; k < 3; k++)
        b[0][k] = INFINITY, b[1][k] = -INFINITY;
    for (uint64_t v = begin; v < end; v++) {
        double p[3];
        ebpo_mesh_position(a->mesh, v, p);
        for (int k = 0; k < 3; k++)
            if (!isfinite(p[k]))
                return ebpo_fail_file(error, EBPO_E_FORMAT, ebpo_mesh_label(a->mesh),
                                      "vertex %llu has %c = %s; repair the coordinate or drop the "
                                      "vertex and its faces",
                                      (unsigned long long)ebpo_mesh_source_vertex(a->mesh, v),
                                      "xyz"[k],
                                      isnan(p[k]) ? "nan"
                                      : p[k] > 0  ? "inf"
                                                  : "-inf");
        for (int k = 0; k < 3 && is_referenced(a, v); k++) {
            b[0][k] = p[k] < b[0][k] ? p[k] : b[0][k];
            b[1][k] = p[k] > b[1][k] ? p[k] : b[1][k];
        }
    }
    return EBPO_OK;
}

/* Makes the root box around the model, so that cell faces are exact in doubles down to `level`. If
 * the model is small and far from the origin, this condition can enlarge the box much. If `level`
 * is -1, the function uses the deepest level at which the condition hardly enlarges the box.
 * Returns false if the coordinates are too large for every box. */
static bool choose_box(ebpo_box *out, const double min[3], const double max[3], int level)
{
    /* maximum ratio of the sides of `out` and of the least box */
    static const double allowed = 1 + 0x1p-16;
    ebpo_box least;
    if (level >= 0)
        return ebpo_box_make(out, min, max, level);
    if (!ebpo_box_make(&least, min, max, 0))
        return false;
    for (int deep = EBPO_MAX_LEVEL; deep > 0; deep--)
        if (ebpo_box_make(out, min, max, deep) && out->size[0] <= least.size[0] * allowed &&
            out->size[1] <= least.size[1] * allowed && out->size[2] <= least.size[2] * allowed)
            return true;
    *out = least;
    return true;
}

static ebpo_status measure_all(arranging *a, int level, ebpo_error *error)
{
    ebpo_mesh *mesh = a->mesh;
    uint64_t blocks = (mesh->vertex_count + GRAIN - 1) / GRAIN;
    a->referenced = ebpo_array_zero(mesh->workspace, mesh->vertex_count / 8 + 1, 1);
    a->bounds = ebpo_alloc(blocks, sizeof *a->bounds);
    if (!a->referenced || !a->bounds)
        return ebpo_workspace_fail(mesh->workspace,
                                   mesh->vertex_count / 8 + blocks * sizeof *a->bounds, error);
    ebpo_status status = ebpo_parallel_for(a->threads, mesh->workspace, mesh->face_count, GRAIN,
                                           mark_vertices, a, a->progress, "checking faces", error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(a->threads, mesh->workspace, mesh->vertex_count, GRAIN,
                                   find_bounds, a, a->progress, "measuring the box", error);
    if (status != EBPO_OK)
        return status;
    double min[3] = { INFINITY, INFINITY, INFINITY }, max[3] = { -INFINITY, -INFINITY, -INFINITY };
    for (uint64_t i = 0; i < blocks; i++)
        for (int k = 0; k < 3; k++) {
            min[k] = fmin(min[k], a->bounds[i][0][k]);
            max[k] = fmax(max[k], a->bounds[i][1][k]);
        }
    double greatest = 0;
    for (int k = 0; k < 3; k++)
        greatest = fmax(greatest, fmax(fabs(min[k]), fabs(max[k])));
    if (!choose_box(&a->to->box, min, max, level))
        return ebpo_fail_file(
            error, EBPO_E_LIMIT, ebpo_mesh_label(mesh),
            "coordinates up to %g are too large for an exact grid; scale the model", greatest);
    return EBPO_OK;
}

/* --- vertices --- */

/* The record that is sorted for each vertex of a mesh with double coordinates. */
typedef struct vertex_record {
    uint64_t key;               /* result of key_of */
    uint32_t old_index, unused; /* old_index: index in the mesh before sorting */
    double p[3];                /* position */
} vertex_record;

/* The record that is sorted for each vertex of a mesh with float coordinates, in 24 bytes. */
typedef struct float_record {
    uint64_t key;
    uint32_t old_index;
    float p[3];
} float_record;

/* Returns the index, along one axis, of the cell that contains the coordinate x. The division may
 * round to the wrong side of a cell face. The comparisons with the exact cell faces correct the
 * index. */
static uint32_t cell_index(const ebpo_box *box, int axis, int level, double x)
{
    double cells = (double)(1u << level),
           quotient = (x - box->origin[axis]) / (box->size[axis] / cells);
    uint32_t k = quotient <= 0 ? 0 : quotient >= cells ? (1u << level) - 1 : (uint32_t)quotient;
    while (k > 0 && x < ebpo_cell_face(box, axis, level, k))
        k--;
    while (k + 1 < 1u << level && x >= ebpo_cell_face(box, axis, level, k + 1))
        k++;
    return k;
}

/* Returns the sort key of a vertex: the octcode of its cell, shifted so that the code's leading bit
 * is always at the same position. The bit UNREFERENCED is added if the vertex must come after all
 * referenced vertices. */
static uint64_t key_of(const arranging *a, uint64_t v)
{
    const ebpo_box *box = &a->to->box;
    double p[3];
    ebpo_mesh_position(a->mesh, v, p);
    ebpo_cell cell = { box->grid_level, { 0, 0, 0 } };
    for (int k = 0; k < 3; k++)
        cell.at[k] = cell_index(box, k, cell.level, p[k]);
    return ebpo_octcode_of_cell(cell) << 3 * (EBPO_MAX_LEVEL - box->grid_level) |
           (a->all_by_position || is_referenced(a, v) ? 0 : UNREFERENCED);
}

static ebpo_status make_vertices(void *context, uint64_t begin, uint64_t end, void *records,
                                 ebpo_error *error)
{
    const arranging *a = context;
    const ebpo_mesh *mesh = a->mesh;
    (void)error;
    for (uint64_t v = begin; v < end; v++) {
        if (mesh->xyz32) {
            float_record *r = (float_record *)records + (v - begin);
            *r = (float_record){ .key = key_of(a, v), .old_index = (uint32_t)v };
            memcpy(r->p, mesh->xyz32 + 3 * v, sizeof r->p);
        } else {
            vertex_record *r = (vertex_record *)records + (v - begin);
            *r = (vertex_record){ .key = key_of(a, v), .old_index = (uint32_t)v };
            memcpy(r->p, mesh->xyz64 + 3 * v, sizeof r->p);
        }
    }
    return EBPO_OK;
}

/* Compares two vertices of one cell by their positions `p` and `q`, so that vertices with equal
 * positions become neighbours. Equal positions are compared by the vertices' old indices `a` and
 * `b`. */
static int compare_points(const double p[3], const double q[3], uint32_t a, uint32_t b)
{
    for (int k = 0; k < 3; k++)
        if (p[k] != q[k])
            return p[k] < q[k] ? -1 : 1;
    return a < b ? -1 : 1;
}

static int compare_floats(const void *x, const void *y)
{
    const float_record *a = x, *b = y;
    double p[3] = { a->p[0], a->p[1], a->p[2] }, q[3] = { b->p[0], b->p[1], b->p[2] };
    return compare_points(p, q, a->old_index, b->old_index);
}

static int compare_doubles(const void *x, const void *y)
{
    const vertex_record *a = x, *b = y;
    return compare_points(a->p, b->p, a->old_index, b->old_index);
}

/* Stores sorted records as the vertices with the new indices new_index, new_index + 1, ... */
static void store_vertices(void *context, uint64_t new_index, const void *records, uint64_t count)
{
    arranging *a = context;
    for (uint64_t i = 0; i < count; i++, new_index++) {
        uint64_t key;
        uint32_t old_index;
        if (a->xyz32) {
            const float_record *r = (const float_record *)records + i;
            memcpy(a->xyz32 + 3 * new_index, r->p, sizeof r->p);
            key = r->key, old_index = r->old_index;
        } else {
            const vertex_record *r = (const vertex_record *)records + i;
            memcpy(a->xyz64 + 3 * new_index, r->p, sizeof r->p);
            key = r->key, old_index = r->old_index;
        }
        if (a->to->key)
            a->to->key[new_index] =
                (key & ~UNREFERENCED) >> 3 * (EBPO_MAX_LEVEL - a->to->box.grid_level);
        /* compose_maps replaces the old index by the source index */
        a->to->vertex_source[new_index] = old_index;
    }
}

static ebpo_status sort_vertices(arranging *a, ebpo_error *error)
{
    ebpo_mesh *mesh = a->mesh;
    uint64_t n = mesh->vertex_count;
    for (uint64_t v = 0; v < n; v++)
        a->to->referenced += is_referenced(a, v);
    a->to->grouped = a->all_by_position || a->to->referenced == n;
    bool ordered = !a->all_by_position || a->to->referenced == n;
    a->to->key = ordered ? ebpo_array_alloc(mesh->workspace, n, sizeof *a->to->key) : NULL;
    a->to->vertex_source = ebpo_array_alloc(mesh->workspace, n, sizeof *a->to->vertex_source);
    a->xyz32 = mesh->xyz32 ? ebpo_array_alloc(mesh->workspace, n, 3 * sizeof *a->xyz32) : NULL;
    a->xyz64 = mesh->xyz32 ? NULL : ebpo_array_alloc(mesh->workspace, n, 3 * sizeof *a->xyz64);
    if ((ordered && !a->to->key) || !a->to->vertex_source || (!a->xyz32 && !a->xyz64))
        return ebpo_workspace_fail(mesh->workspace, n * 36, error);
    ebpo_sort sort = { .workspace = mesh->workspace,
                       .threads = a->threads,
                       .progress = a->progress,
                       .stage = "ordering vertices",
                       .count = n,
                       .record = mesh->xyz32 ? sizeof(float_record) : sizeof(vertex_record),
                       /* the highest 18 bits of the 64-bit key choose the bin of a record */
                       .shift = 46,
                       .context = a,
                       .make = make_vertices,
                       .compare = mesh->xyz32 ? compare_floats : compare_doubles,
                       .take = store_vertices };
    return ebpo_sort_run(&sort, error);
}

/* --- faces: the faces' vertices get their new indices; then the faces are sorted by their least
 * vertex --- */

static ebpo_status fill_ranks(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    arranging *a = context;
    (void)worker, (void)error;
    for (uint64_t i = begin; i < end; i++) {
        uint64_t v = a->to->vertex_source[i] - a->rank_first;
        if (v < a->rank_count)
            a->rank[v] = (uint32_t)i;
    }
    return EBPO_OK;
}

static ebpo_status translate_corners(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                     ebpo_error *error)
{
    arranging *a = context;
    (void)worker, (void)error;
    for (uint64_t i = 3 * begin; i < 3 * end; i++) {
        uint64_t v = a->mesh->faces[i] - a->rank_first;
        if (v < a->rank_count)
            a->corners[i] = a->rank[v];
    }
    return EBPO_OK;
}

/* Replaces the old vertex indices in all faces by the new indices. A window is a range of old
 * indices, so short that the table `rank` of its new indices fits into memory. For each window, one
 * pass fills this table and a second pass reads all faces. So all arrays except this table are
 * accessed in order. */
static ebpo_status translate_faces(arranging *a, uint64_t *passes, ebpo_error *error)
{
    ebpo_mesh *mesh = a->mesh;
    ebpo_workspace_stats stats = EBPO_WORKSPACE_STATS_INIT;
    stats.memory = UINT64_MAX;
    if (mesh->workspace)
        ebpo_workspace_get_stats(mesh->workspace, &stats);
    uint64_t window = stats.memory / 8 / sizeof *a->rank;
    a->rank_count = mesh->vertex_count < window ? mesh->vertex_count : window ? window : 1;
    a->rank = ebpo_alloc(a->rank_count, sizeof *a->rank);
    a->corners = ebpo_array_alloc(mesh->workspace, mesh->face_count, 3 * sizeof *a->corners);
    if (!a->rank || !a->corners) {
        free(a->rank);
        a->rank = NULL;
        return ebpo_workspace_fail(mesh->workspace, a->rank_count * 4 + mesh->face_count * 12,
                                   error);
    }
    ebpo_status status = EBPO_OK;
    *passes = 2 * ((mesh->vertex_count + a->rank_count - 1) / a->rank_count);
    ebpo_pass pass = { a->progress, 0, 0, *passes + EBPO_SORT_PASSES };
    ebpo_progress progress = ebpo_pass_progress(&pass);
    for (a->rank_first = 0; a->rank_first < mesh->vertex_count && status == EBPO_OK;
         a->rank_first += a->rank_count) {
        pass.begin = pass.end++;
        status = ebpo_parallel_for(a->threads, mesh->workspace, mesh->vertex_count, GRAIN,
                                   fill_ranks, a, &progress, "ordering faces", error);
        pass.begin = pass.end++;
        if (status == EBPO_OK)
            status = ebpo_parallel_for(a->threads, mesh->workspace, mesh->face_count, GRAIN,
                                       translate_corners, a, &progress, "ordering faces", error);
    }
    free(a->rank);
    a->rank = NULL;
    return status;
}

typedef struct face_record {
    /* Upper 32 bits: the least vertex index of the face. Lower 32 bits: the face's index in the
     * source, so that the result does not depend on the old order. */
    uint64_t key;
    uint32_t corner[3], unused; /* corner: new indices of the vertices */
} face_record;

static ebpo_status make_faces(void *context, uint64_t begin, uint64_t end, void *records,
                              ebpo_error *error)
{
    const arranging *a = context;
    (void)error;
    for (uint64_t f = begin; f < end; f++) {
        face_record *r = (face_record *)records + (f - begin);
        const uint32_t *c = a->corners + 3 * f;
        uint32_t least = c[0] < c[1] ? c[0] : c[1];
        *r = (face_record){ .key = (uint64_t)(c[2] < least ? c[2] : least) << 32 |
                                   ebpo_mesh_source_face(a->mesh, f),
                            .corner = { c[0], c[1], c[2] } };
    }
    return EBPO_OK;
}

static int compare_faces(const void *x, const void *y)
{
    const face_record *a = x, *b = y;
    return (a->key > b->key) - (a->key < b->key); /* no two keys are equal */
}

/* Stores sorted records as the faces with the new indices new_index, new_index + 1, ... */
static void store_faces(void *context, uint64_t new_index, const void *records, uint64_t count)
{
    arranging *a = context;
    const face_record *r = records;
    for (uint64_t i = 0; i < count; i++, new_index++) {
        memcpy(a->faces + 3 * new_index, r[i].corner, sizeof r[i].corner);
        a->to->face_source[new_index] = (uint32_t)r[i].key;
    }
}

static ebpo_status sort_faces(arranging *a, ebpo_error *error)
{
    ebpo_mesh *mesh = a->mesh;
    unsigned shift = 32;
    uint64_t passes = 0;
    ebpo_status status = translate_faces(a, &passes, error);
    if (status != EBPO_OK)
        return status;
    a->faces = ebpo_array_alloc(mesh->workspace, mesh->face_count, 3 * sizeof *a->faces);
    a->to->face_source =
        ebpo_array_alloc(mesh->workspace, mesh->face_count, sizeof *a->to->face_source);
    if (!a->faces || !a->to->face_source)
        return ebpo_workspace_fail(mesh->workspace, mesh->face_count * 16, error);
    while (mesh->vertex_count >> (shift - 32) >= EBPO_SORT_BINS)
        shift++;
    ebpo_sort sort = { .workspace = mesh->workspace,
                       .threads = a->threads,
                       .progress = a->progress,
                       .stage = "ordering faces",
                       .passes_before = passes,
                       .count = mesh->face_count,
                       .record = sizeof(face_record),
                       .shift = shift,
                       .context = a,
                       .make = make_faces,
                       .compare = compare_faces,
                       .take = store_faces };
    return ebpo_sort_run(&sort, error);
}

/* --- the whole mesh --- */

/* Converts old indices of vertices in `map` to source indices, if the mesh was arranged before.
 * (For faces, the sort keys contain source indices.) */
static void compose_maps(const struct ebpo_arrangement *before, ebpo_workspace *workspace,
                         uint32_t *map, uint64_t count)
{
    EBPO_FOR_ITEMS_SCATTERED(workspace, i, 0, before ? count : 0)
        map[i] = before->vertex_source[map[i]];
}

/* Replaces the mesh's arrays by the sorted arrays. */
static void put_in_place(arranging *a)
{
    ebpo_mesh *mesh = a->mesh;
    struct ebpo_arrangement *before = mesh->arrangement;
    compose_maps(before, mesh->workspace, a->to->vertex_source, mesh->vertex_count);
    ebpo_arrangement_free(before);
    ebpo_array_free(mesh->workspace, mesh->xyz32);
    ebpo_array_free(mesh->workspace, mesh->xyz64);
    ebpo_array_free(mesh->workspace, mesh->faces);
    mesh->xyz32 = a->xyz32;
    mesh->xyz64 = a->xyz64;
    mesh->faces = a->faces;
    mesh->arrangement = a->to;
    a->to = NULL;
    a->xyz32 = NULL;
    a->xyz64 = NULL;
    a->faces = NULL;
}

static ebpo_status arrange_by_curve(arranging a, int level, ebpo_error *error)
{
    ebpo_mesh *mesh = a.mesh;
    ebpo_status status = ebpo_mesh_check_shape(mesh, error);
    if (status == EBPO_OK && mesh->face_count == 0)
        return ebpo_fail_file(error, EBPO_E_FORMAT, ebpo_mesh_label(mesh),
                              "%llu vertices but no faces; give a triangle mesh, not a point cloud",
                              (unsigned long long)mesh->vertex_count);
    if (status != EBPO_OK)
        return status;
    if (mesh->arrangement && mesh->arrangement->key && mesh->arrangement->level == level)
        return EBPO_OK; /* the mesh already has this arrangement */
    a.to = ebpo_alloc_zero(1, sizeof *a.to);
    if (a.to)
        a.to->workspace = mesh->workspace;
    if (a.to && mesh->arrangement) {
        a.to->whole_vertices = mesh->arrangement->whole_vertices;
        a.to->whole_faces = mesh->arrangement->whole_faces;
        a.to->dropped_faces = mesh->arrangement->dropped_faces;
    }
    status = a.to ? measure_all(&a, level, error) : ebpo_fail_memory(error, sizeof *a.to);
    if (status == EBPO_OK)
        status = sort_vertices(&a, error);
    if (status == EBPO_OK)
        status = sort_faces(&a, error);
    if (status == EBPO_OK) {
        a.to->level = level;
        put_in_place(&a);
    }
    ebpo_arrangement_free(a.to);
    ebpo_array_free(mesh->workspace, a.referenced);
    free(a.bounds);
    ebpo_array_free(mesh->workspace, a.xyz32);
    ebpo_array_free(mesh->workspace, a.xyz64);
    ebpo_array_free(mesh->workspace, a.corners);
    ebpo_array_free(mesh->workspace, a.faces);
    return status;
}

ebpo_status ebpo_mesh_arrange(ebpo_mesh *mesh, unsigned threads, ebpo_progress progress,
                              ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    return ebpo_arrange(mesh, -1, threads, &progress, error);
}

ebpo_status ebpo_arrange_to_repair(ebpo_mesh *mesh, unsigned threads, const ebpo_progress *progress,
                                   ebpo_error *error)
{
    return arrange_by_curve((arranging){ .mesh = mesh,
                                         .threads = ebpo_thread_count(threads),
                                         .progress = progress,
                                         .all_by_position = true },
                            -1, error);
}

ebpo_status ebpo_arrange(ebpo_mesh *mesh, int level, unsigned threads,
                         const ebpo_progress *progress, ebpo_error *error)
{
    return arrange_by_curve((arranging){ .mesh = mesh,
                                         .threads = ebpo_thread_count(threads),
                                         .progress = progress },
                            level, error);
}
