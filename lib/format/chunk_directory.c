/* Finds the offset, the stored size and the checksum of every chunk of an open file. Offsets and
 * sizes are read from the file's list of all chunks, /subtrees/chunk_directory. In a file without
 * this list, they are read from HDF5's chunk index of each array. The list and the indexes may be
 * long or remote, so they are read only when needed, and only once, under the file's lock. The
 * checksums in the list /chunk_checksums detect an intact chunk that belongs to another position or
 * another version of the file. Each of the two lists is a single chunk of any size, so the lists
 * have a separate encoder and decoder. The sum of stored sizes is checked against the size of the
 * file before chunks are decoded. Source: format-spec/subtrees.md and checksums.md. */
#include <stdio.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/endian.h"
#include "core/error.h"
#include "format/checksum_pages.h"
#include "format/chunk_directory.h"
#include "format/file_in.h"
#include "mesh/attributes.h"

/* Numbers that both lists use for arrays (format-spec/subtrees.md, section 3). */
enum {
    LEVEL_NUMBERS = 64,      /* numbers reserved for each level */
    MESH_NUMBERS = 4096,     /* first number of the root's arrays */
    TABLE_NUMBERS = 4112,    /* first number of the tables of subtrees */
    ATTRIBUTE_NUMBERS = 8191 /* number of the header of attributes; attribute arrays follow */
};
_Static_assert(EBPO_A_TYPES == 0 && EBPO_A_PLANES == 2 && EBPO_A_LEAF_REFS == 9 &&
                   EBPO_A_LEAF_INDEX == 12 && EBPO_A_LEAF_PLANES == 14 &&
                   EBPO_A_GRAY_COLOURS == 15 && EBPO_A_FACE_SOURCE - EBPO_A_VERTICES == 4 &&
                   EBPO_A_BORDER_POINTS - EBPO_A_VERTICES == 6 &&
                   EBPO_A_SURFACE_COLOURS - EBPO_A_VERTICES == 11 &&
                   EBPO_A_CHECKSUM_INDEX - EBPO_A_SUBTREE_INDEX == 6,
               "the format fixes these array numbers: append new rows of array_table.inc");

uint32_t ebpo_array_list_number(ebpo_array_id id, int level)
{
    if (id == EBPO_A_ATTRIBUTE)
        return ATTRIBUTE_NUMBERS + (uint32_t)level;
    return id < EBPO_LEVEL_ARRAYS      ? (uint32_t)level * LEVEL_NUMBERS + (uint32_t)id
           : id < EBPO_A_SUBTREE_INDEX ? MESH_NUMBERS + (uint32_t)(id - EBPO_LEVEL_ARRAYS)
                                       : TABLE_NUMBERS + (uint32_t)(id - EBPO_A_SUBTREE_INDEX);
}

/* Returns the array with this number in a list, or EBPO_ARRAYS for an unknown number. *level: level
 * of the array; for an array of attributes, its number in /attributes. */
static ebpo_array_id find_array(uint32_t number, int *level)
{
    *level = 0;
    if (number < MESH_NUMBERS) {
        *level = (int)(number / LEVEL_NUMBERS);
        return number % LEVEL_NUMBERS < EBPO_LEVEL_ARRAYS && *level < EBPO_LEVELS_MAX
                   ? (ebpo_array_id)(number % LEVEL_NUMBERS)
                   : EBPO_ARRAYS;
    }
    if (number >= ATTRIBUTE_NUMBERS && number - ATTRIBUTE_NUMBERS <= 2 * EBPO_ATTRIBUTE_ARRAYS) {
        *level = (int)(number - ATTRIBUTE_NUMBERS);
        return EBPO_A_ATTRIBUTE;
    }
    for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_A_ATTRIBUTE; id++)
        if (ebpo_array_list_number((ebpo_array_id)id, 0) == number)
            return ebpo_schema_is_list((ebpo_array_id)id) ? EBPO_ARRAYS : (ebpo_array_id)id;
    return EBPO_ARRAYS;
}

/* Maximum number of values in a list. Three copies of a list are in memory while it is encoded or
 * decoded. */
static const uint64_t LONGEST = PTRDIFF_MAX / 8 / 3;

/* Returns true if the pipeline shuffles the elements. In this case, the functions below shuffle the
 * list, because the coder's scratch memory is too small for a long list. */
static bool is_shuffled(ebpo_pipeline pipeline)
{
    return ebpo_pipeline_facts_of(pipeline)->compresses;
}

ebpo_status ebpo_long_chunk_encode(const uint64_t *values, uint64_t count, ebpo_pipeline pipeline,
                                   int codec_level, uint8_t **stored, size_t *bytes,
                                   ebpo_error *error)
{
    *stored = NULL;
    if (count > LONGEST)
        return ebpo_fail_memory(error, count * 8);
    size_t size = (size_t)count * 8;
    ebpo_chunk_coder *coder = ebpo_alloc_zero(1, sizeof *coder);
    uint8_t *raw = ebpo_alloc(size, 1), *shuffled = ebpo_alloc(size, 1);
    *stored = ebpo_alloc(ebpo_chunk_bound(size), 1);
    ebpo_status status = coder && raw && shuffled && *stored ? EBPO_OK : EBPO_E_MEMORY;
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        ebpo_store64(raw + 8 * i, values[i]);
    if (status == EBPO_OK && is_shuffled(pipeline))
        ebpo_shuffle(raw, size, 8, shuffled);
    if (status == EBPO_OK)
        status = ebpo_chunk_encode(coder, pipeline, codec_level, 1,
                                   is_shuffled(pipeline) ? shuffled : raw, size, *stored, bytes);
    if (coder)
        ebpo_chunk_coder_clear(coder);
    free(coder);
    free(raw);
    free(shuffled);
    if (status == EBPO_OK)
        return EBPO_OK;
    free(*stored);
    *stored = NULL;
    return ebpo_fail_memory(error, size * 3);
}

ebpo_status ebpo_long_chunk_decode(const uint8_t *stored, size_t stored_bytes,
                                   ebpo_pipeline pipeline, uint64_t count, uint64_t **values,
                                   const char **why, ebpo_error *error)
{
    *values = NULL;
    if (count > LONGEST)
        return ebpo_fail_memory(error, count * 8);
    size_t size = (size_t)count * 8;
    ebpo_chunk_coder *coder = ebpo_alloc_zero(1, sizeof *coder);
    uint8_t *raw = ebpo_alloc(size, 1), *shuffled = ebpo_alloc(size, 1);
    *values = ebpo_alloc(count, sizeof **values);
    ebpo_status status = coder && raw && shuffled && *values ? EBPO_OK : EBPO_E_MEMORY;
    if (status == EBPO_OK)
        status = ebpo_chunk_decode(coder, pipeline, 1, stored, stored_bytes, raw, size, why);
    if (status == EBPO_OK && is_shuffled(pipeline))
        ebpo_unshuffle(raw, size, 8, shuffled);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        (*values)[i] = ebpo_load64((is_shuffled(pipeline) ? shuffled : raw) + 8 * i);
    if (coder)
        ebpo_chunk_coder_clear(coder);
    free(coder);
    free(raw);
    free(shuffled);
    if (status == EBPO_OK)
        return EBPO_OK;
    free(*values);
    *values = NULL;
    return status == EBPO_E_MEMORY ? ebpo_fail_memory(error, size * 3) : status;
}

/* Reports an error in a list and returns EBPO_E_FORMAT. The message is `what` followed by `path`.
 */
static ebpo_status long_chunk_fail(const ebpo_file *file, ebpo_array_id list, const char *what,
                                   const char *path, ebpo_error *error)
{
    return ebpo_fail_at(error, EBPO_E_FORMAT, file->in.shown, file->root_array[list].path, -1,
                        "%s %s; get a fresh copy of the file", what, path);
}

ebpo_status ebpo_long_chunk_read(const ebpo_file *file, const ebpo_array_in *a, uint64_t **values,
                                 ebpo_error *error)
{
    ebpo_chunk_location chunk = a->chunks[0];
    const char *why = "";
    *values = NULL;
    if (a->shape.rows > file->info.file_bytes)
        return long_chunk_fail(file, a->id, "the list has more rows than", "the file has bytes",
                               error);
    uint8_t *stored = ebpo_alloc(chunk.bytes, 1);
    ebpo_status status = stored ? ebpo_input_read(&ebpo_reader_own(file)->in, chunk.address,
                                                  chunk.bytes, stored, error)
                                : ebpo_fail_memory(error, chunk.bytes);
    if (status == EBPO_OK) {
        status = ebpo_long_chunk_decode(stored, chunk.bytes, a->shape.pipeline, a->shape.rows,
                                        values, &why, error);
        if (status == EBPO_E_FORMAT)
            status = long_chunk_fail(file, a->id, "the chunk is damaged:", why, error);
    }
    free(stored);
    return status;
}

/* --- stored sizes --- */

/* Returns the stored bytes of a level. If `located` is false, counts only arrays with a single
 * chunk, because the sizes of other arrays are not known yet. */
static uint64_t level_bytes(const ebpo_file *file, int level, bool located)
{
    uint64_t bytes = 0;
    for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++) {
        const ebpo_array_in *a = &file->level_array[level][id];
        if (located || (a->present && ebpo_shape_chunks(&a->shape) == 1))
            bytes += a->stored_bytes;
    }
    return bytes;
}

uint64_t ebpo_reader_level_bytes(const ebpo_file *file, int level)
{
    return level_bytes(file, level, atomic_load(&file->located));
}

/* Returns the sizes of the arrays whose chunks are located. */
static ebpo_stored_sizes reader_sizes(const ebpo_file *file)
{
    ebpo_stored_sizes sizes = { .map_bytes = 0 };
    for (int level = 0; level < file->info.level_count; level++)
        sizes.level_bytes[level] = level_bytes(file, level, true);
    for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_ARRAYS; id++)
        *(uint64_t *)(void *)((char *)&sizes + ebpo_schema[id].bytes) +=
            file->root_array[id].stored_bytes;
    for (int i = 0; i < file->attributes.arrays; i++)
        sizes.attribute_bytes += file->attributes.array[i].stored_bytes;
    return sizes;
}

ebpo_status ebpo_stored_check(const ebpo_file *file, ebpo_error *error)
{
    uint64_t stored = 0;
    for (int level = 0; level < file->info.level_count; level++)
        stored += level_bytes(file, level, true);
    for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_ARRAYS; id++)
        stored += file->root_array[id].stored_bytes;
    for (int i = 0; i < file->attributes.arrays; i++)
        stored += file->attributes.array[i].stored_bytes;
    if (stored > file->end)
        return ebpo_fail_file(
            error, EBPO_E_FORMAT, file->in.shown,
            "the arrays' chunks have more bytes than the file; get a fresh copy of the file");
    return EBPO_OK;
}

static double decoded_bytes(const ebpo_array_in *a)
{
    return a->present ? (double)a->shape.rows * (double)ebpo_shape_row_bytes(&a->shape) : 0;
}

ebpo_status ebpo_stored_check_expansion(const ebpo_file *file, uint64_t most, ebpo_error *error)
{
    double bytes = 0, file_bytes = (double)file->info.file_bytes;
    for (int level = 0; level < file->info.level_count; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
            bytes += decoded_bytes(&file->level_array[level][id]);
    for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_ARRAYS; id++)
        bytes += decoded_bytes(&file->root_array[id]);
    for (int i = 0; i < file->attributes.arrays; i++)
        bytes += decoded_bytes(&file->attributes.array[i]);
    most = most ? most : EBPO_EXPANSION_MAX;
    if (most == UINT64_MAX || bytes <= (double)EBPO_EXPANSION_FREE ||
        bytes <= (double)most * file_bytes)
        return EBPO_OK;
    return ebpo_fail_file(
        error, EBPO_E_LIMIT, file->in.shown,
        "the decoded arrays take %.0f MB, %.0f times the size of the file (limit: %llu times); the "
        "file may be designed to exhaust memory; if you trust the file, use --max-expansion %.0f",
        bytes / 1e6, bytes / file_bytes, (unsigned long long)most, bytes / file_bytes + 1);
}

/* Finds the rows of one array in the list of chunk checksums, and stores the first of these rows in
 * a->first_checksum. Searches from *row on, skips rows of unknown arrays, and moves *row past the
 * array's rows. */
static ebpo_status find_rows(const ebpo_file *file, ebpo_array_in *a, const uint64_t *list,
                             uint64_t rows, uint64_t *row, ebpo_error *error)
{
    uint32_t number = ebpo_array_list_number(a->id, a->level);
    uint64_t chunks = ebpo_shape_chunks(&a->shape);
    while (*row < rows && ebpo_list_row_number(list[*row]) < number)
        ++*row;
    a->first_checksum = *row;
    while (*row < rows && ebpo_list_row_number(list[*row]) == number)
        ++*row;
    return *row - a->first_checksum == chunks
               ? EBPO_OK
               : long_chunk_fail(file, file->checksum_list,
                                 "the list has more or fewer chunks than", a->path, error);
}

/* Finds the rows of all arrays in the list of chunk checksums, which is sorted by array number. If
 * the file has pages of checksums, the chunks of some arrays are there and not in the list. */
static ebpo_status find_all(ebpo_file *file, const uint64_t *list, uint64_t rows, ebpo_error *error)
{
    const ebpo_array_in *pages = &file->root_array[EBPO_A_CHECKSUM_PAGES];
    ebpo_status status = EBPO_OK;
    uint64_t row = 0, in_pages = 0;
    for (uint64_t i = 1; i < rows; i++)
        if (ebpo_list_row_number(list[i]) < ebpo_list_row_number(list[i - 1]))
            return long_chunk_fail(file, file->checksum_list, "the list is not in the order of",
                                   "the arrays' numbers", error);
    for (int i = 0; i < ebpo_all_arrays(file) && status == EBPO_OK; i++) {
        ebpo_array_in *a = ebpo_array_number(file, i);
        if (!a->present || ebpo_schema_is_list(a->id))
            continue;
        if (pages->present && ebpo_is_paged(&file->info, a->id, a->level, &a->shape))
            in_pages += ebpo_shape_chunks(&a->shape);
        else
            status = find_rows(file, a, list, rows, &row, error);
    }
    if (status == EBPO_OK && pages->present &&
        (in_pages != pages->shape.rows || in_pages > UINT32_MAX))
        return long_chunk_fail(file, EBPO_A_CHECKSUM_PAGES, "the array has more or fewer rows than",
                               "the chunks of subtrees", error);
    return status;
}

static ebpo_status read_checksums(ebpo_file *file, ebpo_error *error)
{
    const ebpo_array_in *a = &file->root_array[file->checksum_list];
    uint64_t *list;
    ebpo_status status = ebpo_long_chunk_read(file, a, &list, error);
    if (status == EBPO_OK)
        status = find_all(file, list, a->shape.rows, error);
    uint32_t *checksums = status == EBPO_OK ? ebpo_alloc(a->shape.rows, sizeof *checksums) : NULL;
    if (status == EBPO_OK && !checksums)
        status = ebpo_fail_memory(error, a->shape.rows * sizeof *checksums);
    for (uint64_t i = 0; i < a->shape.rows && status == EBPO_OK; i++)
        checksums[i] = (uint32_t)list[i];
    free(list);
    if (status == EBPO_OK)
        file->checksums = checksums;
    return status;
}

ebpo_status ebpo_chunk_checksums_read(const ebpo_file *file, ebpo_error *error)
{
    ebpo_file *mutable_file = ebpo_reader_own(file);
    ebpo_status status = EBPO_OK;
    if (!file->has_checksums || atomic_load(&file->checksums_read))
        return EBPO_OK;
    pthread_mutex_lock(&mutable_file->lock);
    if (!atomic_load(&mutable_file->checksums_read)) {
        status = read_checksums(mutable_file, error);
        if (status == EBPO_OK)
            atomic_store(&mutable_file->checksums_read, true);
    }
    pthread_mutex_unlock(&mutable_file->lock);
    return status;
}

/* --- chunk offsets from HDF5's indexes --- */

static ebpo_status locate_array(ebpo_file *file, ebpo_head *head, ebpo_array_in *a,
                                ebpo_error *error)
{
    ebpo_shape shape;
    ebpo_chunk_location *chunks;
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
        ebpo_input_prefetch(&file->in, &index, 1);
    ebpo_status status = ebpo_head_open(&head, &file->in, error);
    if (status == EBPO_OK)
        ebpo_head_hint_index(&head, index);
    for (int i = 0; i < ebpo_all_arrays(file) && status == EBPO_OK; i++)
        status = locate_array(file, &head, ebpo_array_number(file, i), error);
    status = ebpo_head_close(&head, status, error);
    return status == EBPO_OK ? ebpo_stored_check(file, error) : status;
}

/* --- chunk offsets from the list of all chunks (format-spec/subtrees.md) --- */

/* State of list_chunks: for each array, the number of its chunks in the rows read so far. */
typedef struct listing {
    ebpo_file *file;
    uint64_t of_level[EBPO_LEVELS_MAX][EBPO_LEVEL_ARRAYS], of_root[EBPO_ARRAYS];
    uint64_t of_attribute[1 + 2 * EBPO_ATTRIBUTE_ARRAYS];
} listing;

static uint64_t *listed_count(listing *l, ebpo_array_id id, int level)
{
    return id < EBPO_LEVEL_ARRAYS   ? &l->of_level[level][id]
           : id == EBPO_A_ATTRIBUTE ? &l->of_attribute[level]
                                    : &l->of_root[id];
}

static ebpo_status list_fails(const ebpo_file *file, const char *what, const char *path,
                              ebpo_error *error)
{
    return long_chunk_fail(file, EBPO_A_CHUNK_DIRECTORY, what, path, error);
}

/* Stores the location of the next chunk of array `number`. For an array with a single chunk,
 * compares the location with that in the array's header. */
static ebpo_status list_chunk(listing *l, uint32_t number, ebpo_chunk_location chunk,
                              ebpo_error *error)
{
    int level;
    ebpo_array_id id = find_array(number, &level);
    if (id == EBPO_ARRAYS || (id == EBPO_A_ATTRIBUTE && level >= l->file->attributes.arrays))
        return EBPO_OK; /* bytes between chunks, or an array that is not known or not listed */
    ebpo_array_in *a = id < EBPO_LEVEL_ARRAYS   ? &l->file->level_array[level][id]
                       : id == EBPO_A_ATTRIBUTE ? &l->file->attributes.array[level]
                                                : &l->file->root_array[id];
    uint64_t *listed = listed_count(l, id, level);
    if (!a->present)
        return EBPO_OK; /* the file has no such array, so these rows are ignored */
    if (*listed == ebpo_shape_chunks(&a->shape))
        return list_fails(l->file, "the list has more chunks than", a->path, error);
    if (chunk.bytes == 0 || chunk.bytes > ebpo_reader_chunk_bound(a))
        return list_fails(l->file, "the list has an impossible chunk size for", a->path, error);
    if (ebpo_shape_chunks(&a->shape) == 1 &&
        (a->chunks[0].address != chunk.address || a->chunks[0].bytes != chunk.bytes))
        return list_fails(l->file, "the list contradicts the header of", a->path, error);
    if (ebpo_shape_chunks(&a->shape) > 1) {
        a->chunks[*listed] = chunk;
        a->stored_bytes += chunk.bytes;
    }
    ++*listed;
    return EBPO_OK;
}

/* Adds the array's number of chunks to *chunks, and checks that the list has at least *chunks rows.
 * Then allocates the array's table of chunks. */
static ebpo_status begin_array(ebpo_file *file, ebpo_array_in *a, uint64_t *chunks,
                               ebpo_error *error)
{
    if (!a->present || a->chunks)
        return EBPO_OK;
    *chunks += ebpo_shape_chunks(&a->shape);
    if (*chunks > file->root_array[EBPO_A_CHUNK_DIRECTORY].shape.rows)
        return list_fails(file, "the list has fewer chunks than", a->path, error);
    a->stored_bytes = 0;
    a->chunks = ebpo_alloc_zero(ebpo_shape_chunks(&a->shape), sizeof *a->chunks);
    return a->chunks ? EBPO_OK : ebpo_fail_memory(error, *chunks * sizeof *a->chunks);
}

/* Checks that the list had a row for each chunk of the array. */
static ebpo_status end_array(listing *l, const ebpo_array_in *a, ebpo_error *error)
{
    uint64_t listed = *listed_count(l, a->id, a->level);
    return !a->present || ebpo_schema_is_list(a->id) || listed == ebpo_shape_chunks(&a->shape)
               ? EBPO_OK
               : list_fails(l->file, "the list has fewer chunks than", a->path, error);
}

static ebpo_status list_chunks(ebpo_file *file, const uint64_t *rows, uint64_t count,
                               ebpo_error *error)
{
    listing *l = ebpo_alloc_zero(1, sizeof *l);
    uint64_t offset = file->info.head_bytes, chunks = 0;
    ebpo_status status = l ? EBPO_OK : ebpo_fail_memory(error, sizeof *l);
    for (int i = 0; i < ebpo_all_arrays(file) && status == EBPO_OK; i++)
        status = begin_array(file, ebpo_array_number(file, i), &chunks, error);
    if (l)
        l->file = file;
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        if (ebpo_list_row_value(rows[i]) > file->end - offset)
            status =
                list_fails(file, "a chunk is beyond the end of the file in", "the list", error);
        else
            status =
                list_chunk(l, ebpo_list_row_number(rows[i]),
                           (ebpo_chunk_location){ offset, ebpo_list_row_value(rows[i]), 0 }, error);
        offset += ebpo_list_row_value(rows[i]);
    }
    for (int i = 0; i < ebpo_all_arrays(file) && status == EBPO_OK; i++)
        status = end_array(l, ebpo_array_number(file, i), error);
    free(l);
    return status;
}

/* Discards the chunk offsets that were read before an error in the list. */
static void discard_offsets(ebpo_file *file)
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
    const ebpo_array_in *a = &file->root_array[EBPO_A_CHUNK_DIRECTORY];
    uint64_t *rows;
    ebpo_status status = ebpo_long_chunk_read(file, a, &rows, error);
    if (status == EBPO_OK)
        status = list_chunks(file, rows, a->shape.rows, error);
    free(rows);
    if (status != EBPO_OK)
        discard_offsets(file);
    return status == EBPO_OK ? ebpo_stored_check(file, error) : status;
}

/* --- chunk offsets from the list or from the indexes --- */

static ebpo_status locate_all(ebpo_file *file, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    pthread_mutex_lock(&file->lock);
    if (!atomic_load(&file->located)) {
        status = file->has_directory ? locate_by_list(file, error) : locate_by_index(file, error);
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
        sizes = reader_sizes(file);
    if (out)
        EBPO_GIVE(ebpo_stored_sizes, out, &sizes);
    return status;
}

ebpo_status ebpo_reader_locate(const ebpo_file *file, const ebpo_array_in *array, ebpo_error *error)
{
    /* The offset of a single chunk is in the array's header, which is read when a file is opened.
     */
    return ebpo_shape_chunks(&array->shape) == 1 ? EBPO_OK : ebpo_file_locate(file, NULL, error);
}

/* --- information about each array --- */

/* Returns the n-th array of those that the file has, in the order of the format. n begins at 0.
 * Returns NULL if the file has at most n arrays. */
static const ebpo_array_in *find_present_array(const ebpo_file *file, unsigned n)
{
    for (int level = 0; level < file->info.level_count; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
            if (file->level_array[level][id].present && n-- == 0)
                return &file->level_array[level][id];
    for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_ARRAYS; id++)
        if (file->root_array[id].present && n-- == 0)
            return &file->root_array[id];
    for (int i = 0; i < file->attributes.arrays; i++)
        if (file->attributes.array[i].present && n-- == 0)
            return &file->attributes.array[i];
    return NULL;
}

/* The size of an array with several chunks is unknown while another thread may be locating its
 * chunks. */
uint64_t ebpo_reader_stored_bytes(const ebpo_file *file, const ebpo_array_in *array)
{
    bool known =
        !array->present || ebpo_shape_chunks(&array->shape) == 1 || atomic_load(&file->located);
    return known ? array->stored_bytes : 0;
}

bool ebpo_file_array(const ebpo_file *file, unsigned n, ebpo_array_facts *out)
{
    const ebpo_array_in *array = find_present_array(file, n);
    if (!array)
        return false;
    ebpo_array_facts facts = { .rows = array->shape.rows,
                               .columns = array->shape.cols ? array->shape.cols : 1,
                               .element_bytes = array->shape.element_size,
                               .is_signed = array->shape.is_signed,
                               .stored_bytes = ebpo_reader_stored_bytes(file, array),
                               .coding =
                                   array->coding ? array->coding : ebpo_schema[array->id].coding,
                               .about = ebpo_schema[array->id].about };
    if (array->id == EBPO_A_ATTRIBUTE)
        facts.about =
            ebpo_attribute_about(array->level,
                                 array->level % 2 &&
                                     file->attributes.head[(array->level - 1) / 2].different);
    snprintf(facts.path, sizeof facts.path, "%s", array->path);
    return EBPO_GIVE(ebpo_array_facts, out, &facts) == EBPO_OK;
}
