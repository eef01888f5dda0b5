#include "core/cache.h"

#include <inttypes.h>
#include <pthread.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/clock.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/cache_room.h"

static void pin(ebpo_cache *c, ebpo_cache_slot *s)
{
    if (s->pins++ == 0) {
        ebpo_cache_slots_unlink(&c->pool->slots, s);
        c->pool->pinned += s->bytes;
    }
}

/* --- loading --- */

static uint64_t sum(uint64_t a, uint64_t b) { return a > UINT64_MAX - b ? UINT64_MAX : a + b; }

static ebpo_status wait_for_room(ebpo_cache *c, uint64_t peak, ebpo_error *error)
{
    ebpo_cache_pool *p = c->pool;
    ebpo_cache_demand d = { .cache = c, .peak = peak };
    if (ebpo_cache_wait_for_room(p, &d))
        return EBPO_OK;
    uint64_t used = sum(sum(p->pinned, p->taken), p->aside_most);
    return ebpo_fail(error, EBPO_E_LIMIT,
                     "the %s cache's budget is %" PRIu64 " bytes, of which %" PRIu64
                     " are in use, and one %s more takes up to %" PRIu64 "; a budget of %" PRIu64
                     " would do",
                     c->name, p->budget, used, c->name, peak, sum(used, peak));
}

/* Ends a load: `reserved` gives way to the item, which is pinned by whoever waits for it (and `own`
 * times more), or to nothing. */
static void end_load(ebpo_cache *c, ebpo_cache_slot *s, bool loaded, uint64_t reserved,
                     unsigned own)
{
    ebpo_cache_give_back(c, reserved);
    if (loaded) {
        s->state = READY;
        s->pins = own + s->waiters;
        ebpo_cache_count_bytes(c->pool, c, s->bytes);
        if (s->pins)
            c->pool->pinned += s->bytes;
        else
            ebpo_cache_slots_link(&c->pool->slots, s);
    } else {
        ebpo_cache_slots_take(&c->pool->slots, s);
        s->state = FAILED;
        if (s->waiters == 0)
            free(s);
    }
}

static ebpo_status estimate(ebpo_cache *c, uint64_t key, uint64_t *peak, ebpo_error *error)
{
    uint64_t keep = 0;
    *peak = 0;
    ebpo_status status = c->source.estimate(c->source.user, key, peak, &keep, error);
    *peak = *peak > keep ? *peak : keep;
    return status;
}

/* Calls the source, without the lock; an item that is larger than was said cannot stay. *needed:
 * what the source asks for, or 0. */
static ebpo_status call_load(ebpo_cache *c, ebpo_cache_slot *s, uint64_t reserved, uint64_t *needed,
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
                         "%s %" PRIu64 " takes %" PRIu64 " bytes, and at most %" PRIu64
                         " were expected; please report this",
                         c->name, s->key, bytes, reserved);
    }
    s->item = item;
    s->bytes = bytes;
    return status;
}

/* With room for s's load, more of it each time that the source asks for that; *reserved: what ends
 * with the load. The lock is held at beginning and end. */
static ebpo_status load_with_room(ebpo_cache *c, ebpo_cache_slot *s, uint64_t peak,
                                  uint64_t *reserved, ebpo_error *error)
{
    for (;;) {
        uint64_t needed = 0;
        ebpo_status status = wait_for_room(c, peak, error);
        if (status != EBPO_OK)
            return status;
        *reserved = peak;
        pthread_mutex_unlock(&c->pool->lock);
        status = call_load(c, s, peak, &needed, error);
        pthread_mutex_lock(&c->pool->lock);
        if (!needed)
            return status;
        ebpo_cache_give_back(c, *reserved);
        *reserved = 0;
        peak = needed;
    }
}

/* The lock is held at beginning and end. */
static ebpo_status load_here(ebpo_cache *c, uint64_t key, void **item, ebpo_error *error)
{
    ebpo_cache_slot *s =
        ebpo_cache_slots_add(&c->pool->slots, c, key); /* from here on others wait for this load */
    uint64_t peak = 0, reserved = 0;
    if (!s)
        return ebpo_fail_memory(error, sizeof *s);
    pthread_mutex_unlock(&c->pool->lock);
    ebpo_status status = estimate(c, key, &peak, error);
    pthread_mutex_lock(&c->pool->lock);
    if (status == EBPO_OK)
        status = load_with_room(c, s, peak, &reserved, error);
    if (status == EBPO_OK) {
        c->stats.loads++;
        *item = s->item;
    }
    end_load(c, s, status == EBPO_OK, reserved, 1);
    return status;
}

/* Waits for another thread's load; false when it failed. The pin is already taken for us. */
static bool wait_for(ebpo_cache *c, ebpo_cache_slot *s, void **item)
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

static ebpo_status wait_or_load(ebpo_cache *c, uint64_t key, void **item, ebpo_error *error)
{
    for (ebpo_cache_slot *s; (s = ebpo_cache_slots_find(&c->pool->slots, c, key)) != NULL;) {
        if (s->state == READY) {
            pin(c, s);
            *item = s->item;
            return EBPO_OK;
        }
        if (wait_for(c, s, item))
            return EBPO_OK;
    }
    return load_here(c, key, item, error);
}

/* Pins an item that is there. */
static bool take_ready(ebpo_cache *c, uint64_t key, void **item)
{
    ebpo_cache_slot *s = ebpo_cache_slots_find(&c->pool->slots, c, key);
    if (!s || s->state != READY)
        return false;
    pin(c, s);
    *item = s->item;
    c->stats.hits++;
    return true;
}

ebpo_status ebpo_cache_get(ebpo_cache *c, uint64_t key, void **item, bool *hit, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    *item = NULL;
    pthread_mutex_lock(&c->pool->lock);
    bool there = take_ready(c, key, item);
    if (!there) {
        double begin = ebpo_seconds();
        status = wait_or_load(c, key, item, error);
        c->stats.load_seconds += ebpo_seconds() - begin;
    }
    pthread_mutex_unlock(&c->pool->lock);
    if (hit)
        *hit = there;
    return status;
}

bool ebpo_cache_try(ebpo_cache *c, uint64_t key, void **item)
{
    pthread_mutex_lock(&c->pool->lock);
    bool there = take_ready(c, key, item);
    pthread_mutex_unlock(&c->pool->lock);
    return there;
}

bool ebpo_cache_has(ebpo_cache *c, uint64_t key)
{
    pthread_mutex_lock(&c->pool->lock);
    ebpo_cache_slot *s = ebpo_cache_slots_find(&c->pool->slots, c, key);
    bool there = s && s->state == READY;
    pthread_mutex_unlock(&c->pool->lock);
    return there;
}

void ebpo_cache_unpin(ebpo_cache *c, uint64_t key)
{
    pthread_mutex_lock(&c->pool->lock);
    ebpo_cache_slot *s = ebpo_cache_slots_find(&c->pool->slots, c, key);
    if (s && s->pins && --s->pins == 0) {
        c->pool->pinned -= s->bytes;
        ebpo_cache_slots_link(&c->pool->slots, s);
        pthread_cond_broadcast(&c->pool->changed);
    }
    pthread_mutex_unlock(&c->pool->lock);
}

/* --- aside --- */

void ebpo_cache_set_aside(ebpo_cache *c, uint64_t most)
{
    pthread_mutex_lock(&c->pool->lock);
    c->pool->aside_most += most - c->aside_most;
    c->aside_most = most;
    pthread_mutex_unlock(&c->pool->lock);
}

bool ebpo_cache_take_aside(ebpo_cache *c, uint64_t bytes)
{
    ebpo_cache_demand d = { .cache = c, .peak = bytes, .aside = true };
    pthread_mutex_lock(&c->pool->lock);
    bool taken = bytes <= c->aside_most - c->aside;
    if (taken) {
        c->aside += bytes;
        taken = ebpo_cache_make_room(c->pool, &d) == ROOM_MADE;
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

/* --- ahead --- */

/* Loads d->key in the background, or lets it be; false when it must wait for the loads of others.
 * Nobody waits for our key meanwhile: whoever wants it loads it. */
static bool load_ahead(ebpo_cache *c, ebpo_cache_demand *d)
{
    ebpo_cache_slot *s = ebpo_cache_slots_find(&c->pool->slots, c, d->key)
                             ? NULL
                             : ebpo_cache_slots_add(&c->pool->slots, c, d->key);
    if (!s)
        return true;
    if (!d->known) {
        pthread_mutex_unlock(&c->pool->lock);
        d->known = estimate(c, d->key, &d->peak, NULL) == EBPO_OK;
        pthread_mutex_lock(&c->pool->lock);
    }
    ebpo_cache_capacity got = !d->known ? ROOM_NEVER
                              : c->pool->serving != c->pool->tickets
                                  ? ROOM_LATER
                                  : ebpo_cache_make_room(c->pool, d);
    if (got != ROOM_MADE) {
        end_load(c, s, false, 0, 0);
        return got == ROOM_NEVER;
    }
    pthread_mutex_unlock(&c->pool->lock);
    uint64_t needed;
    bool loaded = call_load(c, s, d->peak, &needed, NULL) == EBPO_OK;
    pthread_mutex_lock(&c->pool->lock);
    c->stats.prefetched += loaded;
    end_load(c, s, loaded, d->peak, 0);
    return true;
}

static void *run_ahead(void *context)
{
    ebpo_cache *c = context;
    ebpo_cache_demand d = { .cache = c, .ahead = true };
    pthread_mutex_lock(&c->pool->lock);
    while (!c->stop) {
        if (c->ahead_next == c->ahead_count) {
            pthread_cond_wait(&c->asked, &c->pool->lock);
            continue;
        }
        uint64_t asking = c->asking;
        if (!d.known || d.key != c->ahead[c->ahead_next])
            d = (ebpo_cache_demand){ .cache = c, .key = c->ahead[c->ahead_next], .ahead = true };
        bool done = load_ahead(c, &d);
        if (done)
            d.known = false;
        if (done && asking == c->asking)
            c->ahead_next++;
        else if (!done && asking == c->asking && !c->stop)
            pthread_cond_wait(&c->pool->changed, &c->pool->lock);
    }
    pthread_mutex_unlock(&c->pool->lock);
    return NULL;
}

/* Signals are for the program's own threads. */
static bool start_ahead(ebpo_cache *c)
{
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    bool started = ebpo_thread_start(&c->ahead_thread, run_ahead, c) == 0;
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return started;
}

/* Takes the list, without repetitions. What is there already becomes the newest, the first key
 * last: it is about to be used. */
static void take_list(ebpo_cache *c, const uint64_t *keys, unsigned count)
{
    c->ahead_count = c->ahead_next = 0;
    c->asking++;
    for (unsigned i = 0; i < count && i < EBPO_CACHE_AHEAD; i++)
        if (!ebpo_cache_asked_ahead(c, keys[i]))
            c->ahead[c->ahead_count++] = keys[i];
    for (unsigned i = c->ahead_count; i-- > 0;) {
        ebpo_cache_slot *s = ebpo_cache_slots_find(&c->pool->slots, c, c->ahead[i]);
        if (s && s->state == READY && !s->pins) {
            ebpo_cache_slots_unlink(&c->pool->slots, s);
            ebpo_cache_slots_link(&c->pool->slots, s);
        }
    }
}

void ebpo_cache_prefetch(ebpo_cache *c, const uint64_t *keys, unsigned count)
{
    pthread_mutex_lock(&c->pool->lock);
    take_list(c, keys, count);
    if (!c->ahead_runs && c->ahead_count)
        c->ahead_runs = start_ahead(c);
    pthread_cond_signal(&c->asked);
    pthread_cond_broadcast(&c->pool->changed);
    pthread_mutex_unlock(&c->pool->lock);
}

/* --- the whole --- */

ebpo_status ebpo_cache_make_in(ebpo_cache **out, const ebpo_cache_source *source, const char *name,
                               ebpo_cache_pool *pool, ebpo_error *error)
{
    ebpo_cache *c = *out = ebpo_alloc_zero(1, sizeof *c);
    if (!c)
        return ebpo_fail_memory(error, sizeof *c);
    c->source = *source;
    strncpy(c->name, name, sizeof c->name - 1);
    c->pool = pool;
    pthread_cond_init(&c->asked, NULL);
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
        (*out)->alone = true;
    else
        ebpo_cache_pool_free(pool);
    return status;
}

/* The lock is held. */
static void clear(ebpo_cache *c)
{
    ebpo_cache_slot *leaving = NULL;
    for (ebpo_cache_slot *s = c->pool->slots.oldest, *newer; s; s = newer) {
        newer = s->newer;
        if (s->owner == c)
            ebpo_cache_drop(c->pool, s, &leaving);
    }
    ebpo_cache_release_all(c->pool, leaving);
}

void ebpo_cache_clear(ebpo_cache *c)
{
    pthread_mutex_lock(&c->pool->lock);
    clear(c);
    pthread_mutex_unlock(&c->pool->lock);
}

void ebpo_cache_get_stats(ebpo_cache *c, ebpo_cache_stats *out)
{
    pthread_mutex_lock(&c->pool->lock);
    *out = c->stats;
    pthread_mutex_unlock(&c->pool->lock);
}

static void stop_ahead(ebpo_cache *c)
{
    pthread_mutex_lock(&c->pool->lock);
    c->stop = true;
    pthread_cond_broadcast(&c->pool->changed);
    pthread_cond_signal(&c->asked);
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
    clear(c);
    while (c->leaving) /* others drop them, to make room */
        pthread_cond_wait(&p->changed, &p->lock);
    p->bytes -= c->aside;
    p->aside_most -= c->aside_most;
    pthread_cond_broadcast(&p->changed);
    pthread_mutex_unlock(&p->lock);
    pthread_cond_destroy(&c->asked);
    if (c->alone)
        ebpo_cache_pool_free(p);
    free(c);
}
