#include "format/long_chunk.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "core/endian.h"
#include "core/error.h"

/* Its bytes are three times in memory, coded and plain. */
static const uint64_t LONGEST = PTRDIFF_MAX / 8 / 3;

/* The elements' size as the pipeline sees it: the coder's scratch is too small for shuffling a long
 * list, which is done here. */
static bool is_shuffled(ebpo_pipeline pipeline)
{
    return pipeline == EBPO_PIPELINE_ZSTD || pipeline == EBPO_PIPELINE_DEFLATE;
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
    uint8_t *raw = ebpo_alloc(size, 1), *turned = ebpo_alloc(size, 1);
    *stored = ebpo_alloc(ebpo_chunk_bound(size), 1);
    ebpo_status status = coder && raw && turned && *stored ? EBPO_OK : EBPO_E_MEMORY;
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        ebpo_store64(raw + 8 * i, values[i]);
    if (status == EBPO_OK && is_shuffled(pipeline))
        ebpo_shuffle(raw, size, 8, turned);
    if (status == EBPO_OK)
        status = ebpo_chunk_encode(coder, pipeline, codec_level, 1,
                                   is_shuffled(pipeline) ? turned : raw, size, *stored, bytes);
    if (coder)
        ebpo_chunk_coder_clear(coder);
    free(coder);
    free(raw);
    free(turned);
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
    uint8_t *raw = ebpo_alloc(size, 1), *turned = ebpo_alloc(size, 1);
    *values = ebpo_alloc(count, sizeof **values);
    ebpo_status status = coder && raw && turned && *values ? EBPO_OK : EBPO_E_MEMORY;
    if (status == EBPO_OK)
        status = ebpo_chunk_decode(coder, pipeline, 1, stored, stored_bytes, raw, size, why);
    if (status == EBPO_OK && is_shuffled(pipeline))
        ebpo_unshuffle(raw, size, 8, turned);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        (*values)[i] = ebpo_load64((is_shuffled(pipeline) ? turned : raw) + 8 * i);
    if (coder)
        ebpo_chunk_coder_clear(coder);
    free(coder);
    free(raw);
    free(turned);
    if (status == EBPO_OK)
        return EBPO_OK;
    free(*values);
    *values = NULL;
    return status == EBPO_E_MEMORY ? ebpo_fail_memory(error, size * 3) : status;
}

ebpo_status ebpo_long_chunk_fail(const ebpo_file *file, ebpo_array_id list, const char *what,
                                 const char *path, ebpo_error *error)
{
    return ebpo_fail_at(error, EBPO_E_FORMAT, file->in.shown, file->root_array[list].path, -1,
                        "%s %s; get a fresh copy of the file", what, path);
}

ebpo_status ebpo_long_chunk_read(const ebpo_file *file, const ebpo_array_in *a, uint64_t **values,
                                 ebpo_error *error)
{
    ebpo_chunk_place chunk = a->chunks[0];
    const char *why = "";
    *values = NULL;
    if (a->shape.rows > file->info.file_bytes)
        return ebpo_long_chunk_fail(file, a->id, "the list has more rows than",
                                    "the file has bytes", error);
    uint8_t *stored = ebpo_alloc(chunk.bytes, 1);
    ebpo_status status = stored ? ebpo_input_read(&ebpo_reader_own(file)->in, chunk.address,
                                                  chunk.bytes, stored, error)
                                : ebpo_fail_memory(error, chunk.bytes);
    if (status == EBPO_OK) {
        status = ebpo_long_chunk_decode(stored, chunk.bytes, a->shape.pipeline, a->shape.rows,
                                        values, &why, error);
        if (status == EBPO_E_FORMAT)
            status = ebpo_long_chunk_fail(file, a->id, "the chunk is damaged:", why, error);
    }
    free(stored);
    return status;
}
