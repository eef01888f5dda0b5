/* The faces of a slice: its own, those that it only refers to, their vertices, and local numbers
 * for all. */
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "format/chunks.h"
#include "format/compact.h"
#include "format/slice.h"
#include "format/slice_faces.h"

static void expect_rows(ebpo_chunks *chunks, ebpo_array_id id, const uint32_t *single,
                        uint64_t singles, uint64_t first, uint64_t rows)
{
    ebpo_expected e = EBPO_EXPECTED_INIT(chunks->file);
    /* rows before `next` are in */
    uint64_t chunk_rows = ebpo_reader_array(chunks->file, id, 0)->shape.chunk_rows, next = 0;
    if (!ebpo_input_expects(&chunks->file->in))
        return;
    for (uint64_t i = 0; i < singles; i++)
        if (single[i] >= next) {
            ebpo_chunks_expect(chunks, &e, id, 0, single[i], 1);
            next = (single[i] / chunk_rows + 1) * chunk_rows;
        }
    if (rows && first + rows > next)
        ebpo_chunks_expect(chunks, &e, id, 0, first > next ? first : next,
                           first + rows - (first > next ? first : next));
    ebpo_expect_all(&e);
}

/* Rows of a decoded array: those of `single` (ascending), then [first, first + rows). Chunks stay
 * pinned while rows are in them. */
static ebpo_status gather_rows(ebpo_chunks *chunks, ebpo_array_id id, size_t row_bytes,
                          const uint32_t *single, uint64_t singles, uint64_t first, uint64_t rows,
                          void *out, ebpo_error *error)
{
    ebpo_held_chunk view = { .array = ebpo_reader_array(chunks->file, id, 0) };
    ebpo_status status = EBPO_OK;
    uint8_t *to = out;
    expect_rows(chunks, id, single, singles, first, rows);
    for (uint64_t i = 0;
         i < singles && (status = ebpo_held_chunk_move(chunks, &view, single[i], error)) == EBPO_OK;
         i++, to += row_bytes)
        memcpy(to, view.rows + (single[i] - view.begin) * row_bytes, row_bytes);
    while (rows && status == EBPO_OK &&
           (status = ebpo_held_chunk_move(chunks, &view, first, error)) == EBPO_OK) {
        uint64_t here = view.end - first < rows ? view.end - first : rows;
        memcpy(to, view.rows + (first - view.begin) * row_bytes, here * row_bytes);
        to += here * row_bytes;
        first += here;
        rows -= here;
    }
    ebpo_held_chunk_release(chunks, &view);
    return status;
}

/* --- references --- */

static ebpo_status collect_outer(ebpo_slice *slice, ebpo_compact *outer, ebpo_room *room,
                                 ebpo_error *error)
{
    uint64_t capacity = 0;
    for (int i = 0; i < slice->level_count; i++)
        for (uint64_t k = 0; k < slice->level[i].ref_count; k++)
            capacity += slice->level[i].leaf_refs[k] < slice->first_face;
    ebpo_status status = ebpo_room_check(room, ebpo_compact_bytes(capacity), error);
    if (status == EBPO_OK)
        status = ebpo_compact_make(outer, capacity, error);
    if (status != EBPO_OK)
        return status;
    for (int i = 0; i < slice->level_count; i++)
        for (uint64_t k = 0; k < slice->level[i].ref_count; k++)
            if (slice->level[i].leaf_refs[k] < slice->first_face)
                ebpo_compact_add(outer, slice->level[i].leaf_refs[k]);
    return ebpo_compact_sort(outer, error);
}

static void localise_faces(ebpo_slice *slice, const ebpo_compact *outer)
{
    /* the outer faces are some of those before the first */
    uint64_t less = slice->first_face - outer->count;
    for (int i = 0; i < slice->level_count; i++) {
        ebpo_level *level = &slice->level[i];
        for (uint64_t k = 0; k < level->leaf_count; k++)
            level->leaf_first[k] -= less;
        for (uint64_t k = 0; k < level->ref_count; k++) {
            uint32_t ref = level->leaf_refs[k];
            level->leaf_refs[k] =
                ref < slice->first_face ? ebpo_compact_find(outer, ref) : (uint32_t)(ref - less);
        }
    }
}

/* The list of outer faces stays with the slice. */
static ebpo_status number_faces(ebpo_slice *slice, ebpo_room *room, ebpo_error *error)
{
    ebpo_compact outer = { .slot = NULL };
    ebpo_status status = collect_outer(slice, &outer, room, error);
    if (status == EBPO_OK)
        localise_faces(slice, &outer);
    if (status == EBPO_OK && outer.count) {
        uint32_t *fit = ebpo_realloc(outer.sorted, outer.count, sizeof *fit);
        slice->outer = fit ? fit : outer.sorted;
        slice->outer_count = (uint32_t)outer.count;
        outer.sorted = NULL;
    }
    ebpo_compact_free(&outer);
    return status;
}

/* --- vertices --- */

/* Vertices are numbered by first use, so those that are new in the slice's own faces are a range,
 * [*begin, *end), and all others that it uses lie before. */
static ebpo_status new_vertices(ebpo_slice *slice, ebpo_chunks *chunks, uint64_t *begin,
                                uint64_t *end, ebpo_error *error)
{
    ebpo_held_chunk view = { .array = ebpo_reader_array(chunks->file, EBPO_A_FACES, 0) };
    *begin = *end = UINT32_MAX; /* no own faces: all vertices are older */
    if (slice->face_count == 0)
        return EBPO_OK;
    ebpo_status status = ebpo_held_chunk_move(chunks, &view, slice->first_face, error);
    if (status != EBPO_OK)
        return status;
    const uint32_t *corners = (const uint32_t *)(const void *)view.rows,
                   *own = slice->mesh.faces + 3 * (uint64_t)slice->outer_count;
    uint64_t seen = chunks->seen ? chunks->seen[view.begin / view.array->shape.chunk_rows] : 0;
    uint32_t before = 0, within = 0; /* one past the largest; vertex numbers are below 2^32 - 2 */
    for (uint64_t i = 0; i < 3 * (slice->first_face - view.begin); i++)
        before = corners[i] + 1 > before ? corners[i] + 1 : before;
    for (uint64_t i = 0; i < 3 * slice->face_count; i++)
        within = own[i] + 1 > within ? own[i] + 1 : within;
    ebpo_held_chunk_release(chunks, &view);
    *begin = before > seen ? before : seen;
    *end = within > *begin ? within : *begin;
    return EBPO_OK;
}

static ebpo_status collect_older(const ebpo_mesh *mesh, uint64_t begin, ebpo_room *room,
                                 ebpo_compact *older, uint64_t *bytes, ebpo_error *error)
{
    uint64_t capacity = 0, corners = 3 * mesh->face_count;
    for (uint64_t i = 0; i < corners; i++)
        capacity += mesh->faces[i] < begin;
    *bytes = ebpo_compact_bytes(capacity);
    ebpo_status status = ebpo_room_check(room, *bytes, error);
    if (status == EBPO_OK)
        status = ebpo_compact_make(older, capacity, error);
    for (uint64_t i = 0; i < corners && status == EBPO_OK; i++)
        if (mesh->faces[i] < begin)
            ebpo_compact_add(older, mesh->faces[i]);
    return status == EBPO_OK ? ebpo_compact_sort(older, error) : status;
}

/* Older vertices first, then the new ones: the order of the file. */
static void renumber_vertices(ebpo_mesh *mesh, uint64_t begin, const ebpo_compact *older)
{
    uint32_t less = (uint32_t)(begin - older->count);
    for (uint64_t i = 0; i < 3 * mesh->face_count; i++)
        mesh->faces[i] = mesh->faces[i] < begin ? ebpo_compact_find(older, mesh->faces[i])
                                                : mesh->faces[i] - less;
}

static ebpo_status take_vertices(ebpo_slice *slice, ebpo_chunks *chunks, ebpo_room *room,
                                 ebpo_error *error)
{
    ebpo_mesh *mesh = &slice->mesh;
    ebpo_compact older = { .slot = NULL };
    uint64_t begin, end, table = 0;
    bool wide = chunks->file->info.double_coordinates;
    size_t row_bytes = 3 * (wide ? sizeof(double) : sizeof(float));
    ebpo_status status = new_vertices(slice, chunks, &begin, &end, error);
    if (status == EBPO_OK)
        status = collect_older(mesh, begin, room, &older, &table, error);
    if (status == EBPO_OK) {
        mesh->vertex_count = older.count + (end - begin);
        status = ebpo_room_check(room, table + mesh->vertex_count * row_bytes, error);
    }
    if (status == EBPO_OK)
        status = ebpo_room_take(room, mesh->vertex_count * row_bytes, error);
    if (status == EBPO_OK) {
        renumber_vertices(mesh, begin, &older);
        void *xyz = ebpo_alloc(mesh->vertex_count, row_bytes);
        mesh->xyz32 = wide ? NULL : xyz;
        mesh->xyz64 = wide ? xyz : NULL;
        status = xyz ? gather_rows(chunks, EBPO_A_VERTICES, row_bytes, older.sorted, older.count, begin,
                              end - begin, xyz, error)
                     : ebpo_fail_memory(error, mesh->vertex_count * row_bytes);
    }
    ebpo_compact_free(&older);
    return status;
}

static ebpo_status take_source(ebpo_slice *slice, ebpo_chunks *chunks, ebpo_error *error)
{
    if (!(chunks->file->info.parts & EBPO_PART_MAPS))
        return EBPO_OK;
    slice->face_source = ebpo_alloc(slice->mesh.face_count, sizeof *slice->face_source);
    if (!slice->face_source)
        return ebpo_fail_memory(error, slice->mesh.face_count * sizeof *slice->face_source);
    return gather_rows(chunks, EBPO_A_FACE_SOURCE, sizeof *slice->face_source, slice->outer,
                  slice->outer_count, slice->first_face, slice->face_count, slice->face_source,
                  error);
}

ebpo_status ebpo_slice_take_faces(ebpo_slice *slice, ebpo_chunks *chunks, bool maps,
                                  ebpo_room *room, ebpo_error *error)
{
    enum { ROW = 3 * sizeof(uint32_t), NUMBER = sizeof(uint32_t) };
    ebpo_status status = number_faces(slice, room, error);
    slice->mesh.face_count = slice->outer_count + slice->face_count;
    if (status == EBPO_OK)
        status = ebpo_room_take(room,
                                slice->outer_count * (uint64_t)NUMBER +
                                    slice->mesh.face_count * (maps ? ROW + NUMBER : ROW),
                                error);
    if (status != EBPO_OK)
        return status;
    slice->mesh.faces = ebpo_alloc(slice->mesh.face_count, ROW);
    if (!slice->mesh.faces)
        return ebpo_fail_memory(error, slice->mesh.face_count * ROW);
    status = gather_rows(chunks, EBPO_A_FACES, ROW, slice->outer, slice->outer_count, slice->first_face,
                    slice->face_count, slice->mesh.faces, error);
    if (status == EBPO_OK)
        status = take_vertices(slice, chunks, room, error);
    return status == EBPO_OK && maps ? take_source(slice, chunks, error) : status;
}
