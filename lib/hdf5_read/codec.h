/* Declares what all chunk codecs use, and the codec zstd, which is in a separate file. A codec
 * compresses chunks (the unit of compression in HDF5). chunk.c has the table of all codecs. */
#ifndef EBPO_HDF5_READ_CODEC_H
#define EBPO_HDF5_READ_CODEC_H

#include <ebpo/base.h>

enum {
    EBPO_CHUNK_BYTES_MAX = 65536, /* bytes of one chunk before compression */
    EBPO_ZSTD_LEVEL =
        3, /* default level for small chunks; the HDF5 headers of arrays state this level */
    EBPO_DEFLATE_LEVEL = 6 /* default level */
};

/* Compression state and scratch memory of one thread. Initialise it with zeros, and call
 * ebpo_chunk_coder_clear at the end. */
typedef struct ebpo_chunk_coder {
    void *zstd_out, *zstd_in; /* ZSTD_CCtx, ZSTD_DCtx; NULL until needed */
    uint8_t scratch[EBPO_CHUNK_BYTES_MAX];
} ebpo_chunk_coder;

/* Returns the greatest size of an encoded chunk of raw_bytes bytes, with any filters. The format
 * fixes this bound, so that it does not change with the versions of zlib and zstd. The bounds of
 * zlib and zstd are lower: at most 68 bytes and a 256th of the data more than the data. */
static inline size_t ebpo_chunk_bound(size_t raw_bytes)
{
    return raw_bytes + raw_bytes / 256 + 1024;
}

/* The ends of the blocks of a chunk's zstd frame, without the end of the last block. There is one
 * block for each byte position of an element (at most 8), or one block for each stream (chunk.h).
 */
typedef struct ebpo_chunk_blocks {
    size_t end[8];
    int count;
} ebpo_chunk_blocks;

/* Encode and decode a zstd frame. `level`: level of compression; 0: the default. `out`: has space
 * for ebpo_chunk_bound(raw_bytes) bytes. *why: the reason of EBPO_E_FORMAT, a static string. */
EBPO_MUST_USE ebpo_status ebpo_zstd_encode(ebpo_chunk_coder *coder, int level, const uint8_t *raw,
                                           size_t raw_bytes, const ebpo_chunk_blocks *b,
                                           uint8_t *out, size_t *out_bytes);
EBPO_MUST_USE ebpo_status ebpo_zstd_decode(ebpo_chunk_coder *coder, const uint8_t *stored,
                                           size_t stored_bytes, uint8_t *raw, size_t raw_bytes,
                                           const char **why);
void ebpo_zstd_coder_clear(ebpo_chunk_coder *coder);

/* Checks a frame for two kinds of errors that zstd does not report. Returns the error's text or
 * NULL. The first error is a set bit that must be 0 by RFC 8878, but that most versions of zstd
 * ignore. This is bit 4 of the frame's descriptor, or one of the two lowest bits of the modes of a
 * section of sequences. The second error is an RLE block of one byte, because zstd writes a raw
 * block instead. Also returns NULL if the frame cannot be parsed, because decoding reports this
 * error. */
const char *ebpo_zstd_fault(const uint8_t *frame, size_t bytes);

/* Returns true if a frame has a checksum of its content. A frame without a checksum is rejected,
 * because zstd decodes it, but detects no damage in it. RFC 8878, 3.1.1. */
bool ebpo_zstd_has_checksum(const uint8_t *frame, size_t bytes);

#endif
