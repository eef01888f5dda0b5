/* Encodes and decodes numbers by the codings of format-spec/README.md, section 9, which turn arrays
 * into small numbers before compression. Encoding and decoding are exact inverses for every bit
 * pattern. `file`: encoded bytes, little-endian, without alignment. `rows`: number of rows. Any
 * thread may call these functions. */
#ifndef EBPO_HDF5_READ_CODING_H
#define EBPO_HDF5_READ_CODING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* These functions convert a difference, modulo 2^32 or 2^64, to its zigzag code, and back. The
 * differences 0, -1, 1, -2, 2 have the codes 0, 1, 2, 3, 4. */
static inline uint32_t ebpo_zigzag32(uint32_t v) { return (v << 1) ^ (0u - (v >> 31)); }
static inline uint32_t ebpo_unzigzag32(uint32_t v) { return (v >> 1) ^ (0u - (v & 1)); }
static inline uint64_t ebpo_zigzag64(uint64_t v) { return (v << 1) ^ (UINT64_C(0) - (v >> 63)); }
static inline uint64_t ebpo_unzigzag64(uint64_t v) { return (v >> 1) ^ (UINT64_C(0) - (v & 1)); }

/* These functions convert the bits of a float or double to a signed integer of the same order, that
 * is, greater floats give greater integers. Applied twice, a function returns the original bits. */
static inline uint32_t ebpo_float_order32(uint32_t bits)
{
    return bits ^ ((0u - (bits >> 31)) & UINT32_C(0x7fffffff));
}
static inline uint64_t ebpo_float_order64(uint64_t bits)
{
    return bits ^ ((UINT64_C(0) - (bits >> 63)) & UINT64_C(0x7fffffffffffffff));
}

/* Encode and decode points, [rows][3]. Each component is coded as the difference to the same
 * component of the previous row (to 0 in the first row), modulo 2^32 or 2^64, in zigzag code.
 * Floats are first converted to integers of the same order. */
void ebpo_points32_encode(const float *xyz, uint64_t rows, uint8_t *file);
void ebpo_points32_decode(const uint8_t *file, uint64_t rows, float *xyz);
void ebpo_points64_encode(const double *xyz, uint64_t rows, uint8_t *file);
void ebpo_points64_decode(const uint8_t *file, uint64_t rows, double *xyz);

/* Encode and decode numbers. Each number is coded as the difference to the previous number (to 0
 * for the first number), modulo 2^32, in zigzag code. */
void ebpo_numbers_encode(const uint32_t *numbers, uint64_t rows, uint8_t *file);
void ebpo_numbers_decode(const uint8_t *file, uint64_t rows, uint32_t *numbers);

/* Encode and decode columns. `values`: [rows][cols] unsigned integers of `size` bytes (1, 2, 4 or
 * 8), in the machine's byte order. `file` has the columns one after another. Each value is coded as
 * the difference to the previous value of its column (to 0 for the first value), modulo 2^(8 *
 * size), in zigzag code. If `floats` is true, the values are floats or doubles; these are first
 * converted to integers of the same order. */
void ebpo_columns_encode(const void *values, size_t size, bool floats, uint64_t rows, uint32_t cols,
                         uint8_t *file);
void ebpo_columns_decode(const uint8_t *file, size_t size, bool floats, uint64_t rows,
                         uint32_t cols, void *values);

/* Encode and decode corners of faces, [rows][3], relative to *seen, the number of vertices used so
 * far. Code 0 means vertex *seen, and *seen is then incremented. Code k > 0 means vertex *seen - k.
 * If a corner is a vertex above *seen, or a code is above *seen, the functions return false, and
 * *seen keeps the value that it had before this corner. */
bool ebpo_corners_encode(const uint32_t *faces, uint64_t rows, uint64_t *seen, uint8_t *file);
bool ebpo_corners_decode(const uint8_t *file, uint64_t rows, uint64_t *seen, uint32_t *faces);

/* Convert between little-endian integers of `file_size` bytes in a file and native integers of
 * `size` bytes in memory. Both sizes are 1, 2, 4 or 8, and file_size <= size. The integers are
 * signed or unsigned. The caller has checked that the values fit into file_size bytes. */
void ebpo_integers_encode(const void *values, size_t size, uint64_t rows, size_t file_size,
                          uint8_t *file);
void ebpo_integers_decode(const uint8_t *file, size_t file_size, bool is_signed, uint64_t rows,
                          void *values, size_t size);

#endif
