/* What a cache is made of, and budgets that several of them share. Any thread may call. */
#ifndef EBPO_CORE_CACHE_POOL_H
#define EBPO_CORE_CACHE_POOL_H

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

#endif
