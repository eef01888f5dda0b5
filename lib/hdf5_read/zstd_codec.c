/* Encodes and decodes chunks as zstd frames (RFC 8878). Each frame has its content's size and a
 * checksum. This file also checks the parts of a frame that neither zstd's decoder nor the checksum
 * checks, so that every changed bit is detected. A byte plane has byte k of all elements (shuffled
 * elements consist of byte planes). Each block of a frame is a byte plane, or a stream of a coding.
 * Byte planes and streams have different statistics, so each of them gets a separate table of
 * codes. */
#include <string.h>
#include <zstd.h>

#include "core/endian.h"
#include "hdf5_read/codec.h"

/* --- parts that decoders do not check: RFC 8878, 3.1.1 --- */

/* Types of blocks, and of literals. RLE: one byte and a number of repetitions. */
enum { RAW, RLE, COMPRESSED, RESERVED };
enum { DESCRIPTOR = 4 }; /* offset in a frame of the frame header's descriptor byte */
static const char unused_set[] = "an unused bit of the zstd frame is set";

/* Returns the size of the literals of a compressed block, including the header of the literals.
 * Returns 0 if the block ends within this header. */
static size_t literals_bytes(const uint8_t *block, size_t size)
{
    unsigned kind = block[0] & 3, format = block[0] >> 2 & 3;
    if (kind < COMPRESSED) {
        size_t header = format == 1 ? 2 : format == 3 ? 3 : 1;
        if (size < header)
            return 0;
        size_t count = header == 1   ? block[0] >> 3
                       : header == 2 ? (block[0] | block[1] << 8) >> 4
                                     : (block[0] | block[1] << 8 | block[2] << 16) >> 4;
        return header + (kind == RLE ? 1 : count);
    }
    size_t header = format < 2 ? 3 : format + 2;
    unsigned width = format < 2 ? 10 : format == 2 ? 14 : 18;
    uint64_t bits = 0;
    if (size < header)
        return 0;
    for (size_t i = 0; i < header; i++)
        bits |= (uint64_t)block[i] << 8 * i;
    return header + (size_t)(bits >> (4 + width) & ((1u << width) - 1));
}

/* Returns true if an unused bit of a compressed block is set. */
static bool block_has_unused(const uint8_t *block, size_t size)
{
    size_t at = size ? literals_bytes(block, size) : 0;
    if (at == 0 || at >= size ||
        block[at] == 0) /* block[at] is 0: no sequences, and therefore no byte of modes */
        return false;
    at += block[at] < 128 ? 1 : block[at] < 255 ? 2 : 3;
    return at < size && block[at] & 3;
}

/* Returns the text of an error in a block, or NULL. `stated`: the size in the block's header. */
static const char *block_fault(unsigned kind, const uint8_t *block, size_t stated)
{
    if (kind == RLE && stated == 1)
        return "a block of the zstd frame repeats its byte once";
    return kind == COMPRESSED && block_has_unused(block, stated) ? unused_set : NULL;
}

const char *ebpo_zstd_fault(const uint8_t *frame, size_t bytes)
{
    static const uint8_t id_bytes[4] = { 0, 1, 2, 4 };
    enum { UNUSED = 1 << 4, BLOCK_HEADER = 3 };
    const char *fault = NULL;
    if (bytes <= DESCRIPTOR)
        return NULL;
    unsigned d = frame[DESCRIPTOR], single = d >> 5 & 1, size_code = d >> 6;
    size_t at =
        DESCRIPTOR + 1 + !single + id_bytes[d & 3] + (size_code ? (size_t)1 << size_code : single);
    if (d & UNUSED)
        return unused_set;
    for (bool last = false; !last && !fault && at + BLOCK_HEADER <= bytes;) {
        uint32_t header = (uint32_t)(frame[at] | frame[at + 1] << 8 | frame[at + 2] << 16);
        unsigned kind = header >> 1 & 3;
        size_t size = kind == RLE ? 1 : header >> 3;
        at += BLOCK_HEADER;
        last = header & 1;
        if (kind == RESERVED || size > bytes - at)
            return NULL;
        fault = block_fault(kind, frame + at, header >> 3);
        at += size;
    }
    return fault;
}

bool ebpo_zstd_has_checksum(const uint8_t *frame, size_t bytes)
{
    enum { CONTENT_CHECKSUM = 1 << 2 };
    return bytes > DESCRIPTOR && ebpo_load32(frame) == ZSTD_MAGICNUMBER &&
           frame[DESCRIPTOR] & CONTENT_CHECKSUM;
}

/* --- encoding --- */

/* Begins a frame. If `level` is 0, chunks of at least LARGE bytes get a higher level than zstd's
 * default, and no short matches. The reason is that the byte planes of low bytes are noise, and in
 * noise short matches take more bits than single bytes. Smaller chunks do not gain by these
 * settings, so they get the settings of HDF5's filter. */
static bool begin_frame(ZSTD_CCtx *out, int level, size_t raw_bytes)
{
    enum { LARGE = 4096, LEVEL_OF_LARGE = 7, MATCH_LEAST = 6 };
    bool is_large = !level && raw_bytes >= LARGE;
    if (!level)
        level = is_large ? LEVEL_OF_LARGE : EBPO_ZSTD_LEVEL;
    return !ZSTD_isError(ZSTD_CCtx_reset(out, ZSTD_reset_session_and_parameters)) &&
           !ZSTD_isError(ZSTD_CCtx_setParameter(out, ZSTD_c_compressionLevel, level)) &&
           !ZSTD_isError(ZSTD_CCtx_setParameter(out, ZSTD_c_checksumFlag, 1)) &&
           (!is_large || !ZSTD_isError(ZSTD_CCtx_setParameter(out, ZSTD_c_minMatch, MATCH_LEAST)));
}

/* Encodes the blocks of a chunk in one frame. Returns the frame's size, or a zstd error. */
static size_t encode_blocks(ZSTD_CCtx *zstd, const uint8_t *raw, size_t raw_bytes,
                            const ebpo_chunk_blocks *b, uint8_t *out)
{
    ZSTD_outBuffer to = { out, ebpo_chunk_bound(raw_bytes), 0 };
    size_t pending = ZSTD_CCtx_setPledgedSrcSize(zstd, raw_bytes), at = 0;
    for (int i = 0; i <= b->count && pending == 0; i++) {
        size_t end = i < b->count ? b->end[i] : raw_bytes;
        ZSTD_inBuffer from = { raw + at, end - at, 0 };
        pending = ZSTD_compressStream2(zstd, &to, &from, i == b->count ? ZSTD_e_end : ZSTD_e_flush);
        at = end;
    }
    return pending ? (size_t)-1 : to.pos; /* ZSTD_isError treats -1 as an error */
}

ebpo_status ebpo_zstd_encode(ebpo_chunk_coder *coder, int level, const uint8_t *raw,
                             size_t raw_bytes, const ebpo_chunk_blocks *b, uint8_t *out,
                             size_t *out_bytes)
{
    if (!coder->zstd_out)
        coder->zstd_out = ZSTD_createCCtx();
    if (!coder->zstd_out)
        return EBPO_E_MEMORY;
    if (!begin_frame(coder->zstd_out, level, raw_bytes))
        return EBPO_E_ARGUMENT;
    size_t size = b->count ? encode_blocks(coder->zstd_out, raw, raw_bytes, b, out)
                           : ZSTD_compress2(coder->zstd_out, out, ebpo_chunk_bound(raw_bytes), raw,
                                            raw_bytes);
    *out_bytes = size;
    /* `out` is large enough, so a lack of memory is the only possible cause */
    return ZSTD_isError(size) ? EBPO_E_MEMORY : EBPO_OK;
}

/* --- decoding --- */

/* Returns EBPO_E_FORMAT, with the reason in *why. */
static ebpo_status frame_is_broken(const char **why, const char *what)
{
    *why = what;
    return EBPO_E_FORMAT;
}

static ZSTD_DCtx *make_reader(void)
{
    ZSTD_DCtx *in = ZSTD_createDCtx();
#ifdef EBPO_FUZZING
    if (in) /* ZSTD_d_forceIgnoreChecksum: a fuzzer cannot make correct checksums */
        (void)ZSTD_DCtx_setParameter(in, ZSTD_d_experimentalParam3, 1);
#endif
    return in;
}

ebpo_status ebpo_zstd_decode(ebpo_chunk_coder *coder, const uint8_t *stored, size_t stored_bytes,
                             uint8_t *raw, size_t raw_bytes, const char **why)
{
    if (!coder->zstd_in)
        coder->zstd_in = make_reader();
    if (!coder->zstd_in)
        return EBPO_E_MEMORY;
    if (ZSTD_getFrameContentSize(stored, stored_bytes) != raw_bytes)
        return frame_is_broken(why, "the zstd frame does not state the chunk's size");
    if (!ebpo_zstd_has_checksum(stored, stored_bytes))
        return frame_is_broken(why, "the zstd frame has no checksum");
    const char *fault = ebpo_zstd_fault(stored, stored_bytes);
    if (fault)
        return frame_is_broken(why, fault);
    if (ZSTD_findFrameCompressedSize(stored, stored_bytes) != stored_bytes)
        return frame_is_broken(why, "the zstd frame does not fill the chunk");
    size_t size = ZSTD_decompressDCtx(coder->zstd_in, raw, raw_bytes, stored, stored_bytes);
    if (ZSTD_isError(size))
        return frame_is_broken(why, ZSTD_getErrorName(size));
    return size == raw_bytes
               ? EBPO_OK
               : frame_is_broken(why, "the zstd frame decodes to another size than the chunk's");
}

void ebpo_zstd_coder_clear(ebpo_chunk_coder *coder)
{
    ZSTD_freeCCtx(coder->zstd_out);
    ZSTD_freeDCtx(coder->zstd_in);
    coder->zstd_out = coder->zstd_in = NULL;
}
