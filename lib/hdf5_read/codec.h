/* The interface of chunk codecs, and the codecs in separate files. The table of all codecs is in
 * chunk.c. */
#ifndef EBPO_HDF5_READ_CODEC_H
#define EBPO_HDF5_READ_CODEC_H

#include <ebpo/base.h>

enum {
    EBPO_CHUNK_BYTES_MAX = 65536, /* bytes of one chunk before compression */
    EBPO_ZSTD_LEVEL = 3,          /* for small chunks; stated in headers */
    EBPO_DEFLATE_LEVEL = 6
};

/* Compression state and scratch of one thread; zero-initialise it, clear it when done. */
typedef struct ebpo_chunk_coder {
    void *zstd_out, *zstd_in;
    uint8_t scratch[EBPO_CHUNK_BYTES_MAX];
} ebpo_chunk_coder;

/* Returns the most bytes of an encoded chunk of `raw_bytes` <= EBPO_CHUNK_BYTES_MAX, in any
 * pipeline. The format fixes this bound above those of zlib and zstd (at most a 256th and 68 bytes
 * more than the data), so that the bound does not change with their versions. */
static inline size_t ebpo_chunk_bound(size_t raw_bytes)
{
    return raw_bytes + raw_bytes / 256 + 1024;
}

/* The ends of the blocks of a chunk's zstd frame, without the last block's end. There are at most
 * as many as the widest element has bytes. */
typedef struct ebpo_chunk_blocks {
    size_t end[8];
    int count;
} ebpo_chunk_blocks;

/* Encodes or decodes for a row of the table in chunk.c: `level` 0 is the default, `out` holds
 * ebpo_chunk_bound(raw_bytes) bytes; `*why` as in ebpo_chunk_decode. */
EBPO_MUST_USE ebpo_status ebpo_zstd_encode(ebpo_chunk_coder *coder, int level, const uint8_t *raw,
                                           size_t raw_bytes, const ebpo_chunk_blocks *b,
                                           uint8_t *out, size_t *out_bytes);
EBPO_MUST_USE ebpo_status ebpo_zstd_decode(ebpo_chunk_coder *coder, const uint8_t *stored,
                                           size_t stored_bytes, uint8_t *raw, size_t raw_bytes,
                                           const char **why);
void ebpo_zstd_coder_clear(ebpo_chunk_coder *coder);

/* Returns an error text, or NULL. There are two kinds of error. First, a bit is set that RFC 8878
 * requires to be 0 and most versions of zstd ignore (bit 4 of the frame's descriptor, and the two
 * lowest bits of the modes of each section of sequences). Second, a block repeats its byte only
 * once; zstd writes this as a raw byte. Also returns NULL where the frame cannot be parsed;
 * decoding reports that. */
const char *ebpo_zstd_fault(const uint8_t *frame, size_t bytes);

/* Returns true if a frame has a checksum of its content: zstd also decodes frames without a
 * checksum, but detects no damage in them. RFC 8878, 3.1.1. */
bool ebpo_zstd_has_checksum(const uint8_t *frame, size_t bytes);

#endif
