/* Reads slices: a complete subtree or the whole tree. A subtree is a node with all nodes below it,
 * and a contiguous range of nodes in every level. Gray nodes have children, and leaves list faces.
 * A slice contains these ranges, the faces that its leaves list, and the vertices of these faces.
 * Faces have local indices: first the shared faces, then the owned faces, both in ascending order
 * of their file indices. A leaf before the subtree also lists the shared faces. No leaf before the
 * subtree lists the owned faces. A hash table (ebpo_compact) maps scattered indices to dense
 * indices. A caller may limit the memory (ebpo_quota); the bytes of each array are reserved before
 * it is allocated. Source: format-spec/README.md, sections 6 and 7. */
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/hash.h"
#include "format/chunks.h"
#include "format/file_nodes.h"
#include "format/pick_rows.h"
#include "format/reader.h"
#include "format/slice.h"
#include "format/subtree_faces.h"
#include "format/subtree_index.h"
#include "geometry/level_nodes.h"

static const uint32_t FREE = UINT32_MAX; /* number of a free slot */

uint64_t ebpo_compact_bytes(uint64_t capacity)
{
    const ebpo_compact *c = NULL;
    return ebpo_hash_slots(2 * capacity) * sizeof *c->slot + capacity * 2 * sizeof *c->sorted;
}

static void compact_free(ebpo_compact *compact)
{
    free(compact->slot);
    free(compact->sorted);
    *compact = (ebpo_compact){ .slot = NULL };
}

ebpo_status ebpo_compact_make(ebpo_compact *out, uint64_t capacity, ebpo_error *error)
{
    *out = (ebpo_compact){ .mask = 0 };
    if (capacity > UINT64_C(1) << 31)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "one subtree has %llu references, more than 2^31; choose a deeper level",
                         (unsigned long long)capacity);
    uint64_t slots = ebpo_hash_slots(2 * capacity);
    out->mask = slots - 1;
    out->slot = ebpo_alloc(slots, sizeof *out->slot);
    out->sorted = ebpo_alloc(capacity, sizeof *out->sorted);
    if (!out->slot || !out->sorted) {
        compact_free(out);
        return ebpo_fail_memory(error, slots * sizeof *out->slot + capacity * sizeof *out->sorted);
    }
    memset(out->slot, 0xff, slots * sizeof *out->slot);
    return EBPO_OK;
}

/* Returns the slot that contains a number, or the free slot for it. */
static uint64_t slot_of(const ebpo_compact *c, uint32_t number)
{
    uint64_t at;
    EBPO_HASH_FIND(at, ebpo_hash_number(number), c->mask,
                   c->slot[at].number == number || c->slot[at].number == FREE);
    return at;
}

static void compact_add(ebpo_compact *compact, uint32_t number)
{
    uint64_t at = slot_of(compact, number);
    if (compact->slot[at].number == number)
        return;
    compact->slot[at].number = number;
    compact->sorted[compact->count++] = number;
}

/* Sorts with a radix sort, from the lowest byte to the highest. Skips a byte position if all
 * numbers have the same byte there. `temporary`: memory for `count` numbers. */
static void sort_numbers(uint32_t *numbers, uint32_t *temporary, uint64_t count)
{
    uint64_t begin[4][256] = { { 0 } };
    uint32_t *from = numbers, *to = temporary;
    for (uint64_t i = 0; i < count; i++)
        for (int byte = 0; byte < 4; byte++)
            begin[byte][numbers[i] >> 8 * byte & 255]++;
    for (int byte = 0; byte < 4; byte++) {
        if (begin[byte][from[0] >> 8 * byte & 255] == count)
            continue;
        uint64_t sum = 0;
        for (int k = 0; k < 256; k++) {
            uint64_t in_bin = begin[byte][k];
            begin[byte][k] = sum;
            sum += in_bin;
        }
        for (uint64_t i = 0; i < count; i++)
            to[begin[byte][from[i] >> 8 * byte & 255]++] = from[i];
        uint32_t *swap = from;
        from = to;
        to = swap;
    }
    if (from != numbers)
        memcpy(numbers, from, count * sizeof *numbers);
}

/* Sorts the numbers. Called after the last compact_add. */
static ebpo_status compact_sort(ebpo_compact *compact, ebpo_error *error)
{
    if (compact->count == 0)
        return EBPO_OK;
    uint32_t *temporary = ebpo_alloc(compact->count, sizeof *temporary);
    if (!temporary)
        return ebpo_fail_memory(error, compact->count * sizeof *temporary);
    sort_numbers(compact->sorted, temporary, compact->count);
    free(temporary);
    for (uint64_t i = 0; i < compact->count; i++)
        compact->slot[slot_of(compact, compact->sorted[i])].position = (uint32_t)i;
    return EBPO_OK;
}

/* Returns the position, in sorted order, of a number that was added. */
static uint32_t compact_find(const ebpo_compact *compact, uint32_t number)
{
    return compact->slot[slot_of(compact, number)].position;
}

/* --- faces --- */

/* Sends prefetch hints for the `singles` rows in `single`, which ascend, and for the rows
 * [first, first + rows). */
static void hint_rows(ebpo_chunks *chunks, ebpo_array_id id, const uint32_t *single,
                      uint64_t singles, uint64_t first, uint64_t rows)
{
    ebpo_hints e = EBPO_HINTS_INIT(chunks->file);
    /* rows before `next` are already collected */
    uint64_t chunk_rows = ebpo_reader_array(chunks->file, id, 0)->shape.chunk_rows, next = 0;
    if (!ebpo_input_prefetches(&chunks->file->in))
        return;
    for (uint64_t i = 0; i < singles; i++)
        if (single[i] >= next) {
            ebpo_chunks_hint(chunks, &e, id, 0, single[i], 1);
            next = (single[i] / chunk_rows + 1) * chunk_rows;
        }
    if (rows && first + rows > next)
        ebpo_chunks_hint(chunks, &e, id, 0, first > next ? first : next,
                         first + rows - (first > next ? first : next));
    ebpo_hint_all(&e);
}

/* Reads decoded rows of an array: first the `singles` rows in `single`, which ascend, then the rows
 * [first, first + rows). */
static ebpo_status gather_rows(ebpo_chunks *chunks, ebpo_array_id id, size_t row_bytes,
                               const uint32_t *single, uint64_t singles, uint64_t first,
                               uint64_t rows, void *out, ebpo_error *error)
{
    ebpo_held_chunk view = { .array = ebpo_reader_array(chunks->file, id, 0) };
    ebpo_status status = EBPO_OK;
    uint8_t *to = out;
    hint_rows(chunks, id, single, singles, first, rows);
    for (uint64_t i = 0;
         i < singles && (status = ebpo_held_chunk_move(chunks, &view, single[i], error)) == EBPO_OK;
         i++, to += row_bytes)
        memcpy(to, view.rows + (single[i] - view.begin) * row_bytes, row_bytes);
    while (rows && status == EBPO_OK &&
           (status = ebpo_held_chunk_move(chunks, &view, first, error)) == EBPO_OK) {
        uint64_t step = view.end - first < rows ? view.end - first : rows;
        memcpy(to, view.rows + (first - view.begin) * row_bytes, step * row_bytes);
        to += step * row_bytes;
        first += step;
        rows -= step;
    }
    ebpo_held_chunk_release(chunks, &view);
    return status;
}

/* --- local indices of faces --- */

/* Collects the shared faces: references to faces before the first owned face. */
static ebpo_status collect_shared(ebpo_slice *slice, ebpo_compact *shared, ebpo_quota *space,
                                  ebpo_error *error)
{
    uint64_t capacity = 0;
    for (int i = 0; i < slice->level_count; i++)
        for (uint64_t k = 0; k < slice->level[i].ref_count; k++)
            capacity += slice->level[i].leaf_refs[k] < slice->first_face;
    ebpo_status status = ebpo_quota_check(space, ebpo_compact_bytes(capacity), error);
    if (status == EBPO_OK)
        status = ebpo_compact_make(shared, capacity, error);
    if (status != EBPO_OK)
        return status;
    for (int i = 0; i < slice->level_count; i++)
        for (uint64_t k = 0; k < slice->level[i].ref_count; k++)
            if (slice->level[i].leaf_refs[k] < slice->first_face)
                compact_add(shared, slice->level[i].leaf_refs[k]);
    return compact_sort(shared, error);
}

/* Replaces file indices of faces by local indices. */
static void localise_faces(ebpo_slice *slice, const ebpo_compact *shared)
{
    /* an owned face's index decreases by the number of faces before first_face that the slice lacks
     */
    uint64_t decrease = slice->first_face - shared->count;
    for (int i = 0; i < slice->level_count; i++) {
        ebpo_level *level = &slice->level[i];
        for (uint64_t k = 0; k < level->leaf_count; k++)
            level->leaf_first[k] -= decrease;
        for (uint64_t k = 0; k < level->ref_count; k++) {
            uint32_t ref = level->leaf_refs[k];
            level->leaf_refs[k] =
                ref < slice->first_face ? compact_find(shared, ref) : (uint32_t)(ref - decrease);
        }
    }
}

/* Assigns local indices to the faces, and moves the list of shared faces to the slice. */
static ebpo_status number_faces(ebpo_slice *slice, ebpo_quota *space, ebpo_error *error)
{
    ebpo_compact shared = { .slot = NULL };
    ebpo_status status = collect_shared(slice, &shared, space, error);
    if (status == EBPO_OK)
        localise_faces(slice, &shared);
    if (status == EBPO_OK && shared.count) {
        uint32_t *shrunk = ebpo_realloc(shared.sorted, shared.count, sizeof *shrunk);
        slice->shared = shrunk ? shrunk : shared.sorted;
        slice->shared_count = (uint32_t)shared.count;
        shared.sorted = NULL;
    }
    compact_free(&shared);
    return status;
}

/* --- vertices --- */

/* Finds the vertices that the slice's owned faces use first. Vertices are numbered by first use, so
 * these vertices are a range [*begin, *end), and all other vertices of the slice precede it. */
static ebpo_status new_vertices(ebpo_slice *slice, ebpo_chunks *chunks, uint64_t *begin,
                                uint64_t *end, ebpo_error *error)
{
    ebpo_held_chunk view = { .array = ebpo_reader_array(chunks->file, EBPO_A_FACES, 0) };
    *begin = *end = UINT32_MAX; /* without owned faces, all vertices precede the range */
    if (slice->face_count == 0)
        return EBPO_OK;
    ebpo_status status = ebpo_held_chunk_move(chunks, &view, slice->first_face, error);
    if (status != EBPO_OK)
        return status;
    const uint32_t *corners = (const uint32_t *)(const void *)view.rows,
                   *owned_corners = slice->mesh.faces + 3 * (uint64_t)slice->shared_count;
    /* number of vertices that the chunks before this chunk of faces use */
    uint64_t used = chunks->vertices_before
                        ? chunks->vertices_before[view.begin / view.array->shape.chunk_rows]
                        : 0;
    /* one past the largest vertex: of the faces in this chunk before the owned faces; of the owned
     * faces. Vertex indices are below 2^32 - 2, so adding 1 does not overflow */
    uint32_t end_before = 0, end_owned = 0;
    for (uint64_t i = 0; i < 3 * (slice->first_face - view.begin); i++)
        end_before = corners[i] + 1 > end_before ? corners[i] + 1 : end_before;
    for (uint64_t i = 0; i < 3 * slice->face_count; i++)
        end_owned = owned_corners[i] + 1 > end_owned ? owned_corners[i] + 1 : end_owned;
    ebpo_held_chunk_release(chunks, &view);
    *begin = end_before > used ? end_before : used;
    *end = end_owned > *begin ? end_owned : *begin;
    return EBPO_OK;
}

/* Collects the slice's vertices before `begin`, which faces before the owned faces use first.
 * *bytes: size of the table `older`. */
static ebpo_status collect_older(const ebpo_mesh *mesh, uint64_t begin, ebpo_quota *space,
                                 ebpo_compact *older, uint64_t *bytes, ebpo_error *error)
{
    uint64_t capacity = 0, corners = 3 * mesh->face_count;
    for (uint64_t i = 0; i < corners; i++)
        capacity += mesh->faces[i] < begin;
    *bytes = ebpo_compact_bytes(capacity);
    ebpo_status status = ebpo_quota_check(space, *bytes, error);
    if (status == EBPO_OK)
        status = ebpo_compact_make(older, capacity, error);
    for (uint64_t i = 0; i < corners && status == EBPO_OK; i++)
        if (mesh->faces[i] < begin)
            compact_add(older, mesh->faces[i]);
    return status == EBPO_OK ? compact_sort(older, error) : status;
}

/* Assigns local indices to the vertices, in file order: first the older vertices, then the vertices
 * that owned faces use first. */
static void renumber_vertices(ebpo_mesh *mesh, uint64_t begin, const ebpo_compact *older)
{
    uint32_t decrease = (uint32_t)(begin - older->count);
    for (uint64_t i = 0; i < 3 * mesh->face_count; i++)
        mesh->faces[i] = mesh->faces[i] < begin ? compact_find(older, mesh->faces[i])
                                                : mesh->faces[i] - decrease;
}

static ebpo_status read_vertices(ebpo_slice *slice, ebpo_chunks *chunks, ebpo_quota *space,
                                 ebpo_error *error)
{
    ebpo_mesh *mesh = &slice->mesh;
    ebpo_compact older = { .slot = NULL };
    uint64_t begin, end, table_bytes = 0;
    bool wide = chunks->file->info.double_coordinates;
    size_t row_bytes = 3 * (wide ? sizeof(double) : sizeof(float));
    ebpo_status status = new_vertices(slice, chunks, &begin, &end, error);
    if (status == EBPO_OK)
        status = collect_older(mesh, begin, space, &older, &table_bytes, error);
    if (status == EBPO_OK) {
        mesh->vertex_count = older.count + (end - begin);
        status = ebpo_quota_check(space, table_bytes + mesh->vertex_count * row_bytes, error);
    }
    if (status == EBPO_OK)
        status = ebpo_quota_take(space, mesh->vertex_count * row_bytes, error);
    if (status == EBPO_OK) {
        renumber_vertices(mesh, begin, &older);
        void *xyz = ebpo_alloc(mesh->vertex_count, row_bytes);
        mesh->xyz32 = wide ? NULL : xyz;
        mesh->xyz64 = wide ? xyz : NULL;
        status = xyz ? gather_rows(chunks, EBPO_A_VERTICES, row_bytes, older.sorted, older.count,
                                   begin, end - begin, xyz, error)
                     : ebpo_fail_memory(error, mesh->vertex_count * row_bytes);
    }
    compact_free(&older);
    return status;
}

static ebpo_status read_source_indices(ebpo_slice *slice, ebpo_chunks *chunks, ebpo_error *error)
{
    if (!(chunks->file->info.parts & EBPO_PART_MAPS))
        return EBPO_OK;
    slice->face_source = ebpo_alloc(slice->mesh.face_count, sizeof *slice->face_source);
    if (!slice->face_source)
        return ebpo_fail_memory(error, slice->mesh.face_count * sizeof *slice->face_source);
    return gather_rows(chunks, EBPO_A_FACE_SOURCE, sizeof *slice->face_source, slice->shared,
                       slice->shared_count, slice->first_face, slice->face_count,
                       slice->face_source, error);
}

/* Completes a slice whose levels (with file indices), first_face and face_count are set. Reads
 * faces and vertices, and converts the levels to local indices. If `maps` is true, also reads
 * source indices (positions in the source mesh). `space`: see ebpo_slice_read_within. */
static ebpo_status slice_take_faces(ebpo_slice *slice, ebpo_chunks *chunks, bool maps,
                                    ebpo_quota *space, ebpo_error *error)
{
    enum { ROW = 3 * sizeof(uint32_t), NUMBER = sizeof(uint32_t) };
    ebpo_status status = number_faces(slice, space, error);
    slice->mesh.face_count = slice->shared_count + slice->face_count;
    if (status == EBPO_OK)
        status = ebpo_quota_take(space,
                                 slice->shared_count * (uint64_t)NUMBER +
                                     slice->mesh.face_count * (maps ? ROW + NUMBER : ROW),
                                 error);
    if (status != EBPO_OK)
        return status;
    slice->mesh.faces = ebpo_alloc(slice->mesh.face_count, ROW);
    if (!slice->mesh.faces)
        return ebpo_fail_memory(error, slice->mesh.face_count * ROW);
    if (maps && chunks->file->info.parts & EBPO_PART_MAPS)
        /* requested together with the faces, before the vertices are known */
        hint_rows(chunks, EBPO_A_FACE_SOURCE, slice->shared, slice->shared_count, slice->first_face,
                  slice->face_count);
    status = gather_rows(chunks, EBPO_A_FACES, ROW, slice->shared, slice->shared_count,
                         slice->first_face, slice->face_count, slice->mesh.faces, error);
    if (status == EBPO_OK)
        status = read_vertices(slice, chunks, space, error);
    return status == EBPO_OK && maps ? read_source_indices(slice, chunks, error) : status;
}

/* --- subtrees --- */

void ebpo_slice_free(ebpo_slice *slice)
{
    if (!slice)
        return;
    for (int i = 0; i < EBPO_LEVELS_MAX; i++)
        ebpo_level_free(&slice->level[i]);
    free(slice->shared);
    ebpo_mesh_free(&slice->mesh);
    ebpo_array_free(NULL, slice->face_source);
    memset(slice, 0, sizeof *slice);
}

/* A subtree's nodes in one level of the file. */
typedef struct range {
    int level;
    ebpo_run run;
} range;

/* Sets *out to the range that consists of the root only. */
static ebpo_status root_range(const ebpo_chunks *chunks, const ebpo_node *root, range *out,
                              ebpo_error *error)
{
    if (root->type != EBPO_GRAY && root->type != EBPO_LEAF)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, chunks->file->in.shown,
                              "a white or black node has no subtree");
    *out = (range){ .level = root->cell.level };
    out->run.rank[root->type] = root->rank;
    out->run.count[root->type] = 1;
    return ebpo_chunks_check_node(chunks, root, error);
}

/* Selected levels of a subtree, and the data to read. */
typedef struct extent {
    uint32_t needs;    /* EBPO_NEEDS_... (schema.h): arrays to read */
    int end;           /* one past the deepest selected level, as a level of the file */
    bool faces;        /* the faces that the leaves list will also be read */
    ebpo_quota *space; /* NULL: no limit */
} extent;

/* Selects `levels` levels below the root, or all. */
static extent extent_of(const ebpo_chunks *chunks, const ebpo_node *root, uint32_t needs,
                        int levels)
{
    int count = chunks->file->info.level_count, below = count - 1 - root->cell.level;
    return (extent){ needs & ebpo_schema_has(&chunks->file->info),
                     levels >= 0 && levels < below ? root->cell.level + levels + 1 : count, false,
                     NULL };
}

/* Returns true if the next level of the extent has nodes below this range. */
static bool has_next_level(const extent *e, const range *r)
{
    return r->run.count[EBPO_GRAY] && r->level + 1 < e->end;
}

/* Replaces the range by the range of its nodes' children. `types`: receives the types of the groups
 * of this new range; may be NULL. */
static ebpo_status next_range(ebpo_chunks *chunks, range *r, uint16_t **types, ebpo_error *error)
{
    uint64_t group = r->run.rank[EBPO_GRAY], groups = r->run.count[EBPO_GRAY];
    r->level++;
    ebpo_status status = ebpo_ranks_before(chunks, r->level, group, r->run.rank, error);
    if (status == EBPO_OK && types)
        status = ebpo_chunks_take(chunks, EBPO_A_TYPES, r->level, group, groups, sizeof **types,
                                  types, error);
    if (status == EBPO_OK && types)
        ebpo_groups_count(*types, groups, r->run.count);
    else if (status == EBPO_OK)
        status = ebpo_ranks_count_file(chunks, r->level, group, groups, r->run.count, error);
    return status == EBPO_OK ? ebpo_ranks_check(chunks, r->level, r->run.rank, r->run.count, error)
                             : status;
}

/* Sends prefetch hints for the nodes of a level, and for the types of the next level. For remote
 * files only. */
static void hint_nodes(ebpo_chunks *chunks, const extent *x, const range *r)
{
    ebpo_hints e = EBPO_HINTS_INIT(chunks->file);
    /* ranks are counted from the group of the preceding index row on */
    uint64_t gray = r->run.rank[EBPO_GRAY], index = gray / EBPO_INDEX_ROWS,
             counted = index * EBPO_INDEX_ROWS;
    ebpo_runs_hint(chunks, &e, r->level, &r->run, 1, x->needs);
    if (has_next_level(x, r) && ebpo_subtree_table_has(chunks->file, r->level + 1)) {
        ebpo_chunks_hint(chunks, &e, EBPO_A_TYPES, r->level + 1, gray, r->run.count[EBPO_GRAY]);
    } else if (has_next_level(x, r)) {
        ebpo_chunks_hint(chunks, &e, EBPO_A_TYPES_INDEX, r->level + 1, index, 1);
        ebpo_chunks_hint(chunks, &e, EBPO_A_TYPES, r->level + 1, counted,
                         gray + r->run.count[EBPO_GRAY] - counted);
    }
    ebpo_hint_all(&e);
}

/* Sends prefetch hints for all levels below the subtrees' roots. Does nothing if the range is in
 * another level than these roots, because the table only locates the chunks of whole subtrees. */
static void hint_subtrees(ebpo_chunks *chunks, const extent *x, const range *r)
{
    uint64_t first = r->run.rank[EBPO_GRAY], count = r->run.count[EBPO_GRAY];
    ebpo_hints e = EBPO_HINTS_INIT(chunks->file);
    e.local = true;
    if (!ebpo_subtree_table_has(chunks->file, r->level + 1) || !has_next_level(x, r) ||
        r->level != chunks->file->info.subtree_level || !ebpo_hints_wanted(&e))
        return;
    ebpo_subtree_table_hint_run(chunks, first, count);
    ebpo_subtrees_hint(chunks, &e, first, count, x->needs, x->end - 1, x->faces);
    ebpo_hint_all(&e);
}

/* Reads all arrays of one level except its types. */
static ebpo_status read_nodes(ebpo_chunks *chunks, const extent *x, const range *r, ebpo_level *out,
                              ebpo_error *error)
{
    hint_subtrees(chunks, x, r);
    hint_nodes(chunks, x, r);
    return ebpo_runs_read(chunks, r->level, &r->run, 1, x->needs, x->space, out, error);
}

/* Reads the levels of the extent, from the root down. */
static ebpo_status read_levels(ebpo_slice *slice, ebpo_chunks *chunks, const extent *x,
                               ebpo_error *error)
{
    const ebpo_node *root = &slice->root;
    range r;
    ebpo_status status = root_range(chunks, root, &r, error);
    if (status != EBPO_OK)
        return status;
    slice->level[0].group_count = 1;
    slice->level[0].types = ebpo_alloc(1, sizeof(uint16_t));
    if (!slice->level[0].types)
        return ebpo_fail_memory(error, sizeof(uint16_t));
    slice->level[0].types[0] = (uint16_t)root->type;
    status = read_nodes(chunks, x, &r, &slice->level[0], error);
    for (slice->level_count = 1; status == EBPO_OK && has_next_level(x, &r); slice->level_count++) {
        ebpo_level *out = &slice->level[slice->level_count];
        out->group_count = r.run.count[EBPO_GRAY];
        status = ebpo_quota_take(x->space, out->group_count * sizeof *out->types, error);
        if (status == EBPO_OK)
            status = next_range(chunks, &r, &out->types, error);
        if (status == EBPO_OK)
            status = read_nodes(chunks, x, &r, out, error);
    }
    return status;
}

/* State of a visit of all leaves of a slice in depth-first order. */
typedef struct walk {
    ebpo_chunks *chunks;
    ebpo_slice *slice;
    uint64_t group[EBPO_LEVELS_MAX], leaf[EBPO_LEVELS_MAX]; /* next item of each level */
    bool begun;                                             /* true after the first leaf */
} walk;

/* Visits a group and the groups below it. Checks that the new faces of the leaves, in depth-first
 * order, are one range without gaps. These faces are the owned faces of the slice; sets first_face
 * and face_count to this range. */
static ebpo_status walk_group(walk *w, int level, ebpo_error *error)
{
    const ebpo_level *arrays = &w->slice->level[level];
    uint16_t types = arrays->types[w->group[level]++];
    for (unsigned octant = 0; octant < ebpo_group_octants(level); octant++) {
        ebpo_node_type type = ebpo_group_type(types, octant);
        if (type == EBPO_GRAY && level + 1 < w->slice->level_count) {
            ebpo_status status = walk_group(w, level + 1, error);
            if (status != EBPO_OK)
                return status;
        } else if (type == EBPO_LEAF) {
            uint64_t i = w->leaf[level]++;
            if (!w->begun)
                w->slice->first_face = arrays->leaf_first[i];
            w->begun = true;
            if (arrays->leaf_first[i] != w->slice->first_face + w->slice->face_count)
                return ebpo_chunks_fail(w->chunks, w->slice->root.cell.level + level,
                                        EBPO_A_LEAF_SKIP,
                                        "the leaves' new faces are not in depth-first order",
                                        error);
            w->slice->face_count += arrays->leaf_new[i];
        }
    }
    return EBPO_OK;
}

/* Returns true if the root is the root of a subtree of the file's table, and all its levels are
 * read. */
static bool is_subtree(const ebpo_chunks *chunks, const extent *x, const ebpo_node *root)
{
    const ebpo_info *info = &chunks->file->info;
    /* the table states only the faces of whole subtrees */
    return info->subtree_level && root->cell.level == info->subtree_level &&
           root->type == EBPO_GRAY && x->end == info->level_count;
}

/* Checks that the owned faces are the faces that the table states for the subtree. */
static ebpo_status check_owned_faces(const ebpo_slice *slice, ebpo_chunks *chunks, const extent *x,
                                     ebpo_error *error)
{
    ebpo_subtree_row row;
    if (!is_subtree(chunks, x, &slice->root))
        return EBPO_OK;
    ebpo_status status = ebpo_subtree_table_row(chunks, slice->root.rank, &row, error);
    if (status != EBPO_OK)
        return status;
    uint64_t stated = row.after[EBPO_S_FACES] - row.before[EBPO_S_FACES];
    return stated == slice->face_count && (stated == 0 || row.face == slice->first_face)
               ? EBPO_OK
               : ebpo_chunks_fail(chunks, -1, EBPO_A_SUBTREE_COUNTS,
                                  "a row contradicts the faces of its subtree", error);
}

static ebpo_status read_extent(ebpo_slice *out, ebpo_chunks *chunks, const ebpo_node *root,
                               const extent *x, ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    out->root = *root;
    out->pruned = chunks->file->info.pruned;
    ebpo_status status = read_levels(out, chunks, x, error);
    if (status == EBPO_OK && x->needs & EBPO_NEEDS_MESH &&
        ebpo_subtree_table_has(chunks->file, root->cell.level))
        status = ebpo_subtree_faces_check(chunks, root, error);
    if (status != EBPO_OK)
        ebpo_slice_free(out);
    return status;
}

ebpo_status ebpo_slice_read_nodes(ebpo_slice *out, ebpo_chunks *chunks, const ebpo_node *root,
                                  uint32_t needs, int levels, ebpo_error *error)
{
    extent x = extent_of(chunks, root, needs, levels);
    return read_extent(out, chunks, root, &x, error);
}

ebpo_status ebpo_slice_read_parts(ebpo_slice *out, ebpo_chunks *chunks, const ebpo_node *root,
                                  uint32_t needs, ebpo_error *error)
{
    return ebpo_slice_read_within(out, chunks, root, needs, NULL, error);
}

ebpo_status ebpo_slice_read_within(ebpo_slice *out, ebpo_chunks *chunks, const ebpo_node *root,
                                   uint32_t needs, ebpo_quota *space, ebpo_error *error)
{
    enum { ALWAYS = EBPO_NEEDS_ALWAYS | EBPO_NEEDS_MESH };
    extent x = extent_of(chunks, root, needs | ALWAYS, EBPO_SLICE_ALL);
    memset(out, 0, sizeof *out);
    if (!(chunks->file->info.parts & EBPO_PART_MESH))
        return ebpo_fail_file(
            error, EBPO_E_ABSENT, chunks->file->in.shown,
            "the file was written without its mesh; build it again with the mesh");
    walk w = { .chunks = chunks, .slice = out };
    x.faces = true;
    x.space = space;
    ebpo_status status = read_extent(out, chunks, root, &x, error);
    if (status == EBPO_OK)
        status = walk_group(&w, 0, error);
    if (status == EBPO_OK)
        status = check_owned_faces(out, chunks, &x, error);
    if (status == EBPO_OK)
        status = slice_take_faces(out, chunks, needs & EBPO_NEEDS_MAPS, space, error);
    if (status != EBPO_OK)
        ebpo_slice_free(out);
    return status;
}

ebpo_status ebpo_slice_read(ebpo_slice *out, ebpo_chunks *chunks, const ebpo_node *root,
                            ebpo_error *error)
{
    return ebpo_slice_read_parts(out, chunks, root, ~(uint32_t)EBPO_NEEDS_LEAF_PLANES, error);
}

/* Adds to *out the numbers of references and new faces of the leaves of a range. */
static ebpo_status measure_faces(ebpo_chunks *chunks, const range *r, ebpo_slice_size *out,
                                 ebpo_error *error)
{
    uint64_t refs = 0, new_faces = 0, first = r->run.rank[EBPO_LEAF],
             count = r->run.count[EBPO_LEAF];
    const ebpo_level_summary *s = &chunks->file->info.level[r->level];
    ebpo_status status =
        ebpo_chunks_sum(chunks, EBPO_A_LEAF_REF_COUNT, r->level, first, count, &refs, error);
    if (status == EBPO_OK)
        status =
            ebpo_chunks_sum(chunks, EBPO_A_LEAF_NEW, r->level, first, count, &new_faces, error);
    if (status == EBPO_OK && (refs > s->ref_count || new_faces > s->new_count))
        status = ebpo_chunks_fail(chunks, r->level, EBPO_A_LEAF_NEW,
                                  "the leaves' counts do not add up to those in the header", error);
    out->refs += refs;
    out->new_faces += new_faces;
    return status;
}

/* Adds to *out the number of planes of the nodes of one type in a range. */
static ebpo_status measure_planes(ebpo_chunks *chunks, const range *r, ebpo_node_type type,
                                  ebpo_slice_size *out, ebpo_error *error)
{
    ebpo_array_id id = type == EBPO_LEAF ? EBPO_A_LEAF_PLANE_COUNTS : EBPO_A_PLANE_COUNTS;
    uint64_t sum = 0, count = r->run.count[type];
    ebpo_status status =
        count ? ebpo_chunks_sum(chunks, id, r->level, r->run.rank[type], count, &sum, error)
              : EBPO_OK;
    out->planes += sum;
    return status;
}

/* Adds to *out the numbers of leaves, faces and planes of the nodes of a range. */
static ebpo_status measure_nodes(ebpo_chunks *chunks, const extent *x, const range *r,
                                 ebpo_slice_size *out, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    out->leaves += r->run.count[EBPO_LEAF];
    if (x->needs & EBPO_NEEDS_MESH && r->run.count[EBPO_LEAF])
        status = measure_faces(chunks, r, out, error);
    if (status == EBPO_OK && x->needs & EBPO_NEEDS_PLANES)
        status = measure_planes(chunks, r, EBPO_GRAY, out, error);
    if (status == EBPO_OK && x->needs & EBPO_NEEDS_LEAF_PLANES)
        status = measure_planes(chunks, r, EBPO_LEAF, out, error);
    return status;
}

/* Adds to *out the sizes of a subtree, except its root, from the table of subtrees. */
static ebpo_status measure_subtree(ebpo_chunks *chunks, const extent *x, uint64_t subtree,
                                   ebpo_slice_size *out, ebpo_error *error)
{
    const ebpo_info *info = &chunks->file->info;
    ebpo_subtree_row row;
    /* the later read needs the same rows of the table */
    ebpo_subtree_table_hint_run(chunks, subtree, 1);
    ebpo_status status = ebpo_subtree_table_row(chunks, subtree, &row, error);
    for (int level = info->subtree_level + 1; level < x->end && status == EBPO_OK; level++) {
        uint64_t counts[EBPO_SUBTREE_LEVEL_COLS];
        for (unsigned k = 0; k < EBPO_SUBTREE_LEVEL_COLS; k++)
            counts[k] = row.after[ebpo_subtree_column(info, level, k)] -
                        row.before[ebpo_subtree_column(info, level, k)];
        out->groups += ebpo_subtree_groups(info, &row, level, true) -
                       ebpo_subtree_groups(info, &row, level, false);
        out->leaves += counts[EBPO_S_LEAF];
        out->refs += x->needs & EBPO_NEEDS_MESH ? counts[EBPO_S_REFS] : 0;
        out->planes += (x->needs & EBPO_NEEDS_PLANES ? counts[EBPO_S_PLANES] : 0) +
                       (x->needs & EBPO_NEEDS_LEAF_PLANES ? counts[EBPO_S_LEAF_PLANES] : 0);
    }
    if (status == EBPO_OK && x->needs & EBPO_NEEDS_MESH)
        out->new_faces += row.after[EBPO_S_FACES] - row.before[EBPO_S_FACES];
    return status;
}

ebpo_status ebpo_slice_measure_nodes(ebpo_chunks *chunks, const ebpo_node *root, uint32_t needs,
                                     int levels, ebpo_slice_size *out, ebpo_error *error)
{
    range r;
    extent x = extent_of(chunks, root, needs, levels);
    *out = (ebpo_slice_size){ .groups = 1 };
    ebpo_status status = root_range(chunks, root, &r, error);
    if (status == EBPO_OK)
        status = measure_nodes(chunks, &x, &r, out, error);
    if (status == EBPO_OK && is_subtree(chunks, &x, root)) {
        status = measure_subtree(chunks, &x, root->rank, out, error);
        out->shared = out->refs;
        return status;
    }
    while (status == EBPO_OK && has_next_level(&x, &r)) {
        out->groups += r.run.count[EBPO_GRAY];
        status = next_range(chunks, &r, NULL, error);
        if (status == EBPO_OK)
            status = measure_nodes(chunks, &x, &r, out, error);
    }
    out->shared = root->cell.level == 0 ? 0 : out->refs; /* the whole tree owns all faces */
    return status;
}

ebpo_status ebpo_slice_measure(ebpo_chunks *chunks, const ebpo_node *root, ebpo_slice_size *out,
                               ebpo_error *error)
{
    return ebpo_slice_measure_nodes(chunks, root, EBPO_NEEDS_MESH, EBPO_SLICE_ALL, out, error);
}

/* --- the whole tree --- */

/* Removes data that ebpo_slice_read does not read: planes of leaves, and volumes. */
static void drop_arrays(ebpo_level *level)
{
    ebpo_level_drop(level, EBPO_NEEDS_LEAF_PLANES);
    level->leaf_plane_count = 0;
    level->gray_volume = level->leaf_volume = 0;
}

ebpo_status ebpo_slice_read_all(ebpo_slice *out, const ebpo_file *file, unsigned threads,
                                ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    if (!(file->info.parts & EBPO_PART_MESH))
        return ebpo_fail_file(
            error, EBPO_E_ABSENT, file->in.shown,
            "the file was written without its mesh; build it again with the mesh");
    ebpo_tree tree;
    ebpo_read_options read = ebpo_read_threads(threads);
    ebpo_status status = ebpo_file_read_tree(file, &read, &tree, error);
    if (status != EBPO_OK)
        return status;
    out->level_count = file->info.level_count;
    out->pruned = file->info.pruned;
    for (int i = 0; i < out->level_count; i++) {
        drop_arrays(&tree.level[i]);
        out->level[i] = tree.level[i];
        memset(&tree.level[i], 0, sizeof tree.level[i]);
    }
    out->root.type = (ebpo_node_type)out->level[0].types[0];
    out->face_count = tree.mesh.face_count;
    out->mesh = tree.mesh;
    memset(&tree.mesh, 0, sizeof tree.mesh);
    out->face_source = tree.face_source;
    tree.face_source = NULL;
    ebpo_tree_free(&tree);
    return EBPO_OK;
}
