/* Welds vertices. A group of vertices at one position, or within a distance of each other
 * (weld_within.c), becomes one vertex: the first vertex of the group in the source. The attributes
 * of this vertex stay. An *arranged* mesh is sorted along a Morton curve (ebpo_mesh_arrange). */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/hash.h"
#include "core/parallel.h"
#include "core/sort.h"
#include "mesh/attributes.h"
#include "mesh/mesh_parts.h"

/* A record of a position, without its lower HASH_SHIFT bits, is below EBPO_SORT_BINS. */
enum { HASH_SHIFT = 46, DIFFERENT_MAX = 16 };

/* The bits of a position as doubles, in which -0 is replaced by 0. */
typedef struct key {
    uint64_t bits[3];
} key;

static inline key key_of(const ebpo_mesh *mesh, uint32_t v)
{
    double p[3];
    key k;
    ebpo_mesh_position(mesh, v, p);
    for (int i = 0; i < 3; i++)
        p[i] += 0.0; /* -0 becomes 0 */
    memcpy(k.bits, p, sizeof k.bits);
    return k;
}

static inline bool same_key(const key *a, const key *b)
{
    return a->bits[0] == b->bits[0] && a->bits[1] == b->bits[1] && a->bits[2] == b->bits[2];
}

/* Makes the records of vertices: the upper half of the hash of the position, then the vertex. */
static ebpo_status make_hashes(void *context, uint64_t begin, uint64_t end, void *records,
                               ebpo_error *error)
{
    const ebpo_positions *t = context;
    uint64_t *out = records;
    (void)error;
    for (uint64_t v = begin; v < end; v++) {
        key k = key_of(t->mesh, (uint32_t)v);
        *out++ = ebpo_hash_three(k.bits) >> 32 << 32 | v;
        t->first[v] = (uint32_t)v;
    }
    return EBPO_OK;
}

/* Compares two records by their positions, then by their vertices. */
static int compare_records(const void *a, const void *b, void *context)
{
    const ebpo_positions *t = context;
    uint32_t v = (uint32_t) * (const uint64_t *)a, w = (uint32_t) * (const uint64_t *)b;
    key k = key_of(t->mesh, v), l = key_of(t->mesh, w);
    int order = memcmp(k.bits, l.bits, sizeof k.bits);
    return order ? order : (v > w) - (v < w);
}

/* Sets t->first of vertices with equal hashes by sorting their positions, and adds to *repeated.
 * Returns false without memory. */
static bool sort_positions(ebpo_positions *t, const uint64_t *record, uint64_t count,
                           uint64_t *repeated)
{
    uint64_t *sorted = ebpo_alloc(count, sizeof *sorted);
    if (!sorted)
        return false;
    memcpy(sorted, record, count * sizeof *sorted);
    ebpo_sort_with(sorted, count, sizeof *sorted, compare_records, t);
    for (uint64_t i = 1; i < count; i++) {
        uint32_t v = (uint32_t)sorted[i], before = (uint32_t)sorted[i - 1];
        key k = key_of(t->mesh, v), l = key_of(t->mesh, before);
        if (t->first[v] == v && same_key(&k, &l)) {
            t->first[v] = t->first[before];
            ++*repeated;
        }
    }
    free(sorted);
    return true;
}

/* Sets t->first of vertices with equal hashes. record: their records, in ascending order. Returns
 * the number of vertices that repeat the position of an earlier vertex. Positions with equal hashes
 * are nearly always equal, so nearly all vertices but the first are skipped. If there are many
 * different positions, which somebody may have chosen, they are sorted. */
static uint64_t compare_positions(ebpo_positions *t, const uint64_t *record, uint64_t count)
{
    uint64_t repeated = 0;
    int different = 0;
    for (uint64_t i = 0; i + 1 < count; i++) {
        uint32_t v = (uint32_t)record[i];
        if (t->first[v] != v)
            continue;
        if (++different == DIFFERENT_MAX && sort_positions(t, record + i, count - i, &repeated))
            return repeated;
        key k = key_of(t->mesh, v);
        for (uint64_t n = i + 1; n < count; n++) {
            uint32_t later = (uint32_t)record[n];
            key other = key_of(t->mesh, later);
            if (!same_key(&k, &other))
                continue;
            t->first[later] = v;
            repeated++;
        }
    }
    return repeated;
}

/* Receives sorted records; all records with one hash are in the same call. */
static void take_hashes(void *context, uint64_t place, const void *records, uint64_t count)
{
    ebpo_positions *t = context;
    const uint64_t *record = records;
    uint64_t repeated = 0, released = 0;
    (void)place;
    for (uint64_t i = 0, end; i < count; i = end) {
        if (i - released >= EBPO_ITEMS_SCATTERED) {
            ebpo_release_pages(t->workspace);
            released = i;
        }
        for (end = i + 1; end < count && record[end] >> 32 == record[i] >> 32;)
            end++;
        repeated += compare_positions(t, record + i, end - i);
    }
    __atomic_fetch_add(&t->repeated, repeated, __ATOMIC_RELAXED);
}

ebpo_status ebpo_positions_build(ebpo_positions *out, const ebpo_mesh *mesh, unsigned threads,
                                 const ebpo_progress *progress, ebpo_error *error)
{
    const ebpo_sort sort = { .workspace = mesh->workspace,
                             .threads = ebpo_thread_count(threads),
                             .progress = progress,
                             .stage = "comparing positions",
                             .count = mesh->vertex_count,
                             .record = sizeof(uint64_t),
                             .shift = HASH_SHIFT,
                             .context = out,
                             .make = make_hashes,
                             .take = take_hashes }; /* no `compare`: all records are different */
    *out = (ebpo_positions){ .mesh = mesh, .workspace = mesh->workspace };
    out->first = ebpo_array_alloc(mesh->workspace, mesh->vertex_count, sizeof *out->first);
    if (!out->first)
        return ebpo_workspace_fail(mesh->workspace, mesh->vertex_count * sizeof *out->first, error);
    ebpo_status status = ebpo_sort_run(&sort, error);
    if (status != EBPO_OK)
        ebpo_positions_free(out);
    return status;
}

void ebpo_positions_free(ebpo_positions *positions)
{
    ebpo_array_free(positions->workspace, positions->first);
    *positions = (ebpo_positions){ .mesh = NULL };
}

enum {
    GRAIN = 1 << 15, /* number of vertices, or of faces, of a block */
    WORD = 64        /* bits of a word of welding.remaining */
};

typedef struct welding {
    ebpo_mesh *mesh;
    double distance;    /* 0: merge vertices at equal positions */
    double moved;       /* largest distance by which a vertex moves */
    uint64_t collapsed; /* number of faces that repeat a vertex only after welding */
    uint64_t kept;      /* number of remaining vertices */
    uint32_t *map;      /* [vertex_count] new index of each vertex */
    uint32_t *from;     /* [kept] the remaining vertex of each group */
    /* arranged mesh: [blocks of GRAIN vertices] number of groups that begin in the block; later the
     * number of groups that begin in all previous blocks */
    uint64_t *heads;
    uint64_t *remaining; /* arranged mesh: bit s is set if vertex s of the source remains */
    uint64_t *before;    /* [words of `remaining`] number of bits that are set before the word */
    uint32_t *rows;      /* arranged mesh with attributes: [kept] attribute rows that stay */
} welding;

static ebpo_status check_indices(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    const ebpo_mesh *mesh = context;
    (void)worker;
    for (uint64_t i = 3 * begin; i < 3 * end; i++)
        if (mesh->faces[i] >= mesh->vertex_count)
            return ebpo_fail_file(error, EBPO_E_FORMAT, ebpo_mesh_label(mesh),
                                  "face %llu names vertex %lu, but there are %llu vertices; "
                                  "repair the file or drop the face",
                                  (unsigned long long)ebpo_mesh_source_face(mesh, i / 3),
                                  (unsigned long)mesh->faces[i],
                                  (unsigned long long)mesh->vertex_count);
    return EBPO_OK;
}

/* --- groups in a mesh of any order --- */

static ebpo_status group_by_positions(welding *w, ebpo_error *error)
{
    const ebpo_mesh *mesh = w->mesh;
    ebpo_positions positions = { .mesh = NULL };
    ebpo_status status = ebpo_positions_build(&positions, mesh, 0, NULL, error);
    if (status != EBPO_OK)
        return status;
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, v, 0, mesh->vertex_count) {
        uint32_t first = ebpo_positions_first(&positions, (uint32_t)v);
        w->map[v] = first == v ? (uint32_t)w->kept++ : w->map[first];
    }
    ebpo_positions_free(&positions);
    return EBPO_OK;
}

/* --- groups in an arranged mesh: comparison of neighbours --- */

/* Returns true if vertex v has another position than the previous vertex. */
static bool begins_group(const ebpo_mesh *mesh, uint64_t v)
{
    double p[3], q[3];
    if (v == 0)
        return true;
    ebpo_mesh_position(mesh, v - 1, p);
    ebpo_mesh_position(mesh, v, q);
    return p[0] != q[0] || p[1] != q[1] || p[2] != q[2];
}

/* Sets w->heads of a block of vertices to the number of groups that begin in the block. */
static ebpo_status count_heads(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    welding *w = context;
    (void)worker, (void)error;
    uint64_t count = 0;
    for (uint64_t v = begin; v < end; v++)
        count += begins_group(w->mesh, v);
    w->heads[begin / GRAIN] = count;
    return EBPO_OK;
}

/* Sets w->map of a block of vertices to the indices of their groups. w->heads: number of groups
 * that begin before the block. */
static ebpo_status number_groups(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    welding *w = context;
    (void)worker, (void)error;
    uint64_t next = w->heads[begin / GRAIN];
    for (uint64_t v = begin; v < end; v++) {
        next += begins_group(w->mesh, v);
        w->map[v] = (uint32_t)(next - 1);
    }
    return EBPO_OK;
}

static ebpo_status group_neighbours(welding *w, ebpo_error *error)
{
    uint64_t n = w->mesh->vertex_count, blocks = (n + GRAIN - 1) / GRAIN;
    w->heads = ebpo_alloc(blocks, sizeof *w->heads);
    if (!w->heads)
        return ebpo_fail_memory(error, blocks * sizeof *w->heads);
    ebpo_status status =
        ebpo_parallel_for(0, w->mesh->workspace, n, GRAIN, count_heads, w, NULL, "", error);
    for (uint64_t i = 0; status == EBPO_OK && i < blocks; i++) {
        uint64_t count = w->heads[i];
        w->heads[i] = w->kept;
        w->kept += count;
    }
    return status == EBPO_OK ? ebpo_parallel_for(0, w->mesh->workspace, n, GRAIN, number_groups, w,
                                                 NULL, "", error)
                             : status;
}

/* --- within a distance --- */

static ebpo_status group_within(welding *w, ebpo_error *error)
{
    const ebpo_mesh *mesh = w->mesh;
    w->from = ebpo_array_alloc(mesh->workspace, mesh->vertex_count, sizeof *w->from);
    return w->from
               ? ebpo_weld_group_within(mesh, w->distance, w->map, w->from, &w->kept, &w->moved,
                                        error)
               : ebpo_workspace_fail(mesh->workspace, mesh->vertex_count * sizeof *w->from, error);
}

/* --- remaining vertices --- */

/* Chooses, for each group, the vertex that is first in the source. Groups are numbered in the order
 * of their first vertices. So a new index equal to group_count, the number of groups so far, begins
 * the next group. */
static ebpo_status choose_remaining(welding *w, ebpo_error *error)
{
    const ebpo_mesh *mesh = w->mesh;
    uint64_t group_count = 0;
    w->from = ebpo_array_alloc(mesh->workspace, w->kept, sizeof *w->from);
    if (!w->from)
        return ebpo_workspace_fail(mesh->workspace, w->kept * sizeof *w->from, error);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, v, 0, mesh->vertex_count) {
        uint32_t group = w->map[v];
        if (group == group_count)
            w->from[group_count++] = (uint32_t)v;
        else if (ebpo_mesh_source_vertex(mesh, v) < ebpo_mesh_source_vertex(mesh, w->from[group]))
            w->from[group] = (uint32_t)v;
    }
    return EBPO_OK;
}

/* Sets the bits of the remaining vertices' source indices in w->remaining. */
static ebpo_status mark_sources(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                ebpo_error *error)
{
    welding *w = context;
    (void)worker, (void)error;
    EBPO_FOR_ITEMS_SCATTERED(w->mesh->workspace, i, begin, end) {
        uint64_t s = ebpo_mesh_source_vertex(w->mesh, w->from[i]);
        __atomic_fetch_or(&w->remaining[s / WORD], UINT64_C(1) << s % WORD, __ATOMIC_RELAXED);
    }
    return EBPO_OK;
}

/* Sets w->remaining and w->before. Source indices will be renumbered as if the source had no
 * removed vertices: the new index of a vertex is the number of remaining vertices before it. */
static ebpo_status number_sources(welding *w, ebpo_error *error)
{
    ebpo_workspace *workspace = w->mesh->workspace;
    uint64_t words = w->mesh->vertex_count / WORD + 1, sum = 0;
    w->remaining = ebpo_array_zero(workspace, words, sizeof *w->remaining);
    w->before = ebpo_array_alloc(workspace, words, sizeof *w->before);
    if (!w->remaining || !w->before)
        return ebpo_workspace_fail(workspace, 2 * words * sizeof *w->remaining, error);
    ebpo_status status =
        ebpo_parallel_for(0, NULL, w->kept, GRAIN, mark_sources, w, NULL, "", error);
    EBPO_FOR_ITEMS(workspace, i, 0, words) {
        w->before[i] = sum;
        sum += (uint64_t)__builtin_popcountll(w->remaining[i]);
    }
    return status;
}

/* Records the number of removed vertices whose attribute values differ from the values of the
 * remaining vertex. */
static void record_differences(const welding *w)
{
    const ebpo_mesh *mesh = w->mesh;
    uint64_t differ = 0;
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, v, 0, mesh->vertex_count) {
        uint64_t remaining = w->from[w->map[v]];
        differ +=
            remaining != v && !ebpo_attributes_equal_rows(mesh->attributes, "vertex",
                                                          ebpo_mesh_source_vertex(mesh, v),
                                                          ebpo_mesh_source_vertex(mesh, remaining));
    }
    if (differ)
        ebpo_attributes_lose(mesh->attributes,
                             "attribute values of joined vertices that differ from the remaining "
                             "vertex: %llu",
                             (unsigned long long)differ);
}

/* Lists the attribute rows of the remaining vertices. Attributes are in the order of the source, so
 * without an arrangement the rows are w->from. */
static ebpo_status list_rows(welding *w, ebpo_error *error)
{
    ebpo_mesh *mesh = w->mesh;
    uint64_t kept = 0;
    if (!mesh->attributes || !mesh->arrangement)
        return EBPO_OK;
    w->rows = ebpo_array_alloc(mesh->workspace, w->kept, sizeof *w->rows);
    if (!w->rows)
        return ebpo_workspace_fail(mesh->workspace, w->kept * sizeof *w->rows, error);
    EBPO_FOR_ITEMS(mesh->workspace, s, 0, mesh->vertex_count)
        if (w->remaining[s / WORD] >> s % WORD & 1)
            w->rows[kept++] = (uint32_t)s;
    return EBPO_OK;
}

/* --- writing the result: cannot fail from here on --- */

static ebpo_status rename_corners(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                  ebpo_error *error)
{
    welding *w = context;
    uint64_t collapsed = 0;
    (void)worker, (void)error;
    EBPO_FOR_ITEMS_SCATTERED(w->mesh->workspace, f, begin, end) {
        uint32_t *face = w->mesh->faces + 3 * f;
        bool repeated = ebpo_face_repeats_index(face);
        for (int k = 0; k < 3; k++)
            face[k] = w->map[face[k]];
        collapsed += !repeated && ebpo_face_repeats_index(face);
    }
    __atomic_fetch_add(&w->collapsed, collapsed, __ATOMIC_RELAXED);
    return EBPO_OK;
}

static void move_attributes(const welding *w)
{
    ebpo_attributes *attributes = w->mesh->attributes;
    if (!attributes)
        return;
    record_differences(w);
    ebpo_attributes_keep(attributes, "vertex", w->rows ? w->rows : w->from, w->kept);
}

/* Moves vertices to their new indices. A new index is at most the least index of the group's
 * vertices, so moving in ascending order overwrites no vertex that is still needed. */
static void move_vertices(welding *w)
{
    ebpo_mesh *mesh = w->mesh;
    struct ebpo_arrangement *order = mesh->arrangement;
    size_t size = 3 * (mesh->xyz32 ? sizeof *mesh->xyz32 : sizeof *mesh->xyz64);
    char *base = mesh->xyz32 ? (char *)mesh->xyz32 : (char *)mesh->xyz64;
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, w->kept) {
        uint64_t from = w->from[i];
        if (from != i)
            memmove(base + i * size, base + from * size, size);
        if (order) {
            uint64_t s = order->vertex_source[from];
            order->vertex_source[i] =
                (uint32_t)(w->before[s / WORD] +
                           (uint64_t)__builtin_popcountll(w->remaining[s / WORD] &
                                                          ((UINT64_C(1) << s % WORD) - 1)));
        }
    }
    mesh->vertex_count = w->kept;
    if (order) {
        ebpo_array_free(mesh->workspace, order->key);
        order->key = NULL;
    }
    /* frees the unused end of the array */
    void *smaller = mesh->workspace || order ? NULL : ebpo_realloc(base, 3 * w->kept, size / 3);
    if (smaller && mesh->xyz32)
        mesh->xyz32 = smaller;
    else if (smaller)
        mesh->xyz64 = smaller;
}

/* Welds the mesh. The caller frees the arrays of *w, also on failure. */
static ebpo_status run_welding(welding *w, ebpo_error *error)
{
    ebpo_mesh *mesh = w->mesh;
    ebpo_status status = ebpo_parallel_for(0, mesh->workspace, mesh->face_count, GRAIN,
                                           check_indices, mesh, NULL, "", error);
    if (status != EBPO_OK)
        return status;
    w->map = ebpo_array_alloc(mesh->workspace, mesh->vertex_count, sizeof *w->map);
    if (!w->map)
        return ebpo_workspace_fail(mesh->workspace, mesh->vertex_count * sizeof *w->map, error);
    if (w->distance > 0)
        status = group_within(w, error);
    else
        status = mesh->arrangement && mesh->arrangement->grouped ? group_neighbours(w, error)
                                                                 : group_by_positions(w, error);
    if (status != EBPO_OK || w->kept == mesh->vertex_count)
        return status;
    status = ebpo_mesh_check_whole(mesh, error);
    if (status == EBPO_OK && !w->from)
        status = choose_remaining(w, error);
    if (status != EBPO_OK)
        return status;
    if (mesh->arrangement)
        status = number_sources(w, error);
    if (status == EBPO_OK)
        status = list_rows(w, error);
    if (status == EBPO_OK)
        status =
            ebpo_parallel_for(0, NULL, mesh->face_count, GRAIN, rename_corners, w, NULL, "", error);
    if (status == EBPO_OK) {
        move_attributes(w);
        move_vertices(w);
    }
    return status;
}

/* Welds the mesh and adds to the record. Distance 0 means equal positions. */
static ebpo_status weld_mesh(ebpo_mesh *mesh, double distance, ebpo_repair_record *record,
                             ebpo_error *error)
{
    welding w = { .mesh = mesh, .distance = distance };
    ebpo_status status = ebpo_mesh_check_shape(mesh, error);
    if (status != EBPO_OK)
        return status;
    uint64_t count = mesh->vertex_count;
    status = run_welding(&w, error);
    if (status == EBPO_OK && record) {
        record->weld = true;
        record->welded_vertices += count - mesh->vertex_count;
        if (distance > 0) {
            record->weld_distance = distance;
            record->weld_moved = w.moved > record->weld_moved ? w.moved : record->weld_moved;
            record->collapsed_faces += w.collapsed;
        }
    }
    ebpo_array_free(mesh->workspace, w.map);
    ebpo_array_free(mesh->workspace, w.from);
    ebpo_array_free(mesh->workspace, w.remaining);
    ebpo_array_free(mesh->workspace, w.rows);
    ebpo_array_free(mesh->workspace, w.before);
    free(w.heads);
    return status;
}

ebpo_status ebpo_mesh_weld(ebpo_mesh *mesh, ebpo_repair_record *record, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    return weld_mesh(mesh, 0, record, error);
}

ebpo_status ebpo_mesh_weld_within(ebpo_mesh *mesh, double distance, ebpo_repair_record *record,
                                  ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    if (!(distance > 0))
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, ebpo_mesh_label(mesh),
                              "the weld distance must be above 0, not %g", distance);
    ebpo_status status = weld_mesh(mesh, 0, record, error);
    return status == EBPO_OK ? weld_mesh(mesh, distance, record, error) : status;
}
