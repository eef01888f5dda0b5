/* By digits from the least on; few pairs by comparing. */
#include "collide/met_sort.h"

#include <stdlib.h>
#include <string.h>

enum { DIGIT_BITS = 11, DIGITS = 1 << DIGIT_BITS, FEW = 2000 };

static inline uint32_t digit_of(const ebpo_met_pair *m, bool by_a, unsigned shift)
{
    return (by_a ? m->a : m->b) >> shift & (DIGITS - 1);
}

static void pass(const ebpo_met_pair *from, ebpo_met_pair *to, uint64_t count, bool by_a,
                 unsigned shift)
{
    uint64_t begin[DIGITS + 1] = { 0 };
    for (uint64_t i = 0; i < count; i++)
        begin[digit_of(&from[i], by_a, shift) + 1]++;
    for (int d = 0; d < DIGITS; d++)
        begin[d + 1] += begin[d];
    for (uint64_t i = 0; i < count; i++)
        to[begin[digit_of(&from[i], by_a, shift)]++] = from[i];
}

static int compare(const void *x, const void *y)
{
    const ebpo_met_pair *p = x, *q = y;
    if (p->a != q->a)
        return p->a < q->a ? -1 : 1;
    return (p->b > q->b) - (p->b < q->b);
}

void ebpo_met_sort(ebpo_met_pair *met, ebpo_met_pair *spare, uint64_t count, uint32_t most_a,
                   uint32_t most_b)
{
    if (count <= FEW) {
        if (count)
            qsort(met, count, sizeof *met, compare);
        return;
    }
    ebpo_met_pair *from = met, *to = spare;
    for (int by_a = 0; by_a < 2; by_a++)
        for (unsigned shift = 0; shift < 32 && (by_a ? most_a : most_b) >> shift;
             shift += DIGIT_BITS) {
            pass(from, to, count, by_a, shift);
            ebpo_met_pair *other = from;
            from = to;
            to = other;
        }
    if (from != met)
        memcpy(met, from, count * sizeof *met);
}
