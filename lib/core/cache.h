/* Caches: items found by key and loaded when missing, under a budget that several caches may share.
 * The least recently used items are dropped first. Thread-safe. */
#ifndef EBPO_CORE_CACHE_H
#define EBPO_CORE_CACHE_H

#include <ebpo/base.h>

typedef struct ebpo_cache ebpo_cache;

/* The source of items. Called without locks held, by any thread; estimate and load never run twice
 * at once for one key. They may use other caches; on this cache they may only call
 * ebpo_cache_take_aside. */
typedef struct ebpo_cache_source {
    void *user;
    /* Estimates the bytes that loading `key` takes, including the item; they are reserved first.
     * *keep: bytes of the loaded item. */
    ebpo_status (*estimate)(void *user, uint64_t key, uint64_t *peak, uint64_t *keep,
                            ebpo_error *error);
    /* Loads an item within `most` bytes: the estimate, or UINT64_MAX without a budget. *bytes: size
     * of the item. If `most` is too little, load returns EBPO_E_LIMIT with a sufficient size, above
     * `most`, in *bytes; the cache then reserves that size and calls load again. An item larger
     * than `most` is dropped, and ebpo_cache_get fails with EBPO_E_LIMIT. */
    ebpo_status (*load)(void *user, uint64_t key, uint64_t most, void **item, uint64_t *bytes,
                        ebpo_error *error);
    void (*release)(void *user, void *item);
} ebpo_cache_source;

typedef struct ebpo_cache_stats {
    uint64_t hits;                       /* lookups that did not wait */
    uint64_t loads, prefetched, evicted; /* loads by get, loads in the background, items dropped */
    /* bytes of items and of reservations for running loads, and bytes set aside; now and at most */
    uint64_t bytes, peak_bytes;
    double load_seconds; /* time that callers of get waited */
} ebpo_cache_stats;

/* Number of keys that may be prefetched. */
enum { EBPO_CACHE_AHEAD = 64 };

/* A budget shared by caches: the least recently used items of all of them are dropped first. */
typedef struct ebpo_cache_pool ebpo_cache_pool;

EBPO_MUST_USE ebpo_status ebpo_cache_pool_make(ebpo_cache_pool **out, uint64_t budget,
                                               ebpo_error *error);
/* Frees the pool; call it after freeing its caches. NULL is allowed. */
void ebpo_cache_pool_free(ebpo_cache_pool *pool);
/* Reserves bytes of the budget for another purpose, until ebpo_cache_pool_give_back returns them.
 * Drops items to free the bytes. EBPO_E_LIMIT: the items in use leave too few bytes. */
EBPO_MUST_USE ebpo_status ebpo_cache_pool_take(ebpo_cache_pool *pool, uint64_t bytes,
                                               ebpo_error *error);
void ebpo_cache_pool_give_back(ebpo_cache_pool *pool, uint64_t bytes);
/* Returns the current bytes, the peak, and the bytes taken by ebpo_cache_pool_take. */
void ebpo_cache_pool_get_bytes(ebpo_cache_pool *pool, uint64_t *now, uint64_t *peak,
                               uint64_t *taken);

/* Makes a cache. `budget` is in bytes; 0 means no limit. `name` ("subtree") is for messages. */
EBPO_MUST_USE ebpo_status ebpo_cache_make(ebpo_cache **out, const ebpo_cache_source *source,
                                          const char *name, uint64_t budget, ebpo_error *error);
/* Makes a cache in a shared pool, which must outlive it. */
EBPO_MUST_USE ebpo_status ebpo_cache_make_in(ebpo_cache **out, const ebpo_cache_source *source,
                                             const char *name, ebpo_cache_pool *pool,
                                             ebpo_error *error);
/* Stops the background thread and releases all items; none may be pinned. NULL is allowed. */
void ebpo_cache_free(ebpo_cache *cache);

/* Finds or loads an item and pins it: the item stays until ebpo_cache_unpin was called once for
 * each get. Waits while another thread loads the same key, or while a background load holds the
 * memory. EBPO_E_LIMIT when the item does not fit the budget even with all unpinned items dropped;
 * the message states a sufficient budget. *hit may be NULL. */
EBPO_MUST_USE ebpo_status ebpo_cache_get(ebpo_cache *cache, uint64_t key, void **item, bool *hit,
                                         ebpo_error *error);
/* Returns true if an item is in memory now; this does not count as a use or a hit. */
bool ebpo_cache_has(ebpo_cache *cache, uint64_t key);
void ebpo_cache_unpin(ebpo_cache *cache, uint64_t key);

/* Pins an item if it is in memory; otherwise returns false without waiting. */
bool ebpo_cache_try(ebpo_cache *cache, uint64_t key, void **item);

/* Requests that a background thread (started by the first call) loads the items of these keys in
 * this order; pending earlier requests are dropped. Background loads evict only items that are
 * unpinned and not among the keys; their failures are silent (get will load the key when needed).
 * Keys beyond EBPO_CACHE_AHEAD are ignored. Items that are in memory already count as just used. */
void ebpo_cache_prefetch(ebpo_cache *cache, const uint64_t *keys, unsigned count);

/* Sets the number of bytes of the budget that are set aside for other data than the items. Loads
 * are refused as if all these bytes were taken. Call it before the cache is used. */
void ebpo_cache_set_aside(ebpo_cache *cache, uint64_t most);
/* Uses bytes that are set aside, and drops items to free them. Returns false if too few are left,
 * or if items in use and running loads leave too little memory now. */
bool ebpo_cache_take_aside(ebpo_cache *cache, uint64_t bytes);
/* Returns bytes that ebpo_cache_take_aside has used. */
void ebpo_cache_give_back_aside(ebpo_cache *cache, uint64_t bytes);

/* Drops all unpinned items. */
void ebpo_cache_clear(ebpo_cache *cache);

void ebpo_cache_get_stats(ebpo_cache *cache, ebpo_cache_stats *out);

#endif
