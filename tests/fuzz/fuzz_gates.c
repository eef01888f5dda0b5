/* Any bytes as a chunk of faces with the coding `gates`: read as by the simple reader of the
 * verifier, or refused by both. The first byte gives the number of vertices seen before. */
#include "fuzz_support.h"

#include "hdf5_read/coding.h"
#include "hdf5_read/face_gates.h"
#include "verify/verify_parts.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint32_t rows = size > EBPO_GATES_COLS ? (uint32_t)((size - 1) / EBPO_GATES_COLS) : 0;
    if (rows == 0)
        return 0;
    size_t corners = 12 * (size_t)rows, bytes = EBPO_GATES_COLS * (size_t)rows;
    uint64_t seen = (uint64_t)data[0] * data[0] * 3, plainly_seen = seen;
    uint8_t *in = fuzz_copy(data + 1, bytes), *codes = fuzz_capacity(corners);
    uint32_t *faces = fuzz_capacity(corners), *plainly = fuzz_capacity(corners);
    bool fine =
        ebpo_gates_decode(in, rows, codes) && ebpo_corners_decode(codes, rows, &seen, faces);
    if (fine != ebpo_plain_gates_read(in, rows, &plainly_seen, plainly) ||
        (fine && (seen != plainly_seen || memcmp(faces, plainly, corners) != 0)))
        abort();
    free(in);
    free(codes);
    free(faces);
    free(plainly);
    return 0;
}
