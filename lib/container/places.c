#include "container/places.h"

#include <stdlib.h>

#include "attributes/attributes.h"
#include "base/alloc.h"
#include "base/endian.h"
#include "base/error.h"

enum { LEVEL_NUMBERS = 64, MESH_NUMBERS = 4096, TABLE_NUMBERS = 4112, ATTRIBUTE_NUMBERS = 8191 };
_Static_assert(EBPO_A_TYPES == 0 && EBPO_A_PLANES == 2 && EBPO_A_LEAF_REFS == 9 &&
                   EBPO_A_LEAF_INDEX == 12 && EBPO_A_LEAF_PLANES == 14 &&
                   EBPO_A_GRAY_COLOURS == 15 && EBPO_A_FACE_SOURCE - EBPO_A_VERTICES == 4 &&
                   EBPO_A_SUBTREE_OUTER - EBPO_A_SUBTREE_INDEX == 2,
               "arrays in files have these numbers: a new row of array_table.inc goes behind them");

uint32_t ebpo_place_number(ebpo_array_id id, int level)
{
    if (id == EBPO_A_ATTRIBUTE)
        return ATTRIBUTE_NUMBERS + (uint32_t)level;
    return id < EBPO_LEVEL_ARRAYS      ? (uint32_t)level * LEVEL_NUMBERS + (uint32_t)id
           : id < EBPO_A_SUBTREE_INDEX ? MESH_NUMBERS + (uint32_t)(id - EBPO_LEVEL_ARRAYS)
                                       : TABLE_NUMBERS + (uint32_t)(id - EBPO_A_SUBTREE_INDEX);
}

ebpo_array_id ebpo_place_array(uint32_t number, int *level)
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
    for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_A_PLACES; id++)
        if (ebpo_place_number((ebpo_array_id)id, 0) == number)
            return (ebpo_array_id)id;
    return EBPO_ARRAYS;
}

/* The elements' size as the pipeline sees it: the coder's scratch is too small for shuffling a long
 * list, which is done here. */
static bool shuffled(ebpo_pipeline pipeline)
{
    return pipeline == EBPO_PIPELINE_ZSTD || pipeline == EBPO_PIPELINE_DEFLATE;
}

ebpo_status ebpo_places_encode(const uint64_t *places, uint64_t count, ebpo_pipeline pipeline,
                               int codec_level, uint8_t **stored, size_t *bytes, ebpo_error *error)
{
    size_t size = count * 8;
    ebpo_chunk_coder *coder = ebpo_alloc_zero(1, sizeof *coder);
    uint8_t *raw = ebpo_alloc(size, 1), *turned = ebpo_alloc(size, 1);
    *stored = ebpo_alloc(ebpo_chunk_bound(size), 1);
    ebpo_status status = coder && raw && turned && *stored ? EBPO_OK : EBPO_E_MEMORY;
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        ebpo_store64(raw + 8 * i, places[i]);
    if (status == EBPO_OK && shuffled(pipeline))
        ebpo_shuffle(raw, size, 8, turned);
    if (status == EBPO_OK)
        status = ebpo_chunk_encode(coder, pipeline, codec_level, 1,
                                   shuffled(pipeline) ? turned : raw, size, *stored, bytes);
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

ebpo_status ebpo_places_decode(const uint8_t *stored, size_t stored_bytes, ebpo_pipeline pipeline,
                               uint64_t count, uint64_t **places, const char **why,
                               ebpo_error *error)
{
    size_t size = count * 8;
    ebpo_chunk_coder *coder = ebpo_alloc_zero(1, sizeof *coder);
    uint8_t *raw = ebpo_alloc(size, 1), *turned = ebpo_alloc(size, 1);
    *places = ebpo_alloc(count, sizeof **places);
    ebpo_status status = coder && raw && turned && *places ? EBPO_OK : EBPO_E_MEMORY;
    if (status == EBPO_OK)
        status = ebpo_chunk_decode(coder, pipeline, 1, stored, stored_bytes, raw, size, why);
    if (status == EBPO_OK && shuffled(pipeline))
        ebpo_unshuffle(raw, size, 8, turned);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        (*places)[i] = ebpo_load64((shuffled(pipeline) ? turned : raw) + 8 * i);
    if (coder)
        ebpo_chunk_coder_clear(coder);
    free(coder);
    free(raw);
    free(turned);
    if (status == EBPO_OK)
        return EBPO_OK;
    free(*places);
    *places = NULL;
    return status == EBPO_E_MEMORY ? ebpo_fail_memory(error, size * 3) : status;
}
