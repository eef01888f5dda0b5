/* Keeps items in caches under a memory budget. A pool is a budget that several caches share; a
 * cache with a separate budget has its own pool. A slot is the record of one key of one cache. A
 * pool has one lock and one table of slots for all its caches, and keeps the order of last use of
 * small items apart from that of large items. Memory for an item is reserved before the item is
 * loaded, and the lock is not held while a source loads or releases items. While an item is loaded,
 * its slot is LOADING, and threads that need the same key wait. Waiting reservations are served in
 * order of arrival; otherwise a large reservation might wait for ever. A prefetch is a list of keys
 * that the caller will need soon. A background thread loads their items. To free memory, this
 * thread drops no item that is in use or in the same prefetch. */
#include <inttypes.h>
#include <pthread.h>
#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/cache.h"
#include "core/error.h"
#include "core/hash.h"
#include "core/os.h"
#include "core/parallel.h"

typedef enum cache_slot_state { LOADING, READY, FAILED } cache_slot_state;

struct ebpo_cache;

/* The slot of one key of one cache. The slot is in the table while it is LOADING or READY; a FAILED
 * slot is freed when the last waiting thread has seen it. */
typedef struct cache_slot {
    struct ebpo_cache *owner;
    uint64_t key, bytes; /* bytes: size of the item */
    cache_slot_state state;
    unsigned pins, waiters;           /* number of pins, and of threads that wait for the load */
    void *item;                       /* set if the slot is READY */
    struct cache_slot *chain;         /* next slot in the bucket, or in a list of leaving items */
    struct cache_slot *older, *newer; /* READY and not pinned: neighbours in order of last use */
} cache_slot;

/* Items that are not pinned, in the order of last use. */
typedef struct cache_order {
    cache_slot *oldest, *newest;
    uint64_t bytes; /* sum of the items */
} cache_order;

/* A small item has at most SMALL bytes. Its load takes more time for each byte than that of a large
 * item, so large items are dropped first, unless small items take more than half of the budget. */
enum { SMALL = 2048 };

/* The slots of all caches that share a budget. This is a hash table with chains, because keys are
 * also removed, which the tables of core/hash.h do not allow. */
typedef struct cache_slots {
    cache_slot **bucket; /* [bucket_count], a power of two */
    uint64_t bucket_count, count;
    cache_order order[2]; /* of large items, and of small items */
} cache_slots;

struct ebpo_cache_pool {
    uint64_t budget; /* bytes; 0: no limit */
    /* protects all members that follow, and the caches of the pool; never held while a source is
     * called */
    pthread_mutex_t lock;
    pthread_cond_t changed; /* broadcast when a load has ended or memory has become free */
    cache_slots slots;
    /* bytes that all caches and ebpo_cache_pool_take use: now, and greatest so far */
    uint64_t bytes, peak_bytes;
    uint64_t pinned;    /* bytes of pinned items */
    uint64_t taken;     /* bytes that ebpo_cache_pool_take has reserved */
    uint64_t aside_max; /* sum of the bytes that all caches have set aside */
    /* bytes reserved for running loads, and bytes of items that are being released: they will
     * become free or pinned when the loads and releases end */
    uint64_t passing;
    /* tickets: number of tickets given so far. Each reservation takes a ticket; reservations of
     * background threads and of bytes set aside take none. serving: the ticket whose turn it is */
    uint64_t tickets, serving;
};

struct ebpo_cache {
    ebpo_cache_source source;
    char name[32];
    ebpo_cache_pool *pool;
    bool owns_pool; /* true: no other cache uses the pool, which is freed with this cache */
    /* signalled when the background thread has work; separate from `changed`, because each unpin
     * broadcasts `changed`, which would wake the thread */
    pthread_cond_t work_added;
    /* aside_max: bytes of the budget that are set aside for data other than items; aside: how many
     * of these bytes are used */
    uint64_t aside_max, aside;
    uint64_t leaving; /* number of items that are out of the table and being released */
    ebpo_cache_stats stats;
    bool ahead_runs;                  /* true: the background thread was started */
    bool stop;                        /* true: the background thread must end */
    pthread_t ahead_thread;           /* the background thread */
    uint64_t ahead[EBPO_CACHE_AHEAD]; /* [ahead_count] keys of the latest prefetch */
    unsigned ahead_count, ahead_next; /* ahead_next: index of the next key to load */
    uint64_t prefetch_count;          /* number of calls of ebpo_cache_prefetch */
};

/* A request to reserve bytes. A request of the background thread waits until no other request
 * waits, and drops no item of the latest prefetch. */
typedef struct cache_demand {
    ebpo_cache *cache;  /* NULL: ebpo_cache_pool_take */
    uint64_t key, peak; /* peak: bytes to reserve */
    bool ahead;         /* true: the background thread loads the item */
    bool aside;         /* true: the request uses bytes that are set aside */
    bool known;         /* true: `peak` is known from an earlier attempt */
} cache_demand;

/* Result of a reservation. CAPACITY_LATER: the bytes are not free now, but will be when running
 * loads and releases end. CAPACITY_NEVER: the budget is too small for the items in use and these
 * bytes. */
typedef enum cache_capacity { CAPACITY_MADE, CAPACITY_LATER, CAPACITY_NEVER } cache_capacity;

/* Callers of a static function hold the pool's lock, except where the function's comment says
 * otherwise. A function that waits, or calls a source, releases the lock meanwhile. */

/* Makes an empty table. Called before the pool's lock exists. Returns false when out of memory. The
 * caller frees the slots, and then t->bucket. */
static bool make_slots(cache_slots *t)
{
    enum { BUCKETS = 64 };
    *t = (cache_slots){ .bucket = ebpo_alloc_zero(BUCKETS, sizeof *t->bucket) };
    t->bucket_count = BUCKETS;
    return t->bucket != NULL;
}

static cache_slot **bucket_of(cache_slot **bucket, uint64_t bucket_count,
                              const struct ebpo_cache *owner, uint64_t key)
{
    uint64_t hash = ebpo_hash_number(ebpo_hash_number((uintptr_t)owner) + key);
    return &bucket[hash & (bucket_count - 1)];
}

/* Returns the slot of a key, or NULL. */
static cache_slot *find_slot(const cache_slots *t, const struct ebpo_cache *owner, uint64_t key)
{
    cache_slot *s = *bucket_of(t->bucket, t->bucket_count, owner, key);
    while (s && (s->key != key || s->owner != owner))
        s = s->chain;
    return s;
}

/* Doubles the number of buckets. If the allocation fails, the table stays as it is, with long
 * chains. */
static void grow_table(cache_slots *t)
{
    uint64_t count = 2 * t->bucket_count;
    cache_slot **bucket = ebpo_alloc_zero(count, sizeof *bucket);
    if (!bucket)
        return;
    for (uint64_t i = 0; i < t->bucket_count; i++)
        for (cache_slot *s = t->bucket[i], *next; s; s = next) {
            next = s->chain;
            cache_slot **to = bucket_of(bucket, count, s->owner, s->key);
            s->chain = *to;
            *to = s;
        }
    free(t->bucket);
    t->bucket = bucket;
    t->bucket_count = count;
}

/* Adds a slot with the state LOADING to the table, but not to the order of last use. Returns NULL
 * when out of memory. */
static cache_slot *add_slot(cache_slots *t, struct ebpo_cache *owner, uint64_t key)
{
    cache_slot *s = ebpo_alloc_zero(1, sizeof *s);
    if (!s)
        return NULL;
    if (t->count++ == t->bucket_count)
        grow_table(t);
    s->owner = owner;
    s->key = key;
    cache_slot **to = bucket_of(t->bucket, t->bucket_count, owner, key);
    s->chain = *to;
    *to = s;
    return s;
}

static void remove_slot(cache_slots *t, cache_slot *s)
{
    cache_slot **at = bucket_of(t->bucket, t->bucket_count, s->owner, s->key);
    while (*at != s)
        at = &(*at)->chain;
    *at = s->chain;
    t->count--;
}

/* Adds a slot to the order of last use, as the newest. */
static void link_slot(cache_slots *t, cache_slot *s)
{
    cache_order *o = &t->order[s->bytes <= SMALL];
    s->older = o->newest;
    s->newer = NULL;
    *(o->newest ? &o->newest->newer : &o->oldest) = s;
    o->newest = s;
    o->bytes += s->bytes;
}

/* Removes a slot from the order of last use. */
static void unlink_slot(cache_slots *t, cache_slot *s)
{
    cache_order *o = &t->order[s->bytes <= SMALL];
    *(s->older ? &s->older->newer : &o->oldest) = s->newer;
    *(s->newer ? &s->newer->older : &o->newest) = s->older;
    o->bytes -= s->bytes;
}

/* --- reservations in a budget, for which items of any cache are dropped --- */

/* Adds `bytes` to the bytes in use of the pool and of the cache `c` (NULL: no cache). */
static void count_bytes(ebpo_cache_pool *p, ebpo_cache *c, uint64_t bytes)
{
    p->bytes += bytes;
    if (p->bytes > p->peak_bytes)
        p->peak_bytes = p->bytes;
    if (!c)
        return;
    c->stats.bytes += bytes;
    if (c->stats.bytes > c->stats.peak_bytes)
        c->stats.peak_bytes = c->stats.bytes;
}

/* Returns true if the key is in the latest prefetch. */
static bool is_in_prefetch(const ebpo_cache *c, uint64_t key)
{
    for (unsigned i = 0; i < c->ahead_count; i++)
        if (c->ahead[i] == key)
            return true;
    return false;
}

/* Releases the items of the list `leaving`, which are out of the table. The bytes of an item are
 * counted until it is released; otherwise another thread would reserve memory that is still in use.
 */
static void release_leaving(ebpo_cache_pool *p, cache_slot *leaving)
{
    if (!leaving)
        return;
    pthread_mutex_unlock(&p->lock);
    for (const cache_slot *s = leaving; s; s = s->chain)
        s->owner->source.release(s->owner->source.user, s->item);
    pthread_mutex_lock(&p->lock);
    for (cache_slot *next; leaving; leaving = next) {
        next = leaving->chain;
        p->bytes -= leaving->bytes;
        p->passing -= leaving->bytes;
        leaving->owner->stats.bytes -= leaving->bytes;
        leaving->owner->leaving--;
        free(leaving);
    }
    pthread_cond_broadcast(&p->changed);
}

/* Moves an item from the table to the list of leaving items. */
static void drop_item(ebpo_cache_pool *p, cache_slot *s, cache_slot **leaving)
{
    unlink_slot(&p->slots, s);
    remove_slot(&p->slots, s);
    p->passing += s->bytes;
    s->owner->leaving++;
    s->chain = *leaving;
    *leaving = s;
}

/* Returns the bytes of the unpinned items that must not be dropped for this request. A request of
 * the background thread keeps the items of the latest prefetch. Other requests keep no unpinned
 * item. */
static uint64_t kept_for(const ebpo_cache_pool *p, const cache_demand *d)
{
    uint64_t bytes = 0;
    for (unsigned i = 0; d->ahead && i < d->cache->ahead_count; i++) {
        const cache_slot *s = find_slot(&p->slots, d->cache, d->cache->ahead[i]);
        bytes += s && s->state == READY && !s->pins ? s->bytes : 0;
    }
    return bytes;
}

static uint64_t saturated_sum(uint64_t a, uint64_t b)
{
    return a > UINT64_MAX - b ? UINT64_MAX : a + b;
}

/* Returns the least budget that suffices for the request once every item that may be dropped is
 * dropped. This budget is the sum of the bytes in use, set aside, and requested. */
static uint64_t least_budget(const ebpo_cache_pool *p, const cache_demand *d)
{
    uint64_t used = saturated_sum(saturated_sum(p->pinned, p->taken), p->aside_max);
    return saturated_sum(saturated_sum(used, kept_for(p, d)), d->aside ? 0 : d->peak);
}

/* Drops the oldest items of an order until *total, the bytes that the pool needs, fit the budget.
 */
static void drop_oldest(ebpo_cache_pool *p, const cache_demand *d, const cache_order *order,
                        uint64_t *total, cache_slot **leaving)
{
    for (cache_slot *s = order->oldest, *newer; s && *total > p->budget; s = newer) {
        newer = s->newer;
        if (d->ahead && s->owner == d->cache && is_in_prefetch(d->cache, s->key))
            continue;
        *total -= s->bytes;
        s->owner->stats.evicted++;
        drop_item(p, s, leaving);
    }
}

/* Reserves d->peak bytes. Drops items if necessary. */
static cache_capacity reserve_space(ebpo_cache_pool *p, const cache_demand *d)
{
    while (p->budget && saturated_sum(p->bytes, d->peak) > p->budget) {
        uint64_t least = least_budget(p, d);
        if (least > p->budget)
            return CAPACITY_NEVER;
        if (saturated_sum(least, p->passing) > p->budget)
            return CAPACITY_LATER;
        cache_slot *leaving = NULL;
        cache_order *order = p->slots.order;
        uint64_t total = saturated_sum(p->bytes, d->peak);
        bool small_first = order[1].bytes > p->budget / 2;
        drop_oldest(p, d, &order[small_first], &total, &leaving);
        drop_oldest(p, d, &order[!small_first], &total, &leaving);
        release_leaving(p, leaving);
    }
    count_bytes(p, d->cache, d->peak);
    p->passing += d->peak;
    return CAPACITY_MADE;
}

/* Waits until all earlier requests have ended, and then until reserve_space has reserved the bytes.
 * Returns false if the budget is too small (CAPACITY_NEVER). */
static bool wait_in_turn(ebpo_cache_pool *p, const cache_demand *d)
{
    uint64_t ticket = p->tickets++;
    cache_capacity result = CAPACITY_LATER;
    while (ticket != p->serving || (result = reserve_space(p, d)) == CAPACITY_LATER)
        pthread_cond_wait(&p->changed, &p->lock);
    p->serving++;
    pthread_cond_broadcast(&p->changed);
    return result == CAPACITY_MADE;
}

/* Gives the bytes that were reserved for a load back to the budget. */
static void give_back_reserved(ebpo_cache *c, uint64_t reserved)
{
    c->stats.bytes -= reserved;
    c->pool->bytes -= reserved;
    c->pool->passing -= reserved;
    pthread_cond_broadcast(&c->pool->changed);
}

/* --- pools --- */

ebpo_status ebpo_cache_pool_make(ebpo_cache_pool **out, uint64_t budget, ebpo_error *error)
{
    *out = NULL;
    ebpo_cache_pool *p = ebpo_alloc_zero(1, sizeof *p);
    if (!p || !make_slots(&p->slots)) {
        free(p);
        return ebpo_fail_memory(error, sizeof *p);
    }
    p->budget = budget;
    pthread_mutex_init(&p->lock, NULL);
    pthread_cond_init(&p->changed, NULL);
    *out = p;
    return EBPO_OK;
}

void ebpo_cache_pool_free(ebpo_cache_pool *p)
{
    if (!p)
        return;
    pthread_cond_destroy(&p->changed);
    pthread_mutex_destroy(&p->lock);
    free(p->slots.bucket);
    free(p);
}

ebpo_status ebpo_cache_pool_take(ebpo_cache_pool *p, uint64_t bytes, ebpo_error *error)
{
    cache_demand d = { .peak = bytes };
    pthread_mutex_lock(&p->lock);
    bool made = wait_in_turn(p, &d);
    uint64_t sufficient = least_budget(p, &d);
    if (made) {
        p->passing -= bytes;
        p->taken += bytes;
    }
    pthread_mutex_unlock(&p->lock);
    return made ? EBPO_OK
                : ebpo_fail(error, EBPO_E_LIMIT,
                            "%" PRIu64 " bytes are not free in a shared budget of %" PRIu64 " bytes"
                            "; a budget of %" PRIu64 " bytes would suffice",
                            bytes, p->budget, sufficient);
}

void ebpo_cache_pool_give_back(ebpo_cache_pool *p, uint64_t bytes)
{
    pthread_mutex_lock(&p->lock);
    p->taken -= bytes;
    p->bytes -= bytes;
    pthread_cond_broadcast(&p->changed);
    pthread_mutex_unlock(&p->lock);
}

void ebpo_cache_pool_get_bytes(ebpo_cache_pool *p, uint64_t *now, uint64_t *peak, uint64_t *taken)
{
    pthread_mutex_lock(&p->lock);
    *now = p->bytes;
    *peak = p->peak_bytes;
    *taken = p->taken;
    pthread_mutex_unlock(&p->lock);
}

static void pin_slot(ebpo_cache *c, cache_slot *s)
{
    if (s->pins++ == 0) {
        unlink_slot(&c->pool->slots, s);
        c->pool->pinned += s->bytes;
    }
}

/* --- loading --- */

/* Waits until `peak` bytes are reserved. Fails if the budget is too small for the items in use and
 * these bytes. */
static ebpo_status wait_for_capacity(ebpo_cache *c, uint64_t peak, ebpo_error *error)
{
    ebpo_cache_pool *p = c->pool;
    cache_demand d = { .cache = c, .peak = peak };
    if (wait_in_turn(p, &d))
        return EBPO_OK;
    uint64_t used = saturated_sum(saturated_sum(p->pinned, p->taken), p->aside_max);
    return ebpo_fail(error, EBPO_E_LIMIT,
                     "the %s cache's budget is %" PRIu64 " bytes, of which %" PRIu64
                     " are in use, and one %s more takes up to %" PRIu64 "; a budget of %" PRIu64
                     " would suffice",
                     c->name, p->budget, used, c->name, peak, saturated_sum(used, peak));
}

/* Ends a load. The item's bytes replace the `reserved` bytes, and the item is pinned once for each
 * waiting thread and `caller_pins` times for this thread. If the load has failed, only gives the
 * reserved bytes back. */
static void end_load(ebpo_cache *c, cache_slot *s, bool loaded, uint64_t reserved,
                     unsigned caller_pins)
{
    give_back_reserved(c, reserved);
    if (loaded) {
        s->state = READY;
        s->pins = caller_pins + s->waiters;
        count_bytes(c->pool, c, s->bytes);
        if (s->pins)
            c->pool->pinned += s->bytes;
        else
            link_slot(&c->pool->slots, s);
    } else {
        remove_slot(&c->pool->slots, s);
        s->state = FAILED;
        if (s->waiters == 0)
            free(s);
    }
}

/* Sets *peak to the bytes that loading a key takes. Called without the lock. */
static ebpo_status estimate_bytes(ebpo_cache *c, uint64_t key, uint64_t *peak, ebpo_error *error)
{
    uint64_t keep = 0;
    *peak = 0;
    ebpo_status status = c->source.estimate(c->source.user, key, peak, &keep, error);
    *peak = *peak > keep ? *peak : keep;
    return status;
}

/* Calls the source to load an item with the `reserved` bytes. Called without the lock. If the item
 * is larger than `reserved`, releases the item and fails. If the source refuses to load with so few
 * bytes, sets *needed to the bytes that the source requests; otherwise sets *needed to 0. */
static ebpo_status call_load(ebpo_cache *c, cache_slot *s, uint64_t reserved, uint64_t *needed,
                             ebpo_error *error)
{
    void *item = NULL;
    uint64_t bytes = 0;
    ebpo_status status =
        c->source.load(c->source.user, s->key, c->pool->budget ? reserved : UINT64_MAX, &item,
                       &bytes, error);
    *needed = status == EBPO_E_LIMIT && bytes > reserved ? bytes : 0;
    if (status == EBPO_OK && bytes > reserved && c->pool->budget) {
        c->source.release(c->source.user, item);
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "%s %" PRIu64 " takes %" PRIu64 " bytes, but at most %" PRIu64
                         " were expected; please report this",
                         c->name, s->key, bytes, reserved);
    }
    s->item = item;
    s->bytes = bytes;
    return status;
}

/* Loads the item of slot s with a reservation of `peak` bytes, and enlarges the reservation
 * whenever the source requests this. *reserved: bytes to give back when the load ends. */
static ebpo_status load_with_capacity(ebpo_cache *c, cache_slot *s, uint64_t peak,
                                      uint64_t *reserved, ebpo_error *error)
{
    for (;;) {
        uint64_t needed = 0;
        ebpo_status status = wait_for_capacity(c, peak, error);
        if (status != EBPO_OK)
            return status;
        *reserved = peak;
        pthread_mutex_unlock(&c->pool->lock);
        status = call_load(c, s, peak, &needed, error);
        pthread_mutex_lock(&c->pool->lock);
        if (!needed)
            return status;
        give_back_reserved(c, *reserved);
        *reserved = 0;
        peak = needed;
    }
}

/* Loads an item on this thread, and pins it. */
static ebpo_status load_here(ebpo_cache *c, uint64_t key, void **item, ebpo_error *error)
{
    /* after this line, other threads that need the key wait for this load */
    cache_slot *s = add_slot(&c->pool->slots, c, key);
    uint64_t peak = 0, reserved = 0;
    if (!s)
        return ebpo_fail_memory(error, sizeof *s);
    pthread_mutex_unlock(&c->pool->lock);
    ebpo_status status = estimate_bytes(c, key, &peak, error);
    pthread_mutex_lock(&c->pool->lock);
    if (status == EBPO_OK)
        status = load_with_capacity(c, s, peak, &reserved, error);
    if (status == EBPO_OK) {
        c->stats.loads++;
        *item = s->item;
    }
    end_load(c, s, status == EBPO_OK, reserved, 1);
    return status;
}

/* Waits for another thread's load, and returns false if the load has failed. The loading thread
 * pins the item for this thread. */
static bool wait_for(ebpo_cache *c, cache_slot *s, void **item)
{
    s->waiters++;
    while (s->state == LOADING)
        pthread_cond_wait(&c->pool->changed, &c->pool->lock);
    s->waiters--;
    if (s->state == READY) {
        *item = s->item;
        return true;
    }
    if (s->waiters == 0)
        free(s);
    return false;
}

/* Pins the item of a key that was not in memory. If another thread loads the item, waits for this
 * load; otherwise loads the item on this thread. */
static ebpo_status wait_or_load(ebpo_cache *c, uint64_t key, void **item, ebpo_error *error)
{
    for (cache_slot *s; (s = find_slot(&c->pool->slots, c, key)) != NULL;) {
        if (s->state == READY) {
            pin_slot(c, s);
            *item = s->item;
            return EBPO_OK;
        }
        if (wait_for(c, s, item))
            return EBPO_OK;
    }
    return load_here(c, key, item, error);
}

/* If the item of a key is in memory, pins it and returns true; otherwise returns false. */
static bool pin_ready(ebpo_cache *c, uint64_t key, void **item)
{
    cache_slot *s = find_slot(&c->pool->slots, c, key);
    if (!s || s->state != READY)
        return false;
    pin_slot(c, s);
    *item = s->item;
    c->stats.hits++;
    return true;
}

ebpo_status ebpo_cache_get(ebpo_cache *c, uint64_t key, void **item, bool *hit, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    *item = NULL;
    pthread_mutex_lock(&c->pool->lock);
    bool present = pin_ready(c, key, item);
    if (!present) {
        double begin = ebpo_seconds();
        status = wait_or_load(c, key, item, error);
        c->stats.load_seconds += ebpo_seconds() - begin;
    }
    pthread_mutex_unlock(&c->pool->lock);
    if (hit)
        *hit = present;
    return status;
}

bool ebpo_cache_try(ebpo_cache *c, uint64_t key, void **item)
{
    pthread_mutex_lock(&c->pool->lock);
    bool present = pin_ready(c, key, item);
    pthread_mutex_unlock(&c->pool->lock);
    return present;
}

bool ebpo_cache_has(ebpo_cache *c, uint64_t key)
{
    pthread_mutex_lock(&c->pool->lock);
    cache_slot *s = find_slot(&c->pool->slots, c, key);
    bool present = s && s->state == READY;
    pthread_mutex_unlock(&c->pool->lock);
    return present;
}

void ebpo_cache_unpin(ebpo_cache *c, uint64_t key)
{
    pthread_mutex_lock(&c->pool->lock);
    cache_slot *s = find_slot(&c->pool->slots, c, key);
    if (s && s->pins && --s->pins == 0) {
        c->pool->pinned -= s->bytes;
        link_slot(&c->pool->slots, s);
        pthread_cond_broadcast(&c->pool->changed);
    }
    pthread_mutex_unlock(&c->pool->lock);
}

/* --- bytes set aside --- */

void ebpo_cache_set_aside(ebpo_cache *c, uint64_t most)
{
    pthread_mutex_lock(&c->pool->lock);
    c->pool->aside_max += most - c->aside_max;
    c->aside_max = most;
    pthread_mutex_unlock(&c->pool->lock);
}

bool ebpo_cache_take_aside(ebpo_cache *c, uint64_t bytes)
{
    cache_demand d = { .cache = c, .peak = bytes, .aside = true };
    pthread_mutex_lock(&c->pool->lock);
    bool taken = bytes <= c->aside_max - c->aside;
    if (taken) {
        c->aside += bytes;
        taken = reserve_space(c->pool, &d) == CAPACITY_MADE;
        *(taken ? &c->pool->passing : &c->aside) -= bytes;
    }
    pthread_mutex_unlock(&c->pool->lock);
    return taken;
}

void ebpo_cache_give_back_aside(ebpo_cache *c, uint64_t bytes)
{
    pthread_mutex_lock(&c->pool->lock);
    c->aside -= bytes;
    c->stats.bytes -= bytes;
    c->pool->bytes -= bytes;
    pthread_cond_broadcast(&c->pool->changed);
    pthread_mutex_unlock(&c->pool->lock);
}

/* --- prefetch --- */

/* Loads the item of d->key on the background thread. Skips the item if it is in memory, another
 * thread loads it, or the budget is too small. Returns false if the load must wait for other loads;
 * then the slot is removed, so that a thread that needs the item can load it. */
static bool load_ahead(ebpo_cache *c, cache_demand *d)
{
    cache_slot *s =
        find_slot(&c->pool->slots, c, d->key) ? NULL : add_slot(&c->pool->slots, c, d->key);
    if (!s)
        return true;
    if (!d->known) {
        pthread_mutex_unlock(&c->pool->lock);
        d->known = estimate_bytes(c, d->key, &d->peak, NULL) == EBPO_OK;
        pthread_mutex_lock(&c->pool->lock);
    }
    cache_capacity capacity = !d->known                              ? CAPACITY_NEVER
                              : c->pool->serving != c->pool->tickets ? CAPACITY_LATER
                                                                     : reserve_space(c->pool, d);
    if (capacity != CAPACITY_MADE) {
        end_load(c, s, false, 0, 0);
        return capacity == CAPACITY_NEVER;
    }
    pthread_mutex_unlock(&c->pool->lock);
    uint64_t needed;
    bool loaded = call_load(c, s, d->peak, &needed, NULL) == EBPO_OK;
    pthread_mutex_lock(&c->pool->lock);
    c->stats.prefetched += loaded;
    end_load(c, s, loaded, d->peak, 0);
    return true;
}

/* Loads the keys of the latest prefetch. This is the function of the background thread, which
 * begins without the lock. */
static void *run_ahead(void *context)
{
    ebpo_cache *c = context;
    cache_demand d = { .cache = c, .ahead = true };
    pthread_mutex_lock(&c->pool->lock);
    while (!c->stop) {
        if (c->ahead_next == c->ahead_count) {
            pthread_cond_wait(&c->work_added, &c->pool->lock);
            continue;
        }
        uint64_t prefetch_count = c->prefetch_count;
        if (!d.known || d.key != c->ahead[c->ahead_next])
            d = (cache_demand){ .cache = c, .key = c->ahead[c->ahead_next], .ahead = true };
        bool done = load_ahead(c, &d);
        if (done)
            d.known = false;
        if (done && prefetch_count == c->prefetch_count)
            c->ahead_next++;
        else if (!done && prefetch_count == c->prefetch_count && !c->stop)
            pthread_cond_wait(&c->pool->changed, &c->pool->lock);
    }
    pthread_mutex_unlock(&c->pool->lock);
    return NULL;
}

/* Starts the background thread with all signals blocked, because the threads of the calling program
 * must receive them. Returns false if the thread cannot be started. */
static bool start_ahead(ebpo_cache *c)
{
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    bool started = ebpo_thread_start(&c->ahead_thread, run_ahead, c) == 0;
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return started;
}

/* Replaces the list of keys to load in the background, without repetitions. Items of these keys
 * that are already in memory move to the newest end of the order of last use. The item of the first
 * key becomes the newest, because it is used next. */
static void replace_list(ebpo_cache *c, const uint64_t *keys, unsigned count)
{
    c->ahead_count = c->ahead_next = 0;
    c->prefetch_count++;
    for (unsigned i = 0; i < count && i < EBPO_CACHE_AHEAD; i++)
        if (!is_in_prefetch(c, keys[i]))
            c->ahead[c->ahead_count++] = keys[i];
    for (unsigned i = c->ahead_count; i-- > 0;) {
        cache_slot *s = find_slot(&c->pool->slots, c, c->ahead[i]);
        if (s && s->state == READY && !s->pins) {
            unlink_slot(&c->pool->slots, s);
            link_slot(&c->pool->slots, s);
        }
    }
}

void ebpo_cache_prefetch(ebpo_cache *c, const uint64_t *keys, unsigned count)
{
    pthread_mutex_lock(&c->pool->lock);
    replace_list(c, keys, count);
    if (!c->ahead_runs && c->ahead_count)
        c->ahead_runs = start_ahead(c);
    pthread_cond_signal(&c->work_added);
    pthread_cond_broadcast(&c->pool->changed);
    pthread_mutex_unlock(&c->pool->lock);
}

/* --- the cache --- */

ebpo_status ebpo_cache_make_in(ebpo_cache **out, const ebpo_cache_source *source, const char *name,
                               ebpo_cache_pool *pool, ebpo_error *error)
{
    ebpo_cache *c = *out = ebpo_alloc_zero(1, sizeof *c);
    if (!c)
        return ebpo_fail_memory(error, sizeof *c);
    c->source = *source;
    strncpy(c->name, name, sizeof c->name - 1);
    c->pool = pool;
    pthread_cond_init(&c->work_added, NULL);
    return EBPO_OK;
}

ebpo_status ebpo_cache_make(ebpo_cache **out, const ebpo_cache_source *source, const char *name,
                            uint64_t budget, ebpo_error *error)
{
    ebpo_cache_pool *pool;
    *out = NULL;
    ebpo_status status = ebpo_cache_pool_make(&pool, budget, error);
    if (status == EBPO_OK)
        status = ebpo_cache_make_in(out, source, name, pool, error);
    if (status == EBPO_OK)
        (*out)->owns_pool = true;
    else
        ebpo_cache_pool_free(pool);
    return status;
}

/* Drops all unpinned items of a cache. */
static void drop_unpinned(ebpo_cache *c)
{
    cache_slot *leaving = NULL;
    for (int small = 0; small < 2; small++)
        for (cache_slot *s = c->pool->slots.order[small].oldest, *newer; s; s = newer) {
            newer = s->newer;
            if (s->owner == c)
                drop_item(c->pool, s, &leaving);
        }
    release_leaving(c->pool, leaving);
}

void ebpo_cache_clear(ebpo_cache *c)
{
    pthread_mutex_lock(&c->pool->lock);
    drop_unpinned(c);
    pthread_mutex_unlock(&c->pool->lock);
}

void ebpo_cache_get_stats(ebpo_cache *c, ebpo_cache_stats *out)
{
    pthread_mutex_lock(&c->pool->lock);
    *out = c->stats;
    pthread_mutex_unlock(&c->pool->lock);
}

/* Ends the background thread, and waits for its end. Called without the lock. */
static void stop_ahead(ebpo_cache *c)
{
    pthread_mutex_lock(&c->pool->lock);
    c->stop = true;
    pthread_cond_broadcast(&c->pool->changed);
    pthread_cond_signal(&c->work_added);
    pthread_mutex_unlock(&c->pool->lock);
    if (c->ahead_runs)
        pthread_join(c->ahead_thread, NULL);
}

void ebpo_cache_free(ebpo_cache *c)
{
    if (!c)
        return;
    ebpo_cache_pool *p = c->pool;
    stop_ahead(c);
    pthread_mutex_lock(&p->lock);
    drop_unpinned(c);
    /* Other threads may have dropped items of this cache for their requests, and may still be
     * releasing these items. */
    while (c->leaving)
        pthread_cond_wait(&p->changed, &p->lock);
    p->bytes -= c->aside;
    p->aside_max -= c->aside_max;
    pthread_cond_broadcast(&p->changed);
    pthread_mutex_unlock(&p->lock);
    pthread_cond_destroy(&c->work_added);
    if (c->owns_pool)
        ebpo_cache_pool_free(p);
    free(c);
}
