#include "geometry/node_types.h"

#include <string.h>

static const uint64_t EVEN = UINT64_C(0x5555555555555555), PAIRS = UINT64_C(0x3333333333333333),
                      NIBBLES = UINT64_C(0x0f0f0f0f0f0f0f0f), BYTES = UINT64_C(0x00ff00ff00ff00ff);

/* Set bits of each byte; only even bits are set. */
static inline uint64_t bits_of_bytes(uint64_t x)
{
    x = (x & PAIRS) + (x >> 2 & PAIRS);
    return (x + (x >> 4)) & NIBBLES;
}

static inline uint64_t sum_of_bytes(uint64_t x)
{
    return ((x & BYTES) + (x >> 8 & BYTES)) * UINT64_C(0x0001000100010001) >> 48;
}

/* Types of up to 128 groups, four in a word. Bytes of the sums stay below 256. */
static void count_words(const uint8_t *types, unsigned words, uint64_t counts[4])
{
    uint64_t low = 0, high = 0, both = 0;
    for (unsigned i = 0; i < words; i++) {
        uint64_t word;
        memcpy(&word, types + 8 * (size_t)i, sizeof word);
        low += bits_of_bytes(word & EVEN);
        high += bits_of_bytes(word >> 1 & EVEN);
        both += bits_of_bytes(word & word >> 1 & EVEN);
    }
    uint64_t gray = sum_of_bytes(both);
    counts[EBPO_GRAY] += gray;
    counts[EBPO_BLACK] += sum_of_bytes(low) - gray;
    counts[EBPO_LEAF] += sum_of_bytes(high) - gray;
}

void ebpo_groups_count(const void *types, uint64_t groups, uint64_t counts[4])
{
    const uint8_t *at = types;
    uint64_t words = groups / 4;
    memset(counts, 0, 4 * sizeof *counts);
    for (; words; at += 8 * 32, words -= 32) {
        count_words(at, words < 32 ? (unsigned)words : 32, counts);
        if (words < 32)
            break;
    }
    uint8_t rest[8] = { 0 };
    memcpy(rest, (const uint8_t *)types + groups / 4 * 8, groups % 4 * 2);
    count_words(rest, 1, counts);
    counts[EBPO_WHITE] = 8 * groups - counts[EBPO_BLACK] - counts[EBPO_LEAF] - counts[EBPO_GRAY];
}
