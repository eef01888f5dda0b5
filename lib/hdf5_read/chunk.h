/* A chunk's bytes as HDF5 stores them: shuffle, compression, checksum. Bit for bit what libhdf5's
 * own filters read and write. */
#ifndef EBPO_HDF5_READ_CHUNK_H
#define EBPO_HDF5_READ_CHUNK_H

#include <ebpo/base.h>

enum {
    EBPO_CHUNK_BYTES_MAX = 65536, /* of one chunk before compression */
    EBPO_ZSTD_LEVEL = 3,          /* of small chunks; what headers state */
    EBPO_DEFLATE_LEVEL = 6
};

/* Filter pipelines. Shuffle comes first where elements have more than one byte (but not in the last
 * two). */
typedef enum ebpo_pipeline {
    EBPO_PIPELINE_ZSTD,     /* shuffle, zstd frame with content size and checksum */
    EBPO_PIPELINE_DEFLATE,  /* shuffle, zlib stream, fletcher32 */
    EBPO_PIPELINE_CHECKSUM, /* fletcher32 */
    EBPO_PIPELINE_BARE      /* nothing: what `h5repack -f NONE` leaves; read, never written */
} ebpo_pipeline;

/* Compression state and scratch of one thread; zero-initialise, clear when done. */
typedef struct ebpo_chunk_coder {
    void *zstd_out, *zstd_in;
    uint8_t scratch[EBPO_CHUNK_BYTES_MAX];
} ebpo_chunk_coder;

void ebpo_chunk_coder_clear(ebpo_chunk_coder *coder);

/* Bytes that an encoded chunk of `raw_bytes` <= EBPO_CHUNK_BYTES_MAX can have at most, in any
 * pipeline. */
size_t ebpo_chunk_bound(size_t raw_bytes);

/* Encodes raw_bytes (a multiple of element_size) into `out` of ebpo_chunk_bound(raw_bytes) bytes.
 * `level` 0: the default, which in zstd goes by the chunk's size. */
EBPO_MUST_USE ebpo_status ebpo_chunk_encode(ebpo_chunk_coder *coder, ebpo_pipeline pipeline,
                                            int level, size_t element_size, const uint8_t *raw,
                                            size_t raw_bytes, uint8_t *out, size_t *out_bytes);

/* The same of single bytes that are `count` streams, one behind the other up to ends[i] (ascending,
 * some may be empty), and a rest: zstd tells each by itself. */
EBPO_MUST_USE ebpo_status ebpo_chunk_encode_streams(ebpo_chunk_coder *coder, ebpo_pipeline pipeline,
                                                    int level, const uint8_t *raw, size_t raw_bytes,
                                                    const size_t *ends, int count, uint8_t *out,
                                                    size_t *out_bytes);

/* Decodes into exactly raw_bytes. On EBPO_E_FORMAT *why is a static string that says what is wrong.
 * Safe on any bytes. */
EBPO_MUST_USE ebpo_status ebpo_chunk_decode(ebpo_chunk_coder *coder, ebpo_pipeline pipeline,
                                            size_t element_size, const uint8_t *stored,
                                            size_t stored_bytes, uint8_t *raw, size_t raw_bytes,
                                            const char **why);

/* HDF5's shuffle: byte k of every element, for k = 0, 1, ...; bytes is a multiple of element_size.
 */
void ebpo_shuffle(const uint8_t *in, size_t bytes, size_t element_size, uint8_t *out);
void ebpo_unshuffle(const uint8_t *in, size_t bytes, size_t element_size, uint8_t *out);

/* HDF5's fletcher32: over big-endian 16-bit words, both sums kept modulo 65535 (never reduced to 0
 * from a positive sum). */
uint32_t ebpo_fletcher32(const uint8_t *data, size_t bytes);

#endif
