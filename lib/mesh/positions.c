#include "core/strict_fp.h"

#include "mesh/positions.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/workspace.h"
#include "core/hash.h"

enum { VERTEX_GRAIN = 1 << 14 };

typedef struct key {
    uint64_t bits[3];
} key;

static inline key key_of(const ebpo_mesh *mesh, uint32_t v)
{
    double p[3];
    key k;
    ebpo_mesh_position(mesh, v, p);
    for (int i = 0; i < 3; i++)
        p[i] += 0.0; /* -0 becomes 0 */
    memcpy(k.bits, p, sizeof k.bits);
    return k;
}

static inline bool same_key(const key *a, const key *b)
{
    return a->bits[0] == b->bits[0] && a->bits[1] == b->bits[1] && a->bits[2] == b->bits[2];
}

/* True when the position was there already. Whoever comes first, the slot ends up with the lowest
 * number. */
static bool insert(ebpo_positions *t, uint32_t v)
{
    key k = key_of(t->mesh, v);
    for (uint64_t h = ebpo_hash_three(k.bits) & t->mask;; h = (h + 1) & t->mask) {
        uint32_t held = __atomic_load_n(&t->slots[h], __ATOMIC_RELAXED);
        if (held == EBPO_NO_INDEX &&
            __atomic_compare_exchange_n(&t->slots[h], &held, v, false, __ATOMIC_RELAXED,
                                        __ATOMIC_RELAXED))
            return false;
        key other = key_of(t->mesh, held);
        if (!same_key(&k, &other))
            continue;
        while (v < held && !__atomic_compare_exchange_n(&t->slots[h], &held, v, false,
                                                        __ATOMIC_RELAXED, __ATOMIC_RELAXED))
            ;
        return true;
    }
}

static ebpo_status insert_range(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                ebpo_error *error)
{
    (void)worker, (void)error;
    ebpo_positions *t = context;
    uint64_t repeated = 0;
    EBPO_FOR_ITEMS_SCATTERED(t->mesh->workspace, v, begin, end)
        repeated += insert(t, (uint32_t)v);
    __atomic_fetch_add(&t->repeated, repeated, __ATOMIC_RELAXED);
    return EBPO_OK;
}

ebpo_status ebpo_positions_build(ebpo_positions *out, const ebpo_mesh *mesh, unsigned threads,
                                 const ebpo_progress *progress, ebpo_error *error)
{
    uint64_t size = ebpo_hash_slots(mesh->vertex_count + mesh->vertex_count / 3);
    *out = (ebpo_positions){ .mesh = mesh, .workspace = mesh->workspace, .mask = size - 1 };
    out->slots = ebpo_array_alloc(mesh->workspace, size, sizeof *out->slots);
    if (!out->slots)
        return ebpo_workspace_fail(mesh->workspace, size * sizeof *out->slots, error);
    ebpo_array_fill(mesh->workspace, out->slots, 0xff, size * sizeof *out->slots);
    ebpo_status status =
        ebpo_parallel_for(threads, NULL, mesh->vertex_count, VERTEX_GRAIN, insert_range, out,
                          progress, "comparing positions", error);
    if (status != EBPO_OK)
        ebpo_positions_free(out);
    return status;
}

void ebpo_positions_free(ebpo_positions *positions)
{
    ebpo_array_free(positions->workspace, positions->slots);
    *positions = (ebpo_positions){ .mesh = NULL };
}

static inline bool has_key(const ebpo_positions *t, uint32_t held, uint32_t v, const key *k)
{
    if (held == v)
        return true;
    key other = key_of(t->mesh, held);
    return same_key(k, &other);
}

uint32_t ebpo_positions_first(const ebpo_positions *t, uint32_t v)
{
    key k = key_of(t->mesh, v);
    uint64_t at;
    EBPO_HASH_FIND(at, ebpo_hash_three(k.bits), t->mask, has_key(t, t->slots[at], v, &k));
    return t->slots[at];
}
