/* Encodes and decodes numbers by the codings of format-spec/README.md, section 9. There are three
 * kinds. The first kind stores differences to the previous value (modulo 2^32 or 2^64), in zigzag
 * code: 0, -1, 1, -2 become 0, 1, 2, 3. The second kind stores corners of faces relative to the
 * number of vertices that were used so far. The third kind stores integers with fewer bytes.
 * Encoding and decoding are exact inverses for every bit pattern. Floats are first converted to
 * integers, so that a greater float becomes a greater integer. Files are little-endian. */
#include "hdf5_read/coding.h"

#include <string.h>

#include "core/endian.h"

void ebpo_points32_encode(const float *xyz, uint64_t rows, uint8_t *file)
{
    uint32_t before[3] = { 0, 0, 0 };
    for (uint64_t i = 0; i < rows * 3; i++) {
        uint32_t bits;
        memcpy(&bits, &xyz[i], sizeof bits);
        uint32_t value = ebpo_float_order32(bits);
        ebpo_store32(file + 4 * i, ebpo_zigzag32(value - before[i % 3]));
        before[i % 3] = value;
    }
}

void ebpo_points32_decode(const uint8_t *file, uint64_t rows, float *xyz)
{
    typedef uint32_t row4 __attribute__((vector_size(16))); /* a row, and an unused number */
    row4 before = { 0, 0, 0, 0 };
    for (uint64_t i = 0; i < rows; i++, file += 12) {
        row4 code = { ebpo_load32(file), ebpo_load32(file + 4), ebpo_load32(file + 8), 0 };
        before += (code >> 1) ^ (0 - (code & 1));                           /* ebpo_unzigzag32 */
        row4 bits = before ^ ((0 - (before >> 31)) & UINT32_C(0x7fffffff)); /* ..._float_order32 */
        memcpy(&xyz[3 * i], &bits, 12);
    }
}

void ebpo_points64_encode(const double *xyz, uint64_t rows, uint8_t *file)
{
    uint64_t before[3] = { 0, 0, 0 };
    for (uint64_t i = 0; i < rows * 3; i++) {
        uint64_t bits;
        memcpy(&bits, &xyz[i], sizeof bits);
        uint64_t value = ebpo_float_order64(bits);
        ebpo_store64(file + 8 * i, ebpo_zigzag64(value - before[i % 3]));
        before[i % 3] = value;
    }
}

void ebpo_points64_decode(const uint8_t *file, uint64_t rows, double *xyz)
{
    uint64_t before[3] = { 0, 0, 0 };
    for (uint64_t i = 0; i < rows * 3; i++) {
        before[i % 3] += ebpo_unzigzag64(ebpo_load64(file + 8 * i));
        uint64_t bits = ebpo_float_order64(before[i % 3]);
        memcpy(&xyz[i], &bits, sizeof bits);
    }
}

void ebpo_numbers_encode(const uint32_t *numbers, uint64_t rows, uint8_t *file)
{
    uint32_t before = 0;
    for (uint64_t i = 0; i < rows; i++) {
        ebpo_store32(file + 4 * i, ebpo_zigzag32(numbers[i] - before));
        before = numbers[i];
    }
}

void ebpo_numbers_decode(const uint8_t *file, uint64_t rows, uint32_t *numbers)
{
    uint32_t before = 0;
    for (uint64_t i = 0; i < rows; i++)
        numbers[i] = before += ebpo_unzigzag32(ebpo_load32(file + 4 * i));
}

bool ebpo_corners_encode(const uint32_t *faces, uint64_t rows, uint64_t *seen, uint8_t *file)
{
    for (uint64_t i = 0; i < rows * 3; i++) {
        if (faces[i] > *seen)
            return false;
        uint64_t code = *seen - faces[i];
        *seen += code == 0;
        ebpo_store32(file + 4 * i, (uint32_t)code);
    }
    return true;
}

bool ebpo_corners_decode(const uint8_t *file, uint64_t rows, uint64_t *seen, uint32_t *faces)
{
    for (uint64_t i = 0; i < rows * 3; i++) {
        uint32_t code = ebpo_load32(file + 4 * i);
        if (code > *seen)
            return false;
        faces[i] = (uint32_t)(*seen - code);
        *seen += code == 0;
    }
    return true;
}

/* Returns element i of an array of unsigned integers of `size` bytes. */
static uint64_t get_native(const void *values, size_t size, uint64_t i)
{
    switch (size) {
    case 1: return ((const uint8_t *)values)[i];
    case 2: return ((const uint16_t *)values)[i];
    case 4: return ((const uint32_t *)values)[i];
    default: return ((const uint64_t *)values)[i];
    }
}

void ebpo_integers_encode(const void *values, size_t size, uint64_t rows, size_t file_size,
                          uint8_t *file)
{
    for (uint64_t i = 0; i < rows; i++) {
        uint64_t value = get_native(values, size, i);
        switch (file_size) {
        case 1: file[i] = (uint8_t)value; break;
        case 2: ebpo_store16(file + 2 * i, (uint16_t)value); break;
        case 4: ebpo_store32(file + 4 * i, (uint32_t)value); break;
        default: ebpo_store64(file + 8 * i, value);
        }
    }
}

/* Reads a little-endian integer. Signed integers are sign-extended to 64 bits. */
static uint64_t load_integer(const uint8_t *p, size_t size, bool is_signed)
{
    switch (size) {
    case 1: return is_signed ? (uint64_t)(int64_t)(int8_t)p[0] : p[0];
    case 2: return is_signed ? (uint64_t)(int64_t)(int16_t)ebpo_load16(p) : ebpo_load16(p);
    case 4: return is_signed ? (uint64_t)(int64_t)(int32_t)ebpo_load32(p) : ebpo_load32(p);
    default: return ebpo_load64(p);
    }
}

void ebpo_integers_decode(const uint8_t *file, size_t file_size, bool is_signed, uint64_t rows,
                          void *values, size_t size)
{
    for (uint64_t i = 0; i < rows; i++) {
        uint64_t value = load_integer(file + file_size * i, file_size, is_signed);
        switch (size) {
        case 1: ((uint8_t *)values)[i] = (uint8_t)value; break;
        case 2: ((uint16_t *)values)[i] = (uint16_t)value; break;
        case 4: ((uint32_t *)values)[i] = (uint32_t)value; break;
        default: ((uint64_t *)values)[i] = value;
        }
    }
}

static void put_native(void *values, size_t size, uint64_t i, uint64_t value)
{
    switch (size) {
    case 1: ((uint8_t *)values)[i] = (uint8_t)value; break;
    case 2: ((uint16_t *)values)[i] = (uint16_t)value; break;
    case 4: ((uint32_t *)values)[i] = (uint32_t)value; break;
    default: ((uint64_t *)values)[i] = value;
    }
}

static void store_integer(uint8_t *file, size_t size, uint64_t value)
{
    switch (size) {
    case 1: *file = (uint8_t)value; break;
    case 2: ebpo_store16(file, (uint16_t)value); break;
    case 4: ebpo_store32(file, (uint32_t)value); break;
    default: ebpo_store64(file, value);
    }
}

/* Converts the bits of a float (size 4) or double (size 8) to an integer, or back. A greater number
 * becomes a greater integer. */
static uint64_t sortable_bits(uint64_t bits, size_t size)
{
    return size == 4 ? ebpo_float_order32((uint32_t)bits) : ebpo_float_order64(bits);
}

/* Returns the zigzag code of a difference. Only the lowest `size` bytes of the difference are used,
 * and their highest bit is the sign. */
static uint64_t zigzag_of(uint64_t difference, size_t size)
{
    unsigned unused = 64 - 8 * (unsigned)size;
    return ebpo_zigzag64((uint64_t)((int64_t)(difference << unused) >> unused));
}

void ebpo_columns_encode(const void *values, size_t size, bool floats, uint64_t rows, uint32_t cols,
                         uint8_t *file)
{
    for (uint32_t c = 0; c < cols; c++) {
        uint64_t before = 0;
        for (uint64_t i = 0; i < rows; i++, file += size) {
            uint64_t value = get_native(values, size, i * cols + c);
            if (floats)
                value = sortable_bits(value, size);
            store_integer(file, size, zigzag_of(value - before, size));
            before = value;
        }
    }
}

void ebpo_columns_decode(const uint8_t *file, size_t size, bool floats, uint64_t rows,
                         uint32_t cols, void *values)
{
    for (uint32_t c = 0; c < cols; c++) {
        uint64_t value = 0;
        for (uint64_t i = 0; i < rows; i++, file += size) {
            value += ebpo_unzigzag64(load_integer(file, size, false));
            put_native(values, size, i * cols + c, floats ? sortable_bits(value, size) : value);
        }
    }
}
