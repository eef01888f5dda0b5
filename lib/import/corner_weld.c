#include "import/corner_weld.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/hash.h"

#define EMPTY UINT32_MAX

/* The bits of a vertex, those of -0 as those of 0. */
static void key_of(const char *xyz, size_t size, uint64_t key[3])
{
    float narrow[3];
    double wide[3];
    memcpy(size == sizeof narrow ? (void *)narrow : (void *)wide, xyz, size);
    for (int k = 0; k < 3; k++) {
        double value = size == sizeof narrow ? (double)narrow[k] : wide[k];
        value = value == 0 ? 0 : value;
        memcpy(&key[k], &value, sizeof value);
    }
}

static bool has_key(const char *xyz, size_t size, const uint64_t key[3])
{
    uint64_t own[3];
    key_of(xyz, size, own);
    return memcmp(key, own, sizeof own) == 0;
}

/* Place of the key in the table: where an equal vertex is, or would go. */
static uint64_t find(const uint32_t *table, uint64_t mask, const char *xyz, size_t size,
                     const uint64_t key[3])
{
    uint64_t at;
    EBPO_HASH_FIND(at, ebpo_hash_three(key), mask,
                   table[at] == EMPTY || has_key(xyz + table[at] * size, size, key));
    return at;
}

ebpo_status ebpo_import_weld(void *xyz, size_t size, uint64_t count, uint32_t *map,
                             uint64_t *welded, ebpo_error *error)
{
    char *vertex = xyz;
    uint64_t slots = ebpo_hash_slots(count + count / 2);
    uint32_t *table = ebpo_alloc(slots, sizeof *table);
    if (!table)
        return ebpo_fail_memory(error, slots * sizeof *table);
    memset(table, 0xff, (size_t)slots * sizeof *table);
    uint32_t kept = 0;
    for (uint64_t i = 0; i < count; i++) {
        uint64_t key[3];
        key_of(vertex + i * size, size, key);
        uint64_t at = find(table, slots - 1, vertex, size, key);
        if (table[at] == EMPTY) {
            memmove(vertex + kept * size, vertex + i * size, size);
            table[at] = kept++;
        }
        map[i] = table[at];
    }
    free(table);
    *welded = kept;
    return EBPO_OK;
}
