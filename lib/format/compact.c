/* Numbers that are picked here and there out of a large range, made dense in their own order. */
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"
#include "format/compact.h"

static const uint32_t FREE = UINT32_MAX;

uint64_t ebpo_compact_bytes(uint64_t capacity)
{
    const ebpo_compact *c = NULL;
    return ebpo_hash_slots(2 * capacity) * sizeof *c->slot + capacity * 2 * sizeof *c->sorted;
}

ebpo_status ebpo_compact_make(ebpo_compact *out, uint64_t capacity, ebpo_error *error)
{
    *out = (ebpo_compact){ .mask = 0 };
    if (capacity > UINT64_C(1) << 31)
        return ebpo_fail(
            error, EBPO_E_LIMIT,
            "%llu references in one subtree are more than can be numbered; choose a deeper level",
            (unsigned long long)capacity);
    uint64_t slots = ebpo_hash_slots(2 * capacity);
    out->mask = slots - 1;
    out->slot = ebpo_alloc(slots, sizeof *out->slot);
    out->sorted = ebpo_alloc(capacity, sizeof *out->sorted);
    if (!out->slot || !out->sorted) {
        ebpo_compact_free(out);
        return ebpo_fail_memory(error, slots * sizeof *out->slot + capacity * sizeof *out->sorted);
    }
    memset(out->slot, 0xff, slots * sizeof *out->slot);
    return EBPO_OK;
}

void ebpo_compact_free(ebpo_compact *compact)
{
    free(compact->slot);
    free(compact->sorted);
    *compact = (ebpo_compact){ .slot = NULL };
}

/* Where a number is, or would be. */
static uint64_t slot_of(const ebpo_compact *c, uint32_t number)
{
    uint64_t at;
    EBPO_HASH_FIND(at, ebpo_hash_number(number), c->mask,
                   c->slot[at].number == number || c->slot[at].number == FREE);
    return at;
}

void ebpo_compact_add(ebpo_compact *compact, uint32_t number)
{
    uint64_t at = slot_of(compact, number);
    if (compact->slot[at].number == number)
        return;
    compact->slot[at].number = number;
    compact->sorted[compact->count++] = number;
}

/* Radix sort, byte by byte from the lowest; bytes in which all numbers agree are passed over. */
static void sort_numbers(uint32_t *numbers, uint32_t *other, uint64_t count)
{
    uint64_t begin[4][256] = { { 0 } };
    uint32_t *from = numbers, *to = other;
    for (uint64_t i = 0; i < count; i++)
        for (int byte = 0; byte < 4; byte++)
            begin[byte][numbers[i] >> 8 * byte & 255]++;
    for (int byte = 0; byte < 4; byte++) {
        if (begin[byte][from[0] >> 8 * byte & 255] == count)
            continue;
        uint64_t sum = 0;
        for (int k = 0; k < 256; k++) {
            uint64_t here = begin[byte][k];
            begin[byte][k] = sum;
            sum += here;
        }
        for (uint64_t i = 0; i < count; i++)
            to[begin[byte][from[i] >> 8 * byte & 255]++] = from[i];
        uint32_t *swap = from;
        from = to;
        to = swap;
    }
    if (from != numbers)
        memcpy(numbers, from, count * sizeof *numbers);
}

ebpo_status ebpo_compact_sort(ebpo_compact *compact, ebpo_error *error)
{
    if (compact->count == 0)
        return EBPO_OK;
    uint32_t *other = ebpo_alloc(compact->count, sizeof *other);
    if (!other)
        return ebpo_fail_memory(error, compact->count * sizeof *other);
    sort_numbers(compact->sorted, other, compact->count);
    free(other);
    for (uint64_t i = 0; i < compact->count; i++)
        compact->slot[slot_of(compact, compact->sorted[i])].place = (uint32_t)i;
    return EBPO_OK;
}

uint32_t ebpo_compact_find(const ebpo_compact *compact, uint32_t number)
{
    return compact->slot[slot_of(compact, number)].place;
}
