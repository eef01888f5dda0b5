/* By digits from the least on, of so many bits that counting them takes no longer than moving. */
#include "extras/collide/met_sort.h"

#include <string.h>

enum { LEAST_BITS = 4, MOST_BITS = 11 };

static inline uint32_t digit_of(const ebpo_met_pair *m, bool by_a, unsigned shift, unsigned bits)
{
    return (by_a ? m->a : m->b) >> shift & ((1u << bits) - 1);
}

static void pass(const ebpo_met_pair *from, ebpo_met_pair *to, uint64_t count, bool by_a,
                 unsigned shift, unsigned bits)
{
    uint64_t begin[(1 << MOST_BITS) + 1];
    memset(begin, 0, ((1u << bits) + 1) * sizeof *begin);
    for (uint64_t i = 0; i < count; i++)
        begin[digit_of(&from[i], by_a, shift, bits) + 1]++;
    for (unsigned d = 0; d < 1u << bits; d++)
        begin[d + 1] += begin[d];
    for (uint64_t i = 0; i < count; i++)
        to[begin[digit_of(&from[i], by_a, shift, bits)]++] = from[i];
}

static unsigned bits_for(uint64_t count)
{
    unsigned bits = LEAST_BITS;
    while (bits < MOST_BITS && count >> bits > 1)
        bits++;
    return bits;
}

void ebpo_met_sort(ebpo_met_pair *met, ebpo_met_pair *spare, uint64_t count, uint32_t most_a,
                   uint32_t most_b)
{
    ebpo_met_pair *from = met, *to = spare;
    unsigned bits = bits_for(count);
    if (count < 2)
        return;
    for (int by_a = 0; by_a < 2; by_a++)
        for (unsigned shift = 0; shift < 32 && (by_a ? most_a : most_b) >> shift; shift += bits) {
            pass(from, to, count, by_a, shift, bits);
            ebpo_met_pair *other = from;
            from = to;
            to = other;
        }
    if (from != met)
        memcpy(met, from, count * sizeof *met);
}
