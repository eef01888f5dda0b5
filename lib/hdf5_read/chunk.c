/* Encodes and decodes chunks as HDF5 stores them. A pipeline is the list of the HDF5 filters of an
 * array. The table `codecs` has a row for each pipeline, with its filters and the functions that
 * encode and decode. Two flags of the row say if values are shuffled before compression, and if a
 * fletcher32 checksum follows. A writer gives a new array the filters of the row; a reader
 * recognises the pipeline by these filters. A new codec needs a number in chunk.h, a row, and its
 * functions in a separate file, such as zstd_codec.c. Deflate needs only two calls of zlib, which
 * are in this file. The output is bit for bit the output of libhdf5's own filters. Source: docs of
 * HDF5 ("HDF5 filters"), format-spec/README.md, section 4. */
#include <string.h>
#include <zlib.h>

#include "core/checksum.h"
#include "core/endian.h"
#include "core/simd.h"
#include "hdf5_read/chunk.h"

/* --- shuffle and checksum --- */

void ebpo_shuffle(const uint8_t *in, size_t bytes, size_t element_size, uint8_t *out)
{
    size_t count = bytes / element_size;
    for (size_t k = 0; k < element_size; k++)
        for (size_t i = 0; i < count; i++)
            out[k * count + i] = in[i * element_size + k];
}

/* Restores elements of two bytes. The common sizes two and four have separate functions, because
 * compilers vectorise their loops over elements. */
static void unshuffle_two(const uint8_t *in, size_t count, uint8_t *out)
{
    for (size_t i = 0; i < count; i++) {
        out[2 * i] = in[i];
        out[2 * i + 1] = in[count + i];
    }
}

static void unshuffle_four(const uint8_t *in, size_t count, uint8_t *out)
{
    size_t i = 0;
#ifdef EBPO_SIMD_SSE2
    for (; i + 16 <= count; i += 16) { /* 16 elements at a time */
        __m128i plane[4], pair[4], *to = (void *)(out + 4 * i);
        for (size_t k = 0; k < 4; k++)
            plane[k] = _mm_loadu_si128((const void *)(in + k * count + i));
        pair[0] = _mm_unpacklo_epi8(plane[0], plane[1]); /* bytes 0 and 1 of elements 0 to 7 */
        pair[1] = _mm_unpacklo_epi8(plane[2], plane[3]);
        pair[2] = _mm_unpackhi_epi8(plane[0], plane[1]);
        pair[3] = _mm_unpackhi_epi8(plane[2], plane[3]);
        for (size_t k = 0; k < 4; k += 2) {
            _mm_storeu_si128(to + k, _mm_unpacklo_epi16(pair[k], pair[k + 1]));
            _mm_storeu_si128(to + k + 1, _mm_unpackhi_epi16(pair[k], pair[k + 1]));
        }
    }
#endif
    for (; i < count; i++)
        ebpo_store32(out + 4 * i, in[i] | (uint32_t)in[count + i] << 8 |
                                      (uint32_t)in[2 * count + i] << 16 |
                                      (uint32_t)in[3 * count + i] << 24);
}

void ebpo_unshuffle(const uint8_t *in, size_t bytes, size_t element_size, uint8_t *out)
{
    size_t count = bytes / element_size;
    if (element_size == 2) {
        unshuffle_two(in, count, out);
        return;
    }
    if (element_size == 4) {
        unshuffle_four(in, count, out);
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
        /* The two sums over at most 360 words fit 32 bits. After each run, they are folded to 16
         * bits. */
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

/* --- codecs --- */

/* Returns EBPO_E_FORMAT, with the reason in *why. */
static ebpo_status chunk_is_broken(const char **why, const char *what)
{
    *why = what;
    return EBPO_E_FORMAT;
}

static ebpo_status deflate_encode(ebpo_chunk_coder *coder, int level, const uint8_t *raw,
                                  size_t raw_bytes, const ebpo_chunk_blocks *b, uint8_t *out,
                                  size_t *out_bytes)
{
    (void)coder, (void)b;
    uLongf size = (uLongf)ebpo_chunk_bound(raw_bytes);
    int code = compress2(out, &size, raw, (uLong)raw_bytes, level ? level : EBPO_DEFLATE_LEVEL);
    *out_bytes = size;
    return code == Z_OK ? EBPO_OK : code == Z_MEM_ERROR ? EBPO_E_MEMORY : EBPO_E_ARGUMENT;
}

static ebpo_status deflate_decode(ebpo_chunk_coder *coder, const uint8_t *stored,
                                  size_t stored_bytes, uint8_t *raw, size_t raw_bytes,
                                  const char **why)
{
    (void)coder;
    uLongf size = (uLongf)raw_bytes;
    uLong used = (uLong)stored_bytes;
    int code = uncompress2(raw, &size, stored, &used);
    if (code == Z_MEM_ERROR)
        return EBPO_E_MEMORY;
    if (code != Z_OK || size != raw_bytes || used != stored_bytes)
        return chunk_is_broken(why, "the deflate stream does not decode to the chunk's size");
    return EBPO_OK;
}

/* Encode and decode without compression. */
static ebpo_status copy_out(ebpo_chunk_coder *coder, int level, const uint8_t *raw,
                            size_t raw_bytes, const ebpo_chunk_blocks *b, uint8_t *out,
                            size_t *out_bytes)
{
    (void)coder, (void)level, (void)b;
    memcpy(out, raw, raw_bytes);
    *out_bytes = raw_bytes;
    return EBPO_OK;
}

static ebpo_status copy_in(ebpo_chunk_coder *coder, const uint8_t *stored, size_t stored_bytes,
                           uint8_t *raw, size_t raw_bytes, const char **why)
{
    (void)coder;
    if (stored_bytes != raw_bytes)
        return chunk_is_broken(why, "the stored size is not the chunk's size");
    memcpy(raw, stored, raw_bytes);
    return EBPO_OK;
}

/* A row of the table: a pipeline. */
typedef struct codec {
    ebpo_pipeline_facts facts;
    ebpo_status (*encode)(ebpo_chunk_coder *coder, int level, const uint8_t *raw, size_t raw_bytes,
                          const ebpo_chunk_blocks *b, uint8_t *out, size_t *out_bytes);
    ebpo_status (*decode)(ebpo_chunk_coder *coder, const uint8_t *stored, size_t stored_bytes,
                          uint8_t *raw, size_t raw_bytes, const char **why);
} codec;

static const codec codecs[] = {
    [EBPO_PIPELINE_ZSTD] = { { { EBPO_FILTER_ZSTD }, 1, EBPO_ZSTD_LEVEL, 22, true, false },
                             ebpo_zstd_encode,
                             ebpo_zstd_decode },
    [EBPO_PIPELINE_DEFLATE] = { { { EBPO_FILTER_DEFLATE, EBPO_FILTER_FLETCHER },
                                  2,
                                  EBPO_DEFLATE_LEVEL,
                                  9,
                                  true,
                                  true },
                                deflate_encode,
                                deflate_decode },
    [EBPO_PIPELINE_CHECKSUM] = { { { EBPO_FILTER_FLETCHER }, 1, 0, 0, false, true },
                                 copy_out,
                                 copy_in },
    [EBPO_PIPELINE_BARE] = { { { 0 }, 0, 0, 0, false, false }, copy_out, copy_in },
};
_Static_assert(sizeof codecs / sizeof *codecs == EBPO_PIPELINE_COUNT,
               "each pipeline of chunk.h needs a row in this table");

const ebpo_pipeline_facts *ebpo_pipeline_facts_of(ebpo_pipeline pipeline)
{
    return &codecs[pipeline].facts;
}

bool ebpo_pipeline_of_filters(const unsigned *filters, int count, unsigned element_size,
                              ebpo_pipeline *pipeline)
{
    for (int i = 0; i < EBPO_PIPELINE_COUNT; i++) {
        const ebpo_pipeline_facts *row = &codecs[i].facts;
        bool begins_with_shuffle = count > 0 && filters[0] == EBPO_FILTER_SHUFFLE;
        int shuffles = row->compresses && (element_size > 1 || begins_with_shuffle);
        if (count != row->filter_count + shuffles || (shuffles && !begins_with_shuffle))
            continue;
        bool same = true;
        for (int k = 0; k < row->filter_count; k++)
            same = same && filters[shuffles + k] == row->filter[k];
        if (same) {
            *pipeline = (ebpo_pipeline)i;
            return true;
        }
    }
    return false;
}

/* --- chunks --- */

void ebpo_chunk_coder_clear(ebpo_chunk_coder *coder) { ebpo_zstd_coder_clear(coder); }

/* Returns the blocks of a zstd frame for shuffled elements: one block for each byte plane. Byte
 * plane k has byte k of every element. The result omits the end of the last block. */
static ebpo_chunk_blocks blocks_of_byte_planes(size_t raw_bytes, size_t element_size)
{
    enum {
        /* Minimum bytes of a byte plane for a separate block, because each block has a table of
         * codes of some 100 bytes. */
        BYTE_PLANE_LEAST = 1024
    };
    ebpo_chunk_blocks b = { .count = 0 };
    size_t plane = raw_bytes / element_size;
    for (size_t at = plane; at < raw_bytes && plane >= BYTE_PLANE_LEAST; at += plane)
        b.end[b.count++] = at;
    return b;
}

/* Returns the blocks of a zstd frame for streams: one block for each stream that is not empty.
 * Stream i ends at ends[i]. The result omits the end of the last block. */
static ebpo_chunk_blocks blocks_of_streams(size_t raw_bytes, const size_t *ends, int count)
{
    ebpo_chunk_blocks b = { .count = 0 };
    size_t last = 0;
    for (int i = 0; i < count; last = ends[i++])
        if (ends[i] > last && ends[i] < raw_bytes)
            b.end[b.count++] = ends[i];
    return b;
}

/* Encodes bytes that are already shuffled, and appends the checksum if the pipeline has one. */
static ebpo_status encode_bytes(ebpo_chunk_coder *coder, ebpo_pipeline pipeline, int level,
                                const uint8_t *raw, size_t raw_bytes, const ebpo_chunk_blocks *b,
                                uint8_t *out, size_t *out_bytes)
{
    const codec *row = &codecs[pipeline];
    ebpo_status status = row->encode(coder, level, raw, raw_bytes, b, out, out_bytes);
    if (status == EBPO_OK && row->facts.fletcher) {
        ebpo_store32(out + *out_bytes, ebpo_fletcher32(out, *out_bytes));
        *out_bytes += 4;
    }
    return status;
}

ebpo_status ebpo_chunk_encode(ebpo_chunk_coder *coder, ebpo_pipeline pipeline, int level,
                              size_t element_size, const uint8_t *raw, size_t raw_bytes,
                              uint8_t *out, size_t *out_bytes)
{
    ebpo_chunk_blocks b = blocks_of_byte_planes(raw_bytes, element_size);
    if (ebpo_pipeline_facts_of(pipeline)->compresses && element_size > 1) {
        ebpo_shuffle(raw, raw_bytes, element_size, coder->scratch);
        raw = coder->scratch;
    }
    return encode_bytes(coder, pipeline, level, raw, raw_bytes, &b, out, out_bytes);
}

ebpo_status ebpo_chunk_encode_streams(ebpo_chunk_coder *coder, ebpo_pipeline pipeline, int level,
                                      const uint8_t *raw, size_t raw_bytes, const size_t *ends,
                                      int count, uint8_t *out, size_t *out_bytes)
{
    ebpo_chunk_blocks b = blocks_of_streams(raw_bytes, ends, count);
    return encode_bytes(coder, pipeline, level, raw, raw_bytes, &b, out, out_bytes);
}

ebpo_status ebpo_chunk_decode(ebpo_chunk_coder *coder, ebpo_pipeline pipeline, size_t element_size,
                              const uint8_t *stored, size_t stored_bytes, uint8_t *raw,
                              size_t raw_bytes, const char **why)
{
    *why = "";
    const codec *row = &codecs[pipeline];
    if (row->facts.fletcher) {
        if (stored_bytes < 4 || ebpo_sum_differs(ebpo_load32(stored + stored_bytes - 4),
                                                 ebpo_fletcher32(stored, stored_bytes - 4)))
            return chunk_is_broken(why, "the fletcher32 checksum does not match");
        stored_bytes -= 4;
    }
    bool shuffled = row->facts.compresses && element_size > 1;
    uint8_t *target = shuffled ? coder->scratch : raw;
    ebpo_status status = row->decode(coder, stored, stored_bytes, target, raw_bytes, why);
    if (status == EBPO_OK && shuffled)
        ebpo_unshuffle(target, raw_bytes, element_size, raw);
    return status;
}
