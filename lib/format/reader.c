#include "format/reader.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/arrays.h"
#include "hdf5_read/coding.h"
#include "hdf5_read/face_gates.h"
#include "format/chunk_directory.h"

enum {
    RUN_BYTES = 1 << 20, /* of one read, at most */
    RUN_CHUNKS = 64      /* that a thread takes on at a time */
};

typedef struct job {
    const ebpo_file *file;
    const ebpo_array_in *array;
    ebpo_rows_fn take;
    void *context;
    ebpo_workspace *workspace;
    ebpo_idle_reader **reader; /* for each worker, taken when first needed */
} job;

/* Bytes [address, address + bytes) of the file to reader->stored, with room for at least
 * `capacity`. */
static ebpo_status fetch_stored(const ebpo_file *file, ebpo_chunk_reader *reader, uint64_t address,
                         size_t bytes, size_t capacity, ebpo_error *error)
{
    if (capacity < bytes)
        capacity = bytes;
    if (reader->capacity < capacity) {
        free(reader->stored);
        reader->stored = ebpo_alloc(capacity, 1);
        reader->capacity = reader->stored ? capacity : 0;
    }
    if (!reader->stored)
        return ebpo_fail_memory(error, capacity);
    return ebpo_input_read(&ebpo_reader_own(file)->in, address, bytes, reader->stored, error);
}

static ebpo_status chunk_damaged(const ebpo_file *file, const ebpo_array_in *array, uint64_t chunk,
                           const char *why, ebpo_error *error)
{
    return ebpo_fail_at(error, EBPO_E_FORMAT, file->in.shown, array->path, -1,
                        "chunk %" PRIu64 " is damaged: %s; get a fresh copy of the file", chunk,
                        why);
}

/* As HDF5 would give it. */
static ebpo_status unpack_stored(const ebpo_file *file, const ebpo_array_in *array, uint64_t chunk,
                          ebpo_chunk_coder *coder, const uint8_t *stored, uint8_t *raw,
                          ebpo_error *error)
{
    ebpo_shape shape = ebpo_stored_shape(&array->shape, array->gates);
    size_t bytes = shape.chunk_rows * ebpo_shape_row_bytes(&shape);
    const char *why;
    if (!ebpo_chunk_fits(file, array, chunk, stored, array->chunks[chunk].bytes))
        return chunk_damaged(file, array, chunk, "it is not the one that was written there", error);
    ebpo_status status = ebpo_chunk_decode(coder, shape.pipeline, shape.element_size, stored,
                                           array->chunks[chunk].bytes, raw, bytes, &why);
    if (status == EBPO_E_MEMORY)
        return ebpo_fail_memory(error, bytes);
    return status == EBPO_OK ? EBPO_OK : chunk_damaged(file, array, chunk, why, error);
}

/* From gates to codes of high-water, with filling. Single bytes are not shuffled: the coder's room
 * for that is free. */
static ebpo_status unpack_gates(const ebpo_file *file, const ebpo_array_in *array, uint64_t chunk,
                                ebpo_chunk_coder *coder, const uint8_t *stored, uint8_t *codes,
                                ebpo_error *error)
{
    uint64_t left = array->shape.rows - chunk * array->shape.chunk_rows,
             rows = left < array->shape.chunk_rows ? left : array->shape.chunk_rows;
    size_t row = ebpo_shape_row_bytes(&array->shape);
    ebpo_status status = unpack_stored(file, array, chunk, coder, stored, coder->scratch, error);
    if (status != EBPO_OK)
        return status;
    memset(codes + rows * row, 0, (array->shape.chunk_rows - rows) * row);
    return ebpo_gates_decode(coder->scratch, (uint32_t)rows, codes)
               ? EBPO_OK
               : chunk_damaged(file, array, chunk, "its streams are those of no faces", error);
}

static ebpo_status decode_stored(const ebpo_file *file, const ebpo_array_in *array, uint64_t chunk,
                          ebpo_chunk_coder *coder, const uint8_t *stored, uint8_t *raw,
                          ebpo_error *error)
{
    return array->gates ? unpack_gates(file, array, chunk, coder, stored, raw, error)
                        : unpack_stored(file, array, chunk, coder, stored, raw, error);
}

static ebpo_status fetch_chunk(const ebpo_file *file, const ebpo_array_in *array, uint64_t chunk,
                               ebpo_chunk_reader *reader, ebpo_error *error)
{
    ebpo_status status = ebpo_reader_locate(file, array, error);
    if (status == EBPO_OK)
        status = ebpo_chunk_sums_read(file, error);
    if (status != EBPO_OK)
        return status;
    const ebpo_chunk_place *at = &array->chunks[chunk];
    return fetch_stored(file, reader, at->address, at->bytes, ebpo_reader_chunk_bound(array), error);
}

ebpo_status ebpo_reader_chunk(const ebpo_file *file, const ebpo_array_in *array, uint64_t chunk,
                              ebpo_chunk_reader *reader, uint8_t *raw, ebpo_error *error)
{
    ebpo_status status = fetch_chunk(file, array, chunk, reader, error);
    return status == EBPO_OK
               ? decode_stored(file, array, chunk, &reader->coder, reader->stored, raw, error)
               : status;
}

ebpo_status ebpo_reader_gates(const ebpo_file *file, uint64_t chunk, ebpo_chunk_reader *reader,
                              uint8_t *raw, ebpo_error *error)
{
    const ebpo_array_in *array = ebpo_reader_array(file, EBPO_A_FACES, 0);
    ebpo_status status = fetch_chunk(file, array, chunk, reader, error);
    return status == EBPO_OK
               ? unpack_stored(file, array, chunk, &reader->coder, reader->stored, raw, error)
               : status;
}

/* End of the run of chunks from `begin` on (at most to `end`) that lie one behind the other in the
 * file, up to RUN_BYTES: one read brings them all. */
static uint64_t find_run(const ebpo_array_in *array, uint64_t begin, uint64_t end, size_t *bytes)
{
    const ebpo_chunk_place *c = array->chunks;
    uint64_t next = begin + 1;
    *bytes = c[begin].bytes;
    while (next < end && c[next].address == c[begin].address + *bytes &&
           *bytes + c[next].bytes <= RUN_BYTES)
        *bytes += c[next++].bytes;
    return next;
}

static ebpo_status read_run(job *j, ebpo_idle_reader *s, uint64_t begin, uint64_t end, size_t bytes,
                            ebpo_error *error)
{
    const ebpo_array_in *a = j->array;
    ebpo_status status = fetch_stored(j->file, &s->reader, a->chunks[begin].address, bytes, 0, error);
    size_t at = 0;
    for (uint64_t chunk = begin; chunk < end && status == EBPO_OK; chunk++) {
        uint64_t row = chunk * a->shape.chunk_rows, left = a->shape.rows - row;
        status = decode_stored(j->file, a, chunk, &s->reader.coder, s->reader.stored + at, s->raw, error);
        if (status == EBPO_OK)
            status =
                j->take(j->context, a, chunk, row,
                        left < a->shape.chunk_rows ? left : a->shape.chunk_rows, s->raw, error);
        at += a->chunks[chunk].bytes;
    }
    return status;
}

static ebpo_status read_chunks(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    job *j = context;
    if (!j->reader[worker])
        j->reader[worker] = ebpo_idle_readers_take(&ebpo_reader_own(j->file)->idle);
    if (!j->reader[worker])
        return ebpo_fail_memory(error, sizeof **j->reader);
    ebpo_status status = EBPO_OK;
    while (begin < end && status == EBPO_OK) {
        size_t bytes;
        uint64_t run = find_run(j->array, begin, end, &bytes);
        status = read_run(j, j->reader[worker], begin, run, bytes, error);
        ebpo_release_pages(j->workspace);
        begin = run;
    }
    return status;
}

ebpo_status ebpo_reader_rows(const ebpo_file *file, const ebpo_array_in *array,
                             const ebpo_read_options *options, ebpo_rows_fn take, void *context,
                             ebpo_error *error)
{
    uint64_t chunks = ebpo_shape_chunks(&array->shape);
    ebpo_status status = ebpo_reader_locate(file, array, error);
    if (status == EBPO_OK)
        status = ebpo_chunk_sums_read(file, error);
    if (status != EBPO_OK)
        return status;
    unsigned threads = chunks > 2 ? ebpo_thread_count(options->threads) : 1;
    job j = { .file = file,
              .array = array,
              .take = take,
              .context = context,
              .workspace = options->workspace };
    j.reader = ebpo_alloc_zero(threads, sizeof *j.reader);
    if (!j.reader)
        return ebpo_fail_memory(error, threads * sizeof *j.reader);
    /* each thread gets a few turns, of runs as long as that allows */
    uint64_t grain = chunks / (threads * 4) + 1;
    if (grain > RUN_CHUNKS)
        grain = RUN_CHUNKS;
    status = ebpo_parallel_for(threads, NULL, chunks, grain, read_chunks, &j, NULL, "read", error);
    for (unsigned i = 0; i < threads; i++)
        ebpo_idle_readers_give(&ebpo_reader_own(file)->idle, j.reader[i]);
    free(j.reader);
    return status;
}

typedef struct target {
    uint8_t *values;
    size_t size;
} target;

static ebpo_status take_integers(void *context, const ebpo_array_in *array, uint64_t chunk,
                                 uint64_t row, uint64_t rows, const uint8_t *bytes,
                                 ebpo_error *error)
{
    (void)chunk;
    (void)error;
    const target *t = context;
    uint64_t cols = array->shape.cols ? array->shape.cols : 1;
    ebpo_integers_decode(bytes, array->shape.element_size, array->shape.is_signed, rows * cols,
                         t->values + row * cols * t->size, t->size);
    return EBPO_OK;
}

ebpo_status ebpo_reader_integers(const ebpo_file *file, const ebpo_array_in *array,
                                 const ebpo_read_options *options, void *values, size_t size,
                                 ebpo_error *error)
{
    target t = { values, size };
    return ebpo_reader_rows(file, array, options, take_integers, &t, error);
}

ebpo_status ebpo_reader_make(const ebpo_file *file, ebpo_array_id id, int level,
                             const ebpo_read_options *options, size_t size, void *values_out,
                             ebpo_error *error)
{
    const ebpo_array_in *array = ebpo_reader_array(file, id, level);
    void *values = NULL;
    ebpo_status status = EBPO_OK;
    if (array->present) {
        uint64_t cols = array->shape.cols ? array->shape.cols : 1;
        values = ebpo_array_alloc(options->workspace, array->shape.rows, size * cols);
        status = values ? ebpo_reader_integers(file, array, options, values, size, error)
                        : ebpo_workspace_fail(options->workspace, array->shape.rows * size * cols,
                                              error);
    }
    if (status != EBPO_OK) {
        ebpo_array_free(options->workspace, values);
        values = NULL;
    }
    memcpy(values_out, &values, sizeof values);
    return status;
}
