#include "container/pick.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/parallel.h"
#include "container/chunks.h"
#include "container/ranks.h"
#include "geom/plane_code.h"
#include "octree/node_types.h"
#include "octree/rule.h"

typedef struct picking {
    ebpo_chunks *chunks;
    int level;
    ebpo_run *run;
    uint64_t run_count;
    uint32_t parts;
    ebpo_level *out;
    ebpo_error *error;
} picking;

/* --- types, and which nodes they make each run have --- */

static void expect_types(const picking *p)
{
    ebpo_expected e = EBPO_EXPECTED_INIT(p->chunks->file);
    for (uint64_t i = 0; i < p->run_count; i++) {
        uint64_t index = p->run[i].group / EBPO_INDEX_ROWS, counted = index * EBPO_INDEX_ROWS;
        ebpo_chunks_expect(p->chunks, &e, EBPO_A_TYPES_INDEX, p->level, index, 1);
        ebpo_chunks_expect(p->chunks, &e, EBPO_A_TYPES, p->level, counted,
                           p->run[i].group + p->run[i].groups - counted);
    }
    ebpo_expect_all(&e);
}

static ebpo_status pick_types(const picking *p)
{
    uint64_t at = 0;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < p->run_count; i++)
        p->out->group_count += p->run[i].groups;
    p->out->types = ebpo_alloc(p->out->group_count, sizeof *p->out->types);
    if (!p->out->types)
        return ebpo_fail_memory(p->error, p->out->group_count * sizeof *p->out->types);
    expect_types(p);
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
        p->out->white_count += r->count[EBPO_WHITE];
        p->out->black_count += r->count[EBPO_BLACK];
        p->out->leaf_count += r->count[EBPO_LEAF];
        p->out->gray_count += r->count[EBPO_GRAY];
    }
    return status;
}

/* --- an array with a row for each node of a type --- */

static bool has(const picking *p, ebpo_array_id id)
{
    return ebpo_reader_array(p->chunks->file, id, p->level)->present;
}

static ebpo_status pick_column(const picking *p, ebpo_array_id id, ebpo_node_type type, size_t size,
                               void *values_out)
{
    uint64_t count = 0;
    uint8_t *values, *to;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < p->run_count; i++)
        count += p->run[i].count[type];
    if (count == 0 || !has(p, id))
        return EBPO_OK;
    values = to = ebpo_alloc(count, size);
    if (!values)
        return ebpo_fail_memory(p->error, count * size);
    memcpy(values_out, &values, sizeof values);
    for (uint64_t i = 0; i < p->run_count && status == EBPO_OK;
         to += p->run[i++].count[type] * size)
        if (p->run[i].count[type])
            status = ebpo_chunks_integers(p->chunks, id, p->level, p->run[i].rank[type],
                                          p->run[i].count[type], to, size, p->error);
    return status;
}

static void expect_column(const picking *p, ebpo_expected *e, ebpo_array_id id, ebpo_node_type type)
{
    for (uint64_t i = 0; i < p->run_count; i++)
        ebpo_chunks_expect(p->chunks, e, id, p->level, p->run[i].rank[type], p->run[i].count[type]);
}

/* An array whose sums are needed from the nearest row of an index on, and that row. */
static void expect_counted(const picking *p, ebpo_expected *e, ebpo_array_id id,
                           ebpo_array_id index_id, ebpo_node_type type)
{
    for (uint64_t i = 0; i < p->run_count; i++) {
        uint64_t index = p->run[i].rank[type] / EBPO_INDEX_ROWS, counted = index * EBPO_INDEX_ROWS;
        if (p->run[i].count[type] == 0)
            continue;
        ebpo_chunks_expect(p->chunks, e, index_id, p->level, index, 1);
        ebpo_chunks_expect(p->chunks, e, id, p->level, counted,
                           p->run[i].rank[type] + p->run[i].count[type] - counted);
    }
}

static void expect_nodes(const picking *p)
{
    ebpo_expected e = EBPO_EXPECTED_INIT(p->chunks->file);
    expect_column(p, &e, EBPO_A_WHITE_WINDING, EBPO_WHITE);
    expect_column(p, &e, EBPO_A_BLACK_WINDING, EBPO_BLACK);
    expect_column(p, &e, EBPO_A_LEAF_WINDING, EBPO_LEAF);
    if (p->parts & EBPO_PART_PLANES)
        expect_counted(p, &e, EBPO_A_PLANE_COUNTS, EBPO_A_GRAY_INDEX, EBPO_GRAY);
    if (p->parts & EBPO_PART_MESH) {
        expect_counted(p, &e, EBPO_A_LEAF_SKIP, EBPO_A_LEAF_INDEX, EBPO_LEAF);
        expect_counted(p, &e, EBPO_A_LEAF_NEW, EBPO_A_LEAF_INDEX, EBPO_LEAF);
        expect_counted(p, &e, EBPO_A_LEAF_REF_COUNT, EBPO_A_LEAF_INDEX, EBPO_LEAF);
    }
    if (p->parts & EBPO_PART_LEAF_PLANES)
        expect_counted(p, &e, EBPO_A_LEAF_PLANE_COUNTS, EBPO_A_LEAF_INDEX, EBPO_LEAF);
    ebpo_expect_all(&e);
}

static ebpo_status pick_windings(const picking *p)
{
    const ebpo_info *info = &p->chunks->file->info;
    ebpo_level *out = p->out;
    if (!info->solid)
        return EBPO_OK;
    ebpo_status status = pick_column(p, EBPO_A_LEAF_WINDING, EBPO_LEAF, 4, &out->leaf_winding);
    if (status == EBPO_OK)
        status = pick_column(p, EBPO_A_BLACK_WINDING, EBPO_BLACK, 4, &out->black_winding);
    if (status == EBPO_OK)
        status = pick_column(p, EBPO_A_WHITE_WINDING, EBPO_WHITE, 4, &out->white_winding);
    for (uint64_t i = 0; out->black_winding && i < out->black_count && status == EBPO_OK; i++)
        if (!ebpo_rule_inside(info->rule, out->black_winding[i]))
            status = ebpo_chunks_fail(p->chunks, p->level, EBPO_A_BLACK_WINDING,
                                      "a black node lies outside by the winding rule", p->error);
    for (uint64_t i = 0; out->white_winding && i < out->white_count && status == EBPO_OK; i++)
        if (ebpo_rule_inside(info->rule, out->white_winding[i]))
            status = ebpo_chunks_fail(p->chunks, p->level, EBPO_A_WHITE_WINDING,
                                      "a white node lies inside by the winding rule", p->error);
    return status;
}

/* --- lists behind counts: planes, leaf planes, references --- */

/* A run's part of a list: rows [first, first + count) of the file. */
typedef struct span {
    uint64_t first, count;
} span;

static ebpo_status sum_span(const picking *p, const void *counts, size_t size, uint64_t begin,
                            uint64_t nodes, uint64_t all, span *s, const char *what)
{
    s->count = 0;
    for (uint64_t i = begin; i < begin + nodes; i++)
        s->count += size == 1 ? ((const uint8_t *)counts)[i] : ((const uint32_t *)counts)[i];
    if (s->first > all || s->count > all - s->first)
        return ebpo_chunks_fail(p->chunks, p->level, EBPO_A_TYPES, what, p->error);
    return EBPO_OK;
}

static ebpo_status pick_list(const picking *p, ebpo_array_id id, const span *spans, uint64_t *total,
                             uint32_t **out)
{
    ebpo_expected e = EBPO_EXPECTED_INIT(p->chunks->file);
    uint64_t at = 0;
    ebpo_status status = EBPO_OK;
    *total = 0;
    for (uint64_t i = 0; i < p->run_count; i++) {
        *total += spans[i].count;
        ebpo_chunks_expect(p->chunks, &e, id, p->level, spans[i].first, spans[i].count);
    }
    ebpo_expect_all(&e);
    if (*total == 0)
        return EBPO_OK;
    *out = ebpo_alloc(*total, sizeof **out);
    if (!*out)
        return ebpo_fail_memory(p->error, *total * sizeof **out);
    for (uint64_t i = 0; i < p->run_count && status == EBPO_OK; at += spans[i++].count)
        if (spans[i].count)
            status = ebpo_chunks_integers(p->chunks, id, p->level, spans[i].first, spans[i].count,
                                          *out + at, sizeof **out, p->error);
    return status;
}

static ebpo_status check_codes(const picking *p, ebpo_array_id id, const uint32_t *codes,
                               uint64_t count)
{
    for (uint64_t i = 0; i < count; i++) {
        int32_t n[3], d;
        if (!ebpo_plane_code_decode(codes[i], n, &d))
            return ebpo_chunks_fail(p->chunks, p->level, id, "a code stands for no plane",
                                    p->error);
    }
    return EBPO_OK;
}

static const char *const planes_wrong = "the counts do not add up to the number of planes",
                         *const refs_wrong = "the counts do not add up to the number of references";

static ebpo_status pick_planes(const picking *p, span *spans)
{
    ebpo_level *out = p->out;
    uint64_t gray = 0, all = p->chunks->file->info.level[p->level].plane_count;
    ebpo_status status = pick_column(p, EBPO_A_PLANE_COUNTS, EBPO_GRAY, 1, &out->plane_counts);
    for (uint64_t i = 0; i < p->run_count && status == EBPO_OK;
         gray += p->run[i++].count[EBPO_GRAY]) {
        spans[i] = (span){ 0, 0 };
        if (p->run[i].count[EBPO_GRAY] == 0)
            continue;
        status = ebpo_ranks_planes(p->chunks, p->level, p->run[i].rank[EBPO_GRAY], &spans[i].first,
                                   p->error);
        if (status == EBPO_OK)
            status = sum_span(p, out->plane_counts, 1, gray, p->run[i].count[EBPO_GRAY], all,
                              &spans[i], planes_wrong);
    }
    if (status == EBPO_OK)
        status = pick_list(p, EBPO_A_PLANES, spans, &out->plane_count, &out->planes);
    return status == EBPO_OK ? check_codes(p, EBPO_A_PLANES, out->planes, out->plane_count)
                             : status;
}

static ebpo_status pick_leaf_planes(const picking *p, span *spans)
{
    ebpo_level *out = p->out;
    uint64_t leaf = 0, all = p->chunks->file->info.level[p->level].leaf_plane_count;
    ebpo_status status =
        pick_column(p, EBPO_A_LEAF_PLANE_COUNTS, EBPO_LEAF, 1, &out->leaf_plane_counts);
    for (uint64_t i = 0; i < p->run_count && status == EBPO_OK;
         leaf += p->run[i++].count[EBPO_LEAF]) {
        spans[i] = (span){ 0, 0 };
        if (p->run[i].count[EBPO_LEAF] == 0)
            continue;
        status = ebpo_ranks_leaf_planes(p->chunks, p->level, p->run[i].rank[EBPO_LEAF],
                                        &spans[i].first, p->error);
        if (status == EBPO_OK)
            status = sum_span(p, out->leaf_plane_counts, 1, leaf, p->run[i].count[EBPO_LEAF], all,
                              &spans[i], planes_wrong);
    }
    if (status == EBPO_OK)
        status = pick_list(p, EBPO_A_LEAF_PLANES, spans, &out->leaf_plane_count, &out->leaf_planes);
    return status == EBPO_OK
               ? check_codes(p, EBPO_A_LEAF_PLANES, out->leaf_planes, out->leaf_plane_count)
               : status;
}

/* Skips to first faces. */
static ebpo_status add_up_skips(const picking *p, uint64_t begin, uint64_t leaves, uint64_t end)
{
    ebpo_level *out = p->out;
    uint64_t faces = p->chunks->file->info.face_count;
    for (uint64_t i = begin; i < begin + leaves; i++) {
        uint64_t skip = out->leaf_first[i];
        if (end > faces || skip > faces - end || out->leaf_new[i] > faces - end - skip)
            return ebpo_chunks_fail(p->chunks, p->level, EBPO_A_LEAF_SKIP,
                                    "a leaf's new faces lie beyond the last face", p->error);
        out->leaf_first[i] = end + skip;
        end += skip + out->leaf_new[i];
        out->new_count += out->leaf_new[i];
    }
    return EBPO_OK;
}

static ebpo_status pick_refs(const picking *p, span *spans)
{
    ebpo_level *out = p->out;
    uint64_t leaf = 0, end, at = 0, all = p->chunks->file->info.level[p->level].ref_count;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < p->run_count && status == EBPO_OK;
         leaf += p->run[i++].count[EBPO_LEAF]) {
        spans[i] = (span){ 0, 0 };
        if (p->run[i].count[EBPO_LEAF] == 0)
            continue;
        status = ebpo_ranks_leaf(p->chunks, p->level, p->run[i].rank[EBPO_LEAF], &end,
                                 &spans[i].first, p->error);
        if (status == EBPO_OK)
            status = add_up_skips(p, leaf, p->run[i].count[EBPO_LEAF], end);
        if (status == EBPO_OK)
            status = sum_span(p, out->leaf_ref_count, 4, leaf, p->run[i].count[EBPO_LEAF], all,
                              &spans[i], refs_wrong);
    }
    if (status == EBPO_OK)
        status = pick_list(p, EBPO_A_LEAF_REFS, spans, &out->ref_count, &out->leaf_refs);
    for (uint64_t i = 0; i < out->leaf_count && status == EBPO_OK; at += out->leaf_ref_count[i++])
        if (out->leaf_ref_count[i] &&
            !ebpo_refs_decode(out->leaf_refs + at, out->leaf_ref_count[i], out->leaf_first[i]))
            status = ebpo_chunks_fail(p->chunks, p->level, EBPO_A_LEAF_REFS,
                                      "a reference does not lead to a face before the leaf's own",
                                      p->error);
    return status;
}

static ebpo_status pick_faces(const picking *p, span *spans)
{
    ebpo_level *out = p->out;
    ebpo_status status = pick_column(p, EBPO_A_LEAF_SKIP, EBPO_LEAF, 8, &out->leaf_first);
    if (status == EBPO_OK)
        status = pick_column(p, EBPO_A_LEAF_NEW, EBPO_LEAF, 4, &out->leaf_new);
    if (status == EBPO_OK)
        status = pick_column(p, EBPO_A_LEAF_REF_COUNT, EBPO_LEAF, 4, &out->leaf_ref_count);
    return status == EBPO_OK && out->leaf_count ? pick_refs(p, spans) : status;
}

ebpo_status ebpo_pick_level(ebpo_chunks *chunks, int level, ebpo_run *runs, uint64_t run_count,
                            uint32_t parts, ebpo_level *out, ebpo_error *error)
{
    picking p = { chunks, level, runs, run_count, parts & chunks->file->info.parts, out, error };
    memset(out, 0, sizeof *out);
    span *spans = ebpo_alloc(run_count, sizeof *spans);
    ebpo_status status =
        spans ? pick_types(&p) : ebpo_fail_memory(error, run_count * sizeof *spans);
    if (status == EBPO_OK)
        expect_nodes(&p);
    if (status == EBPO_OK)
        status = pick_windings(&p);
    if (status == EBPO_OK && p.parts & EBPO_PART_PLANES)
        status = pick_planes(&p, spans);
    if (status == EBPO_OK && p.parts & EBPO_PART_LEAF_PLANES)
        status = pick_leaf_planes(&p, spans);
    if (status == EBPO_OK && p.parts & EBPO_PART_MESH)
        status = pick_faces(&p, spans);
    free(spans);
    if (status != EBPO_OK)
        ebpo_level_free(out);
    return status;
}

/* --- rows of the mesh --- */

typedef struct gathering {
    ebpo_chunks *chunks;
    const ebpo_array_in *array;
    const uint32_t *rows, *order; /* order: places in `rows`, chunk after chunk */
    const uint64_t *begin;        /* [chunks + 1] in `order` */
    size_t row_bytes;
    uint8_t *out;
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

/* Counting sort by chunk. */
static ebpo_status sort_rows(const gathering *g, uint64_t count, uint64_t *begin, uint32_t *order,
                             uint64_t chunks, ebpo_error *error)
{
    uint64_t chunk_rows = g->array->shape.chunk_rows, sum = 0;
    memset(begin, 0, (chunks + 1) * sizeof *begin);
    for (uint64_t i = 0; i < count; i++) {
        if (g->rows[i] >= g->array->shape.rows)
            return ebpo_chunks_fail(g->chunks, -1, g->array->id, "a row is named that is not there",
                                    error);
        begin[g->rows[i] / chunk_rows]++;
    }
    for (uint64_t c = 0; c <= chunks; c++) {
        uint64_t here = begin[c];
        begin[c] = sum;
        sum += here;
    }
    for (uint64_t i = 0; i < count; i++)
        order[begin[g->rows[i] / chunk_rows]++] = (uint32_t)i;
    memmove(begin + 1, begin, chunks * sizeof *begin);
    begin[0] = 0;
    return EBPO_OK;
}

ebpo_status ebpo_pick_rows(ebpo_chunks *chunks, ebpo_array_id id, const uint32_t *rows,
                           uint64_t count, unsigned threads, void *out, ebpo_error *error)
{
    const ebpo_array_in *array = ebpo_reader_array(chunks->file, id, 0);
    bool vertices = id == EBPO_A_VERTICES, wide = chunks->file->info.double_coordinates;
    gathering g = { .chunks = chunks, .array = array, .rows = rows, .out = out };
    g.row_bytes = vertices             ? 3 * (wide ? sizeof(double) : sizeof(float))
                  : id == EBPO_A_FACES ? 3 * sizeof(uint32_t)
                                       : sizeof(uint32_t);
    if (!array->present)
        return ebpo_fail_at(error, EBPO_E_ABSENT, chunks->file->in.shown, array->path, -1,
                            "the file does not hold this array");
    uint64_t number = ebpo_h5_chunk_count(&array->shape);
    uint64_t *begin = ebpo_alloc(number + 2, sizeof *begin);
    uint32_t *order = ebpo_alloc(count, sizeof *order);
    ebpo_status status = begin && order ? sort_rows(&g, count, begin, order, number, error)
                                        : ebpo_fail_memory(error, count * sizeof *order);
    if (status == EBPO_OK) {
        ebpo_expected e = EBPO_EXPECTED_INIT(chunks->file);
        for (uint64_t c = 0; c < number; c++)
            if (begin[c] < begin[c + 1])
                ebpo_chunks_expect(chunks, &e, id, 0, c * array->shape.chunk_rows, 1);
        ebpo_expect_all(&e);
        g.begin = begin;
        g.order = order;
        status =
            ebpo_parallel_for(threads, number, 1, gather_chunks, &g, NULL, "picking faces", error);
    }
    free(begin);
    free(order);
    return status;
}
