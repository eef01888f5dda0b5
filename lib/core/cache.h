/* Provides caches. A cache finds items by keys, and loads missing items, under a memory budget that
 * several caches may share. The least recently used items are dropped first; small items are kept
 * longer than large ones. Any thread may call these functions. */
#ifndef EBPO_CORE_CACHE_H
#define EBPO_CORE_CACHE_H

#include <ebpo/base.h>

typedef struct ebpo_cache ebpo_cache;

/* Callbacks that load the items of a cache. Any thread may call them, without a lock; estimate and
 * load are never called at the same time for the same key. The callbacks may use other caches. With
 * this cache, they may only call ebpo_cache_take_aside. */
typedef struct ebpo_cache_source {
    void *user;
    /* Estimates the memory for an item. *peak: bytes that loading takes, including the item. The
     * cache reserves these bytes before it loads the item. *keep: bytes of the loaded item. */
    ebpo_status (*estimate)(void *user, uint64_t key, uint64_t *peak, uint64_t *keep,
                            ebpo_error *error);
    /* Loads an item with at most `most` bytes of memory: the reserved bytes, or UINT64_MAX if there
     * is no budget. *bytes: size of the item. If `most` is not sufficient, load returns
     * EBPO_E_LIMIT and sets *bytes to a sufficient number above `most`; the cache then reserves
     * this number and calls load again. If load succeeds but the item is larger than `most`, the
     * cache releases the item, and ebpo_cache_get fails with EBPO_E_LIMIT. */
    ebpo_status (*load)(void *user, uint64_t key, uint64_t most, void **item, uint64_t *bytes,
                        ebpo_error *error);
    /* Frees an item. */
    void (*release)(void *user, void *item);
} ebpo_cache_source;

typedef struct ebpo_cache_stats {
    uint64_t hits;  /* number of calls of ebpo_cache_get and ebpo_cache_try that found an item */
    uint64_t loads; /* number of items that ebpo_cache_get has loaded */
    uint64_t prefetched; /* number of items that the background thread has loaded */
    uint64_t evicted;    /* number of items that were dropped so that others fit in the budget */
    /* bytes of items, of reservations for running loads, and of ebpo_cache_take_aside: now, and
     * greatest so far */
    uint64_t bytes, peak_bytes;
    double load_seconds; /* time that callers of ebpo_cache_get waited */
} ebpo_cache_stats;

/* Greatest number of keys of a prefetch. */
enum { EBPO_CACHE_AHEAD = 64 };

/* A budget that caches share: items of all these caches are dropped in one order. */
typedef struct ebpo_cache_pool ebpo_cache_pool;

EBPO_MUST_USE ebpo_status ebpo_cache_pool_make(ebpo_cache_pool **out, uint64_t budget,
                                               ebpo_error *error);
/* Frees the pool; call it after freeing its caches. NULL is allowed. */
void ebpo_cache_pool_free(ebpo_cache_pool *pool);
/* Reserves bytes of the budget for data other than items, until ebpo_cache_pool_give_back is
 * called. Drops items to free these bytes. Returns EBPO_E_LIMIT if the items in use leave too few
 * bytes. */
EBPO_MUST_USE ebpo_status ebpo_cache_pool_take(ebpo_cache_pool *pool, uint64_t bytes,
                                               ebpo_error *error);
void ebpo_cache_pool_give_back(ebpo_cache_pool *pool, uint64_t bytes);
/* Sets *now to the bytes in use, *peak to the greatest number of bytes in use so far, and *taken to
 * the bytes that ebpo_cache_pool_take has reserved. */
void ebpo_cache_pool_get_bytes(ebpo_cache_pool *pool, uint64_t *now, uint64_t *peak,
                               uint64_t *taken);

/* Makes a cache. `budget`: in bytes; 0: no limit. `name`: kind of the items, such as "subtree", for
 * messages. */
EBPO_MUST_USE ebpo_status ebpo_cache_make(ebpo_cache **out, const ebpo_cache_source *source,
                                          const char *name, uint64_t budget, ebpo_error *error);
/* Makes a cache that uses a shared budget. The pool must outlive the cache. */
EBPO_MUST_USE ebpo_status ebpo_cache_make_in(ebpo_cache **out, const ebpo_cache_source *source,
                                             const char *name, ebpo_cache_pool *pool,
                                             ebpo_error *error);
/* Stops the background thread and releases all items; none may be pinned. NULL is allowed. */
void ebpo_cache_free(ebpo_cache *cache);

/* Finds or loads an item and pins it: the item stays until ebpo_cache_unpin was called once for
 * each call of this function. Waits while another thread loads the same key, or while a background
 * load uses the memory. Returns EBPO_E_LIMIT if the item exceeds the budget even after all unpinned
 * items are dropped; the message states a sufficient budget. *hit: true if the item was in memory;
 * `hit` may be NULL. */
EBPO_MUST_USE ebpo_status ebpo_cache_get(ebpo_cache *cache, uint64_t key, void **item, bool *hit,
                                         ebpo_error *error);
/* Returns true if an item is in memory now; this does not count as a use or a hit. */
bool ebpo_cache_has(ebpo_cache *cache, uint64_t key);
void ebpo_cache_unpin(ebpo_cache *cache, uint64_t key);

/* Pins an item if it is in memory; otherwise returns false without waiting. */
bool ebpo_cache_try(ebpo_cache *cache, uint64_t key, void **item);

/* Requests that a background thread, which the first call starts, loads the items of these keys in
 * this order. Requests of earlier calls that are not loaded yet are dropped. Background loads drop
 * only items that are unpinned and not among these keys. If a background load fails, nothing is
 * reported; ebpo_cache_get loads the item when it is needed. Keys beyond the first EBPO_CACHE_AHEAD
 * are ignored. Items that are already in memory count as just used. */
void ebpo_cache_prefetch(ebpo_cache *cache, const uint64_t *keys, unsigned count);

/* Sets `most` bytes of the budget aside for data other than items: items can no longer use these
 * bytes. Call this function before the cache is used. */
void ebpo_cache_set_aside(ebpo_cache *cache, uint64_t most);
/* Takes bytes that are set aside, and drops items to free memory. Returns false if too few bytes
 * are still set aside, or if items in use and running loads leave too little memory now. */
bool ebpo_cache_take_aside(ebpo_cache *cache, uint64_t bytes);
/* Gives back bytes that ebpo_cache_take_aside has taken. */
void ebpo_cache_give_back_aside(ebpo_cache *cache, uint64_t bytes);

/* Drops all unpinned items. */
void ebpo_cache_clear(ebpo_cache *cache);

void ebpo_cache_get_stats(ebpo_cache *cache, ebpo_cache_stats *out);

#endif
