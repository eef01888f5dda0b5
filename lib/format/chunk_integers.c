/* Rows of plain arrays, out of decoded chunks. */
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "hdf5_read/coding.h"
#include "format/chunks.h"

static void widen_integers(const ebpo_shape *shape, const uint8_t *rows, uint64_t numbers, uint8_t *values,
                  size_t size)
{
    if (shape->element_size == size && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__)
        memcpy(values, rows, numbers * size);
    else
        ebpo_integers_decode(rows, shape->element_size, shape->is_signed, numbers, values, size);
}

static ebpo_status check_rows(const ebpo_chunks *chunks, ebpo_array_id id, int level, uint64_t row,
                              uint64_t rows, size_t size, ebpo_error *error)
{
    const char *shown = chunks->file->in.shown;
    if ((id >= EBPO_LEVEL_ARRAYS && id != EBPO_A_SUBTREE_OUTER) || level < 0 ||
        level >= chunks->file->info.level_count)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, shown,
                              "level %d has no array number %d of integers", level, (int)id);
    const ebpo_array_in *array = ebpo_reader_array(chunks->file, id, level);
    if (!array->present || row > array->shape.rows || rows > array->shape.rows - row ||
        size < array->shape.element_size)
        return ebpo_fail_at(error, EBPO_E_ARGUMENT, shown, array->path, -1,
                            "rows %" PRIu64 " to %" PRIu64
                            " of %zu bytes are asked for, and the array has %" PRIu64 " of %d",
                            row, row + rows, size, array->shape.rows, array->shape.element_size);
    return EBPO_OK;
}

ebpo_status ebpo_chunks_integers(ebpo_chunks *chunks, ebpo_array_id id, int level, uint64_t row,
                                 uint64_t rows, void *values, size_t size, ebpo_error *error)
{
    ebpo_status status = check_rows(chunks, id, level, row, rows, size, error);
    if (status != EBPO_OK)
        return status;
    const ebpo_array_in *array = ebpo_reader_array(chunks->file, id, level);
    ebpo_expected expected = EBPO_EXPECTED_INIT(chunks->file);
    if (!chunks->counted)
        ebpo_chunks_expect(chunks, &expected, id, level, row, rows);
    ebpo_expect_all(&expected);
    ebpo_held_chunk view = { .array = array };
    uint64_t cols = array->shape.cols ? array->shape.cols : 1;
    uint8_t *out = values;
    while (rows && status == EBPO_OK) {
        status = ebpo_held_chunk_move(chunks, &view, row, error);
        if (status != EBPO_OK)
            break;
        uint64_t here = view.end - row < rows ? view.end - row : rows;
        widen_integers(&array->shape, view.rows + (row - view.begin) * ebpo_shape_row_bytes(&array->shape),
              here * cols, out, size);
        out += here * cols * size;
        row += here;
        rows -= here;
    }
    ebpo_held_chunk_release(chunks, &view);
    return status;
}

ebpo_status ebpo_chunks_take(ebpo_chunks *chunks, ebpo_array_id id, int level, uint64_t row,
                             uint64_t rows, size_t size, void *values_out, ebpo_error *error)
{
    void *values = NULL;
    /* before room is made */
    ebpo_status status = rows ? check_rows(chunks, id, level, row, rows, size, error) : EBPO_OK;
    if (status == EBPO_OK && rows) {
        const ebpo_array_in *array = ebpo_reader_array(chunks->file, id, level);
        uint64_t cols = array->shape.cols ? array->shape.cols : 1;
        values = ebpo_alloc(rows, size * cols);
        status = values ? ebpo_chunks_integers(chunks, id, level, row, rows, values, size, error)
                        : ebpo_fail_memory(error, rows * size * cols);
    }
    if (status != EBPO_OK) {
        free(values);
        values = NULL;
    }
    memcpy(values_out, &values, sizeof values);
    return status;
}
