/* Declares what all chunk codecs use, and the codecs that are in separate files. chunk.c has the
 * table of all codecs. */
#ifndef EBPO_HDF5_READ_CODEC_H
#define EBPO_HDF5_READ_CODEC_H

#include <ebpo/base.h>

enum {
    EBPO_CHUNK_BYTES_MAX = 65536, /* bytes of one chunk before compression */
    EBPO_ZSTD_LEVEL = 3,          /* for small chunks; stated in headers */
    EBPO_DEFLATE_LEVEL = 6
};

/* Compression state and scratch memory of one thread. Initialise it with zeros, and call
 * ebpo_chunk_coder_clear at the end. */
typedef struct ebpo_chunk_coder {
    void *zstd_out, *zstd_in;
    uint8_t scratch[EBPO_CHUNK_BYTES_MAX];
} ebpo_chunk_coder;

/* Returns the greatest size of an encoded chunk of `raw_bytes` <= EBPO_CHUNK_BYTES_MAX, in any
 * pipeline. The format fixes this bound, so that the bound does not change with the versions of
 * zlib and zstd. The bounds of zlib and zstd are lower: at most a 256th and 68 bytes more than the
 * data. */
static inline size_t ebpo_chunk_bound(size_t raw_bytes)
{
    return raw_bytes + raw_bytes / 256 + 1024;
}

/* The ends of the blocks of a chunk's zstd frame, without the last block's end. There is one block
 * for each byte of the widest element (8), or one for each stream. */
typedef struct ebpo_chunk_blocks {
    size_t end[8];
    int count;
} ebpo_chunk_blocks;

/* Encode and decode for a row of the table in chunk.c. `level`: 0 means the default. `out`: has
 * space for ebpo_chunk_bound(raw_bytes) bytes. `*why`: as in ebpo_chunk_decode. */
EBPO_MUST_USE ebpo_status ebpo_zstd_encode(ebpo_chunk_coder *coder, int level, const uint8_t *raw,
                                           size_t raw_bytes, const ebpo_chunk_blocks *b,
                                           uint8_t *out, size_t *out_bytes);
EBPO_MUST_USE ebpo_status ebpo_zstd_decode(ebpo_chunk_coder *coder, const uint8_t *stored,
                                           size_t stored_bytes, uint8_t *raw, size_t raw_bytes,
                                           const char **why);
void ebpo_zstd_coder_clear(ebpo_chunk_coder *coder);

/* Returns the text of an error that zstd does not report, or NULL. There are two kinds of such
 * errors. First, a bit is set that RFC 8878 requires to be 0 and most versions of zstd ignore (bit
 * 4 of the frame's descriptor, and the two lowest bits of the modes of each section of sequences).
 * Second, a block repeats its byte only once; zstd would write a raw byte instead. Also returns
 * NULL if the frame cannot be parsed, because decoding reports such an error. */
const char *ebpo_zstd_fault(const uint8_t *frame, size_t bytes);

/* Returns true if a frame has a checksum of its content: zstd also decodes frames without a
 * checksum, but detects no damage in them. RFC 8878, 3.1.1. */
bool ebpo_zstd_has_checksum(const uint8_t *frame, size_t bytes);

#endif
