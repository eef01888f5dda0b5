/* Repairs a mesh: performs the requested repairs in a fixed order. Separate functions remove
 * repeated faces (faces with the same three vertices as another face), and count the faces whose
 * corners have the same positions as the corners of another face. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "mesh/adjacency.h"
#include "mesh/component_parts.h"
#include "mesh/mesh_check_parts.h"
#include "mesh/mesh_parts.h"

/* --- repeated faces --- */

enum {
    DROP_GRAIN = 1 << 13, /* number of vertices for each call of a thread's function */
    WORD = 64             /* bits of a word of dropping.removed */
};

typedef struct dropping {
    ebpo_mesh *mesh;
    ebpo_stars stars;
    ebpo_same_faces *scratch; /* one for each worker */
    unsigned threads;
    uint64_t *removed; /* bit f is set if face f is to be removed */
    uint64_t count;    /* number of faces to be removed */
    uint64_t opposite; /* number of these faces with the orientation opposite to the kept face */
} dropping;

static bool is_removed(const dropping *d, uint64_t f)
{
    return d->removed[f / WORD] >> f % WORD & 1;
}

/* Starts at the vertex with the face's lowest index. Returns true if the index of the next vertex
 * is lower than the index of the last vertex. Repeated faces with different results have opposite
 * orientations. */
static bool runs_up(const uint32_t face[3])
{
    int low = face[0] < face[1] ? (face[0] < face[2] ? 0 : 2) : (face[1] < face[2] ? 1 : 2);
    return face[(low + 1) % 3] < face[(low + 2) % 3];
}

/* Marks all but the first face of each set of repeated faces. */
static void mark_repeated(dropping *d, const ebpo_same_faces *same)
{
    const uint32_t *faces = d->mesh->faces;
    uint64_t count = 0, opposite = 0, first = 0;
    for (uint64_t i = 1; i < same->count; i++) {
        if (!ebpo_same_faces_repeats(same, i)) {
            first = i;
            continue;
        }
        uint64_t f = same->item[i].face, kept = same->item[first].face;
        __atomic_fetch_or(&d->removed[f / WORD], UINT64_C(1) << f % WORD, __ATOMIC_RELAXED);
        opposite += runs_up(faces + 3 * f) != runs_up(faces + 3 * kept);
        count++;
    }
    if (count) {
        __atomic_fetch_add(&d->count, count, __ATOMIC_RELAXED);
        __atomic_fetch_add(&d->opposite, opposite, __ATOMIC_RELAXED);
    }
}

static ebpo_status find_repeated(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    dropping *d = context;
    EBPO_FOR_ITEMS_SCATTERED(d->mesh->workspace, v, begin, end) {
        uint64_t degree = ebpo_stars_degree(&d->stars, (uint32_t)v);
        if (!ebpo_same_faces_gather(&d->scratch[worker], &d->stars, d->mesh, (uint32_t)v))
            return ebpo_workspace_fail(d->mesh->workspace, degree * sizeof(ebpo_same_face), error);
        mark_repeated(d, &d->scratch[worker]);
    }
    return EBPO_OK;
}

/* Adds source indices to a mesh that is in the order of the source. */
static ebpo_status add_source_indices(ebpo_mesh *mesh, ebpo_error *error)
{
    if (mesh->arrangement)
        return EBPO_OK;
    ebpo_workspace *workspace = mesh->workspace;
    struct ebpo_arrangement *a = ebpo_alloc_zero(1, sizeof *a);
    if (!a)
        return ebpo_fail_memory(error, sizeof *a);
    a->workspace = workspace;
    a->level = -1;
    a->vertex_source = ebpo_array_alloc(workspace, mesh->vertex_count, sizeof *a->vertex_source);
    a->face_source = ebpo_array_alloc(workspace, mesh->face_count, sizeof *a->face_source);
    if (!a->vertex_source || !a->face_source) {
        ebpo_arrangement_free(a);
        return ebpo_workspace_fail(workspace, (mesh->vertex_count + mesh->face_count) * 4, error);
    }
    EBPO_FOR_ITEMS(workspace, i, 0, mesh->vertex_count)
        a->vertex_source[i] = (uint32_t)i;
    EBPO_FOR_ITEMS(workspace, i, 0, mesh->face_count)
        a->face_source[i] = (uint32_t)i;
    mesh->arrangement = a;
    return EBPO_OK;
}

/* Removes the marked faces in place. Sorted faces stay sorted. Every vertex that had a face still
 * has a face, because the first of the repeated faces stays. */
static void remove_marked(const dropping *d)
{
    ebpo_mesh *mesh = d->mesh;
    uint64_t to = 0;
    EBPO_FOR_ITEMS(mesh->workspace, f, 0, mesh->face_count) {
        if (is_removed(d, f))
            continue;
        if (to != f) {
            memcpy(mesh->faces + 3 * to, mesh->faces + 3 * f, 3 * sizeof *mesh->faces);
            mesh->arrangement->face_source[to] = mesh->arrangement->face_source[f];
        }
        to++;
    }
    mesh->arrangement->dropped_faces += d->count;
    mesh->face_count = to;
}

/* Marks the repeated faces of the whole mesh. */
static ebpo_status mark_all(dropping *d, ebpo_error *error)
{
    const ebpo_mesh *mesh = d->mesh;
    uint64_t words = mesh->face_count / WORD + 1;
    d->scratch = ebpo_alloc_zero(d->threads, sizeof *d->scratch);
    if (!d->scratch)
        return ebpo_fail_memory(error, d->threads * sizeof *d->scratch);
    ebpo_status status = ebpo_stars_build(&d->stars, mesh, d->threads, NULL, error);
    if (status != EBPO_OK)
        return status;
    d->removed = ebpo_array_zero(mesh->workspace, words, sizeof *d->removed);
    if (!d->removed)
        return ebpo_workspace_fail(mesh->workspace, words * sizeof *d->removed, error);
    return ebpo_parallel_for(d->threads, mesh->workspace, mesh->vertex_count, DROP_GRAIN,
                             find_repeated, d, NULL, "", error);
}

static ebpo_status drop_faces(dropping *d, ebpo_error *error)
{
    ebpo_mesh *mesh = d->mesh;
    ebpo_status status = mark_all(d, error);
    if (status != EBPO_OK || d->count == 0)
        return status;
    status = ebpo_mesh_check_whole(mesh, error);
    if (status == EBPO_OK)
        status = add_source_indices(mesh, error);
    if (status == EBPO_OK)
        remove_marked(d);
    return status;
}

static void free_dropping(dropping *d)
{
    ebpo_stars_free(&d->stars);
    ebpo_array_free(d->mesh->workspace, d->removed);
    for (unsigned t = 0; d->scratch && t < d->threads; t++)
        ebpo_same_faces_free(&d->scratch[t]);
    free(d->scratch);
}

ebpo_status ebpo_mesh_drop_duplicates(ebpo_mesh *mesh, ebpo_repair_record *record,
                                      ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    dropping d = { .mesh = mesh, .threads = ebpo_thread_count(0) };
    ebpo_status status = ebpo_mesh_check_shape(mesh, error);
    if (status != EBPO_OK)
        return status;
    status = drop_faces(&d, error);
    if (status == EBPO_OK && record) {
        record->drop_duplicates = true;
        record->dropped_faces += d.count;
        record->dropped_opposite += d.opposite;
    }
    free_dropping(&d);
    return status;
}

/* --- faces with the positions of another face --- */

/* Sets each corner to the first vertex at its position. */
static ebpo_status merge_corners(const ebpo_mesh *mesh, unsigned threads, uint32_t *corner,
                                 ebpo_error *error)
{
    ebpo_positions positions = { .mesh = NULL };
    ebpo_status status = ebpo_positions_build(&positions, mesh, threads, NULL, error);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, status == EBPO_OK ? 3 * mesh->face_count : 0)
        corner[i] = ebpo_positions_first(&positions, mesh->faces[i]);
    ebpo_positions_free(&positions);
    return status;
}

ebpo_status ebpo_mesh_count_repeated(const ebpo_mesh *mesh, unsigned threads, ebpo_finding *out,
                                     uint64_t *opposite, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_mesh welded = *mesh;
    dropping d = { .mesh = &welded, .threads = ebpo_thread_count(threads) };
    *out = (ebpo_finding){ 0 };
    *opposite = 0;
    ebpo_status status = ebpo_components_check(mesh, error);
    if (status != EBPO_OK)
        return status;
    uint64_t bytes = 3 * mesh->face_count * sizeof *welded.faces;
    welded.faces = ebpo_array_alloc(mesh->workspace, 3 * mesh->face_count, sizeof *welded.faces);
    status = welded.faces ? merge_corners(mesh, threads, welded.faces, error)
                          : ebpo_workspace_fail(mesh->workspace, bytes, error);
    if (status == EBPO_OK)
        status = mark_all(&d, error);
    EBPO_FOR_ITEMS(mesh->workspace, f, 0, status == EBPO_OK ? mesh->face_count : 0)
        if (is_removed(&d, f))
            ebpo_finding_add(out, ebpo_mesh_source_face(mesh, f));
    *opposite = d.opposite;
    free_dropping(&d);
    ebpo_array_free(mesh->workspace, welded.faces);
    return status;
}

/* --- all repairs, in order --- */

enum { TURN_GRAIN = 1 << 14 }; /* number of faces for each call of a thread's function */

static ebpo_status turn_faces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    ebpo_mesh *mesh = context;
    (void)worker, (void)error;
    EBPO_FOR_ITEMS(mesh->workspace, f, begin, end)
        ebpo_face_turn(mesh->faces + 3 * f);
    return EBPO_OK;
}

ebpo_status ebpo_mesh_flip(ebpo_mesh *mesh, ebpo_repair_record *record, ebpo_error *error)
{
    ebpo_status status = ebpo_mesh_check_shape(mesh, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(0, NULL, mesh->face_count, TURN_GRAIN, turn_faces, mesh, NULL,
                                   "", error);
    if (status == EBPO_OK && record)
        record->flipped_faces += mesh->face_count;
    return status;
}

ebpo_status ebpo_mesh_orient(ebpo_mesh *mesh, ebpo_repair_record *record, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    uint32_t *closed = NULL;
    ebpo_status status = ebpo_mesh_make_consistent(mesh, record, &closed, error);
    if (status == EBPO_OK)
        status = ebpo_mesh_turn_shells(mesh, closed, record, error);
    ebpo_array_free(mesh->workspace, closed);
    return status;
}

/* Orients the mesh. With EBPO_REPAIR_EARLIER, gives the result of earlier builds (mesh_parts.h). */
static ebpo_status orient_mesh(ebpo_mesh *mesh, unsigned steps, ebpo_repair_record *record,
                               ebpo_error *error)
{
    return steps & EBPO_REPAIR_EARLIER ? ebpo_mesh_make_consistent(mesh, record, NULL, error)
                                       : ebpo_mesh_orient(mesh, record, error);
}

ebpo_status ebpo_mesh_repair(ebpo_mesh *mesh, unsigned steps, double weld_distance,
                             ebpo_repair_record *record, ebpo_error *error)
{
    uint64_t filled = record->filled_holes, unorientable = record->unorientable_components;
    ebpo_status status = EBPO_OK;
    if (weld_distance > 0)
        status = ebpo_mesh_weld_within(mesh, weld_distance, record, error);
    else if (steps & EBPO_REPAIR_WELD)
        status = ebpo_mesh_weld(mesh, record, error);
    if (status == EBPO_OK && steps & EBPO_REPAIR_DROP)
        status = ebpo_mesh_drop_duplicates(mesh, record, error);
    if (status == EBPO_OK && steps & EBPO_REPAIR_ORIENT)
        status = orient_mesh(mesh, steps, record, error);
    if (status == EBPO_OK && steps & EBPO_REPAIR_FLIP)
        status = ebpo_mesh_flip(mesh, record, error);
    if (status == EBPO_OK && steps & EBPO_REPAIR_FILL)
        status = ebpo_mesh_fill_holes(mesh, record, error);
    /* Filling holes can close components. A closed component has an outside, which determines its
     * orientation. So the mesh is oriented again. The record then has the number of unorientable
     * components of the filled mesh only. */
    if (status == EBPO_OK && steps & EBPO_REPAIR_ORIENT && !(steps & EBPO_REPAIR_EARLIER) &&
        record->filled_holes > filled) {
        record->unorientable_components = unorientable;
        status = ebpo_mesh_orient(mesh, record, error);
    }
    return status;
}
