/* Arrays in chunks: their shape, and where a chunk lies in its file. */
#ifndef EBPO_HDF5_READ_SHAPE_H
#define EBPO_HDF5_READ_SHAPE_H

#include "hdf5_read/chunk.h"

/* An integer array: [rows] when cols is 0, else [rows][cols]; chunks of chunk_rows rows. */
typedef struct ebpo_shape {
    uint64_t rows;
    uint32_t cols;
    uint32_t chunk_rows;
    uint8_t element_size;
    bool is_signed;
    ebpo_pipeline pipeline;
} ebpo_shape;

/* Where a chunk lies in the file, as stored. */
typedef struct ebpo_chunk_place {
    uint64_t address;
    uint32_t bytes;
} ebpo_chunk_place;

/* Rows of a chunk: the power of two that fills up to 64 KiB, or all rows when there are fewer. rows
 * > 0. */
static inline uint32_t ebpo_full_chunk_rows(uint64_t rows, uint32_t cols, uint32_t element_size)
{
    uint32_t row = element_size * (cols ? cols : 1), full = 1;
    while (2 * full * row <= EBPO_CHUNK_BYTES_MAX)
        full *= 2;
    return rows < full ? (uint32_t)rows : full;
}
static inline uint64_t ebpo_shape_chunks(const ebpo_shape *shape)
{
    return shape->rows / shape->chunk_rows + (shape->rows % shape->chunk_rows != 0);
}
static inline size_t ebpo_shape_row_bytes(const ebpo_shape *shape)
{
    return (size_t)shape->element_size * (shape->cols ? shape->cols : 1);
}

#endif
