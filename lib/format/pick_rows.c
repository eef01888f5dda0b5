/* Rows of the mesh's arrays, in any order: chunk by chunk. */
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "format/pick.h"
#include "format/chunks.h"

/* --- announcing --- */

/* Which chunks of the array these rows lie in; NULL: not known. The caller frees it. */
static bool *chunks_of(const ebpo_array_in *array, const uint32_t *rows, uint64_t count)
{
    bool *has = ebpo_alloc_zero(ebpo_shape_chunks(&array->shape), sizeof *has);
    for (uint64_t i = 0; has && i < count; i++)
        if (rows[i] < array->shape.rows)
            has[rows[i] / array->shape.chunk_rows] = true;
    return has;
}

static void expect_vertices(ebpo_chunks *chunks, ebpo_expected *e, uint64_t row, uint64_t rows,
                            uint32_t parts)
{
    ebpo_chunks_expect(chunks, e, EBPO_A_VERTICES, 0, row, rows);
    if (parts & EBPO_PART_MAPS)
        ebpo_chunks_expect(chunks, e, EBPO_A_VERTEX_SOURCE, 0, row, rows);
}

void ebpo_faces_expect(ebpo_chunks *chunks, const uint32_t *faces, uint64_t count, uint32_t parts)
{
    const ebpo_array_in *array = ebpo_reader_array(chunks->file, EBPO_A_FACES, 0);
    uint64_t number = ebpo_shape_chunks(&array->shape), rows = array->shape.chunk_rows;
    ebpo_expected e = EBPO_EXPECTED_INIT(chunks->file);
    bool *has = ebpo_input_expects(&chunks->file->in) ? chunks_of(array, faces, count) : NULL;
    for (uint64_t i = 0; has && i < number; i++) {
        uint64_t first = chunks->seen ? chunks->seen[i] : 0,
                 end = chunks->seen && i + 1 < number ? chunks->seen[i + 1]
                                                      : chunks->file->info.vertex_count;
        if (!has[i])
            continue;
        ebpo_chunks_expect(chunks, &e, EBPO_A_FACES, 0, i * rows, rows);
        if (parts & EBPO_PART_MAPS)
            ebpo_chunks_expect(chunks, &e, EBPO_A_FACE_SOURCE, 0, i * rows, rows);
        if (first < end)
            expect_vertices(chunks, &e, first, end - first, parts);
    }
    ebpo_expect_all(&e);
    free(has);
}

void ebpo_vertices_expect(ebpo_chunks *chunks, const uint32_t *vertices, uint64_t count,
                          uint32_t parts)
{
    const ebpo_array_in *array = ebpo_reader_array(chunks->file, EBPO_A_VERTICES, 0);
    uint64_t rows = array->shape.chunk_rows;
    ebpo_expected e = EBPO_EXPECTED_INIT(chunks->file);
    bool *has = ebpo_input_expects(&chunks->file->in) ? chunks_of(array, vertices, count) : NULL;
    for (uint64_t i = 0; has && i < ebpo_shape_chunks(&array->shape); i++)
        if (has[i])
            expect_vertices(chunks, &e, i * rows, rows, parts);
    ebpo_expect_all(&e);
    free(has);
}

/* --- reading --- */

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

static ebpo_status pick_rows(ebpo_chunks *chunks, const ebpo_array_in *array, const uint32_t *rows,
                             uint64_t count, unsigned threads, void *out, ebpo_error *error)
{
    gathering g = { .chunks = chunks, .array = array, .rows = rows, .out = out };
    g.row_bytes = ebpo_shape_row_bytes(&array->shape); /* decoding changes no array's width */
    if (!array->present)
        return ebpo_fail_at(error, EBPO_E_ABSENT, chunks->file->in.shown, array->path, -1,
                            "the file does not hold this array");
    uint64_t number = ebpo_shape_chunks(&array->shape);
    uint64_t *begin = ebpo_alloc(number + 2, sizeof *begin);
    uint32_t *order = ebpo_alloc(count, sizeof *order);
    ebpo_status status = begin && order ? sort_rows(&g, count, begin, order, number, error)
                                        : ebpo_fail_memory(error, count * sizeof *order);
    if (status == EBPO_OK) {
        ebpo_expected e = EBPO_EXPECTED_INIT(chunks->file);
        for (uint64_t c = 0; c < number; c++)
            if (begin[c] < begin[c + 1])
                ebpo_chunks_expect(chunks, &e, array->id, array->level, c * array->shape.chunk_rows,
                                   1);
        ebpo_expect_all(&e);
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

ebpo_status ebpo_pick_attribute_rows(ebpo_chunks *chunks, int number, const uint32_t *rows,
                                     uint64_t count, unsigned threads, void *out, ebpo_error *error)
{
    return pick_rows(chunks, ebpo_reader_array(chunks->file, EBPO_A_ATTRIBUTE, number), rows, count,
                     threads, out, error);
}
