#include "import/corner_weld.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"

#define EMPTY UINT32_MAX

static void key_of(const float xyz[3], uint32_t key[3])
{
    memcpy(key, xyz, 3 * sizeof *key);
    for (int k = 0; k < 3; k++)
        if (key[k] == UINT32_C(0x80000000))
            key[k] = 0;
}

static uint64_t hash(const uint32_t key[3])
{
    uint64_t h = UINT64_C(0x9e3779b97f4a7c15);
    for (int k = 0; k < 3; k++) {
        h = (h ^ key[k]) * UINT64_C(0xbf58476d1ce4e5b9);
        h ^= h >> 29;
    }
    return h;
}

/* Place of the key in the table: where an equal vertex is, or would go. */
static uint64_t find(const uint32_t *table, uint64_t mask, const float *xyz, const uint32_t key[3])
{
    uint64_t at = hash(key) & mask;
    for (; table[at] != EMPTY; at = (at + 1) & mask) {
        uint32_t other[3];
        key_of(xyz + 3 * (uint64_t)table[at], other);
        if (memcmp(key, other, sizeof other) == 0)
            break;
    }
    return at;
}

ebpo_status ebpo_import_weld(float *xyz, uint64_t count, uint32_t *map, uint64_t *welded,
                             ebpo_error *error)
{
    uint64_t slots = 16;
    while (slots < count + count / 2)
        slots *= 2;
    uint32_t *table = ebpo_alloc(slots, sizeof *table);
    if (!table)
        return ebpo_fail_memory(error, slots * sizeof *table);
    memset(table, 0xff, (size_t)slots * sizeof *table);
    uint32_t kept = 0;
    for (uint64_t i = 0; i < count; i++) {
        uint32_t key[3];
        key_of(xyz + 3 * i, key);
        uint64_t at = find(table, slots - 1, xyz, key);
        if (table[at] == EMPTY) {
            memmove(xyz + 3 * (uint64_t)kept, xyz + 3 * i, 3 * sizeof *xyz);
            table[at] = kept++;
        }
        map[i] = table[at];
    }
    free(table);
    *welded = kept;
    return EBPO_OK;
}
