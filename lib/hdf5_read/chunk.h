/* Encodes and decodes chunks of arrays as HDF5 stores them, with shuffle, compression and checksum.
 * The encoded bytes are equal to the output of libhdf5's filters. Also declares the shape of an
 * array, and the location of a chunk in its file. */
#ifndef EBPO_HDF5_READ_CHUNK_H
#define EBPO_HDF5_READ_CHUNK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <ebpo/base.h>

#include "hdf5_read/codec.h"

/* Filter pipelines: the filters of an array, in the order of application. The first three pipelines
 * have the values of ebpo_codec. Shuffle is only applied to elements of more than one byte. */
typedef enum ebpo_pipeline {
    EBPO_PIPELINE_ZSTD,     /* shuffle, zstd frame with content size and checksum */
    EBPO_PIPELINE_DEFLATE,  /* shuffle, zlib stream, fletcher32 */
    EBPO_PIPELINE_CHECKSUM, /* fletcher32 */
    EBPO_PIPELINE_BARE,     /* no filters, as `h5repack -f NONE` writes; read, never written */
    EBPO_PIPELINE_COUNT
} ebpo_pipeline;

/* HDF5 filter numbers. */
enum {
    EBPO_FILTER_DEFLATE = 1,
    EBPO_FILTER_SHUFFLE = 2,
    EBPO_FILTER_FLETCHER = 3,
    EBPO_FILTER_ZSTD = 32015
};

/* The properties of a pipeline; each is a row of the table in chunk.c. */
typedef struct ebpo_pipeline_facts {
    unsigned filter[2]; /* HDF5 filter numbers in the order of application, without shuffle */
    int filter_count;
    int level;       /* default level of compression, which headers state; 0: no levels */
    int level_max;   /* greatest allowed level of compression */
    bool compresses; /* true: compresses; elements of several bytes are shuffled first */
    bool fletcher;   /* true: a fletcher32 checksum comes last */
} ebpo_pipeline_facts;

const ebpo_pipeline_facts *ebpo_pipeline_facts_of(ebpo_pipeline pipeline);
/* Finds the pipeline of these filters. Returns false if no pipeline has these filters. For elements
 * of one byte, the filters may include shuffle, because h5repack shuffles all arrays. Shuffle does
 * not change such elements. */
bool ebpo_pipeline_of_filters(const unsigned *filters, int count, unsigned element_size,
                              ebpo_pipeline *pipeline);

/* Frees the memory of a coder. */
void ebpo_chunk_coder_clear(ebpo_chunk_coder *coder);

/* Encodes raw_bytes bytes (a multiple of element_size) into `out`, which has space for
 * ebpo_chunk_bound(raw_bytes) bytes. `level`: level of compression; 0: the default, which for zstd
 * depends on the chunk's size. */
EBPO_MUST_USE ebpo_status ebpo_chunk_encode(ebpo_chunk_coder *coder, ebpo_pipeline pipeline,
                                            int level, size_t element_size, const uint8_t *raw,
                                            size_t raw_bytes, uint8_t *out, size_t *out_bytes);

/* Same as ebpo_chunk_encode, for elements of one byte that form `count` consecutive streams, and a
 * last part after them. Stream i ends at ends[i] (ascending; streams may be empty), and the last
 * part ends at raw_bytes. zstd compresses each stream and the last part as a separate block. */
EBPO_MUST_USE ebpo_status ebpo_chunk_encode_streams(ebpo_chunk_coder *coder, ebpo_pipeline pipeline,
                                                    int level, const uint8_t *raw, size_t raw_bytes,
                                                    const size_t *ends, int count, uint8_t *out,
                                                    size_t *out_bytes);

/* Decodes into exactly raw_bytes bytes. Safe for any stored bytes. If the stored bytes are damaged,
 * returns EBPO_E_FORMAT and sets *why to a static string with the reason. */
EBPO_MUST_USE ebpo_status ebpo_chunk_decode(ebpo_chunk_coder *coder, ebpo_pipeline pipeline,
                                            size_t element_size, const uint8_t *stored,
                                            size_t stored_bytes, uint8_t *raw, size_t raw_bytes,
                                            const char **why);

/* Applies HDF5's shuffle: writes byte 0 of every element, then byte 1 of every element, and so on.
 * `bytes` is a multiple of element_size. */
void ebpo_shuffle(const uint8_t *in, size_t bytes, size_t element_size, uint8_t *out);
/* Reverses ebpo_shuffle. */
void ebpo_unshuffle(const uint8_t *in, size_t bytes, size_t element_size, uint8_t *out);

/* Returns HDF5's fletcher32 checksum of big-endian 16-bit words. It consists of two sums modulo
 * 65535. A sum that is a positive multiple of 65535 becomes 65535, not 0. */
uint32_t ebpo_fletcher32(const uint8_t *data, size_t bytes);

/* The shape of an integer array: [rows] if cols is 0, else [rows][cols]. Each chunk has chunk_rows
 * rows; the last chunk is padded. element_size: bytes of an integer. */
typedef struct ebpo_shape {
    uint64_t rows;
    uint32_t cols;
    uint32_t chunk_rows;
    uint8_t element_size;
    bool is_signed;
    ebpo_pipeline pipeline;
} ebpo_shape;

/* The offset and size of a stored chunk in the file. */
typedef struct ebpo_chunk_location {
    uint64_t address;
    uint32_t bytes;
    uint32_t checksum_row; /* for format/checksum_pages.h: row of /subtrees/checksums, or 0 */
} ebpo_chunk_location;

/* Returns the number of rows in a full chunk. This is the largest power of two with which a chunk
 * takes at most 64 KiB, or `rows` if `rows` is less. rows > 0. */
static inline uint32_t ebpo_full_chunk_rows(uint64_t rows, uint32_t cols, uint32_t element_size)
{
    uint32_t row = element_size * (cols ? cols : 1), full = 1;
    while (2 * full * row <= EBPO_CHUNK_BYTES_MAX)
        full *= 2;
    return rows < full ? (uint32_t)rows : full;
}
/* Returns the number of chunks of an array. */
static inline uint64_t ebpo_shape_chunks(const ebpo_shape *shape)
{
    return shape->rows / shape->chunk_rows + (shape->rows % shape->chunk_rows != 0);
}
static inline size_t ebpo_shape_row_bytes(const ebpo_shape *shape)
{
    return (size_t)shape->element_size * (shape->cols ? shape->cols : 1);
}

#endif
