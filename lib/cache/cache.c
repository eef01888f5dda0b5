#include "cache/cache.h"

#include <inttypes.h>
#include <pthread.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/error.h"
#include "cache/cache_slots.h"

/* What there must be room for. The background yields to everyone else, and drops nothing that was
 * asked for together. */
typedef struct demand {
    uint64_t key, peak;
    bool ahead;
    bool aside; /* of what is set aside anyway */
    bool known; /* the peak, from an attempt before */
} demand;

struct ebpo_cache {
    ebpo_cache_source source;
    char name[32];
    uint64_t budget;
    pthread_mutex_t lock;   /* guards all below; never held while the source is called */
    pthread_cond_t changed; /* loads ended, room came free */
    /* the background has something to do: apart from `changed`, or each unpin would wake it */
    pthread_cond_t asked;
    ebpo_cache_slots slots;
    uint64_t pinned; /* bytes of items that are in use */
    uint64_t aside_most, aside;
    /* bytes reserved for loads under way, and of items on their way out: these become free or
     * pinned without anyone's help */
    uint64_t passing;
    /* gets that wait for room are served in the order they came, or a large one might wait for ever
     */
    uint64_t tickets, serving;
    ebpo_cache_stats stats;
    bool ahead_runs, stop;
    pthread_t ahead_thread;
    uint64_t ahead[EBPO_CACHE_AHEAD];
    unsigned ahead_count, ahead_next;
    uint64_t asking; /* how often something was asked for */
};

static void pin(ebpo_cache *c, ebpo_cache_slot *s)
{
    if (s->pins++ == 0) {
        ebpo_cache_slots_unlink(&c->slots, s);
        c->pinned += s->bytes;
    }
}

/* --- room --- */

static void count_bytes(ebpo_cache *c, uint64_t bytes)
{
    c->stats.bytes += bytes;
    if (c->stats.bytes > c->stats.peak_bytes)
        c->stats.peak_bytes = c->stats.bytes;
}

static bool asked_ahead(const ebpo_cache *c, uint64_t key)
{
    for (unsigned i = 0; i < c->ahead_count; i++)
        if (c->ahead[i] == key)
            return true;
    return false;
}

/* Releases items that are out of the table. Their bytes count until they are really gone, or
 * another thread would use them twice. */
static void release_all(ebpo_cache *c, ebpo_cache_slot *leaving)
{
    uint64_t bytes = 0;
    if (!leaving)
        return;
    pthread_mutex_unlock(&c->lock);
    for (ebpo_cache_slot *next; leaving; leaving = next) {
        next = leaving->chain;
        bytes += leaving->bytes;
        c->source.release(c->source.user, leaving->item);
        free(leaving);
    }
    pthread_mutex_lock(&c->lock);
    c->stats.bytes -= bytes;
    c->passing -= bytes;
    pthread_cond_broadcast(&c->changed);
}

static void drop(ebpo_cache *c, ebpo_cache_slot *s, ebpo_cache_slot **leaving)
{
    ebpo_cache_slots_unlink(&c->slots, s);
    ebpo_cache_slots_take(&c->slots, s);
    c->passing += s->bytes;
    s->chain = *leaving;
    *leaving = s;
}

/* Bytes that the background may not drop: what was asked for together. */
static uint64_t kept_for(const ebpo_cache *c, const demand *d)
{
    uint64_t bytes = 0;
    for (unsigned i = 0; d->ahead && i < c->ahead_count; i++) {
        const ebpo_cache_slot *s = ebpo_cache_slots_find(&c->slots, c->ahead[i]);
        bytes += s && s->state == READY && !s->pins ? s->bytes : 0;
    }
    return bytes;
}

static uint64_t sum(uint64_t a, uint64_t b) { return a > UINT64_MAX - b ? UINT64_MAX : a + b; }

typedef enum capacity { ROOM_MADE, ROOM_LATER, ROOM_NEVER } capacity;

/* Reserves d->peak, dropping the least recently used items. ROOM_LATER: when loads under way end.
 */
static capacity make_room(ebpo_cache *c, const demand *d)
{
    while (c->budget && sum(c->stats.bytes, d->peak) > c->budget) {
        uint64_t held =
            sum(sum(sum(c->pinned, kept_for(c, d)), d->aside ? 0 : d->peak), c->aside_most);
        if (held > c->budget)
            return ROOM_NEVER;
        if (sum(held, c->passing) > c->budget)
            return ROOM_LATER;
        ebpo_cache_slot *leaving = NULL;
        uint64_t left = sum(c->stats.bytes, d->peak);
        for (ebpo_cache_slot *s = c->slots.oldest, *newer; s && left > c->budget; s = newer) {
            newer = s->newer;
            if (d->ahead && asked_ahead(c, s->key))
                continue;
            left -= s->bytes;
            drop(c, s, &leaving);
            c->stats.evicted++;
        }
        release_all(c, leaving);
    }
    count_bytes(c, d->peak);
    c->passing += d->peak;
    return ROOM_MADE;
}

static ebpo_status wait_for_room(ebpo_cache *c, uint64_t peak, ebpo_error *error)
{
    demand d = { .peak = peak };
    uint64_t ticket = c->tickets++;
    capacity got = ROOM_LATER;
    while (ticket != c->serving || (got = make_room(c, &d)) == ROOM_LATER)
        pthread_cond_wait(&c->changed, &c->lock);
    c->serving++;
    pthread_cond_broadcast(&c->changed);
    if (got == ROOM_MADE)
        return EBPO_OK;
    return ebpo_fail(error, EBPO_E_LIMIT,
                     "the %s cache's budget is %" PRIu64 " bytes, of which %" PRIu64
                     " are in use, and one %s more takes up to %" PRIu64 "; a budget of %" PRIu64
                     " would do",
                     c->name, c->budget, sum(c->pinned, c->aside_most), c->name, peak,
                     sum(sum(c->pinned, c->aside_most), peak));
}

/* --- loading --- */

/* What was reserved for a load. */
static void give_back(ebpo_cache *c, uint64_t reserved)
{
    c->stats.bytes -= reserved;
    c->passing -= reserved;
    pthread_cond_broadcast(&c->changed);
}

/* Ends a load: `reserved` gives way to the item, which is pinned by whoever waits for it (and `own`
 * times more), or to nothing. */
static void end_load(ebpo_cache *c, ebpo_cache_slot *s, bool loaded, uint64_t reserved,
                     unsigned own)
{
    give_back(c, reserved);
    if (loaded) {
        s->state = READY;
        s->pins = own + s->waiters;
        count_bytes(c, s->bytes);
        if (s->pins)
            c->pinned += s->bytes;
        else
            ebpo_cache_slots_link(&c->slots, s);
    } else {
        ebpo_cache_slots_take(&c->slots, s);
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
    ebpo_status status = c->source.load(c->source.user, s->key, c->budget ? reserved : UINT64_MAX,
                                        &item, &bytes, error);
    *needed = status == EBPO_E_LIMIT && bytes > reserved ? bytes : 0;
    if (status == EBPO_OK && bytes > reserved && c->budget) {
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
        pthread_mutex_unlock(&c->lock);
        status = call_load(c, s, peak, &needed, error);
        pthread_mutex_lock(&c->lock);
        if (!needed)
            return status;
        give_back(c, *reserved);
        *reserved = 0;
        peak = needed;
    }
}

/* The lock is held at beginning and end. */
static ebpo_status load_here(ebpo_cache *c, uint64_t key, void **item, ebpo_error *error)
{
    ebpo_cache_slot *s =
        ebpo_cache_slots_add(&c->slots, key); /* from here on others wait for this load */
    uint64_t peak = 0, reserved = 0;
    if (!s)
        return ebpo_fail_memory(error, sizeof *s);
    pthread_mutex_unlock(&c->lock);
    ebpo_status status = estimate(c, key, &peak, error);
    pthread_mutex_lock(&c->lock);
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
        pthread_cond_wait(&c->changed, &c->lock);
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
    for (ebpo_cache_slot *s; (s = ebpo_cache_slots_find(&c->slots, key)) != NULL;) {
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
    ebpo_cache_slot *s = ebpo_cache_slots_find(&c->slots, key);
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
    pthread_mutex_lock(&c->lock);
    bool there = take_ready(c, key, item);
    if (!there) {
        double begin = ebpo_seconds();
        status = wait_or_load(c, key, item, error);
        c->stats.load_seconds += ebpo_seconds() - begin;
    }
    pthread_mutex_unlock(&c->lock);
    if (hit)
        *hit = there;
    return status;
}

bool ebpo_cache_try(ebpo_cache *c, uint64_t key, void **item)
{
    pthread_mutex_lock(&c->lock);
    bool there = take_ready(c, key, item);
    pthread_mutex_unlock(&c->lock);
    return there;
}

bool ebpo_cache_has(ebpo_cache *c, uint64_t key)
{
    pthread_mutex_lock(&c->lock);
    ebpo_cache_slot *s = ebpo_cache_slots_find(&c->slots, key);
    bool there = s && s->state == READY;
    pthread_mutex_unlock(&c->lock);
    return there;
}

void ebpo_cache_unpin(ebpo_cache *c, uint64_t key)
{
    pthread_mutex_lock(&c->lock);
    ebpo_cache_slot *s = ebpo_cache_slots_find(&c->slots, key);
    if (s && s->pins && --s->pins == 0) {
        c->pinned -= s->bytes;
        ebpo_cache_slots_link(&c->slots, s);
        pthread_cond_broadcast(&c->changed);
    }
    pthread_mutex_unlock(&c->lock);
}

/* --- aside --- */

void ebpo_cache_set_aside(ebpo_cache *c, uint64_t most) { c->aside_most = most; }

bool ebpo_cache_take_aside(ebpo_cache *c, uint64_t bytes)
{
    demand d = { .peak = bytes, .aside = true };
    pthread_mutex_lock(&c->lock);
    bool taken = bytes <= c->aside_most - c->aside;
    if (taken) {
        c->aside += bytes;
        taken = make_room(c, &d) == ROOM_MADE;
        *(taken ? &c->passing : &c->aside) -= bytes;
    }
    pthread_mutex_unlock(&c->lock);
    return taken;
}

void ebpo_cache_give_back_aside(ebpo_cache *c, uint64_t bytes)
{
    pthread_mutex_lock(&c->lock);
    c->aside -= bytes;
    c->stats.bytes -= bytes;
    pthread_cond_broadcast(&c->changed);
    pthread_mutex_unlock(&c->lock);
}

/* --- ahead --- */

/* Loads d->key in the background, or lets it be; false when it must wait for the loads of others.
 * Nobody waits for our key meanwhile: whoever wants it loads it. */
static bool load_ahead(ebpo_cache *c, demand *d)
{
    ebpo_cache_slot *s =
        ebpo_cache_slots_find(&c->slots, d->key) ? NULL : ebpo_cache_slots_add(&c->slots, d->key);
    if (!s)
        return true;
    if (!d->known) {
        pthread_mutex_unlock(&c->lock);
        d->known = estimate(c, d->key, &d->peak, NULL) == EBPO_OK;
        pthread_mutex_lock(&c->lock);
    }
    capacity got = !d->known ? ROOM_NEVER : c->serving != c->tickets ? ROOM_LATER : make_room(c, d);
    if (got != ROOM_MADE) {
        end_load(c, s, false, 0, 0);
        return got == ROOM_NEVER;
    }
    pthread_mutex_unlock(&c->lock);
    uint64_t needed;
    bool loaded = call_load(c, s, d->peak, &needed, NULL) == EBPO_OK;
    pthread_mutex_lock(&c->lock);
    c->stats.prefetched += loaded;
    end_load(c, s, loaded, d->peak, 0);
    return true;
}

static void *run_ahead(void *context)
{
    ebpo_cache *c = context;
    demand d = { .ahead = true };
    pthread_mutex_lock(&c->lock);
    while (!c->stop) {
        if (c->ahead_next == c->ahead_count) {
            pthread_cond_wait(&c->asked, &c->lock);
            continue;
        }
        uint64_t asking = c->asking;
        if (!d.known || d.key != c->ahead[c->ahead_next])
            d = (demand){ .key = c->ahead[c->ahead_next], .ahead = true };
        bool done = load_ahead(c, &d);
        if (done)
            d.known = false;
        if (done && asking == c->asking)
            c->ahead_next++;
        else if (!done && asking == c->asking && !c->stop)
            pthread_cond_wait(&c->changed, &c->lock);
    }
    pthread_mutex_unlock(&c->lock);
    return NULL;
}

/* Signals are for the program's own threads. */
static bool start_ahead(ebpo_cache *c)
{
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    bool started = pthread_create(&c->ahead_thread, NULL, run_ahead, c) == 0;
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
        if (!asked_ahead(c, keys[i]))
            c->ahead[c->ahead_count++] = keys[i];
    for (unsigned i = c->ahead_count; i-- > 0;) {
        ebpo_cache_slot *s = ebpo_cache_slots_find(&c->slots, c->ahead[i]);
        if (s && s->state == READY && !s->pins) {
            ebpo_cache_slots_unlink(&c->slots, s);
            ebpo_cache_slots_link(&c->slots, s);
        }
    }
}

void ebpo_cache_prefetch(ebpo_cache *c, const uint64_t *keys, unsigned count)
{
    pthread_mutex_lock(&c->lock);
    take_list(c, keys, count);
    if (!c->ahead_runs && c->ahead_count)
        c->ahead_runs = start_ahead(c);
    pthread_cond_signal(&c->asked);
    pthread_cond_broadcast(&c->changed);
    pthread_mutex_unlock(&c->lock);
}

/* --- the whole --- */

ebpo_status ebpo_cache_make(ebpo_cache **out, const ebpo_cache_source *source, const char *name,
                            uint64_t budget, ebpo_error *error)
{
    *out = NULL;
    ebpo_cache *c = ebpo_alloc_zero(1, sizeof *c);
    if (!c || !ebpo_cache_slots_make(&c->slots)) {
        free(c);
        return ebpo_fail_memory(error, sizeof *c);
    }
    c->source = *source;
    strncpy(c->name, name, sizeof c->name - 1);
    c->budget = budget;
    pthread_mutex_init(&c->lock, NULL);
    pthread_cond_init(&c->changed, NULL);
    pthread_cond_init(&c->asked, NULL);
    *out = c;
    return EBPO_OK;
}

void ebpo_cache_clear(ebpo_cache *c)
{
    ebpo_cache_slot *leaving = NULL;
    pthread_mutex_lock(&c->lock);
    while (c->slots.oldest)
        drop(c, c->slots.oldest, &leaving);
    release_all(c, leaving);
    pthread_mutex_unlock(&c->lock);
}

void ebpo_cache_get_stats(ebpo_cache *c, ebpo_cache_stats *out)
{
    pthread_mutex_lock(&c->lock);
    *out = c->stats;
    pthread_mutex_unlock(&c->lock);
}

void ebpo_cache_free(ebpo_cache *c)
{
    if (!c)
        return;
    pthread_mutex_lock(&c->lock);
    c->stop = true;
    pthread_cond_broadcast(&c->changed);
    pthread_cond_signal(&c->asked);
    pthread_mutex_unlock(&c->lock);
    if (c->ahead_runs)
        pthread_join(c->ahead_thread, NULL);
    for (uint64_t i = 0; i < c->slots.bucket_count; i++)
        for (ebpo_cache_slot *s = c->slots.bucket[i], *next; s; s = next) {
            next = s->chain;
            c->source.release(c->source.user, s->item);
            free(s);
        }
    pthread_cond_destroy(&c->asked);
    pthread_cond_destroy(&c->changed);
    pthread_mutex_destroy(&c->lock);
    free(c->slots.bucket);
    free(c);
}
