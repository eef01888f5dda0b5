#include "hdf5_read/chunk.h"
#include "hdf5_read/zstd_frame.h"

#include <string.h>
#include <zlib.h>
#include <zstd.h>

#include "core/endian.h"
#include "core/sums.h"

void ebpo_chunk_coder_clear(ebpo_chunk_coder *coder)
{
    ZSTD_freeCCtx(coder->zstd_out);
    ZSTD_freeDCtx(coder->zstd_in);
    coder->zstd_out = coder->zstd_in = NULL;
}

/* The format's number, above what zlib and zstd say of themselves (at most a 256th and 68 bytes
 * more than the data), so that it does not change with them. */
size_t ebpo_chunk_bound(size_t raw_bytes) { return raw_bytes + raw_bytes / 256 + 1024; }

void ebpo_shuffle(const uint8_t *in, size_t bytes, size_t element_size, uint8_t *out)
{
    size_t count = bytes / element_size;
    for (size_t k = 0; k < element_size; k++)
        for (size_t i = 0; i < count; i++)
            out[k * count + i] = in[i * element_size + k];
}

/* The usual element sizes byte by byte but element after element, which compilers turn into vector
 * code. */
static void unshuffle2(const uint8_t *in, size_t count, uint8_t *out)
{
    for (size_t i = 0; i < count; i++) {
        out[2 * i] = in[i];
        out[2 * i + 1] = in[count + i];
    }
}

static void unshuffle4(const uint8_t *in, size_t count, uint8_t *out)
{
    for (size_t i = 0; i < count; i++)
        ebpo_store32(out + 4 * i, in[i] | (uint32_t)in[count + i] << 8 |
                                      (uint32_t)in[2 * count + i] << 16 |
                                      (uint32_t)in[3 * count + i] << 24);
}

void ebpo_unshuffle(const uint8_t *in, size_t bytes, size_t element_size, uint8_t *out)
{
    size_t count = bytes / element_size;
    if (element_size == 2) {
        unshuffle2(in, count, out);
        return;
    }
    if (element_size == 4) {
        unshuffle4(in, count, out);
        return;
    }
    for (size_t k = 0; k < element_size; k++)
        for (size_t i = 0; i < count; i++)
            out[i * element_size + k] = in[k * count + i];
}

uint32_t ebpo_fletcher32(const uint8_t *data, size_t bytes)
{
    uint32_t low = 0, high = 0;
    size_t words = bytes / 2;
    while (words) {
        /* no overflow of 32 bits before the sums are folded */
        size_t run = words > 360 ? 360 : words;
        words -= run;
        for (; run; run--, data += 2) {
            low += (uint32_t)data[0] << 8 | data[1];
            high += low;
        }
        low = (low & 0xffff) + (low >> 16);
        high = (high & 0xffff) + (high >> 16);
    }
    if (bytes % 2) {
        low += (uint32_t)data[0] << 8;
        high += low;
        low = (low & 0xffff) + (low >> 16);
        high = (high & 0xffff) + (high >> 16);
    }
    low = (low & 0xffff) + (low >> 16);
    high = (high & 0xffff) + (high >> 16);
    return high << 16 | low;
}

/* A shuffled chunk is planes of bytes that have little in common: the low ones are noise, the high
 * ones nearly all alike. Each in a block of its own has a table of codes of its own. Short matches
 * are left alone: in such planes they cost more than single bytes. Chunks too small to gain by any
 * of that are as HDF5's filter makes them. */
static bool zstd_begin(ZSTD_CCtx *out, int level, size_t raw_bytes)
{
    enum { LARGE = 4096, LEVEL_OF_LARGE = 7, MATCH_LEAST = 6 };
    bool effort = !level && raw_bytes >= LARGE;
    if (!level)
        level = effort ? LEVEL_OF_LARGE : EBPO_ZSTD_LEVEL;
    return !ZSTD_isError(ZSTD_CCtx_reset(out, ZSTD_reset_session_and_parameters)) &&
           !ZSTD_isError(ZSTD_CCtx_setParameter(out, ZSTD_c_compressionLevel, level)) &&
           !ZSTD_isError(ZSTD_CCtx_setParameter(out, ZSTD_c_checksumFlag, 1)) &&
           (!effort || !ZSTD_isError(ZSTD_CCtx_setParameter(out, ZSTD_c_minMatch, MATCH_LEAST)));
}

/* Where blocks end before the chunk does: at most one for each byte of the widest element. */
typedef struct blocks {
    size_t end[8];
    int count;
} blocks;

static blocks blocks_of_planes(size_t raw_bytes, size_t element_size)
{
    enum { PLANE_LEAST = 1024 }; /* a table of codes takes some 100 bytes */
    blocks b = { .count = 0 };
    size_t plane = raw_bytes / element_size;
    for (size_t at = plane; at < raw_bytes && plane >= PLANE_LEAST; at += plane)
        b.end[b.count++] = at;
    return b;
}

/* Those of streams that are neither empty nor all of the chunk. */
static blocks blocks_of_streams(size_t raw_bytes, const size_t *ends, int count)
{
    blocks b = { .count = 0 };
    size_t last = 0;
    for (int i = 0; i < count; last = ends[i++])
        if (ends[i] > last && ends[i] < raw_bytes)
            b.end[b.count++] = ends[i];
    return b;
}

static size_t zstd_blocks(ZSTD_CCtx *zstd, const uint8_t *raw, size_t raw_bytes, const blocks *b,
                          uint8_t *out)
{
    ZSTD_outBuffer to = { out, ebpo_chunk_bound(raw_bytes), 0 };
    size_t left = ZSTD_CCtx_setPledgedSrcSize(zstd, raw_bytes), at = 0;
    for (int i = 0; i <= b->count && left == 0; i++) {
        size_t end = i < b->count ? b->end[i] : raw_bytes;
        ZSTD_inBuffer from = { raw + at, end - at, 0 };
        left = ZSTD_compressStream2(zstd, &to, &from, i == b->count ? ZSTD_e_end : ZSTD_e_flush);
        at = end;
    }
    return left ? (size_t)-1 : to.pos; /* an error, as ZSTD_isError has it */
}

static ebpo_status zstd_encode(ebpo_chunk_coder *coder, int level, const uint8_t *raw,
                               size_t raw_bytes, const blocks *b, uint8_t *out, size_t *out_bytes)
{
    if (!coder->zstd_out)
        coder->zstd_out = ZSTD_createCCtx();
    if (!coder->zstd_out)
        return EBPO_E_MEMORY;
    if (!zstd_begin(coder->zstd_out, level, raw_bytes))
        return EBPO_E_ARGUMENT;
    size_t size = b->count ? zstd_blocks(coder->zstd_out, raw, raw_bytes, b, out)
                           : ZSTD_compress2(coder->zstd_out, out, ebpo_chunk_bound(raw_bytes), raw,
                                            raw_bytes);
    *out_bytes = size;
    return ZSTD_isError(size) ? EBPO_E_MEMORY : EBPO_OK; /* the bound leaves no other cause */
}

static ebpo_status deflate_encode(int level, const uint8_t *raw, size_t raw_bytes, uint8_t *out,
                                  size_t *out_bytes)
{
    uLongf size = (uLongf)ebpo_chunk_bound(raw_bytes);
    int code = compress2(out, &size, raw, (uLong)raw_bytes, level ? level : EBPO_DEFLATE_LEVEL);
    *out_bytes = size;
    return code == Z_OK ? EBPO_OK : code == Z_MEM_ERROR ? EBPO_E_MEMORY : EBPO_E_ARGUMENT;
}

static ebpo_status encode(ebpo_chunk_coder *coder, ebpo_pipeline pipeline, int level,
                          const uint8_t *raw, size_t raw_bytes, const blocks *b, uint8_t *out,
                          size_t *out_bytes)
{
    ebpo_status status = EBPO_OK;
    if (pipeline == EBPO_PIPELINE_ZSTD)
        return zstd_encode(coder, level, raw, raw_bytes, b, out, out_bytes);
    if (pipeline == EBPO_PIPELINE_DEFLATE) {
        status = deflate_encode(level, raw, raw_bytes, out, out_bytes);
    } else {
        memcpy(out, raw, raw_bytes);
        *out_bytes = raw_bytes;
    }
    if (status == EBPO_OK && pipeline != EBPO_PIPELINE_BARE) {
        ebpo_store32(out + *out_bytes, ebpo_fletcher32(out, *out_bytes));
        *out_bytes += 4;
    }
    return status;
}

ebpo_status ebpo_chunk_encode(ebpo_chunk_coder *coder, ebpo_pipeline pipeline, int level,
                              size_t element_size, const uint8_t *raw, size_t raw_bytes,
                              uint8_t *out, size_t *out_bytes)
{
    blocks b = blocks_of_planes(raw_bytes, element_size);
    bool compressed = pipeline == EBPO_PIPELINE_ZSTD || pipeline == EBPO_PIPELINE_DEFLATE;
    if (compressed && element_size > 1) {
        ebpo_shuffle(raw, raw_bytes, element_size, coder->scratch);
        raw = coder->scratch;
    }
    return encode(coder, pipeline, level, raw, raw_bytes, &b, out, out_bytes);
}

ebpo_status ebpo_chunk_encode_streams(ebpo_chunk_coder *coder, ebpo_pipeline pipeline, int level,
                                      const uint8_t *raw, size_t raw_bytes, const size_t *ends,
                                      int count, uint8_t *out, size_t *out_bytes)
{
    blocks b = blocks_of_streams(raw_bytes, ends, count);
    return encode(coder, pipeline, level, raw, raw_bytes, &b, out, out_bytes);
}

static ebpo_status broken(const char **why, const char *what)
{
    *why = what;
    return EBPO_E_FORMAT;
}

static ZSTD_DCtx *zstd_reader(void)
{
    ZSTD_DCtx *in = ZSTD_createDCtx();
#ifdef EBPO_FUZZING
    if (in) /* ZSTD_d_forceIgnoreChecksum, see core/sums.h */
        (void)ZSTD_DCtx_setParameter(in, ZSTD_d_experimentalParam3, 1);
#endif
    return in;
}

static ebpo_status zstd_decode(ebpo_chunk_coder *coder, const uint8_t *stored, size_t stored_bytes,
                               uint8_t *raw, size_t raw_bytes, const char **why)
{
    if (!coder->zstd_in)
        coder->zstd_in = zstd_reader();
    if (!coder->zstd_in)
        return EBPO_E_MEMORY;
    if (ZSTD_getFrameContentSize(stored, stored_bytes) != raw_bytes)
        return broken(why, "the zstd frame does not state the chunk's size");
    if (!ebpo_zstd_has_checksum(stored, stored_bytes))
        return broken(why, "the zstd frame has no checksum");
    const char *fault = ebpo_zstd_fault(stored, stored_bytes);
    if (fault)
        return broken(why, fault);
    if (ZSTD_findFrameCompressedSize(stored, stored_bytes) != stored_bytes)
        return broken(why, "the zstd frame does not fill the chunk");
    size_t size = ZSTD_decompressDCtx(coder->zstd_in, raw, raw_bytes, stored, stored_bytes);
    if (ZSTD_isError(size))
        return broken(why, ZSTD_getErrorName(size));
    return size == raw_bytes
               ? EBPO_OK
               : broken(why, "the zstd frame decodes to another size than the chunk's");
}

static ebpo_status deflate_decode(const uint8_t *stored, size_t stored_bytes, uint8_t *raw,
                                  size_t raw_bytes, const char **why)
{
    uLongf size = (uLongf)raw_bytes;
    uLong used = (uLong)stored_bytes;
    int code = uncompress2(raw, &size, stored, &used);
    if (code == Z_MEM_ERROR)
        return EBPO_E_MEMORY;
    if (code != Z_OK || size != raw_bytes || used != stored_bytes)
        return broken(why, "the deflate stream does not decode to the chunk's size");
    return EBPO_OK;
}

ebpo_status ebpo_chunk_decode(ebpo_chunk_coder *coder, ebpo_pipeline pipeline, size_t element_size,
                              const uint8_t *stored, size_t stored_bytes, uint8_t *raw,
                              size_t raw_bytes, const char **why)
{
    *why = "";
    if (pipeline == EBPO_PIPELINE_DEFLATE || pipeline == EBPO_PIPELINE_CHECKSUM) {
        if (stored_bytes < 4 || ebpo_sum_differs(ebpo_load32(stored + stored_bytes - 4),
                                                 ebpo_fletcher32(stored, stored_bytes - 4)))
            return broken(why, "the fletcher32 checksum does not match");
        stored_bytes -= 4;
    }
    bool shuffled =
        (pipeline == EBPO_PIPELINE_ZSTD || pipeline == EBPO_PIPELINE_DEFLATE) && element_size > 1;
    uint8_t *into = shuffled ? coder->scratch : raw;
    ebpo_status status = EBPO_OK;
    if (pipeline == EBPO_PIPELINE_ZSTD)
        status = zstd_decode(coder, stored, stored_bytes, into, raw_bytes, why);
    else if (pipeline == EBPO_PIPELINE_DEFLATE)
        status = deflate_decode(stored, stored_bytes, into, raw_bytes, why);
    else if (stored_bytes != raw_bytes)
        status = broken(why, "the stored size is not the chunk's size");
    else
        memcpy(raw, stored, raw_bytes);
    if (status == EBPO_OK && shuffled)
        ebpo_unshuffle(into, raw_bytes, element_size, raw);
    return status;
}
