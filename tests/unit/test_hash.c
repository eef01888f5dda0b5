/* Tests the hash table and the random numbers that all modules share. */
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "core/hash.h"

enum { KEYS = 12288, SLOTS = 16384 }; /* three quarters full */

typedef struct table {
    uint64_t key[SLOTS][3], probes;
    bool used[SLOTS];
} table;

/* Finds the slot of a key, counting the visited slots. */
static uint64_t find(table *t, uint64_t hash, const uint64_t key[3])
{
    uint64_t at;
    EBPO_HASH_FIND(at, hash, SLOTS - 1,
                   (t->probes++, !t->used[at] || memcmp(t->key[at], key, sizeof t->key[at]) == 0));
    return at;
}

/* Typical numbers: consecutive, in steps, with their digits at the top. */
static uint64_t number_of(int kind, uint64_t i)
{
    switch (kind) {
    case 0: return i;
    case 1: return i << 12;
    case 2: return i << 32;
    case 3: return i * 3 + 1000000007;
    case 4: return i << 50;
    default: return i % 64 << 32 | i / 64;
    }
}

static void key_of(int kind, uint64_t i, uint64_t key[3])
{
    double grid[3] = { (double)(i % 32), (double)(i / 32 % 32) / 64, -1e9 * (double)(i / 1024) };
    if (kind == 6) {
        memcpy(key, grid, sizeof grid);
        return;
    }
    key[0] = number_of(kind, i);
    key[1] = key[2] = 0;
}

/* Each key is found in its slot, no other key is found, and few slots are visited. */
START_TEST(test_hash_lookup_finds_keys)
{
    table *t = calloc(1, sizeof *t);
    for (uint64_t i = 0; i < 2 * KEYS; i++) {
        uint64_t key[3];
        key_of(_i, i % KEYS, key);
        uint64_t at = find(t, _i == 6 ? ebpo_hash_three(key) : ebpo_hash_number(key[0]), key);
        ck_assert(t->used[at] == (i >= KEYS));
        memcpy(t->key[at], key, sizeof key);
        t->used[at] = true;
    }
    uint64_t missing[3] = { UINT64_MAX, 1, 2 };
    ck_assert(!t->used[find(t, ebpo_hash_three(missing), missing)]);
    /* random keys visit two and a half slots in the full table, and fewer before */
    ck_assert_uint_lt(t->probes, 2 * KEYS * 3);
    free(t);
}
END_TEST

START_TEST(test_hash_probe_wraps_to_first_slot)
{
    const uint32_t slot[4] = { 7, 0, 0, 9 };
    uint64_t at;
    EBPO_HASH_FIND(at, 3, 3, !slot[at] || slot[at] == 5);
    ck_assert_uint_eq(at, 1);
    EBPO_HASH_FIND(at, 3, 3, !slot[at] || slot[at] == 7);
    ck_assert_uint_eq(at, 0);
}
END_TEST

START_TEST(test_hash_slots_are_power_of_two)
{
    ck_assert_uint_eq(ebpo_hash_slots(0), 16);
    ck_assert_uint_eq(ebpo_hash_slots(16), 16);
    ck_assert_uint_eq(ebpo_hash_slots(17), 32);
    ck_assert_uint_eq(ebpo_hash_slots(UINT64_C(1) << 40), UINT64_C(1) << 40);
}
END_TEST

/* The expected values are the first numbers of SplitMix64 for the state 0, from the program of its
 * authors. */
START_TEST(test_random_matches_splitmix64)
{
    uint64_t state = 0;
    ck_assert_uint_eq(ebpo_random_next(&state), UINT64_C(0xe220a8397b1dcdaf));
    ck_assert_uint_eq(ebpo_random_next(&state), UINT64_C(0x6e789e6aa1b965f4));
    ck_assert_uint_eq(ebpo_random_next(&state), UINT64_C(0x06c45d188009454f));
    ck_assert(ebpo_random_unit(0) == 0);
    ck_assert(ebpo_random_unit(UINT64_MAX) == 1 - 0x1p-53);
}
END_TEST

TEST_SUITE(hash)
{
    TCase *tests = tcase_create("tests");
    tcase_add_loop_test(tests, test_hash_lookup_finds_keys, 0, 7);
    tcase_add_test(tests, test_hash_probe_wraps_to_first_slot);
    tcase_add_test(tests, test_hash_slots_are_power_of_two);
    tcase_add_test(tests, test_random_matches_splitmix64);
    Suite *suite = suite_create("hash");
    suite_add_tcase(suite, tests);
    return suite;
}
