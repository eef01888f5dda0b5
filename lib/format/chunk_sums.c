#include "format/chunk_sums.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "format/all_arrays.h"
#include "format/long_chunk.h"
#include "format/places.h"

/* Finds the rows of one array from *row on, and goes on behind them. Rows of arrays that nobody
 * here knows lie in between. */
static ebpo_status find_rows(const ebpo_file *file, ebpo_array_in *a, const uint64_t *list,
                             uint64_t rows, uint64_t *row, ebpo_error *error)
{
    uint32_t number = ebpo_place_number(a->id, a->level);
    uint64_t chunks = ebpo_shape_chunks(&a->shape);
    while (*row < rows && ebpo_place_number_of(list[*row]) < number)
        ++*row;
    a->first_sum = *row;
    while (*row < rows && ebpo_place_number_of(list[*row]) == number)
        ++*row;
    return *row - a->first_sum == chunks
               ? EBPO_OK
               : ebpo_long_chunk_fail(file, EBPO_A_CHUNK_SUMS,
                                      "the list has more or fewer chunks than", a->path, error);
}

static ebpo_status find_all(ebpo_file *file, const uint64_t *list, uint64_t rows, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    uint64_t row = 0;
    for (uint64_t i = 1; i < rows; i++)
        if (ebpo_place_number_of(list[i]) < ebpo_place_number_of(list[i - 1]))
            return ebpo_long_chunk_fail(file, EBPO_A_CHUNK_SUMS, "the list is not in the order of",
                                        "arrays' numbers", error);
    for (int i = 0; i < ebpo_all_arrays(file) && status == EBPO_OK; i++)
        if (ebpo_array_number(file, i)->present &&
            !ebpo_schema_is_list(ebpo_array_number(file, i)->id))
            status = find_rows(file, ebpo_array_number(file, i), list, rows, &row, error);
    return status;
}

static ebpo_status read_sums(ebpo_file *file, ebpo_error *error)
{
    const ebpo_array_in *a = &file->root_array[EBPO_A_CHUNK_SUMS];
    uint64_t *list;
    ebpo_status status = ebpo_long_chunk_read(file, a, &list, error);
    if (status == EBPO_OK)
        status = find_all(file, list, a->shape.rows, error);
    uint32_t *sums = status == EBPO_OK ? ebpo_alloc(a->shape.rows, sizeof *sums) : NULL;
    if (status == EBPO_OK && !sums)
        status = ebpo_fail_memory(error, a->shape.rows * sizeof *sums);
    for (uint64_t i = 0; i < a->shape.rows && status == EBPO_OK; i++)
        sums[i] = (uint32_t)list[i];
    free(list);
    if (status == EBPO_OK)
        file->sums = sums;
    return status;
}

ebpo_status ebpo_chunk_sums_read(const ebpo_file *file, ebpo_error *error)
{
    ebpo_file *own = ebpo_reader_own(file);
    ebpo_status status = EBPO_OK;
    if (!file->has_sums || atomic_load(&file->summed))
        return EBPO_OK;
    pthread_mutex_lock(&own->lock);
    if (!atomic_load(&own->summed)) {
        status = read_sums(own, error);
        if (status == EBPO_OK)
            atomic_store(&own->summed, true);
    }
    pthread_mutex_unlock(&own->lock);
    return status;
}
