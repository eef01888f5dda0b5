#include "core/strict_fp.h"

#include "mesh/corner_weld.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"

#define EMPTY UINT32_MAX

/* The bits of a coordinate of `size` bytes, those of -0 as those of 0. */
static inline uint64_t bits_of(const char *at, size_t size)
{
    uint32_t narrow;
    uint64_t wide;
    if (size == sizeof narrow) {
        memcpy(&narrow, at, sizeof narrow);
        return narrow << 1 ? narrow : 0;
    }
    memcpy(&wide, at, sizeof wide);
    return wide << 1 ? wide : 0;
}

static inline bool has_key(const char *xyz, size_t size, const uint64_t key[3])
{
    return bits_of(xyz, size) == key[0] && bits_of(xyz + size, size) == key[1] &&
           bits_of(xyz + 2 * size, size) == key[2];
}

/* The size is a constant where this is called, and compiled as such. */
static inline uint64_t weld(char *xyz, size_t size, uint64_t count, uint32_t *map, uint32_t *table,
                            uint64_t slots)
{
    uint32_t kept = 0;
    for (uint64_t i = 0; i < count; i++) {
        const char *own = xyz + 3 * size * i;
        const uint64_t key[3] = { bits_of(own, size), bits_of(own + size, size),
                                  bits_of(own + 2 * size, size) };
        uint64_t at; /* of an equal vertex, or where it would go */
        EBPO_HASH_FIND(at, ebpo_hash_three(key), slots - 1,
                       table[at] == EMPTY || has_key(xyz + 3 * size * table[at], size, key));
        if (table[at] == EMPTY) {
            memmove(xyz + 3 * size * kept, own, 3 * size);
            table[at] = kept++;
        }
        map[i] = table[at];
    }
    return kept;
}

ebpo_status ebpo_import_weld(void *xyz, bool doubles, uint64_t count, uint32_t *map,
                             uint64_t *welded, ebpo_error *error)
{
    uint64_t slots = ebpo_hash_slots(count + count / 2);
    uint32_t *table = ebpo_alloc(slots, sizeof *table);
    if (!table)
        return ebpo_fail_memory(error, slots * sizeof *table);
    memset(table, 0xff, (size_t)slots * sizeof *table);
    *welded = doubles ? weld(xyz, sizeof(double), count, map, table, slots)
                      : weld(xyz, sizeof(float), count, map, table, slots);
    free(table);
    return EBPO_OK;
}
