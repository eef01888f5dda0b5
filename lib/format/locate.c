/* Where chunks lie: what the opening left for later, as it may be far away or long. */
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/sized.h"
#include "format/all_arrays.h"
#include "format/long_chunk.h"
#include "format/places.h"
#include "format/stored_sizes.h"

/* --- by HDF5's index --- */

static ebpo_status locate_array(ebpo_file *file, ebpo_head *head, ebpo_array_in *a,
                                ebpo_error *error)
{
    ebpo_shape shape;
    ebpo_chunk_place *chunks;
    uint64_t stored;
    if (!a->present || a->chunks)
        return EBPO_OK;
    ebpo_status status =
        ebpo_head_read_array(head, a->path, UINT64_MAX, ebpo_reader_rows_of_chunk(file, a->id),
                             &shape, NULL, &chunks, &stored, error);
    if (status != EBPO_OK)
        return status;
    if (shape.rows != a->shape.rows || shape.cols != a->shape.cols ||
        shape.element_size != a->shape.element_size || shape.pipeline != a->shape.pipeline) {
        free(chunks);
        return ebpo_fail_at(error, EBPO_E_IO, file->in.shown, a->path, -1,
                            "the file has changed while it was open; open it again");
    }
    a->chunks = chunks;
    a->stored_bytes = stored;
    return EBPO_OK;
}

static ebpo_status locate_by_index(ebpo_file *file, ebpo_error *error)
{
    ebpo_head head = EBPO_HEAD_INIT;
    ebpo_range index = { file->info.chunk_index_offset, file->info.chunk_index_bytes };
    if (index.size && index.offset + index.size > file->in.source.prefetched)
        ebpo_input_expect(&file->in, &index, 1);
    ebpo_status status = ebpo_head_open(&head, &file->in, error);
    if (status == EBPO_OK)
        ebpo_head_expect_index(&head, index);
    for (int i = 0; i < ebpo_all_arrays(file) && status == EBPO_OK; i++)
        status = locate_array(file, &head, ebpo_array_number(file, i), error);
    status = ebpo_head_close(&head, status, error);
    return status == EBPO_OK ? ebpo_stored_check(file, error) : status;
}

/* --- by the list of all chunks (format-spec/README.md, section 9) --- */

/* Chunks seen so far of each array. */
typedef struct listing {
    ebpo_file *file;
    uint64_t seen[EBPO_LEVELS_MAX][EBPO_LEVEL_ARRAYS], seen_root[EBPO_ARRAYS];
    uint64_t seen_attribute[1 + 2 * EBPO_ATTRIBUTE_ARRAYS];
} listing;

static uint64_t *seen_of(listing *l, ebpo_array_id id, int level)
{
    return id < EBPO_LEVEL_ARRAYS   ? &l->seen[level][id]
           : id == EBPO_A_ATTRIBUTE ? &l->seen_attribute[level]
                                    : &l->seen_root[id];
}

static ebpo_status list_fails(const ebpo_file *file, const char *what, const char *path,
                              ebpo_error *error)
{
    return ebpo_long_chunk_fail(file, EBPO_A_PLACES, what, path, error);
}

static ebpo_status list_chunk(listing *l, uint32_t number, ebpo_chunk_place chunk,
                              ebpo_error *error)
{
    int level;
    ebpo_array_id id = ebpo_place_array(number, &level);
    if (id == EBPO_ARRAYS || (id == EBPO_A_ATTRIBUTE && level >= l->file->attributes.arrays))
        return EBPO_OK; /* a gap, or of a part that is not known, or not listed */
    ebpo_array_in *a = id < EBPO_LEVEL_ARRAYS   ? &l->file->level_array[level][id]
                       : id == EBPO_A_ATTRIBUTE ? &l->file->attributes.array[level]
                                                : &l->file->root_array[id];
    uint64_t *seen = seen_of(l, id, level);
    if (!a->present || *seen == ebpo_shape_chunks(&a->shape))
        return list_fails(l->file, "the list has more chunks than", a->path, error);
    if (chunk.bytes == 0 || chunk.bytes > ebpo_reader_chunk_bound(a))
        return list_fails(l->file, "the list has a chunk of a size that it cannot have of", a->path,
                          error);
    if (ebpo_shape_chunks(&a->shape) == 1 &&
        (a->chunks[0].address != chunk.address || a->chunks[0].bytes != chunk.bytes))
        return list_fails(l->file, "the list contradicts the header of", a->path, error);
    if (ebpo_shape_chunks(&a->shape) > 1) {
        a->chunks[*seen] = chunk;
        a->stored_bytes += chunk.bytes;
    }
    ++*seen;
    return EBPO_OK;
}

/* Tables for chunks; before that, whether the file can hold them. */
static ebpo_status begin_array(ebpo_file *file, ebpo_array_in *a, uint64_t *chunks,
                               ebpo_error *error)
{
    if (!a->present || a->chunks)
        return EBPO_OK;
    *chunks += ebpo_shape_chunks(&a->shape);
    if (*chunks > file->root_array[EBPO_A_PLACES].shape.rows)
        return list_fails(file, "the list has fewer chunks than", a->path, error);
    a->stored_bytes = 0;
    a->chunks = ebpo_alloc_zero(ebpo_shape_chunks(&a->shape), sizeof *a->chunks);
    return a->chunks ? EBPO_OK : ebpo_fail_memory(error, *chunks * sizeof *a->chunks);
}

static ebpo_status end_array(listing *l, const ebpo_array_in *a, ebpo_error *error)
{
    uint64_t seen = *seen_of(l, a->id, a->level);
    return !a->present || ebpo_schema_is_list(a->id) || seen == ebpo_shape_chunks(&a->shape)
               ? EBPO_OK
               : list_fails(l->file, "the list has fewer chunks than", a->path, error);
}

static ebpo_status list_chunks(ebpo_file *file, const uint64_t *places, uint64_t count,
                               ebpo_error *error)
{
    listing *l = ebpo_alloc_zero(1, sizeof *l);
    uint64_t at = file->info.head_bytes, chunks = 0;
    ebpo_status status = l ? EBPO_OK : ebpo_fail_memory(error, sizeof *l);
    for (int i = 0; i < ebpo_all_arrays(file) && status == EBPO_OK; i++)
        status = begin_array(file, ebpo_array_number(file, i), &chunks, error);
    if (l)
        l->file = file;
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        if (ebpo_place_bytes_of(places[i]) > file->info.file_bytes - at)
            status =
                list_fails(file, "a chunk lies beyond the end of the file in", "the list", error);
        else
            status = list_chunk(l, ebpo_place_number_of(places[i]),
                                (ebpo_chunk_place){ at, ebpo_place_bytes_of(places[i]) }, error);
        at += ebpo_place_bytes_of(places[i]);
    }
    for (int i = 0; i < ebpo_all_arrays(file) && status == EBPO_OK; i++)
        status = end_array(l, ebpo_array_number(file, i), error);
    free(l);
    return status;
}

/* A list half read is none. */
static void forget_places(ebpo_file *file)
{
    for (int i = 0; i < ebpo_all_arrays(file); i++) {
        ebpo_array_in *a = ebpo_array_number(file, i);
        if (a->present && ebpo_shape_chunks(&a->shape) > 1) {
            free(a->chunks);
            a->chunks = NULL;
        }
    }
}

static ebpo_status locate_by_list(ebpo_file *file, ebpo_error *error)
{
    const ebpo_array_in *a = &file->root_array[EBPO_A_PLACES];
    uint64_t *places;
    ebpo_status status = ebpo_long_chunk_read(file, a, &places, error);
    if (status == EBPO_OK)
        status = list_chunks(file, places, a->shape.rows, error);
    free(places);
    if (status != EBPO_OK)
        forget_places(file);
    return status == EBPO_OK ? ebpo_stored_check(file, error) : status;
}

/* --- either way --- */

static ebpo_status locate_all(ebpo_file *file, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    pthread_mutex_lock(&file->lock);
    if (!atomic_load(&file->located)) {
        status = file->has_places ? locate_by_list(file, error) : locate_by_index(file, error);
        if (status == EBPO_OK)
            atomic_store(&file->located, true);
    }
    pthread_mutex_unlock(&file->lock);
    return status;
}

ebpo_status ebpo_file_locate(const ebpo_file *file, ebpo_stored_sizes *out, ebpo_error *error)
{
    ebpo_stored_sizes sizes = EBPO_STORED_SIZES_INIT;
    ebpo_status status = out ? EBPO_CHECK_SIZED(ebpo_stored_sizes, out, error) : EBPO_OK;
    if (status == EBPO_OK && !atomic_load(&file->located))
        status = locate_all(ebpo_reader_own(file), error);
    if (status == EBPO_OK && out)
        sizes = ebpo_reader_sizes(file);
    if (out)
        EBPO_GIVE(ebpo_stored_sizes, out, &sizes);
    return status;
}

ebpo_status ebpo_reader_locate(const ebpo_file *file, const ebpo_array_in *array, ebpo_error *error)
{
    /* A single chunk's place stands in the array's header: known since the opening. */
    return ebpo_shape_chunks(&array->shape) == 1 ? EBPO_OK : ebpo_file_locate(file, NULL, error);
}
