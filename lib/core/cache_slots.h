/* What caches hold that share a budget: a table by cache and key, and the order of last use of what
 * is not in use. */
#ifndef EBPO_CORE_CACHE_SLOTS_H
#define EBPO_CORE_CACHE_SLOTS_H

#include <stdbool.h>
#include <stdint.h>

typedef enum ebpo_cache_slot_state { LOADING, READY, FAILED } ebpo_cache_slot_state;

struct ebpo_cache;

/* One key of one cache. In the table while LOADING or READY; a FAILED one lives on until its last
 * waiter has seen it. */
typedef struct ebpo_cache_slot {
    struct ebpo_cache *owner;
    uint64_t key, bytes;
    ebpo_cache_slot_state state;
    unsigned pins, waiters;
    void *item;
    struct ebpo_cache_slot *chain;         /* in its bucket, or in a list of items that leave */
    struct ebpo_cache_slot *older, *newer; /* READY and not pinned: by last use */
} ebpo_cache_slot;

/* Chains by hash: unlike in core/hash.h, keys are taken out again. */
typedef struct ebpo_cache_slots {
    ebpo_cache_slot **bucket;
    uint64_t bucket_count, count;
    ebpo_cache_slot *oldest, *newest;
} ebpo_cache_slots;

/* False: out of memory. Its user frees the slots, then `bucket`. */
bool ebpo_cache_slots_make(ebpo_cache_slots *t);
/* NULL: it has none of this key. */
ebpo_cache_slot *ebpo_cache_slots_find(const ebpo_cache_slots *t, const struct ebpo_cache *owner,
                                       uint64_t key);
/* A new one, LOADING, in the table but not in the order; NULL: out of memory. */
ebpo_cache_slot *ebpo_cache_slots_add(ebpo_cache_slots *t, struct ebpo_cache *owner, uint64_t key);
void ebpo_cache_slots_take(ebpo_cache_slots *t, ebpo_cache_slot *s);

/* Into the order of last use as the newest, and out of it. */
void ebpo_cache_slots_link(ebpo_cache_slots *t, ebpo_cache_slot *s);
void ebpo_cache_slots_unlink(ebpo_cache_slots *t, ebpo_cache_slot *s);

#endif
