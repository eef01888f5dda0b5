#include "container/reader.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/parallel.h"
#include "codec/coding.h"

typedef struct scratch {
    ebpo_chunk_reader reader;
    uint8_t raw[EBPO_CHUNK_BYTES_MAX];
} scratch;

typedef struct job {
    ebpo_file *file;
    const ebpo_array_in *array;
    ebpo_rows_fn take;
    void *context;
    scratch **scratch; /* for each worker, made when first needed */
} job;

void ebpo_chunk_reader_clear(ebpo_chunk_reader *reader)
{
    ebpo_chunk_coder_clear(&reader->coder);
    free(reader->stored);
    reader->stored = NULL;
    reader->capacity = 0;
}

ebpo_status ebpo_reader_chunk(ebpo_file *file, const ebpo_array_in *array, uint64_t chunk, ebpo_chunk_reader *reader, uint8_t *raw_out,
                              ebpo_error *error)
{
    const ebpo_h5_shape *shape = &array->shape;
    size_t stored = 0, raw = shape->chunk_rows * ebpo_h5_row_bytes(shape), bound = ebpo_chunk_bound(raw);
    if (reader->capacity < bound) {
        free(reader->stored);
        reader->stored = ebpo_alloc(bound, 1);
        reader->capacity = reader->stored ? bound : 0;
    }
    if (!reader->stored)
        return ebpo_fail_memory(error, bound);
    ebpo_status status = ebpo_h5_get_chunk(&file->in, array->path, array->handle, shape, chunk, reader->stored, bound, &stored, error);
    if (status != EBPO_OK)
        return status;
    const char *why;
    status = ebpo_chunk_decode(&reader->coder, shape->pipeline, shape->element_size, reader->stored, stored, raw_out, raw, &why);
    if (status == EBPO_E_MEMORY)
        return ebpo_fail_memory(error, raw);
    if (status != EBPO_OK)
        return ebpo_fail(error, status, "%s: %s: chunk %" PRIu64 " is damaged: %s; get a fresh copy of the file", file->in.shown,
                         array->path, chunk, why);
    return EBPO_OK;
}

static ebpo_status read_chunk(job *j, scratch *s, uint64_t chunk, ebpo_error *error)
{
    const ebpo_array_in *a = j->array;
    ebpo_status status = ebpo_reader_chunk(j->file, a, chunk, &s->reader, s->raw, error);
    if (status != EBPO_OK)
        return status;
    uint64_t row = chunk * a->shape.chunk_rows, left = a->shape.rows - row;
    return j->take(j->context, a, chunk, row, left < a->shape.chunk_rows ? left : a->shape.chunk_rows, s->raw, error);
}

static ebpo_status read_chunks(void *context, uint64_t begin, uint64_t end, unsigned worker, ebpo_error *error)
{
    job *j = context;
    if (!j->scratch[worker])
        j->scratch[worker] = ebpo_alloc_zero(1, sizeof(scratch));
    if (!j->scratch[worker])
        return ebpo_fail_memory(error, sizeof(scratch));
    ebpo_status status = EBPO_OK;
    for (uint64_t chunk = begin; chunk < end && status == EBPO_OK; chunk++)
        status = read_chunk(j, j->scratch[worker], chunk, error);
    return status;
}

ebpo_status ebpo_reader_rows(ebpo_file *file, const ebpo_array_in *array, unsigned threads, ebpo_rows_fn take, void *context,
                             ebpo_error *error)
{
    uint64_t chunks = ebpo_h5_chunk_count(&array->shape);
    threads = chunks > 2 ? ebpo_thread_count(threads) : 1;
    job j = { .file = file, .array = array, .take = take, .context = context };
    j.scratch = ebpo_alloc_zero(threads, sizeof *j.scratch);
    if (!j.scratch)
        return ebpo_fail_memory(error, threads * sizeof *j.scratch);
    ebpo_status status = ebpo_parallel_for(threads, chunks, 1, read_chunks, &j, NULL, "read", error);
    for (unsigned i = 0; i < threads; i++)
        if (j.scratch[i]) {
            ebpo_chunk_reader_clear(&j.scratch[i]->reader);
            free(j.scratch[i]);
        }
    free(j.scratch);
    return status;
}

typedef struct target {
    uint8_t *values;
    size_t size;
} target;

static ebpo_status take_integers(void *context, const ebpo_array_in *array, uint64_t chunk, uint64_t row, uint64_t rows, const uint8_t *bytes,
                                 ebpo_error *error)
{
    (void)chunk;
    (void)error;
    const target *t = context;
    uint64_t cols = array->shape.cols ? array->shape.cols : 1;
    ebpo_integers_decode(bytes, array->shape.element_size, array->shape.is_signed, rows * cols, t->values + row * cols * t->size, t->size);
    return EBPO_OK;
}

ebpo_status ebpo_reader_integers(ebpo_file *file, const ebpo_array_in *array, unsigned threads, void *values, size_t size,
                                 ebpo_error *error)
{
    target t = { values, size };
    return ebpo_reader_rows(file, array, threads, take_integers, &t, error);
}

ebpo_status ebpo_reader_make(ebpo_file *file, ebpo_array_id id, int level, unsigned threads, size_t size, void *values_out,
                             ebpo_error *error)
{
    const ebpo_array_in *array = ebpo_reader_array(file, id, level);
    void *values = NULL;
    ebpo_status status = EBPO_OK;
    if (array->present) {
        uint64_t cols = array->shape.cols ? array->shape.cols : 1;
        values = ebpo_alloc(array->shape.rows, size * cols);
        status = values ? ebpo_reader_integers(file, array, threads, values, size, error)
                        : ebpo_fail_memory(error, array->shape.rows * size * cols);
    }
    if (status != EBPO_OK) {
        free(values);
        values = NULL;
    }
    memcpy(values_out, &values, sizeof values);
    return status;
}
