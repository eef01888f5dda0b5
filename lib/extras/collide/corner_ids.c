#include "core/strict_fp.h"

#include "extras/collide/corner_ids.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"

static uint64_t hash_of(const double x[3])
{
    uint64_t bits[3], h = 0;
    memcpy(bits, x, sizeof bits);
    for (int k = 0; k < 3; k++) {
        h = (h ^ bits[k]) * UINT64_C(0x9e3779b97f4a7c15);
        h ^= h >> 32;
    }
    return h;
}

static bool same(const double p[3], const double q[3])
{
    return p[0] == q[0] && p[1] == q[1] && p[2] == q[2];
}

/* Where the corner is in the table, or a free place. */
static uint32_t *find(const ebpo_corner_ids *ids, const double x[3])
{
    uint64_t i = hash_of(x) & (ids->table_size - 1);
    while (ids->table[i] && !same(ids->at[ids->table[i] - 1], x))
        i = (i + 1) & (ids->table_size - 1);
    return &ids->table[i];
}

static bool enlarge(ebpo_corner_ids *ids)
{
    uint64_t size = ids->table_size ? 2 * ids->table_size : 1024;
    uint32_t *table = ebpo_alloc_zero(size, sizeof *table);
    if (!table)
        return false;
    free(ids->table);
    ids->table = table;
    ids->table_size = size;
    for (uint64_t i = 0; i < ids->count; i++)
        *find(ids, ids->at[i]) = (uint32_t)i + 1;
    return true;
}

bool ebpo_corner_id(ebpo_corner_ids *ids, const double x[3], uint32_t *id)
{
    const double corner[3] = { x[0] + 0.0, x[1] + 0.0, x[2] + 0.0 }; /* no -0 */
    if ((2 * ids->count >= ids->table_size && !enlarge(ids)) || ids->count >= UINT32_MAX - 1)
        return false;
    uint32_t *at = find(ids, corner);
    if (*at == 0) {
        if (!ebpo_grow(&ids->at, &ids->capacity, ids->count + 1, sizeof *ids->at))
            return false;
        memcpy(ids->at[ids->count++], corner, sizeof corner);
        *at = (uint32_t)ids->count;
    }
    *id = *at - 1;
    return true;
}

void ebpo_corner_ids_free(ebpo_corner_ids *ids)
{
    free(ids->at);
    free(ids->table);
    *ids = (ebpo_corner_ids){ 0 };
}
