/* Reads selected rows of a file's arrays. A run is a range of groups (eight siblings) of one level.
 * The rank of a node is its position among the nodes of its type in its level. For runs, all arrays
 * of the level are read for the nodes in these groups, including lists of planes and references.
 * Their values are checked as schema.c checks levels. Rows of the mesh's arrays and of attributes
 * are read in any order, chunk by chunk. Prefetch hints for all chunks are sent first, and each
 * chunk is fetched once. Source: format-spec/README.md, sections 6 and 7. */
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "format/chunks.h"
#include "format/pick_rows.h"
#include "format/schema.h"
#include "format/subtree_index.h"
#include "geometry/level_nodes.h"
#include "geometry/polytope.h"

/* The list items (planes or references) of a run's nodes: rows [first, first + count) of the list's
 * array in the file. */
typedef struct span {
    uint64_t first, count;
    uint64_t end; /* for references: one past the last new face of the leaf before the run */
} span;

/* State of ebpo_runs_read. */
typedef struct reading {
    ebpo_chunks *chunks;
    int level;
    const ebpo_run *run; /* [run_count] */
    uint64_t run_count;
    uint32_t needs;    /* EBPO_NEEDS_... (schema.h): arrays to read */
    ebpo_quota *space; /* NULL: no limit of memory */
    span *span;        /* [run_count] list items of each run, in the list that is being read */
    ebpo_level *out;
    ebpo_error *error;
} reading;

static ebpo_status runs_wrong(const reading *r, ebpo_array_id id, const char *what)
{
    return ebpo_chunks_fail(r->chunks, r->level, id, what, r->error);
}

/* Returns true if the caller requested the array and the file has it. */
static bool is_wanted_array(const reading *r, int id)
{
    return ebpo_schema_is_held(id) && ebpo_schema[id].needs & r->needs &&
           ebpo_reader_array(r->chunks->file, (ebpo_array_id)id, r->level)->present;
}

/* --- prefetch hints --- */

/* Returns the index array with sums of this array, or -1. An index array has a row of sums for
 * every EBPO_INDEX_ROWS-th node. */
static int index_of(int id)
{
    switch (id) {
    case EBPO_A_PLANE_COUNTS: return EBPO_A_GRAY_INDEX;
    case EBPO_A_LEAF_SKIP:
    case EBPO_A_LEAF_NEW:
    case EBPO_A_LEAF_REF_COUNT:
    case EBPO_A_LEAF_PLANE_COUNTS: return EBPO_A_LEAF_INDEX;
    default: return -1;
    }
}

/* Collects the chunks of an array with a row for each node of a type. If the array has an index
 * array, its rows are summed from the preceding index row on, so their chunks are also collected.
 */
static void hint_column(const reading *r, ebpo_hints *e, int id, int type)
{
    int index = ebpo_subtree_table_has(r->chunks->file, r->level) ? -1 : index_of(id);
    for (uint64_t i = 0; i < r->run_count; i++) {
        uint64_t rank = r->run[i].rank[type], count = r->run[i].count[type],
                 row = rank / EBPO_INDEX_ROWS, from = index < 0 ? rank : row * EBPO_INDEX_ROWS;
        if (count == 0)
            continue;
        if (index >= 0)
            ebpo_chunks_hint(r->chunks, e, (ebpo_array_id)index, r->level, row, 1);
        ebpo_chunks_hint(r->chunks, e, (ebpo_array_id)id, r->level, from, rank + count - from);
    }
}

void ebpo_runs_hint(ebpo_chunks *chunks, ebpo_hints *hints, int level, const ebpo_run *runs,
                    uint64_t run_count, uint32_t needs)
{
    reading r = {
        .chunks = chunks, .level = level, .run = runs, .run_count = run_count, .needs = needs
    };
    for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++) {
        int type = ebpo_schema_node_type(ebpo_schema[id].per);
        if (type >= 0 && is_wanted_array(&r, id))
            hint_column(&r, hints, id, type);
    }
}

/* --- arrays with a row for each node of a type --- */

/* Allocates an array of the level. Returns NULL on failure, with the reason in *status. */
static void *make_array(const reading *r, int id, uint64_t count, ebpo_status *status)
{
    size_t size = ebpo_schema[id].held_size;
    *status = ebpo_quota_take(r->space, count * size, r->error);
    void *values = *status == EBPO_OK ? ebpo_alloc(count, size) : NULL;
    if (*status == EBPO_OK && !values)
        *status = ebpo_fail_memory(r->error, count * size);
    ebpo_level_set_array(r->out, id, values);
    return values;
}

static ebpo_status read_column(const reading *r, int id, int type)
{
    uint64_t count = ebpo_level_rows(r->out, id), size = ebpo_schema[id].held_size;
    ebpo_status status = EBPO_OK;
    if (count == 0)
        return EBPO_OK;
    uint8_t *to = make_array(r, id, count, &status);
    for (uint64_t i = 0; i < r->run_count && status == EBPO_OK; i++)
        if (r->run[i].count[type]) {
            status =
                ebpo_chunks_integers(r->chunks, (ebpo_array_id)id, r->level, r->run[i].rank[type],
                                     r->run[i].count[type], to, size, r->error);
            to += r->run[i].count[type] * size;
        }
    return status;
}

/* --- lists of planes and references --- */

/* Returns the number of list items of the nodes [begin, begin + nodes) of `out`. `id`: array with
 * the number of list items of each node. */
static uint64_t sum_counts(const reading *r, int id, uint64_t begin, uint64_t nodes)
{
    const uint8_t *small = ebpo_level_array(r->out, id);
    const uint32_t *large = ebpo_level_array(r->out, id);
    uint64_t sum = 0;
    for (uint64_t i = begin; i < begin + nodes; i++)
        sum += ebpo_schema[id].held_size == 1 ? small[i] : large[i];
    return sum;
}

/* Finds the start of the list items of the node with this rank. */
static ebpo_status find_span(const reading *r, ebpo_per per, uint64_t rank, span *s)
{
    switch (per) {
    case EBPO_PER_PLANE: return ebpo_ranks_planes(r->chunks, r->level, rank, &s->first, r->error);
    case EBPO_PER_LEAF_PLANE:
        return ebpo_ranks_leaf_planes(r->chunks, r->level, rank, &s->first, r->error);
    case EBPO_PER_REF:
        return ebpo_ranks_leaf(r->chunks, r->level, rank, &s->end, &s->first, r->error);
    default:
        return ebpo_fail(r->error, EBPO_E_UNSUPPORTED,
                         "no index locates this list; add the list to find_span");
    }
}

/* Finds the list items of each run (r->span), and sets their total number in `out`. `id`: array of
 * the list items. */
static ebpo_status find_spans(const reading *r, int id, const ebpo_list_spec *list)
{
    ebpo_per per = ebpo_schema[id].per;
    int type = ebpo_schema_node_type(list->of);
    uint64_t node = 0, total = 0,
             all = ebpo_schema_rows(&r->chunks->file->info, (ebpo_array_id)id, r->level);
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < r->run_count && status == EBPO_OK; node += r->run[i++].count[type]) {
        span *s = &r->span[i];
        *s = (span){ 0, 0, 0 };
        if (r->run[i].count[type] == 0)
            continue;
        status = find_span(r, per, r->run[i].rank[type], s);
        s->count = sum_counts(r, list->counts, node, r->run[i].count[type]);
        if (status == EBPO_OK && (s->first > all || s->count > all - s->first))
            status = runs_wrong(r, list->counts,
                                per == EBPO_PER_REF
                                    ? "the counts do not add up to the number of references"
                                    : "the counts do not add up to the number of planes");
        total += s->count;
    }
    ebpo_level_set_count(r->out, per, total);
    return status;
}

static void hint_spans(const reading *r, int id)
{
    ebpo_hints e = EBPO_HINTS_INIT(r->chunks->file);
    for (uint64_t i = 0; i < r->run_count; i++)
        ebpo_chunks_hint(r->chunks, &e, (ebpo_array_id)id, r->level, r->span[i].first,
                         r->span[i].count);
    ebpo_hint_all(&e);
}

static ebpo_status read_list(const reading *r, int id, const ebpo_list_spec *list)
{
    size_t size = ebpo_schema[id].held_size;
    ebpo_status status = find_spans(r, id, list);
    uint64_t total = ebpo_level_rows(r->out, id);
    if (status != EBPO_OK || total == 0)
        return status;
    hint_spans(r, id);
    uint8_t *to = make_array(r, id, total, &status);
    for (uint64_t i = 0; i < r->run_count && status == EBPO_OK; i++)
        if (r->span[i].count) {
            status = ebpo_chunks_integers(r->chunks, (ebpo_array_id)id, r->level, r->span[i].first,
                                          r->span[i].count, to, size, r->error);
            to += r->span[i].count * size;
        }
    return status;
}

/* --- constraints on values --- */

static ebpo_status check_codes(const reading *r, ebpo_array_id id)
{
    const uint32_t *codes = ebpo_level_array(r->out, id);
    uint64_t count = codes ? ebpo_level_rows(r->out, id) : 0;
    for (uint64_t i = 0; i < count; i++) {
        int32_t n[3], d;
        if (!ebpo_plane_code_decode(codes[i], n, &d))
            return runs_wrong(r, id, "invalid plane code");
    }
    return EBPO_OK;
}

static ebpo_status check_colours(const reading *r)
{
    const uint32_t *colour = r->out->gray_colours;
    for (uint64_t i = 0; colour && i < r->out->gray_count; i++)
        if (colour[i] >> 24)
            return runs_wrong(r, EBPO_A_GRAY_COLOURS, "a colour is above 2^24 - 1");
    return EBPO_OK;
}

static ebpo_status check_windings(const reading *r, ebpo_array_id id, bool inside)
{
    const int32_t *winding = ebpo_level_array(r->out, id);
    uint64_t count = winding ? ebpo_level_rows(r->out, id) : 0;
    for (uint64_t i = 0; i < count && r->chunks->file->info.solid; i++)
        if (ebpo_rule_inside(r->chunks->file->info.rule, winding[i]) != inside)
            return runs_wrong(r, id,
                              inside ? "a black node is outside by the winding rule"
                                     : "a white node is inside by the winding rule");
    return EBPO_OK;
}

/* Converts leaf_first of the leaves [begin, begin + leaves) to the first new face of each leaf. In
 * the file, a leaf has a skip: the number of faces between its new faces and those of the previous
 * leaf of this level. `end`: one past the last new face of the leaf before leaf `begin`. */
static ebpo_status add_up_skips(const reading *r, uint64_t begin, uint64_t leaves, uint64_t end)
{
    ebpo_level *out = r->out;
    uint64_t faces = r->chunks->file->info.face_count;
    for (uint64_t i = begin; i < begin + leaves; i++) {
        uint64_t skip = out->leaf_first[i];
        if (end > faces || skip > faces - end || out->leaf_new[i] > faces - end - skip)
            return runs_wrong(r, EBPO_A_LEAF_SKIP, "a leaf's new faces are beyond the last face");
        out->leaf_first[i] = end + skip;
        end += skip + out->leaf_new[i];
        out->new_count += out->leaf_new[i];
    }
    return EBPO_OK;
}

/* Decodes the face indices of leaves. r->span must locate the references. */
static ebpo_status decode_faces(const reading *r)
{
    ebpo_level *out = r->out;
    uint64_t leaf = 0, at = 0;
    ebpo_status status = EBPO_OK;
    if (!out->leaf_first)
        return EBPO_OK;
    for (uint64_t i = 0; i < r->run_count && status == EBPO_OK;
         leaf += r->run[i++].count[EBPO_LEAF])
        status = add_up_skips(r, leaf, r->run[i].count[EBPO_LEAF], r->span[i].end);
    for (uint64_t i = 0; i < out->leaf_count && status == EBPO_OK; at += out->leaf_ref_count[i++])
        if (out->leaf_ref_count[i] &&
            !ebpo_refs_decode(out->leaf_refs + at, out->leaf_ref_count[i], out->leaf_first[i]))
            status = runs_wrong(r, EBPO_A_LEAF_REFS,
                                "a reference is not to a face before the leaf's new faces");
    return status;
}

/* Checks an array that has been read. If it is the references, the last array with data of faces,
 * also decodes the face indices. */
static ebpo_status finish_array(const reading *r, int id)
{
    switch (id) {
    case EBPO_A_PLANES:
    case EBPO_A_LEAF_PLANES: return check_codes(r, (ebpo_array_id)id);
    case EBPO_A_GRAY_COLOURS: return check_colours(r);
    case EBPO_A_BLACK_WINDING: return check_windings(r, EBPO_A_BLACK_WINDING, true);
    case EBPO_A_WHITE_WINDING: return check_windings(r, EBPO_A_WHITE_WINDING, false);
    case EBPO_A_LEAF_REFS: return decode_faces(r);
    default: return EBPO_OK;
    }
}

static ebpo_status read_array(const reading *r, int id)
{
    const ebpo_list_spec *list = ebpo_schema_list(ebpo_schema[id].per);
    int type = ebpo_schema_node_type(ebpo_schema[id].per);
    ebpo_status status = EBPO_OK;
    if (type >= 0 && is_wanted_array(r, id))
        status = read_column(r, id, type);
    else if (list && ebpo_level_array(r->out, list->counts)) /* also for lists without items */
        status = read_list(r, id, list);
    return status == EBPO_OK ? finish_array(r, id) : status;
}

ebpo_status ebpo_runs_read(ebpo_chunks *chunks, int level, const ebpo_run *runs, uint64_t run_count,
                           uint32_t needs, ebpo_quota *space, ebpo_level *out, ebpo_error *error)
{
    reading r = { chunks, level, runs, run_count, needs, space, NULL, out, error };
    for (uint64_t i = 0; i < run_count; i++) {
        out->gray_count += runs[i].count[EBPO_GRAY];
        out->leaf_count += runs[i].count[EBPO_LEAF];
        out->white_count += runs[i].count[EBPO_WHITE];
        out->black_count += runs[i].count[EBPO_BLACK];
    }
    r.span = ebpo_alloc(run_count, sizeof *r.span);
    ebpo_status status = r.span ? EBPO_OK : ebpo_fail_memory(error, run_count * sizeof *r.span);
    for (int id = 0; id < EBPO_LEVEL_ARRAYS && status == EBPO_OK; id++)
        status = read_array(&r, id);
    free(r.span);
    return status;
}

/* State of ebpo_pick_level. */
typedef struct picking {
    ebpo_chunks *chunks;
    int level;
    ebpo_run *run;
    uint64_t run_count;
    ebpo_level *out;
    ebpo_error *error;
} picking;

/* Sends prefetch hints for the types of the runs. The ranks of a run are counted from the preceding
 * index row, so also sends hints for this row and for the types since this row. */
static void hint_types(const picking *p)
{
    ebpo_hints e = EBPO_HINTS_INIT(p->chunks->file);
    for (uint64_t i = 0; i < p->run_count; i++) {
        uint64_t index = p->run[i].group / EBPO_INDEX_ROWS, counted = index * EBPO_INDEX_ROWS;
        if (ebpo_subtree_table_has(p->chunks->file, p->level))
            counted = p->run[i].group;
        else
            ebpo_chunks_hint(p->chunks, &e, EBPO_A_TYPES_INDEX, p->level, index, 1);
        ebpo_chunks_hint(p->chunks, &e, EBPO_A_TYPES, p->level, counted,
                         p->run[i].group + p->run[i].groups - counted);
    }
    ebpo_hint_all(&e);
}

/* Reads types and counts the nodes of each run. */
static ebpo_status pick_types(const picking *p)
{
    uint64_t at = 0;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < p->run_count; i++)
        p->out->group_count += p->run[i].groups;
    p->out->types = ebpo_alloc(p->out->group_count, sizeof *p->out->types);
    if (!p->out->types)
        return ebpo_fail_memory(p->error, p->out->group_count * sizeof *p->out->types);
    hint_types(p);
    for (uint64_t i = 0; i < p->run_count && status == EBPO_OK; at += p->run[i++].groups) {
        ebpo_run *r = &p->run[i];
        uint16_t *types = p->out->types + at;
        status = ebpo_ranks_before(p->chunks, p->level, r->group, r->rank, p->error);
        if (status == EBPO_OK)
            status = ebpo_chunks_integers(p->chunks, EBPO_A_TYPES, p->level, r->group, r->groups,
                                          types, sizeof *types, p->error);
        if (status != EBPO_OK)
            break;
        ebpo_groups_count_at(p->level, types, r->groups, r->count);
        status = ebpo_ranks_check(p->chunks, p->level, r->rank, r->count, p->error);
    }
    return status;
}

ebpo_status ebpo_pick_level(ebpo_chunks *chunks, int level, ebpo_run *runs, uint64_t run_count,
                            uint32_t needs, ebpo_level *out, ebpo_error *error)
{
    picking p = { chunks, level, runs, run_count, out, error };
    memset(out, 0, sizeof *out);
    ebpo_status status = pick_types(&p);
    if (status == EBPO_OK) {
        ebpo_hints e = EBPO_HINTS_INIT(chunks->file);
        ebpo_runs_hint(chunks, &e, level, runs, run_count, needs);
        ebpo_hint_all(&e);
        status = ebpo_runs_read(chunks, level, runs, run_count, needs, NULL, out, error);
    }
    if (status != EBPO_OK)
        ebpo_level_free(out);
    return status;
}

/* --- prefetch hints for rows of the mesh's arrays --- */

/* Returns a flag for each chunk: true if it contains one of these rows. Returns NULL when out of
 * memory. The caller frees the flags. */
static bool *chunks_of(const ebpo_array_in *array, const uint32_t *rows, uint64_t count)
{
    bool *requested = ebpo_alloc_zero(ebpo_shape_chunks(&array->shape), sizeof *requested);
    for (uint64_t i = 0; requested && i < count; i++)
        if (rows[i] < array->shape.rows)
            requested[rows[i] / array->shape.chunk_rows] = true;
    return requested;
}

/* Collects the chunks of vertices, and of their source indices if `parts` has EBPO_PART_MAPS. */
static void hint_vertices(ebpo_chunks *chunks, ebpo_hints *e, uint64_t row, uint64_t rows,
                          uint32_t parts)
{
    ebpo_chunks_hint(chunks, e, EBPO_A_VERTICES, 0, row, rows);
    if (parts & EBPO_PART_MAPS)
        ebpo_chunks_hint(chunks, e, EBPO_A_VERTEX_SOURCE, 0, row, rows);
}

void ebpo_faces_hint(ebpo_chunks *chunks, ebpo_hints *hints, const uint32_t *faces, uint64_t count,
                     uint32_t parts)
{
    const ebpo_array_in *array = ebpo_reader_array(chunks->file, EBPO_A_FACES, 0);
    uint64_t number = ebpo_shape_chunks(&array->shape), rows = array->shape.chunk_rows;
    bool *requested =
        ebpo_input_prefetches(&chunks->file->in) ? chunks_of(array, faces, count) : NULL;
    for (uint64_t i = 0; requested && i < number; i++) {
        uint64_t first = chunks->vertices_before ? chunks->vertices_before[i] : 0,
                 end = chunks->vertices_before && i + 1 < number ? chunks->vertices_before[i + 1]
                                                                 : chunks->file->info.vertex_count;
        if (!requested[i])
            continue;
        ebpo_chunks_hint(chunks, hints, EBPO_A_FACES, 0, i * rows, rows);
        if (parts & EBPO_PART_MAPS)
            ebpo_chunks_hint(chunks, hints, EBPO_A_FACE_SOURCE, 0, i * rows, rows);
        if (first < end)
            hint_vertices(chunks, hints, first, end - first, parts);
    }
    free(requested);
}

void ebpo_vertices_hint(ebpo_chunks *chunks, const uint32_t *vertices, uint64_t count,
                        uint32_t parts)
{
    const ebpo_array_in *array = ebpo_reader_array(chunks->file, EBPO_A_VERTICES, 0);
    uint64_t rows = array->shape.chunk_rows;
    ebpo_hints e = EBPO_HINTS_INIT(chunks->file);
    bool *requested =
        ebpo_input_prefetches(&chunks->file->in) ? chunks_of(array, vertices, count) : NULL;
    for (uint64_t i = 0; requested && i < ebpo_shape_chunks(&array->shape); i++)
        if (requested[i])
            hint_vertices(chunks, &e, i * rows, rows, parts);
    ebpo_hint_all(&e);
    free(requested);
}

/* --- reading rows in any order --- */

/* Rows of one array that are read in the order of their chunks. */
typedef struct gathering {
    ebpo_chunks *chunks;
    const ebpo_array_in *array;
    const uint32_t *rows;
    const uint32_t *order; /* indices into `rows`, sorted by chunk */
    const uint64_t *begin; /* [chunks + 1] first index in `order` of each chunk's rows */
    size_t row_bytes;
    uint8_t *out; /* receives the rows in the order of `rows` */
} gathering;

static ebpo_status gather_chunks(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    const gathering *g = context;
    ebpo_status status = EBPO_OK;
    (void)worker;
    for (uint64_t chunk = begin; chunk < end && status == EBPO_OK; chunk++) {
        ebpo_held_chunk view = { .array = g->array };
        for (uint64_t i = g->begin[chunk]; i < g->begin[chunk + 1] && status == EBPO_OK; i++) {
            uint32_t row = g->rows[g->order[i]];
            status = ebpo_held_chunk_move(g->chunks, &view, row, error);
            if (status == EBPO_OK)
                memcpy(g->out + g->order[i] * g->row_bytes,
                       view.rows + (row - view.begin) * g->row_bytes, g->row_bytes);
        }
        ebpo_held_chunk_release(g->chunks, &view);
    }
    return status;
}

/* Sorts the requested rows by chunk with a counting sort: fills in `begin` and `order` of
 * gathering.
 */
static ebpo_status sort_rows(const gathering *g, uint64_t count, uint64_t *begin, uint32_t *order,
                             uint64_t chunks, ebpo_error *error)
{
    uint64_t chunk_rows = g->array->shape.chunk_rows, sum = 0;
    memset(begin, 0, (chunks + 1) * sizeof *begin);
    for (uint64_t i = 0; i < count; i++) {
        if (g->rows[i] >= g->array->shape.rows)
            return ebpo_chunks_fail(g->chunks, -1, g->array->id, "a requested row does not exist",
                                    error);
        begin[g->rows[i] / chunk_rows]++;
    }
    for (uint64_t c = 0; c <= chunks; c++) {
        uint64_t in_chunk = begin[c];
        begin[c] = sum;
        sum += in_chunk;
    }
    for (uint64_t i = 0; i < count; i++)
        order[begin[g->rows[i] / chunk_rows]++] = (uint32_t)i;
    memmove(begin + 1, begin, chunks * sizeof *begin);
    begin[0] = 0;
    return EBPO_OK;
}

static ebpo_status pick_rows(ebpo_chunks *chunks, const ebpo_array_in *array, const uint32_t *rows,
                             uint64_t count, unsigned threads, void *out, ebpo_error *error)
{
    gathering g = { .chunks = chunks, .array = array, .rows = rows, .out = out };
    g.row_bytes =
        ebpo_shape_row_bytes(&array->shape); /* decoding does not change the bytes of a row */
    if (!array->present)
        return ebpo_fail_at(error, EBPO_E_ABSENT, chunks->file->in.shown, array->path, -1,
                            "the file does not have this array");
    uint64_t number = ebpo_shape_chunks(&array->shape);
    uint64_t *begin = ebpo_alloc(number + 2, sizeof *begin);
    uint32_t *order = ebpo_alloc(count, sizeof *order);
    ebpo_status status = begin && order ? sort_rows(&g, count, begin, order, number, error)
                                        : ebpo_fail_memory(error, count * sizeof *order);
    if (status == EBPO_OK) {
        ebpo_hints e = EBPO_HINTS_INIT(chunks->file);
        for (uint64_t c = 0; c < number; c++)
            if (begin[c] < begin[c + 1])
                ebpo_chunks_hint(chunks, &e, array->id, array->level, c * array->shape.chunk_rows,
                                 1);
        ebpo_hint_all(&e);
        g.begin = begin;
        g.order = order;
        status = ebpo_parallel_for(threads, NULL, number, 1, gather_chunks, &g, NULL,
                                   "picking faces", error);
    }
    free(begin);
    free(order);
    return status;
}

ebpo_status ebpo_pick_rows(ebpo_chunks *chunks, ebpo_array_id id, const uint32_t *rows,
                           uint64_t count, unsigned threads, void *out, ebpo_error *error)
{
    return pick_rows(chunks, ebpo_reader_array(chunks->file, id, 0), rows, count, threads, out,
                     error);
}

/* Reads rows of array `number` of /attributes (ebpo_values_number, ebpo_items_number). */
static ebpo_status pick_attribute_rows(ebpo_chunks *chunks, int number, const uint32_t *rows,
                                       uint64_t count, unsigned threads, void *out,
                                       ebpo_error *error)
{
    return pick_rows(chunks, ebpo_reader_array(chunks->file, EBPO_A_ATTRIBUTE, number), rows, count,
                     threads, out, error);
}

/* --- rows of attributes --- */

/* Arguments of ebpo_pick_attributes. */
typedef struct attribute_picking {
    ebpo_chunks *chunks;
    const uint32_t *rows;
    uint64_t count;
    unsigned threads;
    ebpo_error *error;
} attribute_picking;

/* Reads rows of array `number` of /attributes, with the threads and the error of `p`. */
static ebpo_status copy_picked_rows(const attribute_picking *p, int number, const uint32_t *rows,
                                    uint64_t count, void *out)
{
    return pick_attribute_rows(p->chunks, number, rows, count, p->threads, out, p->error);
}

static ebpo_status pick_columns(const attribute_picking *p, uint64_t n, ebpo_attribute *a)
{
    uint64_t bytes = a->columns * (uint64_t)ebpo_attribute_bytes(a->type);
    a->values = ebpo_alloc(p->count, bytes);
    return a->values ? copy_picked_rows(p, ebpo_values_number(n), p->rows, p->count, a->values)
                     : ebpo_fail_memory(p->error, p->count * bytes);
}

/* Computes the file indices of the items of all selected lists. before[i]: begin of selected list i
 * in the file. a->ends[i]: end of this list in the file; the function replaces it by the end of the
 * list among the selected items. */
static ebpo_status number_items(const attribute_picking *p, ebpo_attribute *a,
                                const uint64_t *before, uint32_t **items)
{
    uint64_t sum = 0;
    for (uint64_t i = 0; i < p->count; i++) {
        if (before[i] > a->ends[i])
            return ebpo_chunks_fail(p->chunks, -1, EBPO_A_ATTRIBUTE, "a list ends before it begins",
                                    p->error);
        if (a->ends[i] > UINT32_MAX || a->ends[i] - before[i] > UINT32_MAX - sum)
            return ebpo_fail_file(p->error, EBPO_E_LIMIT, p->chunks->file->in.shown,
                                  "the lists of an attribute have more than 2^32 - 1 items; omit "
                                  "attributes");
        sum += a->ends[i] - before[i];
    }
    uint32_t *next = *items = ebpo_alloc(sum, sizeof *next);
    if (!next)
        return ebpo_fail_memory(p->error, sum * sizeof *next);
    for (uint64_t i = 0; i < p->count; i++) {
        for (uint64_t k = before[i]; k < a->ends[i]; k++)
            *next++ = (uint32_t)k;
        a->ends[i] = (uint64_t)(next - *items);
    }
    return EBPO_OK;
}

/* Reads the begin of each selected list: the end of the preceding list in the file, or 0. */
static ebpo_status pick_before(const attribute_picking *p, uint64_t n, uint64_t *before)
{
    uint32_t *rows = ebpo_alloc(p->count, sizeof *rows);
    if (!rows)
        return ebpo_fail_memory(p->error, p->count * sizeof *rows);
    for (uint64_t i = 0; i < p->count; i++)
        rows[i] = p->rows[i] ? p->rows[i] - 1 : 0;
    ebpo_status status = copy_picked_rows(p, ebpo_values_number(n), rows, p->count, before);
    for (uint64_t i = 0; i < p->count; i++)
        if (p->rows[i] == 0)
            before[i] = 0;
    free(rows);
    return status;
}

static ebpo_status pick_lists(const attribute_picking *p, uint64_t n, ebpo_attribute *a)
{
    unsigned bytes = ebpo_attribute_bytes(a->type);
    uint32_t *items = NULL;
    uint64_t *before = ebpo_alloc(p->count, sizeof *before);
    a->ends = ebpo_alloc(p->count, sizeof *a->ends);
    ebpo_status status =
        before && a->ends ? copy_picked_rows(p, ebpo_values_number(n), p->rows, p->count, a->ends)
                          : ebpo_fail_memory(p->error, p->count * 2 * sizeof *before);
    if (status == EBPO_OK)
        status = pick_before(p, n, before);
    if (status == EBPO_OK)
        status = number_items(p, a, before, &items);
    uint64_t count = status == EBPO_OK && p->count ? a->ends[p->count - 1] : 0;
    if (status == EBPO_OK) {
        a->values = ebpo_alloc(count, bytes);
        status = a->values ? EBPO_OK : ebpo_fail_memory(p->error, count * bytes);
    }
    if (status == EBPO_OK && count)
        status = copy_picked_rows(p, ebpo_items_number(n), items, count, a->values);
    free(items);
    free(before);
    return status;
}

ebpo_status ebpo_pick_attributes(ebpo_chunks *chunks, ebpo_attributes *to, const char *element,
                                 const uint32_t *rows, uint64_t count, unsigned threads,
                                 ebpo_error *error)
{
    attribute_picking p = { chunks, rows, count, threads, error };
    ebpo_status status = EBPO_OK;
    for (uint64_t n = 0; n < to->count && status == EBPO_OK; n++) {
        ebpo_attribute *a = &to->array[n];
        if (!ebpo_attribute_is_of(a, element))
            continue;
        status = chunks->file->attributes.head[n].different ? pick_lists(&p, n, a)
                                                            : pick_columns(&p, n, a);
        a->rows = count;
    }
    return status;
}
