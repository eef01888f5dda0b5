/* Room in a budget: what is used least recently goes, whoever's it is. */
#include "core/cache_room.h"

#include <inttypes.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"

void ebpo_cache_count_bytes(ebpo_cache_pool *p, ebpo_cache *c, uint64_t bytes)
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

bool ebpo_cache_asked_ahead(const ebpo_cache *c, uint64_t key)
{
    for (unsigned i = 0; i < c->ahead_count; i++)
        if (c->ahead[i] == key)
            return true;
    return false;
}

/* Items that are out of the table: their bytes count until they are really gone, or another thread
 * would use them twice. */
void ebpo_cache_release_all(ebpo_cache_pool *p, ebpo_cache_slot *leaving)
{
    if (!leaving)
        return;
    pthread_mutex_unlock(&p->lock);
    for (const ebpo_cache_slot *s = leaving; s; s = s->chain)
        s->owner->source.release(s->owner->source.user, s->item);
    pthread_mutex_lock(&p->lock);
    for (ebpo_cache_slot *next; leaving; leaving = next) {
        next = leaving->chain;
        p->bytes -= leaving->bytes;
        p->passing -= leaving->bytes;
        leaving->owner->stats.bytes -= leaving->bytes;
        leaving->owner->leaving--;
        free(leaving);
    }
    pthread_cond_broadcast(&p->changed);
}

void ebpo_cache_drop(ebpo_cache_pool *p, ebpo_cache_slot *s, ebpo_cache_slot **leaving)
{
    ebpo_cache_slots_unlink(&p->slots, s);
    ebpo_cache_slots_take(&p->slots, s);
    p->passing += s->bytes;
    s->owner->leaving++;
    s->chain = *leaving;
    *leaving = s;
}

/* Bytes that the background may not drop: what was asked for together. */
static uint64_t kept_for(const ebpo_cache_pool *p, const ebpo_cache_demand *d)
{
    uint64_t bytes = 0;
    for (unsigned i = 0; d->ahead && i < d->cache->ahead_count; i++) {
        const ebpo_cache_slot *s = ebpo_cache_slots_find(&p->slots, d->cache, d->cache->ahead[i]);
        bytes += s && s->state == READY && !s->pins ? s->bytes : 0;
    }
    return bytes;
}

static uint64_t sum(uint64_t a, uint64_t b) { return a > UINT64_MAX - b ? UINT64_MAX : a + b; }

/* Of the budget, what nothing can be dropped for. */
static uint64_t held_for(const ebpo_cache_pool *p, const ebpo_cache_demand *d)
{
    uint64_t held = sum(sum(p->pinned, p->taken), p->aside_most);
    return sum(sum(held, kept_for(p, d)), d->aside ? 0 : d->peak);
}

ebpo_cache_capacity ebpo_cache_make_room(ebpo_cache_pool *p, const ebpo_cache_demand *d)
{
    while (p->budget && sum(p->bytes, d->peak) > p->budget) {
        uint64_t held = held_for(p, d);
        if (held > p->budget)
            return ROOM_NEVER;
        if (sum(held, p->passing) > p->budget)
            return ROOM_LATER;
        ebpo_cache_slot *leaving = NULL;
        uint64_t left = sum(p->bytes, d->peak);
        for (ebpo_cache_slot *s = p->slots.oldest, *newer; s && left > p->budget; s = newer) {
            newer = s->newer;
            if (d->ahead && s->owner == d->cache && ebpo_cache_asked_ahead(d->cache, s->key))
                continue;
            left -= s->bytes;
            s->owner->stats.evicted++;
            ebpo_cache_drop(p, s, &leaving);
        }
        ebpo_cache_release_all(p, leaving);
    }
    ebpo_cache_count_bytes(p, d->cache, d->peak);
    p->passing += d->peak;
    return ROOM_MADE;
}

bool ebpo_cache_wait_for_room(ebpo_cache_pool *p, const ebpo_cache_demand *d)
{
    uint64_t ticket = p->tickets++;
    ebpo_cache_capacity got = ROOM_LATER;
    while (ticket != p->serving || (got = ebpo_cache_make_room(p, d)) == ROOM_LATER)
        pthread_cond_wait(&p->changed, &p->lock);
    p->serving++;
    pthread_cond_broadcast(&p->changed);
    return got == ROOM_MADE;
}

void ebpo_cache_give_back(ebpo_cache *c, uint64_t reserved)
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
    if (!p || !ebpo_cache_slots_make(&p->slots)) {
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
    ebpo_cache_demand d = { .peak = bytes };
    pthread_mutex_lock(&p->lock);
    bool made = ebpo_cache_wait_for_room(p, &d);
    uint64_t held = held_for(p, &d);
    if (made) {
        p->passing -= bytes;
        p->taken += bytes;
    }
    pthread_mutex_unlock(&p->lock);
    return made ? EBPO_OK
                : ebpo_fail(error, EBPO_E_LIMIT,
                            "%" PRIu64 " bytes of a shared budget are not free: there are %" PRIu64
                            ", and with what is in use that would be %" PRIu64,
                            bytes, p->budget, held);
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
