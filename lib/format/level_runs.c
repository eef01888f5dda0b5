#include "format/level_runs.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "format/subtree_index.h"
#include "geometry/plane_code.h"
#include "geometry/rule.h"

/* A run's part of a list behind counts: rows [first, first + count) of the file. */
typedef struct span {
    uint64_t first, count;
    uint64_t end; /* of references: where the new faces of the leaf before the run end */
} span;

typedef struct reading {
    ebpo_chunks *chunks;
    int level;
    const ebpo_run *run;
    uint64_t run_count;
    uint32_t needs;
    ebpo_room *room;
    span *span; /* for each run, of the list in hand */
    ebpo_level *out;
    ebpo_error *error;
} reading;

static ebpo_status runs_wrong(const reading *r, ebpo_array_id id, const char *what)
{
    return ebpo_chunks_fail(r->chunks, r->level, id, what, r->error);
}

static bool is_wanted_array(const reading *r, int id)
{
    return ebpo_schema_is_held(id) && ebpo_schema[id].needs & r->needs &&
           ebpo_reader_array(r->chunks->file, (ebpo_array_id)id, r->level)->present;
}

/* --- announcing --- */

/* The index in which sums of this array stand, if it has one. */
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

/* Arrays with sums are read from the nearest row of their index on. */
static void expect_column(const reading *r, ebpo_expected *e, int id, int type)
{
    int index = ebpo_subtree_table_has(r->chunks->file, r->level) ? -1 : index_of(id);
    for (uint64_t i = 0; i < r->run_count; i++) {
        uint64_t rank = r->run[i].rank[type], count = r->run[i].count[type],
                 row = rank / EBPO_INDEX_ROWS, from = index < 0 ? rank : row * EBPO_INDEX_ROWS;
        if (count == 0)
            continue;
        if (index >= 0)
            ebpo_chunks_expect(r->chunks, e, (ebpo_array_id)index, r->level, row, 1);
        ebpo_chunks_expect(r->chunks, e, (ebpo_array_id)id, r->level, from, rank + count - from);
    }
}

void ebpo_runs_expect(ebpo_chunks *chunks, ebpo_expected *expected, int level, const ebpo_run *runs,
                      uint64_t run_count, uint32_t needs)
{
    reading r = {
        .chunks = chunks, .level = level, .run = runs, .run_count = run_count, .needs = needs
    };
    for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++) {
        int type = ebpo_schema_node_type(ebpo_schema[id].per);
        if (type >= 0 && is_wanted_array(&r, id))
            expect_column(&r, expected, id, type);
    }
}

/* --- an array with a row for each node of a type --- */

static void *make_array(const reading *r, int id, uint64_t count, ebpo_status *status)
{
    size_t size = ebpo_schema[id].held_size;
    *status = ebpo_room_take(r->room, count * size, r->error);
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

/* --- lists behind counts --- */

static uint64_t sum_counts(const reading *r, int id, uint64_t begin, uint64_t nodes)
{
    const uint8_t *small = ebpo_level_array(r->out, id);
    const uint32_t *large = ebpo_level_array(r->out, id);
    uint64_t sum = 0;
    for (uint64_t i = begin; i < begin + nodes; i++)
        sum += ebpo_schema[id].held_size == 1 ? small[i] : large[i];
    return sum;
}

/* Where the list of the nodes from `rank` on begins. */
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
                         "a list whose beginnings no index tells; add it to find_span");
    }
}

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
            status =
                runs_wrong(r, list->counts,
                     per == EBPO_PER_REF ? "the counts do not add up to the number of references"
                                         : "the counts do not add up to the number of planes");
        total += s->count;
    }
    ebpo_level_set_count(r->out, per, total);
    return status;
}

static void expect_spans(const reading *r, int id)
{
    ebpo_expected e = EBPO_EXPECTED_INIT(r->chunks->file);
    for (uint64_t i = 0; i < r->run_count; i++)
        ebpo_chunks_expect(r->chunks, &e, (ebpo_array_id)id, r->level, r->span[i].first,
                           r->span[i].count);
    ebpo_expect_all(&e);
}

static ebpo_status read_list(const reading *r, int id, const ebpo_list_spec *list)
{
    size_t size = ebpo_schema[id].held_size;
    ebpo_status status = find_spans(r, id, list);
    uint64_t total = ebpo_level_rows(r->out, id);
    if (status != EBPO_OK || total == 0)
        return status;
    expect_spans(r, id);
    uint8_t *to = make_array(r, id, total, &status);
    for (uint64_t i = 0; i < r->run_count && status == EBPO_OK; i++)
        if (r->span[i].count) {
            status = ebpo_chunks_integers(r->chunks, (ebpo_array_id)id, r->level, r->span[i].first,
                                          r->span[i].count, to, size, r->error);
            to += r->span[i].count * size;
        }
    return status;
}

/* --- what must hold of the values --- */

static ebpo_status check_codes(const reading *r, ebpo_array_id id)
{
    const uint32_t *codes = ebpo_level_array(r->out, id);
    uint64_t count = codes ? ebpo_level_rows(r->out, id) : 0;
    for (uint64_t i = 0; i < count; i++) {
        int32_t n[3], d;
        if (!ebpo_plane_code_decode(codes[i], n, &d))
            return runs_wrong(r, id, "a code stands for no plane");
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
    for (uint64_t i = 0; i < count; i++)
        if (ebpo_rule_inside(r->chunks->file->info.rule, winding[i]) != inside)
            return runs_wrong(r, id,
                        inside ? "a black node lies outside by the winding rule"
                               : "a white node lies inside by the winding rule");
    return EBPO_OK;
}

/* Skips to first faces. */
static ebpo_status add_up_skips(const reading *r, uint64_t begin, uint64_t leaves, uint64_t end)
{
    ebpo_level *out = r->out;
    uint64_t faces = r->chunks->file->info.face_count;
    for (uint64_t i = begin; i < begin + leaves; i++) {
        uint64_t skip = out->leaf_first[i];
        if (end > faces || skip > faces - end || out->leaf_new[i] > faces - end - skip)
            return runs_wrong(r, EBPO_A_LEAF_SKIP, "a leaf's new faces lie beyond the last face");
        out->leaf_first[i] = end + skip;
        end += skip + out->leaf_new[i];
        out->new_count += out->leaf_new[i];
    }
    return EBPO_OK;
}

/* Numbers of faces; the spans are those of the references. */
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
                          "a reference does not lead to a face before the leaf's own");
    return status;
}

/* An array that was read is what it should be, and decoded. */
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
    else if (list && ebpo_level_array(r->out, list->counts)) /* also a list of nothing */
        status = read_list(r, id, list);
    return status == EBPO_OK ? finish_array(r, id) : status;
}

ebpo_status ebpo_runs_read(ebpo_chunks *chunks, int level, const ebpo_run *runs, uint64_t run_count,
                           uint32_t needs, ebpo_room *room, ebpo_level *out, ebpo_error *error)
{
    reading r = { chunks, level, runs, run_count, needs, room, NULL, out, error };
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
