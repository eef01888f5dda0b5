/* Finds the connected components of an operand's whole faces. A whole face has an area, and is in
 * no pair of intersecting faces; two faces that share only a corner or an edge are no such pair.
 *
 * Vertices at one position are one corner. Each edge of a face is listed at its corner with the
 * lower number. Edges are listed for one run (range) of consecutive corners after the other, so the
 * lists need little memory. Faces with a common edge are joined in a disjoint-set forest; the root
 * of a set is its first face. */
#include "core/strict_fp.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "core/disjoint_sets.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/sort.h"
#include "core/workspace.h"
#include "extras/boolean/operand_mesh.h"
#include "geometry/predicates.h"
#include "mesh/mesh_parts.h"

static const char stage[] = "join faces";

/* FACE_GRAIN: number of faces in one task of a thread. EDGES: greatest number of edges that are
 * listed at once. EDGE_BYTES: if arrays are in a workspace, at most one edge for this many bytes of
 * its budget is listed at once. So the lists, of 8 bytes for each edge and for each corner, use at
 * most an eighth of the budget. */
enum { FACE_GRAIN = 1 << 16, EDGES = 1 << 23, EDGE_BYTES = 128 };

typedef struct joining {
    ebpo_whole_faces *out;
    const ebpo_mesh *mesh;
    const uint64_t *paired; /* a bit for each face that is in a pair */
    ebpo_positions first;   /* the first vertex at each position; only if out->repeats */
    uint64_t *flat;         /* a bit for each face without area */
    uint64_t *touched;      /* a bit for each corner of a face that is in a pair */
    uint32_t *degree;       /* for each corner: number of edges that are listed at it */
    uint64_t *begin; /* for each corner of a run and for the corner after it: start of the list */
    uint64_t begin_capacity;
    /* lists of edges: (other corner << 32 | face << 1 | direction); the direction is 1 if the face
     * has the edge from the corner with the higher number */
    uint64_t *edge;
} joining;

static uint64_t words_for(uint64_t bits) { return bits / 64 + 1; }

/* Gets the corners of a face; vertices at one position are one corner. */
static inline void get_corners(const joining *j, uint64_t face, uint32_t out[3])
{
    for (int i = 0; i < 3; i++) {
        out[i] = j->mesh->faces[3 * face + (unsigned)i];
        if (j->out->repeats)
            out[i] = ebpo_positions_first(&j->first, out[i]);
    }
}

/* --- areas --- */

static ebpo_status test_areas(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    joining *j = context;
    (void)worker, (void)error;
    EBPO_FOR_ITEMS(j->mesh->workspace, f, begin, end) {
        double p[3][3];
        for (int i = 0; i < 3; i++)
            ebpo_mesh_position(j->mesh, j->mesh->faces[3 * f + (unsigned)i], p[i]);
        if (ebpo_zero_area(p[0], p[1], p[2]))
            ebpo_set_bit(j->flat,
                         f); /* threads set bits in different words: FACE_GRAIN % 64 is 0 */
    }
    return EBPO_OK;
}

/* --- corners and edges --- */

static bool is_whole(const joining *j, uint64_t face)
{
    return !ebpo_has_bit(j->flat, face) && !ebpo_has_bit(j->paired, face);
}

/* Marks the corners of faces in pairs, and counts edges. */
static void mark_corners(joining *j)
{
    uint32_t corner[3];
    EBPO_FOR_ITEMS(j->mesh->workspace, f, 0, j->mesh->face_count) {
        if (ebpo_has_bit(j->flat, f))
            continue;
        get_corners(j, f, corner);
        for (int i = 0; i < 3; i++) {
            uint32_t a = corner[i], b = corner[i == 2 ? 0 : i + 1];
            j->degree[a < b ? a : b]++;
            if (ebpo_has_bit(j->paired, f))
                ebpo_set_bit(j->touched, a);
        }
    }
}

/* Lists the faces that are not whole, and the faces with two or more marked corners. */
static void list_touched(joining *j)
{
    EBPO_FOR_ITEMS(j->mesh->workspace, f, 0, j->mesh->face_count) {
        uint32_t corner[3];
        bool listed = !is_whole(j, f);
        if (!listed) {
            get_corners(j, f, corner);
            listed = ebpo_has_bit(j->touched, corner[0]) + ebpo_has_bit(j->touched, corner[1]) +
                         ebpo_has_bit(j->touched, corner[2]) >=
                     2;
        }
        if (listed)
            ebpo_set_bit(j->out->listed, f);
    }
}

/* --- joining --- */

static uint32_t face_of(uint64_t edge) { return (uint32_t)edge >> 1; }

/* Joins the faces of an edge if the edge has exactly two faces and both are whole. list: the
 * entries of the edge. Returns false if the edge does not occur equally often in both directions.
 */
static bool join_edge(joining *j, const uint64_t *list, uint64_t count)
{
    int64_t balance = 0;
    for (uint64_t i = 0; i < count; i++) {
        if (ebpo_has_bit(j->paired, face_of(list[i])))
            return true; /* ebpo_cut_mesh_classify tests the edges of cut faces */
        balance += list[i] & 1 ? -1 : 1;
    }
    if (count == 2)
        ebpo_set_join(j->out->component, face_of(list[0]), face_of(list[1]));
    for (uint64_t i = 0; i < count && count > 2; i++)
        ebpo_set_bit(j->out->listed, face_of(list[i]));
    return balance == 0;
}

/* Joins faces at the edges that are listed at one corner. Returns false if an edge is not closed.
 */
static bool join_list(joining *j, uint64_t *list, uint64_t count)
{
    bool closed = true;
    ebpo_sort_numbers(list, count);
    for (uint64_t i = 0, next; i < count; i = next) {
        for (next = i + 1; next < count && list[next] >> 32 == list[i] >> 32;)
            next++;
        closed = join_edge(j, list + i, next - i) && closed;
    }
    return closed;
}

/* Lists the edges at the corners [first, end). */
static void list_edges(joining *j, uint64_t first, uint64_t end)
{
    uint32_t corner[3];
    EBPO_FOR_ITEMS(j->mesh->workspace, f, 0, j->mesh->face_count) {
        if (ebpo_has_bit(j->flat, f))
            continue;
        get_corners(j, f, corner);
        for (int i = 0; i < 3; i++) {
            uint32_t a = corner[i], b = corner[i == 2 ? 0 : i + 1], least = a < b ? a : b;
            if (least >= first && least < end)
                j->edge[j->begin[least - first + 1]++] =
                    (uint64_t)(a < b ? b : a) << 32 | f << 1 | (a > b);
        }
    }
}

/* Joins faces at a run of corners. The run begins at `first`, and is the longest run whose
 * corners together have at most `capacity` edges. Sets *end to the corner after the run. */
static ebpo_status join_run(joining *j, uint64_t first, uint64_t *end, uint64_t capacity,
                            ebpo_error *error)
{
    uint64_t edges = 0, last = first;
    for (; last < j->mesh->vertex_count && edges + j->degree[last] <= capacity; last++)
        edges += j->degree[last];
    if (!ebpo_grow(&j->begin, &j->begin_capacity, last - first + 2, sizeof *j->begin))
        return ebpo_fail_memory(error, (last - first + 2) * sizeof *j->begin);
    uint64_t at = 0;
    EBPO_FOR_ITEMS(j->mesh->workspace, n, first, last) {
        j->begin[n - first + 1] = at; /* list_edges moves this to the end of the list */
        at += j->degree[n];
    }
    j->begin[0] = 0;
    list_edges(j, first, last);
    EBPO_FOR_ITEMS(j->mesh->workspace, v, first, last)
        if (!join_list(j, j->edge + j->begin[v - first],
                       j->begin[v - first + 1] - j->begin[v - first]))
            return ebpo_fail(error, EBPO_E_FORMAT,
                             "the mesh is not closed; check the file (ebpo verify)");
    *end = last;
    return EBPO_OK;
}

static ebpo_status join_all(joining *j, const ebpo_progress *progress, ebpo_error *error)
{
    uint64_t capacity = EDGES, all = 3 * j->mesh->face_count;
    ebpo_status status = EBPO_OK;
    if (j->mesh->workspace && ebpo_workspace_memory(j->mesh->workspace) / EDGE_BYTES < capacity)
        capacity = ebpo_workspace_memory(j->mesh->workspace) / EDGE_BYTES;
    EBPO_FOR_ITEMS(j->mesh->workspace, n, 0, j->mesh->vertex_count)
        capacity = j->degree[n] > capacity ? j->degree[n] : capacity;
    capacity = capacity < all ? capacity : all;
    j->edge = ebpo_alloc(capacity, sizeof *j->edge);
    if (!j->edge)
        return ebpo_fail_memory(error, capacity * sizeof *j->edge);
    for (uint64_t v = 0; v < j->mesh->vertex_count && status == EBPO_OK;) {
        if (!ebpo_progress_step(progress, stage, v, j->mesh->vertex_count, error))
            return EBPO_E_CANCELLED;
        status = join_run(j, v, &v, capacity, error);
    }
    return status;
}

/* --- numbers of components --- */

/* Replaces the forest by the numbers of components, in the order of their first faces. */
static void number_components(joining *j)
{
    uint32_t *parent = j->out->component, count = 0;
    EBPO_FOR_ITEMS(j->mesh->workspace, f, 0, j->mesh->face_count)
        parent[f] = parent[parent[f]]; /* the root, because parents come before their children */
    EBPO_FOR_ITEMS(j->mesh->workspace, g, 0, j->mesh->face_count) {
        if (!is_whole(j, g))
            parent[g] = EBPO_NO_COMPONENT;
        else
            parent[g] = parent[g] == g ? count++ : parent[parent[g]];
    }
    j->out->components = count;
}

/* Lists the first face of each component that has no listed face. The first pass marks the
 * components that have a listed face, the second pass lists faces of the other components. */
static ebpo_status list_components(joining *j, ebpo_error *error)
{
    const uint32_t *component = j->out->component;
    uint64_t *has_listed = ebpo_alloc_zero(words_for(j->out->components), sizeof *has_listed);
    if (!has_listed)
        return ebpo_fail_memory(error, words_for(j->out->components) * sizeof *has_listed);
    for (int pass = 0; pass < 2; pass++)
        EBPO_FOR_ITEMS(j->mesh->workspace, f, 0, j->mesh->face_count) {
            if (component[f] == EBPO_NO_COMPONENT || ebpo_has_bit(has_listed, component[f]))
                continue;
            if (pass)
                ebpo_set_bit(j->out->listed, f);
            if (ebpo_has_bit(j->out->listed, f))
                ebpo_set_bit(has_listed, component[f]);
        }
    free(has_listed);
    return EBPO_OK;
}

/* --- all of it --- */

static ebpo_status make_arrays(joining *j, ebpo_error *error)
{
    const ebpo_mesh *mesh = j->mesh;
    j->out->component =
        ebpo_array_alloc(mesh->workspace, mesh->face_count, sizeof *j->out->component);
    j->out->listed = ebpo_alloc_zero(words_for(mesh->face_count), sizeof *j->out->listed);
    j->flat = ebpo_alloc_zero(words_for(mesh->face_count), sizeof *j->flat);
    j->touched = ebpo_alloc_zero(words_for(mesh->vertex_count), sizeof *j->touched);
    j->degree = ebpo_array_zero(mesh->workspace, mesh->vertex_count, sizeof *j->degree);
    if (!j->out->component || !j->out->listed || !j->flat || !j->touched || !j->degree)
        return ebpo_workspace_fail(mesh->workspace, 4 * (mesh->face_count + mesh->vertex_count),
                                   error);
    EBPO_FOR_ITEMS(mesh->workspace, f, 0, mesh->face_count)
        j->out->component[f] = (uint32_t)f;
    return EBPO_OK;
}

ebpo_status ebpo_whole_faces_find(ebpo_whole_faces *out, const ebpo_mesh *mesh,
                                  const uint64_t *paired, unsigned threads,
                                  const ebpo_progress *progress, ebpo_error *error)
{
    joining j = { .out = out, .mesh = mesh, .paired = paired };
    *out = (ebpo_whole_faces){ .workspace = mesh->workspace };
    ebpo_status status = make_arrays(&j, error);
    if (status == EBPO_OK)
        status = ebpo_positions_build(&j.first, mesh, threads, progress, error);
    if (status == EBPO_OK) {
        out->repeats = j.first.repeated > 0;
        if (!out->repeats)
            ebpo_positions_free(&j.first);
        status = ebpo_parallel_for(threads, mesh->workspace, mesh->face_count, FACE_GRAIN,
                                   test_areas, &j, NULL, stage, error);
    }
    if (status == EBPO_OK) {
        mark_corners(&j);
        list_touched(&j);
        status = join_all(&j, progress, error);
    }
    if (status == EBPO_OK) {
        number_components(&j);
        status = list_components(&j, error);
    }
    ebpo_positions_free(&j.first);
    ebpo_array_free(mesh->workspace, j.degree);
    free(j.flat);
    free(j.touched);
    free(j.begin);
    free(j.edge);
    return status;
}

void ebpo_whole_faces_free(ebpo_whole_faces *faces)
{
    ebpo_array_free(faces->workspace, faces->component);
    free(faces->listed);
    *faces = (ebpo_whole_faces){ 0 };
}
