/* SPDX-License-Identifier: MIT
 * Any bytes as coded numbers: each coding is decoded, and encoding again gives the same bytes, as
 * section 9 of format-spec/README.md says.
 *
 * Input: a byte for the coding, a byte for its kinds, the numbers. */
#include "fuzz_support.h"

#include <ebpo/file.h>

#include "hdf5_read/coding.h"
#include "hdf5_read/face_gates.h"
#include "verify/verify_parts.h"

static void points(const uint8_t *data, uint64_t rows, bool doubles)
{
    size_t bytes = (doubles ? 24 : 12) * (size_t)rows;
    uint8_t *in = fuzz_copy(data, bytes), *again = fuzz_capacity(bytes);
    void *values = fuzz_capacity(bytes);
    if (doubles) {
        ebpo_points64_decode(in, rows, values);
        ebpo_points64_encode(values, rows, again);
    } else {
        ebpo_points32_decode(in, rows, values);
        ebpo_points32_encode(values, rows, again);
    }
    fuzz_must(memcmp(in, again, bytes) == 0);
    free(in);
    free(again);
    free(values);
}

static void numbers(const uint8_t *data, uint64_t rows)
{
    uint8_t *in = fuzz_copy(data, 4 * (size_t)rows), *again = fuzz_capacity(4 * (size_t)rows);
    uint32_t *values = fuzz_capacity(4 * (size_t)rows);
    ebpo_numbers_decode(in, rows, values);
    ebpo_numbers_encode(values, rows, again);
    fuzz_must(memcmp(in, again, 4 * (size_t)rows) == 0);
    free(in);
    free(again);
    free(values);
}

static void columns(const uint8_t *data, size_t size, uint8_t kind)
{
    size_t width = (size_t)1 << (kind & 3);
    uint32_t cols = 1 + (kind >> 3 & 7);
    bool floats = kind & 4 && width >= 4;
    uint64_t rows = size / (width * cols);
    size_t bytes = width * cols * (size_t)rows;
    uint8_t *in = fuzz_copy(data, bytes), *again = fuzz_capacity(bytes);
    void *values = fuzz_capacity(bytes);
    ebpo_columns_decode(in, width, floats, rows, cols, values);
    ebpo_columns_encode(values, width, floats, rows, cols, again);
    fuzz_must(memcmp(in, again, bytes) == 0);
    free(in);
    free(again);
    free(values);
}

static void integers(const uint8_t *data, size_t size, uint8_t kind)
{
    size_t stored = (size_t)1 << (kind & 3), width = (size_t)1 << (kind >> 2 & 3);
    uint64_t rows = size / stored;
    if (width < stored)
        return;
    uint8_t *in = fuzz_copy(data, stored * (size_t)rows),
            *again = fuzz_capacity(stored * (size_t)rows);
    void *values = fuzz_capacity(width * (size_t)rows);
    ebpo_integers_decode(in, stored, kind & 16, rows, values, width);
    ebpo_integers_encode(values, width, rows, stored, again);
    fuzz_must(memcmp(in, again, stored * (size_t)rows) == 0);
    free(in);
    free(again);
    free(values);
}

/* Checks that no corner names a vertex beyond those seen. */
static void corners(const uint8_t *data, uint64_t rows, uint8_t kind)
{
    size_t bytes = 12 * (size_t)rows;
    uint64_t before = (uint64_t)kind * kind * 3, seen = before, seen_again = before;
    uint8_t *in = fuzz_copy(data, bytes), *again = fuzz_capacity(bytes);
    uint32_t *faces = fuzz_capacity(bytes);
    if (ebpo_corners_decode(in, rows, &seen, faces)) {
        for (uint64_t i = 0; i < 3 * rows; i++)
            fuzz_must(faces[i] < seen);
        fuzz_must(ebpo_corners_encode(faces, rows, &seen_again, again) && seen == seen_again);
        fuzz_must(memcmp(in, again, bytes) == 0);
    }
    free(in);
    free(again);
    free(faces);
}

/* Checks that any codes can be written as gates, and are read back by both readers. */
static void gates(const uint8_t *data, uint32_t rows, uint8_t kind)
{
    size_t corners = 12 * (size_t)rows, bytes = EBPO_GATES_COLS * (size_t)rows,
           ends[EBPO_GATES_ENDS];
    uint64_t seen = (uint64_t)kind * kind * 3, plainly_seen = seen;
    uint8_t *in = fuzz_copy(data, corners), *out = fuzz_capacity(bytes),
            *again = fuzz_capacity(corners);
    uint32_t *faces = fuzz_capacity(corners), *plainly = fuzz_capacity(corners);
    ebpo_gates_encode(in, rows, out, ends);
    for (int i = 0; i < EBPO_GATES_ENDS; i++)
        fuzz_must(ends[i] <= bytes && (i == 0 || ends[i] >= ends[i - 1]));
    fuzz_must(ebpo_gates_decode(out, rows, again) && memcmp(in, again, corners) == 0);
    bool good = ebpo_corners_decode(in, rows, &seen, faces);
    fuzz_must(good == ebpo_plain_gates_read(out, rows, &plainly_seen, plainly));
    fuzz_must(!good || (seen == plainly_seen && memcmp(faces, plainly, corners) == 0));
    free(in);
    free(out);
    free(again);
    free(faces);
    free(plainly);
}

static void planes(const uint8_t *data, size_t size)
{
    for (; size >= 4; data += 4, size -= 4) {
        uint32_t code;
        int32_t n[3], d;
        memcpy(&code, data, sizeof code);
        if (ebpo_plane_decode(code, n, &d))
            fuzz_must(abs(n[0]) + abs(n[1]) + abs(n[2]) == 511);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size < 3)
        return 0;
    uint8_t coding = data[0] % 7, kind = data[1];
    data += 2;
    size = size - 2 < 65536 ? size - 2 : 65536;
    switch (coding) {
    case 0: points(data, size / (kind & 1 ? 24 : 12), kind & 1); break;
    case 1: numbers(data, size / 4); break;
    case 2: columns(data, size, kind); break;
    case 3: integers(data, size, kind); break;
    case 4: corners(data, size / 12, kind); break;
    case 5:
        if (size >= 12)
            gates(data, (uint32_t)(size / 12), kind);
        break;
    default: planes(data, size);
    }
    return 0;
}
