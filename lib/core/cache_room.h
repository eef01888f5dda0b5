/* A cache's parts, and how room is made in the budget that caches share. Inside lib/core. */
#ifndef EBPO_CORE_CACHE_ROOM_H
#define EBPO_CORE_CACHE_ROOM_H

#include <pthread.h>

#include "core/cache_pool.h"
#include "core/cache_slots.h"

/* One order of last use for all its caches, and one lock; a cache of its own budget has one too. */
struct ebpo_cache_pool {
    uint64_t budget;
    pthread_mutex_t lock;   /* guards all below; never held while a source is called */
    pthread_cond_t changed; /* loads ended, room came free */
    ebpo_cache_slots slots;
    uint64_t bytes, peak_bytes; /* of all caches, and what has been taken for good */
    uint64_t pinned;            /* bytes of items that are in use */
    uint64_t taken;             /* for good: ebpo_cache_pool_take */
    uint64_t aside_most;
    /* bytes reserved for loads under way, and of items on their way out: these become free or
     * pinned without anyone's help */
    uint64_t passing;
    /* gets that wait for room are served in the order they came, or a large one might wait for ever
     */
    uint64_t tickets, serving;
};

struct ebpo_cache {
    ebpo_cache_source source;
    char name[32];
    ebpo_cache_pool *pool;
    bool alone; /* the pool is its own */
    /* the background has something to do: apart from `changed`, or each unpin would wake it */
    pthread_cond_t asked;
    uint64_t aside_most, aside;
    uint64_t leaving; /* items that are out of the table and are being released */
    ebpo_cache_stats stats;
    bool ahead_runs, stop;
    pthread_t ahead_thread;
    uint64_t ahead[EBPO_CACHE_AHEAD];
    unsigned ahead_count, ahead_next;
    uint64_t asking; /* how often something was asked for */
};

/* What there must be room for. The background yields to everyone else, and drops nothing that was
 * asked for together. */
typedef struct ebpo_cache_demand {
    ebpo_cache *cache; /* NULL: for good */
    uint64_t key, peak;
    bool ahead;
    bool aside; /* of what is set aside anyway */
    bool known; /* the peak, from an attempt before */
} ebpo_cache_demand;

/* What follows is called with the lock held, which may be let go meanwhile. */

bool ebpo_cache_asked_ahead(const ebpo_cache *c, uint64_t key);

typedef enum ebpo_cache_capacity { ROOM_MADE, ROOM_LATER, ROOM_NEVER } ebpo_cache_capacity;

/* Reserves d->peak, dropping the least recently used items. ROOM_LATER: when loads under way end.
 */
ebpo_cache_capacity ebpo_cache_make_room(ebpo_cache_pool *p, const ebpo_cache_demand *d);
/* The same, in turn, as soon as there is room. False: there will be none. */
bool ebpo_cache_wait_for_room(ebpo_cache_pool *p, const ebpo_cache_demand *d);

void ebpo_cache_count_bytes(ebpo_cache_pool *p, ebpo_cache *cache, uint64_t bytes);
/* What was reserved for a load. */
void ebpo_cache_give_back(ebpo_cache *c, uint64_t reserved);

/* Takes an item out of the table, into the list of those that leave; and releases these. */
void ebpo_cache_drop(ebpo_cache_pool *p, ebpo_cache_slot *s, ebpo_cache_slot **leaving);
void ebpo_cache_release_all(ebpo_cache_pool *p, ebpo_cache_slot *leaving);

#endif
