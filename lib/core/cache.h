/* Caches: items found by key, loaded when they are missing, under a budget that several caches may
 * share; those used least recently go first. Any thread may call. */
#ifndef EBPO_CORE_CACHE_H
#define EBPO_CORE_CACHE_H

#include <ebpo/base.h>

typedef struct ebpo_cache ebpo_cache;

/* Where items come from. Called without locks held, by any thread; estimate and load never twice at
 * a time for one key. They may use other caches, and of this one ebpo_cache_take_aside only. */
typedef struct ebpo_cache_source {
    void *user;
    /* Bytes that loading `key` will take, the item itself included; room for that is made first.
     * *keep: what the item takes once loaded. */
    ebpo_status (*estimate)(void *user, uint64_t key, uint64_t *peak, uint64_t *keep,
                            ebpo_error *error);
    /* May take `most` bytes meanwhile: what was said, UINT64_MAX without a budget. *bytes: of the
     * item. Where that does not do: EBPO_E_LIMIT, with what might do, more than `most`, in *bytes;
     * then room for so much is made, and it is called again. An item that is larger is dropped,
     * and the get fails with EBPO_E_LIMIT. */
    ebpo_status (*load)(void *user, uint64_t key, uint64_t most, void **item, uint64_t *bytes,
                        ebpo_error *error);
    void (*release)(void *user, void *item);
} ebpo_cache_source;

typedef struct ebpo_cache_stats {
    uint64_t hits;                       /* finds that needed no waiting */
    uint64_t loads, prefetched, evicted; /* by get, in the background, to make room */
    /* items, what loads under way may take, and what has been taken aside */
    uint64_t bytes, peak_bytes;
    double load_seconds; /* that callers of get waited */
} ebpo_cache_stats;

/* Keys that may be asked for ahead. */
enum { EBPO_CACHE_AHEAD = 64 };

/* A budget that caches share: of all their items the least recently used go first. */
typedef struct ebpo_cache_pool ebpo_cache_pool;

EBPO_MUST_USE ebpo_status ebpo_cache_pool_make(ebpo_cache_pool **out, uint64_t budget,
                                               ebpo_error *error);
/* After its caches; NULL is fine. */
void ebpo_cache_pool_free(ebpo_cache_pool *pool);
/* Takes bytes of the budget for something else, until they are given back; items are dropped for
 * it. EBPO_E_LIMIT: what is in use leaves no room. */
EBPO_MUST_USE ebpo_status ebpo_cache_pool_take(ebpo_cache_pool *pool, uint64_t bytes,
                                               ebpo_error *error);
void ebpo_cache_pool_give_back(ebpo_cache_pool *pool, uint64_t bytes);
/* All, the most that there ever were, and what has been taken so. */
void ebpo_cache_pool_get_bytes(ebpo_cache_pool *pool, uint64_t *now, uint64_t *peak,
                               uint64_t *taken);

/* Things in memory under a budget: found by key, loaded when missing, the least recently used go
 * first. Any thread may call. */

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
