/* Things in memory under a budget: found by key, loaded when missing, the least recently used go
 * first. Any thread may call. */
#ifndef EBPO_CORE_CACHE_H
#define EBPO_CORE_CACHE_H

#include "core/cache_pool.h"

/* `budget` in bytes, 0: no limit. `name` ("subtree") is for messages. */
EBPO_MUST_USE ebpo_status ebpo_cache_make(ebpo_cache **out, const ebpo_cache_source *source,
                                          const char *name, uint64_t budget, ebpo_error *error);
/* One of those that share a pool, which outlives it. */
EBPO_MUST_USE ebpo_status ebpo_cache_make_in(ebpo_cache **out, const ebpo_cache_source *source,
                                             const char *name, ebpo_cache_pool *pool,
                                             ebpo_error *error);
/* Stops the background thread, releases all items; none may be pinned. NULL is fine. */
void ebpo_cache_free(ebpo_cache *cache);

/* Finds or loads an item and pins it: it stays until unpinned as often as it was got. Waits while
 * another thread loads the same key, or while a background load holds the room. EBPO_E_LIMIT when
 * the budget has no room even with everything unpinned gone; it says how much would do. *hit may be
 * NULL. */
EBPO_MUST_USE ebpo_status ebpo_cache_get(ebpo_cache *cache, uint64_t key, void **item, bool *hit,
                                         ebpo_error *error);
/* True if an item is there now; no use of it, no hit. */
bool ebpo_cache_has(ebpo_cache *cache, uint64_t key);
void ebpo_cache_unpin(ebpo_cache *cache, uint64_t key);

/* Pins an item if it is there; false, without waiting, when it is not. */
bool ebpo_cache_try(ebpo_cache *cache, uint64_t key, void **item);

/* Asks a background thread (started by the first call) to load these, in this order; what was asked
 * before and is not done yet is forgotten. Loading in the background evicts only what is unpinned
 * and not among the keys asked for; its failures are silent (the key will be loaded when it is
 * needed). At most EBPO_CACHE_AHEAD keys; what is beyond is ignored. Those that are there already
 * count as just used. */
void ebpo_cache_prefetch(ebpo_cache *cache, const uint64_t *keys, unsigned count);

/* Of the budget so many bytes at most may be taken for what stays beside the items; loads are
 * refused as if all of them were. Before the cache is used. */
void ebpo_cache_set_aside(ebpo_cache *cache, uint64_t most);
/* Takes some of them, and drops items for it. False: they are all taken, or items in use
 * and loads under way leave no room now. */
bool ebpo_cache_take_aside(ebpo_cache *cache, uint64_t bytes);
/* What was taken so and is not needed any more. */
void ebpo_cache_give_back_aside(ebpo_cache *cache, uint64_t bytes);

/* Drops everything that is not pinned. */
void ebpo_cache_clear(ebpo_cache *cache);

void ebpo_cache_get_stats(ebpo_cache *cache, ebpo_cache_stats *out);

#endif
