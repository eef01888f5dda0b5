/* Counts the scalar steps of decoding chunks, which vectors replace. */
#include <string.h>

#include "check_main.h"
#include "core/endian.h"
#include "core/simd.h"
#include "hdf5_read/coding.h"

static unsigned stores, conversions;

static void count_store(uint8_t *to, uint32_t value)
{
    stores++;
    ebpo_store32(to, value);
}

static uint32_t count_conversion(uint32_t code)
{
    conversions++;
    return ebpo_unzigzag32(code);
}

#define ebpo_store32    count_store
#define ebpo_unzigzag32 count_conversion
#include "hdf5_read/chunk.c"
#include "hdf5_read/coding.c"
#undef ebpo_store32
#undef ebpo_unzigzag32

enum { COUNT = 1003 };

START_TEST(test_elements_of_four_bytes_are_restored_together)
{
    static uint8_t in[4 * COUNT], shuffled[4 * COUNT], out[4 * COUNT];
    for (int i = 0; i < 4 * COUNT; i++)
        in[i] = (uint8_t)(i * 151 + i / 256);
    for (size_t count = 0; count <= COUNT; count += count < 40 ? 1 : 321) {
        memset(out, 0, sizeof out);
        ebpo_shuffle(in, 4 * count, 4, shuffled);
        stores = 0;
        ebpo_unshuffle(shuffled, 4 * count, 4, out);
        ck_assert(memcmp(in, out, 4 * count) == 0);
        ck_assert(count == COUNT || out[4 * count] == 0);
#ifdef EBPO_SIMD_SSE2
        ck_assert_uint_eq(stores, count % 16);
#endif
    }
}
END_TEST

START_TEST(test_coordinates_of_a_row_are_decoded_together)
{
    static const uint32_t bits[8] = { 0,          0x80000000, 0x3f800000, 0xbf800001,
                                      0x7f800000, 0xff800000, 0x7fc00001, 0xffffffff };
    float xyz[COUNT], back[COUNT];
    uint8_t file[4 * COUNT];
    for (int i = 0; i < COUNT; i++) {
        uint32_t value = bits[i * 5 % 8] + (uint32_t)i / 8;
        memcpy(&xyz[i], &value, sizeof value);
    }
    ebpo_points32_encode(xyz, COUNT / 3, file);
    conversions = 0;
    ebpo_points32_decode(file, COUNT / 3, back);
    ck_assert(memcmp(xyz, back, sizeof *xyz * (COUNT / 3 * 3)) == 0);
    ck_assert_uint_eq(conversions, 0);
}
END_TEST

Suite *test_suite(void)
{
    Suite *suite = suite_create("decoding");
    TCase *tests = tcase_create("decoding");
    tcase_add_test(tests, test_elements_of_four_bytes_are_restored_together);
    tcase_add_test(tests, test_coordinates_of_a_row_are_decoded_together);
    suite_add_tcase(suite, tests);
    return suite;
}
