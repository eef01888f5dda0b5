/* Fills holes: triangulates each boundary loop (geometry/polygon.h). A new triangle and the
 * adjacent face of the mesh use a boundary edge in opposite directions. The rest of the mesh does
 * not change. The repair record counts the additions. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "core/workspace.h"
#include "mesh/boundary.h"
#include "mesh/mesh_parts.h"
#include "mesh/adjacency.h"

enum {
    /* the faces at a vertex are searched for existing edges only if the vertex has at most this
     * number of faces. So the work is linear in the size of the mesh */
    SEARCHED_DEGREE = 4096,
    /* numbers of vertices and of loops for each call of a thread's function */
    VERTEX_GRAIN = 1 << 13,
    LOOP_GRAIN = 16
};

typedef struct loop_vertex {
    uint32_t vertex;
    uint32_t position; /* index in the loop */
} loop_vertex;

/* Scratch memory of a thread. */
typedef struct scratch {
    ebpo_star star;
    ebpo_boundary boundary;   /* the boundary edges that the thread has found */
    double (*point)[3];       /* positions of the loop's vertices */
    uint32_t (*triangles)[3]; /* the loop's triangles, as indices in the loop */
    uint64_t point_capacity, triangle_capacity;
    /* the loop's vertices, sorted for lookup */
    loop_vertex sorted[EBPO_OPTIMAL_CHAIN];
    /* [n][n] for a loop of n vertices: 1 if an edge of the mesh connects two vertices of the loop
     */
    uint8_t taken[EBPO_OPTIMAL_CHAIN * EBPO_OPTIMAL_CHAIN];
} scratch;

/* Approximate memory for each vertex of a loop, for messages when out of memory. */
enum { LOOP_BYTES = 132 };

typedef struct filling {
    ebpo_mesh *mesh;
    unsigned threads;
    scratch *scratch; /* [threads] */
    ebpo_stars stars;
    ebpo_boundary boundary;
    ebpo_loops loops;
    uint64_t *before; /* [loops.count] number of triangles of the loops that precede each loop in
                       * the order of ebpo_loops_rank */
    uint64_t added;   /* number of added faces */
} filling;

/* Collects the boundary edges whose lower vertex is in the range. */
static ebpo_status collect_edges(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    filling *f = context;
    scratch *s = &f->scratch[worker];
    EBPO_FOR_ITEMS_SCATTERED(f->mesh->workspace, v, begin, end) {
        bool ok = ebpo_star_gather(&s->star, &f->stars, f->mesh, (uint32_t)v);
        for (uint64_t i = 0, next; ok && i < s->star.count; i = next) {
            const ebpo_link *link = &s->star.links[i];
            uint32_t lower = (uint32_t)v, higher = ebpo_link_neighbour(link);
            next = ebpo_star_run_end(&s->star, i);
            if (next - i == 1 && higher > lower)
                ok = ebpo_boundary_add(&s->boundary, f->mesh, link->out ? lower : higher,
                                       link->out ? higher : lower, ebpo_link_face(link));
        }
        if (!ok)
            return ebpo_workspace_fail(f->mesh->workspace,
                                       s->boundary.count * sizeof *s->boundary.edges, error);
    }
    return EBPO_OK;
}

static ebpo_status collect_boundary(filling *f, ebpo_error *error)
{
    ebpo_status status = ebpo_parallel_for(f->threads, NULL, f->mesh->vertex_count, VERTEX_GRAIN,
                                           collect_edges, f, NULL, "", error);
    ebpo_boundary *lists = ebpo_alloc(f->threads, sizeof *lists);
    if (!lists)
        return ebpo_fail_memory(error, f->threads * sizeof *lists);
    for (unsigned t = 0; t < f->threads; t++) {
        lists[t] = f->scratch[t].boundary;
        f->scratch[t].boundary = (ebpo_boundary){ .edges = NULL };
    }
    if (status == EBPO_OK)
        status = ebpo_boundary_join(&f->boundary, lists, f->threads, f->mesh, error);
    for (unsigned t = 0; t < f->threads; t++)
        ebpo_boundary_free(&lists[t]);
    free(lists);
    return status;
}

/* --- one loop --- */

static int by_vertex(const void *a, const void *b)
{
    const loop_vertex *x = a, *y = b;
    return (x->vertex > y->vertex) - (x->vertex < y->vertex);
}

/* Marks the pairs of the loop's vertices that an edge of the mesh connects. */
static void mark_taken(const filling *f, scratch *s, const uint32_t *loop, uint32_t n)
{
    memset(s->taken, 0, (size_t)n * n);
    for (uint32_t i = 0; i < n; i++)
        s->sorted[i] = (loop_vertex){ loop[i], i };
    qsort(s->sorted, n, sizeof *s->sorted, by_vertex);
    for (uint32_t i = 0; i < n; i++) {
        uint64_t begin = f->stars.first[loop[i]], end = f->stars.first[loop[i] + (uint64_t)1];
        for (uint64_t e = begin; e < end && end - begin <= SEARCHED_DEGREE; e++)
            for (int k = 0; k < 3; k++) {
                loop_vertex wanted = { f->mesh->faces[3 * (uint64_t)f->stars.face[e] + (unsigned)k],
                                       0 };
                const loop_vertex *found =
                    bsearch(&wanted, s->sorted, n, sizeof *s->sorted, by_vertex);
                if (found)
                    s->taken[(size_t)i * n + found->position] =
                        s->taken[(size_t)found->position * n + i] = 1;
            }
    }
}

/* Fills a loop. In the mesh, the new triangles follow the triangles of the loops that precede this
 * loop (f->before). Returns false when out of memory. */
static bool fill_loop(filling *f, scratch *s, uint64_t number)
{
    const uint32_t *loop = f->loops.vertex + f->loops.first[number];
    uint32_t n = (uint32_t)(f->loops.first[number + 1] - f->loops.first[number]);
    ebpo_workspace *workspace = f->mesh->workspace;
    if (!ebpo_array_grow(workspace, &s->point, &s->point_capacity, n, sizeof *s->point) ||
        !ebpo_array_grow(workspace, &s->triangles, &s->triangle_capacity, n, sizeof *s->triangles))
        return false;
    EBPO_FOR_ITEMS_SCATTERED(workspace, i, 0, n)
        ebpo_mesh_position(f->mesh, loop[i], s->point[i]);
    bool search = n > 3 && n <= EBPO_OPTIMAL_CHAIN;
    if (search)
        mark_taken(f, s, loop, n);
    ebpo_chain chain = { .n = n,
                         .optimal = EBPO_OPTIMAL_CHAIN,
                         .point = (const double(*)[3])s->point,
                         .taken = search ? s->taken : NULL,
                         .workspace = workspace };
    if (!ebpo_triangulate_chain(&chain, s->triangles))
        return false;
    uint32_t *face = f->mesh->faces + 3 * (f->mesh->face_count + f->before[number]);
    /* the adjacent faces use the chain's edges forwards, so the triangles use these edges
     * backwards */
    EBPO_FOR_ITEMS_SCATTERED(workspace, t, 0, n - 2)
        for (uint64_t k = 0; k < 3; k++)
            face[3 * t + k] = loop[s->triangles[t][2 - k]];
    return true;
}

static ebpo_status fill_loops(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    filling *f = context;
    for (uint64_t i = begin; i < end; i++)
        if (!fill_loop(f, &f->scratch[worker], i))
            return ebpo_workspace_fail(f->mesh->workspace,
                                       (f->loops.first[i + 1] - f->loops.first[i]) * LOOP_BYTES,
                                       error);
    return EBPO_OK;
}

/* --- all loops --- */

/* Reserves space after the mesh's faces, which do not change. The source indices of the added faces
 * follow the source indices of all source faces, including dropped faces. */
static ebpo_status reserve_space(filling *f, ebpo_error *error)
{
    ebpo_mesh *mesh = f->mesh;
    struct ebpo_arrangement *order = mesh->arrangement;
    uint64_t count = mesh->face_count + f->added, capacity = mesh->face_count;
    if (count + (order ? order->dropped_faces : 0) > UINT32_MAX - 1)
        return ebpo_fail_file(error, EBPO_E_LIMIT, ebpo_mesh_label(mesh),
                              "%llu faces with the filled holes, but 2^32 - 2 is the limit; "
                              "split the mesh",
                              (unsigned long long)count);
    if (!ebpo_array_grow(mesh->workspace, &mesh->faces, &capacity, count, 3 * sizeof *mesh->faces))
        return ebpo_workspace_fail(mesh->workspace, count * 3 * sizeof *mesh->faces, error);
    capacity = mesh->face_count;
    if (order && !ebpo_array_grow(mesh->workspace, &order->face_source, &capacity, count,
                                  sizeof *order->face_source))
        return ebpo_workspace_fail(mesh->workspace, count * sizeof *order->face_source, error);
    EBPO_FOR_ITEMS(mesh->workspace, i, mesh->face_count, order ? count : 0)
        order->face_source[i] = (uint32_t)(i + order->dropped_faces);
    return EBPO_OK;
}

/* Fills all holes. The caller frees the arrays of *f, also on failure. */
static ebpo_status run_filling(filling *f, ebpo_error *error)
{
    ebpo_mesh *mesh = f->mesh;
    f->scratch = ebpo_alloc_zero(f->threads, sizeof *f->scratch);
    if (!f->scratch)
        return ebpo_fail_memory(error, f->threads * sizeof *f->scratch);
    ebpo_status status = ebpo_stars_build(&f->stars, mesh, f->threads, NULL, error);
    if (status == EBPO_OK)
        status = collect_boundary(f, error);
    if (status != EBPO_OK || f->boundary.count == 0)
        return status;
    status = ebpo_boundary_loops(&f->loops, &f->boundary, &f->stars, mesh, f->threads, error);
    if (status != EBPO_OK || f->loops.count == 0)
        return status;
    status = ebpo_mesh_check_whole(mesh, error);
    if (status != EBPO_OK)
        return status;
    f->added = f->loops.first[f->loops.count] - 2 * f->loops.count;
    status = ebpo_loops_rank(&f->before, &f->loops, mesh, f->threads, error);
    if (status == EBPO_OK)
        status = reserve_space(f, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(f->threads, f->mesh->workspace, f->loops.count, LOOP_GRAIN,
                                   fill_loops, f, NULL, "", error);
    if (status != EBPO_OK)
        return status;
    mesh->face_count += f->added;
    if (mesh->arrangement) { /* the faces are no longer in Morton order: drop the keys */
        ebpo_array_free(mesh->workspace, mesh->arrangement->key);
        mesh->arrangement->key = NULL;
    }
    return EBPO_OK;
}

static void free_scratch(scratch *s, ebpo_workspace *workspace)
{
    ebpo_star_free(&s->star);
    ebpo_boundary_free(&s->boundary);
    ebpo_array_free(workspace, s->point);
    ebpo_array_free(workspace, s->triangles);
}

ebpo_status ebpo_mesh_fill_holes(ebpo_mesh *mesh, ebpo_repair_record *record, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    filling f = { .mesh = mesh, .threads = ebpo_thread_count(0) };
    ebpo_status status = ebpo_mesh_check_shape(mesh, error);
    if (status != EBPO_OK)
        return status;
    status = run_filling(&f, error);
    if (status == EBPO_OK && record) {
        record->fill_holes = true;
        record->filled_holes += f.loops.count;
        record->added_faces += f.added;
        record->unfilled_holes += f.loops.open_chains;
    }
    ebpo_stars_free(&f.stars);
    ebpo_boundary_free(&f.boundary);
    ebpo_loops_free(&f.loops);
    ebpo_array_free(mesh->workspace, f.before);
    for (unsigned t = 0; f.scratch && t < f.threads; t++)
        free_scratch(&f.scratch[t], mesh->workspace);
    free(f.scratch);
    return status;
}
