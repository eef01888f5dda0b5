/* Provides HDF5 filter 32015, which stores a chunk as one zstd frame. The library registers the
 * filter with libhdf5 in its process. This source file is compiled a second time, with
 * EBPO_FILTER_IN_PLUGIN, as a plugin for h5dump, h5py and all other programs. The plugin uses only
 * headers of HDF5 and does not link with libhdf5, so one plugin serves all builds of HDF5. */
#include "hdf5_write/zstd_filter.h"

#ifdef EBPO_FILTER_IN_PLUGIN
#include <H5PLextern.h>
#endif
#include <stdint.h>
#include <stdlib.h>
#include <zstd.h>

enum { DEFAULT_LEVEL = 3 };

/* HDF5 stores chunk sizes in 32 bits. */
static const uint64_t CHUNK_MAX = UINT32_MAX;

/* Reports a lack of memory to libhdf5. Returns 0, which HDF5 treats as a failure. The plugin does
 * not report the reason, because programs with a private libhdf5, such as h5py, could not load a
 * plugin that calls HDF5's error functions. */
static size_t short_of_memory(void)
{
#ifndef EBPO_FILTER_IN_PLUGIN
    H5Epush2(H5E_DEFAULT, __FILE__, __func__, __LINE__, H5E_ERR_CLS, H5E_RESOURCE, H5E_NOSPACE,
             "not enough memory for a chunk");
#endif
    return 0;
}

/* Replaces HDF5's buffer by `block`, which has `capacity` bytes. Returns `used`, the number of
 * bytes in use. */
static size_t replace_buffer(void **buffer, size_t *buffer_size, void *block, size_t capacity,
                             size_t used)
{
    free(*buffer);
    *buffer = block;
    *buffer_size = capacity;
    return used;
}

/* Replaces the buffer by its compressed content. `level`: [level_count] parameters of the filter;
 * the first parameter is the compression level. Returns the compressed size, or 0 after an error.
 */
static size_t compress_chunk(size_t level_count, const unsigned level[], size_t bytes,
                             size_t *buffer_size, void **buffer)
{
    size_t capacity = ZSTD_compressBound(bytes), used = 0;
    ZSTD_CCtx *context = ZSTD_createCCtx();
    void *block = malloc(capacity ? capacity : 1);
    if (!context || !block)
        goto failed;
    int wanted = level_count ? (int)level[0] : DEFAULT_LEVEL;
    if (ZSTD_isError(ZSTD_CCtx_setParameter(context, ZSTD_c_compressionLevel, wanted)) ||
        ZSTD_isError(ZSTD_CCtx_setParameter(context, ZSTD_c_checksumFlag, 1)))
        goto failed;
    used = ZSTD_compress2(context, block, capacity, *buffer, bytes);
    if (ZSTD_isError(used))
        goto failed;
    ZSTD_freeCCtx(context);
    return replace_buffer(buffer, buffer_size, block, capacity, used);

failed:
    free(block);
    ZSTD_freeCCtx(context);
    return 0; /* HDF5 treats 0 as a failure */
}

/* Decodes a frame that states its size. Returns the size, or 0 after an error. */
static size_t expand_known(uint64_t size, size_t bytes, size_t *buffer_size, void **buffer)
{
    void *block = NULL;
    if (!size || size > CHUNK_MAX)
        return 0;
    if (!(block = malloc((size_t)size)))
        return short_of_memory();
    size_t used = ZSTD_decompress(block, (size_t)size, *buffer, bytes);
    if (ZSTD_isError(used) || used != size) {
        free(block);
        return 0;
    }
    return replace_buffer(buffer, buffer_size, block, (size_t)size, used);
}

/* Decodes a frame that does not state its size into a growing buffer. Other programs write such
 * frames. Returns the size, or 0 after an error. */
static size_t expand_unknown(size_t bytes, size_t *buffer_size, void **buffer)
{
    ZSTD_DCtx *context = ZSTD_createDCtx();
    ZSTD_inBuffer in = { *buffer, bytes, 0 };
    ZSTD_outBuffer out = { NULL, 0, 0 };
    size_t pending = 1;
    while (context && pending) {
        if (out.pos == out.size) {
            uint64_t size = out.size ? 2 * (uint64_t)out.size : 65536;
            void *block = size <= CHUNK_MAX + 1 ? realloc(out.dst, (size_t)size) : NULL;
            if (!block)
                break;
            out.dst = block;
            out.size = (size_t)size;
        }
        size_t before = out.pos;
        pending = ZSTD_decompressStream(context, &out, &in);
        if (ZSTD_isError(pending) || (pending && in.pos == in.size && out.pos == before))
            break; /* the frame is damaged, or ends early */
    }
    ZSTD_freeDCtx(context);
    if (pending == 0 && out.pos)
        return replace_buffer(buffer, buffer_size, out.dst, out.size, out.pos);
    free(out.dst);
    return 0;
}

/* The filter function that HDF5 calls for each chunk. Returns the new size, or 0 after an error. */
static size_t filter_chunk(unsigned flags, size_t cd_count, const unsigned cd_values[],
                           size_t bytes, size_t *buffer_size, void **buffer)
{
    if (!(flags & H5Z_FLAG_REVERSE))
        return compress_chunk(cd_count, cd_values, bytes, buffer_size, buffer);
    unsigned long long size = ZSTD_getFrameContentSize(*buffer, bytes);
    if (size == ZSTD_CONTENTSIZE_ERROR)
        return 0;
    if (size == ZSTD_CONTENTSIZE_UNKNOWN)
        return expand_unknown(bytes, buffer_size, buffer);
    return expand_known(size, bytes, buffer_size, buffer);
}

const H5Z_class2_t ebpo_zstd_filter = {
    .version = H5Z_CLASS_T_VERS,
    .id = EBPO_ZSTD_FILTER_ID,
    .encoder_present = 1,
    .decoder_present = 1,
    .name = "zstd (EBP-Octree)",
    .can_apply = NULL,
    .set_local = NULL,
    .filter = filter_chunk,
};

#ifdef EBPO_FILTER_IN_PLUGIN
__attribute__((visibility("default"))) H5PL_type_t H5PLget_plugin_type(void)
{
    return H5PL_TYPE_FILTER;
}

__attribute__((visibility("default"))) const void *H5PLget_plugin_info(void)
{
    return &ebpo_zstd_filter;
}
#endif
