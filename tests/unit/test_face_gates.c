/* Compares the coding `gates` of faces with the simple reader of the verifier. */
#include <stdlib.h>
#include <string.h>

#include "core/endian.h"
#include "core/hash.h"
#include "hdf5_read/chunk.h"
#include "hdf5_read/coding.h"
#include "check_main.h"
#include "hdf5_read/face_gates.h"
#include "solids.h"
#include "verify/verify_parts.h"

enum { ROWS = 4096, BYTES = ROWS * EBPO_GATES_COLS };

/* ---- meshes ---- */

static uint64_t pick(uint64_t *state, uint64_t below) { return ebpo_random_next(state) % below; }

/* Makes a face of a grid. Faces are ordered by strips and rows, as in scans. */
static void grid_face(uint64_t i, uint32_t width, uint32_t *face)
{
    uint32_t square = (uint32_t)(i / 2), x = square % width, y = square / width,
             v = y * (width + 1) + x;
    const uint32_t low[3] = { v, v + 1, v + width + 1 },
                   high[3] = { v + 1, v + width + 2, v + width + 1 };
    memcpy(face, i % 2 ? high : low, sizeof low);
}

enum { GRID, WIDE_GRID, SHUFFLED, SOUP, FEW_VERTICES, FAR, KINDS };

static void any_face(int kind, uint64_t i, uint64_t *state, uint32_t *face)
{
    if (kind <= SHUFFLED)
        grid_face(kind == SHUFFLED ? pick(state, ROWS) : i, kind == WIDE_GRID ? 400 : 13, face);
    for (uint32_t k = 0; k < 3 && kind > SHUFFLED; k++)
        face[k] = kind == SOUP           ? (uint32_t)(3 * i + k)
                  : kind == FEW_VERTICES ? (uint32_t)pick(state, 7)
                                         : (uint32_t)pick(state, 100000);
    uint32_t turned[3], turn = (uint32_t)pick(state, 3);
    bool mirrored = pick(state, 16) == 0;
    for (uint32_t k = 0; k < 3; k++)
        turned[k] = face[(turn + (mirrored ? 2 * k : k)) % 3];
    memcpy(face, turned, sizeof turned);
}

/* Renumbers vertices by first use, as high-water codes need, when `before` vertices were seen
 * before. Returns the number of vertices seen afterwards. */
static uint64_t number_by_use(uint32_t *faces, uint32_t rows, uint64_t before, uint64_t *state)
{
    static uint32_t number[400000];
    uint64_t seen = before;
    memset(number, 0xff, sizeof number);
    for (uint32_t i = 0; i < 3 * rows; i++) {
        uint32_t *n = &number[faces[i]];
        if (*n == UINT32_MAX)
            *n = before && pick(state, 4) == 0 ? (uint32_t)pick(state, before) : (uint32_t)seen;
        faces[i] = *n;
        seen += *n == seen;
    }
    return seen;
}

static uint32_t faces_made[3 * ROWS], faces_back[3 * ROWS], faces_reference[3 * ROWS];
static uint8_t codes_made[12 * ROWS], codes_back[12 * ROWS], chunk[BYTES];

static bool decode(uint32_t rows, uint64_t before, uint32_t *faces)
{
    return ebpo_gates_decode(chunk, rows, codes_back) &&
           ebpo_corners_decode(codes_back, rows, &before, faces);
}

static bool read_reference(uint32_t rows, uint64_t before)
{
    return ebpo_plain_gates_read(chunk, rows, &before, faces_reference);
}

static void make(int kind, uint32_t rows, uint64_t before, uint64_t *state,
                 size_t ends[EBPO_GATES_ENDS])
{
    for (uint32_t i = 0; i < rows; i++)
        any_face(kind, i, state, faces_made + 3 * i);
    number_by_use(faces_made, rows, before, state);
    uint64_t seen = before;
    ck_assert(ebpo_corners_encode(faces_made, rows, &seen, codes_made));
    memset(chunk, 0xa5, sizeof chunk);
    ebpo_gates_encode(codes_made, rows, chunk, ends);
}

START_TEST(test_face_encoding_round_trip)
{
    static const uint64_t befores[] = { 0, 5, 300, 70000, UINT32_MAX - 60000 };
    uint64_t state = (uint64_t)_i + 1;
    for (uint64_t turn = 0; turn < ebpo_test_scaled(60); turn++) {
        uint32_t rows = turn % 4 == 0   ? 1 + (uint32_t)pick(&state, 20)
                        : turn % 4 == 1 ? ROWS
                                        : 1 + (uint32_t)pick(&state, ROWS);
        uint64_t before = befores[pick(&state, 5)];
        size_t ends[EBPO_GATES_ENDS];
        make(_i, rows, before, &state, ends);
        for (int i = 0; i < EBPO_GATES_ENDS; i++)
            ck_assert(ends[i] <= 13 * (size_t)rows && (i == 0 || ends[i - 1] <= ends[i]));
        ck_assert(decode(rows, before, faces_back));
        ck_assert_int_eq(memcmp(codes_back, codes_made, 12 * (size_t)rows), 0);
        ck_assert_int_eq(memcmp(faces_back, faces_made, 12 * (size_t)rows), 0);
        ck_assert(read_reference(rows, before));
        ck_assert_int_eq(memcmp(faces_reference, faces_made, 12 * (size_t)rows), 0);
    }
}
END_TEST

/* Changed bytes either give the result of the reference implementation, or are refused by both
 * readers. */
START_TEST(test_changed_face_bytes_match_reference)
{
    uint64_t state = (uint64_t)_i + 100, taken = 0, refused = 0;
    for (uint64_t turn = 0; turn < ebpo_test_scaled(2000); turn++) {
        uint32_t rows = 1 + (uint32_t)pick(&state, turn % 8 ? 60 : ROWS);
        uint64_t before = pick(&state, 3) * 1000, changes = 1 + pick(&state, 3);
        size_t ends[EBPO_GATES_ENDS];
        make(_i, rows, before, &state, ends);
        size_t used = ends[EBPO_GATES_ENDS - 1];
        for (; changes; changes--)
            chunk[pick(&state, pick(&state, 8) ? used : 13 * rows)] =
                (uint8_t)pick(&state, pick(&state, 2) ? 16 : 256);
        bool fine = decode(rows, before, faces_back);
        ck_assert(fine == read_reference(rows, before));
        taken += fine;
        refused += !fine;
        if (fine)
            ck_assert_int_eq(memcmp(faces_reference, faces_back, 12 * (size_t)rows), 0);
    }
    ck_assert(refused > 0 && (taken > 0 || ebpo_test_scale() < 0.3));
}
END_TEST

START_TEST(test_noise_face_bytes_match_reference)
{
    uint64_t state = 7;
    for (uint64_t turn = 0; turn < ebpo_test_scaled(4000); turn++) {
        uint32_t rows = 1 + (uint32_t)pick(&state, turn % 50 ? 30 : ROWS);
        uint64_t most = UINT64_C(2) << pick(&state, 8);
        for (size_t i = 0; i < 13 * (size_t)rows; i++)
            chunk[i] = (uint8_t)(i > 4 * (size_t)rows && turn % 2 ? 0 : pick(&state, most));
        chunk[0] = (uint8_t)(turn % 5 == 4);
        bool fine = decode(rows, 1000000, faces_back);
        ck_assert(fine == read_reference(rows, 1000000));
        if (fine)
            ck_assert_int_eq(memcmp(faces_reference, faces_back, 12 * (size_t)rows), 0);
    }
}
END_TEST

/* A grid takes two bytes for each face and hardly any index. Other faces are stored as codes. */
START_TEST(test_face_stream_lengths)
{
    uint64_t state = 3;
    size_t ends[EBPO_GATES_ENDS];
    make(GRID, ROWS, 0, &state, ends);
    ck_assert_uint_eq(chunk[0], 0);
    ck_assert_uint_eq(ends[0], ROWS);
    ck_assert_uint_lt(ends[3], 3 * ROWS);
    for (uint32_t i = 0; i < 3 * ROWS; i++)
        ebpo_store32(codes_made + 4 * i, 1000000 + 5000 * i);
    ebpo_gates_encode(codes_made, ROWS, chunk, ends);
    ck_assert_uint_eq(chunk[0], 1);
    ck_assert_uint_eq(ends[3], 12 * ROWS + 1);
    ck_assert(ebpo_gates_decode(chunk, ROWS, codes_back));
    ck_assert_int_eq(memcmp(codes_back, codes_made, sizeof codes_made), 0);
    chunk[BYTES - 1] = 1;
    ck_assert(!ebpo_gates_decode(chunk, ROWS, codes_back));
}
END_TEST

TEST_SUITE(face_gates)
{
    Suite *s = suite_create("face_gates");
    TCase *tests = tcase_create("face_gates");
    tcase_set_timeout(tests, 600);
    tcase_add_loop_test(tests, test_face_encoding_round_trip, 0, KINDS);
    tcase_add_loop_test(tests, test_changed_face_bytes_match_reference, 0, KINDS);
    tcase_add_test(tests, test_noise_face_bytes_match_reference);
    tcase_add_test(tests, test_face_stream_lengths);
    suite_add_tcase(s, tests);
    return s;
}
