/* SPDX-License-Identifier: MIT
 * Any bytes as a stored chunk, of each pipeline and width: decoded to its size or refused with a
 * reason; and any bytes as the contents of a chunk: they are read back.
 *
 * Input: a byte for pipeline (2 bits), width (2 bits) and direction (1 bit), two bytes for rows,
 * the chunk. */
#include <stdlib.h>
#include <string.h>

#include "hdf5_read/chunk.h"
#include "fuzz_support.h"

static ebpo_chunk_coder coder; /* one for all inputs: its state after a chunk must not matter */

static uint8_t *encoded(ebpo_pipeline pipeline, size_t width, const uint8_t *raw, size_t bytes,
                        size_t *stored)
{
    uint8_t *out = fuzz_capacity(ebpo_chunk_bound(bytes));
    fuzz_must(ebpo_chunk_encode(&coder, pipeline, 0, width, raw, bytes, out, stored) == EBPO_OK);
    fuzz_must(*stored <= ebpo_chunk_bound(bytes));
    return out;
}

static void comes_back(ebpo_pipeline pipeline, size_t width, const uint8_t *raw, size_t bytes)
{
    size_t stored_bytes;
    const char *why;
    uint8_t *stored = encoded(pipeline, width, raw, bytes, &stored_bytes);
    uint8_t *again = fuzz_capacity(bytes);
    fuzz_must(ebpo_chunk_decode(&coder, pipeline, width, stored, stored_bytes, again, bytes,
                                &why) == EBPO_OK);
    fuzz_must(memcmp(again, raw, bytes) == 0);
    free(stored);
    free(again);
}

static void decode(ebpo_pipeline pipeline, size_t width, const uint8_t *data, size_t size,
                   size_t bytes)
{
    const char *why = NULL;
    uint8_t *stored = fuzz_copy(data, size), *raw = fuzz_capacity(bytes);
    ebpo_status status = ebpo_chunk_decode(&coder, pipeline, width, stored, size, raw, bytes, &why);
    fuzz_must(status == EBPO_OK || (status == EBPO_E_FORMAT && why && *why));
    if (status == EBPO_OK)
        comes_back(pipeline, width, raw, bytes);
    free(stored);
    free(raw);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size < 4)
        return 0;
    ebpo_pipeline pipeline = (ebpo_pipeline)(data[0] & 3);
    size_t width = (size_t)1 << (data[0] >> 2 & 3);
    size_t bytes = (data[1] | (size_t)data[2] << 8) % (EBPO_CHUNK_BYTES_MAX / width) * width;
    if (data[0] & 16)
        bytes = (size - 3 < EBPO_CHUNK_BYTES_MAX ? size - 3 : EBPO_CHUNK_BYTES_MAX) / width * width;
    if (bytes && data[0] & 16)
        comes_back(pipeline, width, data + 3, bytes);
    else if (bytes)
        decode(pipeline, width, data + 3, size - 3, bytes);
    return 0;
}
