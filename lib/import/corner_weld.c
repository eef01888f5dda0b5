#include "import/corner_weld.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/hash.h"

#define EMPTY UINT32_MAX

static void key_of(const float xyz[3], uint32_t key[3])
{
    memcpy(key, xyz, 3 * sizeof *key);
    for (int k = 0; k < 3; k++)
        if (key[k] == UINT32_C(0x80000000))
            key[k] = 0;
}

static bool has_key(const float xyz[3], const uint32_t key[3])
{
    uint32_t own[3];
    key_of(xyz, own);
    return memcmp(key, own, sizeof own) == 0;
}

/* Place of the key in the table: where an equal vertex is, or would go. */
static uint64_t find(const uint32_t *table, uint64_t mask, const float *xyz, const uint32_t key[3])
{
    const uint64_t wide[3] = { key[0], key[1], key[2] };
    uint64_t at;
    EBPO_HASH_FIND(at, ebpo_hash_three(wide), mask,
                   table[at] == EMPTY || has_key(xyz + 3 * (uint64_t)table[at], key));
    return at;
}

ebpo_status ebpo_import_weld(float *xyz, uint64_t count, uint32_t *map, uint64_t *welded,
                             ebpo_error *error)
{
    uint64_t slots = ebpo_hash_slots(count + count / 2);
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
