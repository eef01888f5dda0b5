/* Tests the cache against a reference implementation, and with threads. The source counts loads
 * and existing items. The budget holds at all times. */
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/error.h"
#include "check_main.h"
#include "core/cache.h"
#include "solids.h"

enum { KEYS = 256 };

/* An instrumented source. Item `key` takes size[key] bytes, and its loading peak[key] bytes. */
typedef struct source {
    pthread_mutex_t lock;
    pthread_cond_t moved;
    uint64_t budget, bytes, size[KEYS], peak[KEYS];
    int live[KEYS], loading[KEYS], loads[KEYS];
    /* flags by key: loading fails; loading waits until the gate opens */
    bool failing[KEYS], gated[KEYS];
    int order[4 * KEYS], ordered; /* loads in order of their start */
    int faults;                   /* number of violations */
    bool jitter;
} source;

typedef struct item {
    uint64_t key;
    source *from;
} item;

static source *src;
static ebpo_cache *cache;

static void account(source *s, int64_t change)
{
    s->bytes += (uint64_t)change;
    s->faults += s->budget && s->bytes > s->budget;
}

static ebpo_status estimate(void *user, uint64_t key, uint64_t *peak, uint64_t *keep,
                            ebpo_error *error)
{
    source *s = user;
    (void)error;
    pthread_mutex_lock(&s->lock);
    s->faults += s->loading[key] > 0;
    *peak = s->peak[key];
    *keep = s->size[key];
    pthread_mutex_unlock(&s->lock);
    return EBPO_OK;
}

static ebpo_status load(void *user, uint64_t key, uint64_t limit, void **out, uint64_t *bytes,
                        ebpo_error *error)
{
    (void)limit;
    source *s = user;
    pthread_mutex_lock(&s->lock);
    s->faults += s->loading[key]++ > 0;
    s->loads[key]++;
    if (s->ordered < 4 * KEYS)
        s->order[s->ordered++] = (int)key;
    account(s, (int64_t)s->peak[key]);
    pthread_cond_broadcast(&s->moved);
    while (s->gated[key])
        pthread_cond_wait(&s->moved, &s->lock);
    pthread_mutex_unlock(&s->lock);
    if (s->jitter)
        usleep((unsigned)(key * 7 % 50));
    pthread_mutex_lock(&s->lock);
    bool fails = s->failing[key];
    s->loading[key]--;
    account(s, (int64_t)(fails ? 0 : s->size[key]) - (int64_t)s->peak[key]);
    if (!fails)
        s->faults +=
            s->live[key]++ > 1; /* the previous item may still be in the process of removal */
    *bytes = s->size[key];
    pthread_mutex_unlock(&s->lock);
    if (fails)
        return ebpo_fail(error, EBPO_E_IO, "key %d cannot be read", (int)key);
    item *made = malloc(sizeof *made);
    *made = (item){ key, s };
    *out = made;
    return EBPO_OK;
}

static void release(void *user, void *it)
{
    source *s = user;
    item *i = it;
    pthread_mutex_lock(&s->lock);
    s->faults += s->live[i->key]-- < 1;
    account(s, -(int64_t)s->size[i->key]);
    pthread_mutex_unlock(&s->lock);
    free(i);
}

static void begin_with(uint64_t budget, uint64_t size, uint64_t peak)
{
    src = calloc(1, sizeof *src);
    pthread_mutex_init(&src->lock, NULL);
    pthread_cond_init(&src->moved, NULL);
    src->budget = budget;
    for (int i = 0; i < KEYS; i++) {
        src->size[i] = size;
        src->peak[i] = peak;
    }
    ebpo_cache_source from = { src, estimate, load, release };
    ck_assert_int_eq(ebpo_cache_make(&cache, &from, "thing", budget, NULL), EBPO_OK);
}

static void finish(void)
{
    ebpo_cache_free(cache);
    ck_assert_int_eq(src->faults, 0);
    ck_assert_uint_eq(src->bytes, 0);
    for (int i = 0; i < KEYS; i++)
        ck_assert_int_eq(src->live[i], 0);
    pthread_cond_destroy(&src->moved);
    pthread_mutex_destroy(&src->lock);
    free(src);
}

static bool get(uint64_t key)
{
    void *it = NULL;
    bool hit = false;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(ebpo_cache_get(cache, key, &it, &hit, &error) == EBPO_OK, "%s", error.message);
    ck_assert_uint_eq(((item *)it)->key, key);
    return hit;
}

static bool use(uint64_t key)
{
    bool hit = get(key);
    ebpo_cache_unpin(cache, key);
    return hit;
}

static ebpo_cache_stats stats(void)
{
    ebpo_cache_stats s;
    ebpo_cache_get_stats(cache, &s);
    return s;
}

static void set_gate(uint64_t key, bool closed)
{
    pthread_mutex_lock(&src->lock);
    src->gated[key] = closed;
    pthread_cond_broadcast(&src->moved);
    pthread_mutex_unlock(&src->lock);
}

static void await_loading(uint64_t key)
{
    pthread_mutex_lock(&src->lock);
    while (!src->loading[key])
        pthread_cond_wait(&src->moved, &src->lock);
    pthread_mutex_unlock(&src->lock);
}

static int loads_of(uint64_t key)
{
    pthread_mutex_lock(&src->lock);
    int loads = src->loads[key];
    pthread_mutex_unlock(&src->lock);
    return loads;
}

static void await_prefetched(uint64_t count)
{
    for (int i = 0; i < 5000 && stats().prefetched < count; i++)
        usleep(1000);
    ck_assert_uint_eq(stats().prefetched, count);
}

/* --- one thread --- */

/* The reference implementation: keys from the least to the most recently used. */
typedef struct reference {
    int key[KEYS], count, pins[KEYS];
    uint64_t bytes, pinned;
} reference;

static int reference_at(const reference *t, int key)
{
    for (int i = 0; i < t->count; i++)
        if (t->key[i] == key)
            return i;
    return -1;
}

static void reference_remove(reference *t, int at)
{
    t->bytes -= src->size[t->key[at]];
    memmove(t->key + at, t->key + at + 1, (size_t)(t->count - at - 1) * sizeof *t->key);
    t->count--;
}

static void reference_append(reference *t, int key)
{
    t->key[t->count++] = key;
    t->bytes += src->size[key];
}

static void reference_pin(reference *t, int key)
{
    if (t->pins[key]++ == 0)
        t->pinned += src->size[key];
}

static bool reference_get(reference *t, int key)
{
    if (reference_at(t, key) < 0) {
        uint64_t peak = src->peak[key];
        if (t->pinned + peak > src->budget)
            return false;
        for (int i = 0; t->bytes + peak > src->budget;)
            if (t->pins[t->key[i]])
                i++;
            else
                reference_remove(t, i);
        reference_append(t, key);
    }
    reference_pin(t, key);
    return true;
}

static void reference_unpin(reference *t, int key)
{
    if (--t->pins[key])
        return;
    t->pinned -= src->size[key];
    reference_remove(t, reference_at(t, key)); /* an item counts as used when its use ends */
    reference_append(t, key);
}

static void step(reference *t, uint64_t *random)
{
    int key = (int)(ebpo_test_random(random) % 40);
    void *it;
    switch (ebpo_test_random(random) % 8) {
    case 0:
    case 1:
    case 2: {
        ebpo_error error = EBPO_ERROR_INIT;
        bool there = reference_at(t, key) >= 0, hit, fits = reference_get(t, key);
        ck_assert_int_eq(ebpo_cache_get(cache, (uint64_t)key, &it, &hit, &error),
                         fits ? EBPO_OK : EBPO_E_LIMIT);
        ck_assert(hit == there);
        break;
    }
    case 3: {
        bool there = reference_at(t, key) >= 0;
        ck_assert(ebpo_cache_try(cache, (uint64_t)key, &it) == there);
        if (there)
            reference_pin(t, key);
        break;
    }
    case 4:
        if (ebpo_test_random(random) % 50)
            break;
        ebpo_cache_clear(cache);
        for (int i = t->count; i-- > 0;)
            if (!t->pins[t->key[i]])
                reference_remove(t, i);
        break;
    default:
        for (int i = 0; i < 40 && !t->pins[key]; i++)
            key = (key + 1) % 40;
        if (t->pins[key]) {
            ebpo_cache_unpin(cache, (uint64_t)key);
            reference_unpin(t, key);
        }
    }
}

START_TEST(test_cache_random_operations_match_model)
{
    uint64_t random = (uint64_t)_i;
    begin_with(1000, 0, 0);
    for (int i = 0; i < KEYS; i++) {
        src->size[i] = 10 + ebpo_test_random(&random) % 150;
        src->peak[i] = src->size[i] + ebpo_test_random(&random) % 100;
    }
    reference t = { .count = 0 };
    for (int i = 0; i < 20000; i++) {
        step(&t, &random);
        int differ = -1;
        for (int key = 0; key < 40; key++)
            differ = src->live[key] == (reference_at(&t, key) >= 0) ? differ : key;
        ck_assert_msg(differ < 0, "step %d, key %d", i, differ);
        ck_assert_uint_eq(stats().bytes, t.bytes);
    }
    ck_assert_uint_le(stats().peak_bytes, 1000);
    ck_assert_uint_gt(stats().evicted, 1000);
    for (int key = 0; key < 40; key++)
        while (t.pins[key]--)
            ebpo_cache_unpin(cache, (uint64_t)key);
    finish();
}
END_TEST

START_TEST(test_cache_pinned_items_stay)
{
    begin_with(300, 100, 120);
    get(1);
    get(1);
    get(2);
    ebpo_cache_unpin(cache, 1);
    void *it;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_int_eq(ebpo_cache_get(cache, 3, &it, NULL, &error), EBPO_E_LIMIT);
    ck_assert_ptr_null(it);
    ck_assert_msg(strstr(error.message, "budget of 320 would suffice"), "%s", error.message);
    ck_assert(ebpo_cache_try(cache, 1, &it));
    ebpo_cache_unpin(cache, 1);
    ebpo_cache_unpin(cache, 1);
    get(3);
    ck_assert_int_eq(src->live[1], 0);
    ck_assert_int_eq(src->live[2], 1);
    ebpo_cache_unpin(cache, 2);
    ebpo_cache_unpin(cache, 3);
    finish();
}
END_TEST

/* Small items stay while large items can be dropped, up to half of the budget. */
START_TEST(test_cache_keeps_small_items_longer)
{
    begin_with(16 << 10, 4 << 10, 4 << 10);
    for (uint64_t key = 0; key < 8; key++)
        src->size[key] = src->peak[key] = 1 << 10;
    for (uint64_t key = 0; key < 7; key++)
        use(key);
    for (uint64_t key = 10; key < 20; key++) /* two of these fit beside the small items */
        use(key);
    ck_assert_uint_eq(stats().evicted, 8);
    for (uint64_t key = 0; key < 7; key++)
        ck_assert(use(key));
    ck_assert(use(18) && use(19));
    /* With more than half of the budget, small items are not kept longer. */
    src->size[7] = src->peak[7] = 2 << 10;
    use(7);
    ck_assert(!ebpo_cache_has(cache, 18) && use(19));
    use(20);
    ck_assert(!ebpo_cache_has(cache, 0) && ebpo_cache_has(cache, 19));
    finish();
}
END_TEST

/* Items are evicted for a reservation, except items in use. A load that would need the reserved
 * memory is refused before memory is taken. */
START_TEST(test_cache_reserve_evicts_items_when_needed)
{
    begin_with(400, 100, 100);
    ebpo_cache_set_aside(cache, 150);
    for (uint64_t key = 0; key < 4; key++)
        ck_assert(!use(key));
    ebpo_cache_stats stats;
    ck_assert(ebpo_cache_take_aside(cache, 60)); /* evicts the oldest */
    ck_assert_int_eq(src->live[0] + src->live[1], 1);
    ck_assert(!ebpo_cache_take_aside(cache, 91));
    get(2);
    get(3);
    ck_assert(ebpo_cache_take_aside(cache, 90));
    ck_assert(!ebpo_cache_take_aside(cache, 1));
    ebpo_cache_get_stats(cache, &stats);
    ck_assert_uint_eq(stats.bytes, 350);
    ck_assert_uint_le(stats.peak_bytes, 400);
    void *it;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_int_eq(ebpo_cache_get(cache, 5, &it, NULL, &error), EBPO_E_LIMIT);
    ck_assert_msg(strstr(error.message, "budget of 450 would suffice"), "%s", error.message);
    ebpo_cache_unpin(cache, 2);
    ebpo_cache_unpin(cache, 3);
    ck_assert(!use(5));
    finish();
}
END_TEST

/* --- shared --- */

/* Two caches of one source, with different keys. */
static ebpo_cache_pool *pool;
static ebpo_cache *other;

static void begin_two(uint64_t budget, uint64_t size, uint64_t peak)
{
    begin_with(budget, size, peak);
    ebpo_cache_free(cache);
    ebpo_cache_source from = { src, estimate, load, release };
    ck_assert_int_eq(ebpo_cache_pool_make(&pool, budget, NULL), EBPO_OK);
    ck_assert_int_eq(ebpo_cache_make_in(&cache, &from, "thing", pool, NULL), EBPO_OK);
    ck_assert_int_eq(ebpo_cache_make_in(&other, &from, "other", pool, NULL), EBPO_OK);
}

static void finish_two(void)
{
    uint64_t now, peak, taken;
    ebpo_cache_free(other);
    finish();
    ebpo_cache_pool_get_bytes(pool, &now, &peak, &taken);
    ck_assert_uint_eq(now, 0);
    ebpo_cache_pool_free(pool);
}

static void use_other(uint64_t key)
{
    void *it;
    ck_assert_int_eq(ebpo_cache_get(other, key, &it, NULL, NULL), EBPO_OK);
    ck_assert_uint_eq(((item *)it)->key, key);
    ebpo_cache_unpin(other, key);
}

START_TEST(test_shared_budget_evicts_least_recently_used)
{
    begin_two(400, 100, 100);
    use(1);
    use_other(11);
    use(2);
    use_other(12);
    ck_assert(use(1));
    use_other(13);
    ck_assert(src->live[1] && !src->live[11] && src->live[2] && src->live[12]);
    ck_assert(!ebpo_cache_has(cache, 12) && ebpo_cache_has(other, 12));
    use(3);
    ck_assert(src->live[1] && !src->live[2] && src->live[12] && src->live[13]);
    ebpo_cache_clear(other);
    ck_assert(src->live[1] && src->live[3] && !src->live[12] && !src->live[13]);
    finish_two();
}
END_TEST

START_TEST(test_shared_budget_permanent_use_evicts_items)
{
    uint64_t now, peak, taken;
    ebpo_error error = EBPO_ERROR_INIT;
    begin_two(400, 100, 100);
    use(1);
    use_other(11);
    get(2);
    ck_assert_int_eq(ebpo_cache_pool_take(pool, 301, &error), EBPO_E_LIMIT);
    ck_assert_msg(strstr(error.message, "301 bytes are not free in a shared budget"), "%s",
                  error.message);
    ck_assert_int_eq(ebpo_cache_pool_take(pool, 250, NULL), EBPO_OK);
    ck_assert(!src->live[1] && !src->live[11] && src->live[2]);
    ebpo_cache_pool_get_bytes(pool, &now, &peak, &taken);
    ck_assert_uint_eq(now, 350);
    ck_assert_uint_eq(taken, 250);
    ck_assert_uint_le(peak, 400);
    void *it;
    ck_assert_int_eq(ebpo_cache_get(other, 12, &it, NULL, NULL), EBPO_E_LIMIT);
    ebpo_cache_unpin(cache, 2);
    use_other(12);
    ebpo_cache_pool_give_back(pool, 250);
    finish_two();
}
END_TEST

static void *use_either(void *context)
{
    uint64_t state = *(const uint64_t *)context;
    for (int i = 0; i < 2000; i++) {
        uint64_t r = ebpo_test_random(&state), key = r / 2 % 40;
        void *it;
        ebpo_cache *from = r % 2 ? cache : other;
        key += r % 2 ? 0 : 100;
        if (ebpo_cache_get(from, key, &it, NULL, NULL) != EBPO_OK)
            continue;
        ebpo_cache_unpin(from, key);
        if (i % 500 == 0)
            ebpo_cache_clear(from);
    }
    return NULL;
}

/* The source counts all bytes of both caches at all times. */
START_TEST(test_shared_budget_holds_with_four_threads)
{
    pthread_t thread[4];
    uint64_t seed[4] = { 1, 2, 3, 4 };
    begin_two(1500, 100, 130);
    for (int i = 0; i < 4; i++)
        ck_assert_int_eq(pthread_create(&thread[i], NULL, use_either, &seed[i]), 0);
    for (int i = 0; i < 4; i++)
        pthread_join(thread[i], NULL);
    finish_two();
}
END_TEST

START_TEST(test_failed_load_reports_error)
{
    begin_with(300, 100, 120);
    src->failing[5] = true;
    ebpo_error error = EBPO_ERROR_INIT;
    void *it;
    ck_assert_int_eq(ebpo_cache_get(cache, 5, &it, NULL, &error), EBPO_E_IO);
    ck_assert_str_eq(error.message, "key 5 cannot be read");
    ck_assert_uint_eq(stats().bytes, 0);
    src->failing[5] = false;
    ck_assert(!use(5));
    ck_assert(use(5));
    ck_assert_uint_eq(stats().loads, 1);
    ck_assert_uint_eq(stats().hits, 1);
    finish();
}
END_TEST

static ebpo_status report_little(void *user, uint64_t key, uint64_t *peak, uint64_t *keep,
                                 ebpo_error *error)
{
    ebpo_status status = estimate(user, key, peak, keep, error);
    *peak = *keep = 10;
    return status;
}

START_TEST(test_item_beyond_estimate_keeps_budget)
{
    begin_with(300, 100, 100);
    ebpo_cache_free(cache);
    ebpo_cache_source from = { src, report_little, load, release };
    ck_assert_int_eq(ebpo_cache_make(&cache, &from, "thing", 300, NULL), EBPO_OK);
    void *it;
    ck_assert_int_eq(ebpo_cache_get(cache, 1, &it, NULL, NULL), EBPO_E_LIMIT);
    ck_assert_uint_eq(stats().bytes, 0);
    finish();
}
END_TEST

/* A load that needs more memory than stated, which it finds while loading. */
static ebpo_status load_more(void *user, uint64_t key, uint64_t limit, void **out, uint64_t *bytes,
                             ebpo_error *error)
{
    const source *s = user;
    if (limit >= s->peak[key])
        return load(user, key, limit, out, bytes, error);
    *bytes = limit + 60 < s->peak[key] ? limit + 60 : s->peak[key];
    return ebpo_fail(error, EBPO_E_LIMIT, "%d bytes are not enough", (int)limit);
}

START_TEST(test_load_can_request_more_memory)
{
    begin_with(300, 50, 150);
    ebpo_cache_free(cache);
    ebpo_cache_source from = { src, report_little, load_more, release };
    ck_assert_int_eq(ebpo_cache_make(&cache, &from, "thing", 300, NULL), EBPO_OK);
    void *it;
    for (uint64_t key = 0; key < 5; key++) {
        ck_assert_int_eq(ebpo_cache_get(cache, key, &it, NULL, NULL), EBPO_OK);
        ck_assert_uint_le(stats().peak_bytes, 300);
        ebpo_cache_unpin(cache, key);
    }
    ck_assert_uint_eq(stats().bytes, 200);
    ck_assert_uint_eq(stats().evicted, 1);
    src->peak[5] = 301;
    ck_assert_int_eq(ebpo_cache_get(cache, 5, &it, NULL, NULL), EBPO_E_LIMIT);
    ck_assert_uint_le(stats().peak_bytes, 300);
    ck_assert(!ebpo_cache_has(cache, 5));
    finish();
}
END_TEST

START_TEST(test_cache_without_budget_keeps_all_items)
{
    begin_with(0, 1 << 20, 1 << 20);
    for (int round = 0; round < 2; round++)
        for (uint64_t key = 0; key < KEYS; key++)
            ck_assert(use(key) == (round == 1));
    ck_assert_uint_eq(stats().evicted, 0);
    ck_assert_uint_eq(stats().bytes, (uint64_t)KEYS << 20);
    ebpo_cache_clear(cache);
    ck_assert_uint_eq(stats().bytes, 0);
    finish();
}
END_TEST

/* --- several threads --- */

typedef struct getter {
    pthread_t thread;
    uint64_t key;
    bool hit;
    ebpo_status status;
    ebpo_error error;
} getter;

static void *run_getter(void *context)
{
    getter *g = context;
    void *it;
    g->status = ebpo_cache_get(cache, g->key, &it, &g->hit, &g->error);
    if (g->status == EBPO_OK)
        ebpo_cache_unpin(cache, g->key);
    return NULL;
}

static void start(getter *g, uint64_t key)
{
    *g = (getter){ .key = key };
    pthread_create(&g->thread, NULL, run_getter, g);
}

START_TEST(test_concurrent_gets_load_key_once)
{
    getter g[8];
    begin_with(1000, 100, 100);
    set_gate(7, true);
    for (int i = 0; i < 8; i++)
        start(&g[i], 7);
    await_loading(7);
    usleep(20000);
    set_gate(7, false);
    int hits = 0;
    for (int i = 0; i < 8; i++) {
        pthread_join(g[i].thread, NULL);
        ck_assert_int_eq(g[i].status, EBPO_OK);
        hits += g[i].hit;
    }
    ck_assert_int_eq(loads_of(7), 1);
    ck_assert_uint_eq(stats().hits, (uint64_t)hits);
    ck_assert_int_lt(hits, 8);
    ck_assert(stats().load_seconds > 0.01);
    finish();
}
END_TEST

START_TEST(test_waiters_of_failed_load_get_error)
{
    getter g[4];
    begin_with(1000, 100, 100);
    set_gate(7, true);
    src->failing[7] = true;
    for (int i = 0; i < 4; i++)
        start(&g[i], 7);
    await_loading(7);
    usleep(20000);
    set_gate(7, false);
    for (int i = 0; i < 4; i++) {
        pthread_join(g[i].thread, NULL);
        ck_assert_int_eq(g[i].status, EBPO_E_IO);
        ck_assert_str_eq(g[i].error.message, "key 7 cannot be read");
    }
    ck_assert_uint_eq(stats().bytes, 0);
    finish();
}
END_TEST

START_TEST(test_get_waits_for_memory_of_load)
{
    getter a, b;
    begin_with(150, 100, 100);
    set_gate(1, true);
    start(&a, 1);
    await_loading(1);
    start(&b, 2);
    usleep(20000);
    ck_assert_int_eq(loads_of(2), 0);
    set_gate(1, false);
    pthread_join(a.thread, NULL);
    pthread_join(b.thread, NULL);
    ck_assert_int_eq(a.status, EBPO_OK);
    /* the load is refused when item 1 was in use at the time of the request */
    ck_assert(b.status == EBPO_OK || b.status == EBPO_E_LIMIT);
    finish();
}
END_TEST

/* Runs small loads one after the other. On several threads together they never leave enough memory
 * for a large load. */
static void *run_small(void *context)
{
    atomic_bool *stop = context;
    for (uint64_t i = 0; !atomic_load(stop); i++) {
        void *it;
        uint64_t key = i % 100;
        if (ebpo_cache_get(cache, key, &it, NULL, NULL) == EBPO_OK)
            ebpo_cache_unpin(cache, key);
    }
    return NULL;
}

START_TEST(test_large_load_is_not_starved)
{
    pthread_t small[3];
    atomic_bool stop = false;
    begin_with(400, 100, 100);
    src->jitter = true;
    /* A small item in use leaves no space, so that the large load is refused. While only small
     * loads run, the large load waits. */
    src->size[200] = src->peak[200] = 290;
    for (int i = 0; i < 3; i++)
        pthread_create(&small[i], NULL, run_small, &stop);
    int done = 0;
    for (int i = 0; i < 20000 && done < 20; i++) {
        void *it;
        if (ebpo_cache_get(cache, 200, &it, NULL, NULL) != EBPO_OK) {
            usleep(100); /* a thread that lost its turn while it used an item gets a new turn */
            continue;
        }
        ebpo_cache_unpin(cache, 200);
        ebpo_cache_clear(cache);
        done++;
    }
    atomic_store(&stop, true);
    for (int i = 0; i < 3; i++)
        pthread_join(small[i], NULL);
    ck_assert_int_eq(done, 20);
    finish();
}
END_TEST

/* --- prefetching --- */

START_TEST(test_prefetch_loads_in_order)
{
    begin_with(1000, 100, 100);
    uint64_t keys[] = { 9, 3, 9, 5, 200 };
    ebpo_cache_prefetch(cache, keys, 5);
    await_prefetched(4);
    int expected[] = { 9, 3, 5, 200 };
    for (int i = 0; i < 4; i++)
        ck_assert_int_eq(src->order[i], expected[i]);
    ck_assert(use(5) && use(9) && use(3));
    ck_assert_uint_eq(stats().loads, 0);
    finish();
}
END_TEST

START_TEST(test_prefetch_keeps_used_and_hinted_items)
{
    begin_with(500, 100, 100);
    for (uint64_t key = 1; key <= 5; key++)
        use(key);
    get(1);
    uint64_t keys[] = { 2, 10, 11, 12, 13, 14 };
    ebpo_cache_prefetch(cache, keys, 6);
    await_prefetched(3);
    usleep(20000);
    ck_assert_uint_eq(stats().prefetched, 3);
    ck_assert(use(1) && use(2) && use(10) && use(11) && use(12));
    ebpo_cache_unpin(cache, 1);
    finish();
}
END_TEST

START_TEST(test_new_prefetch_hint_replaces_old_one)
{
    begin_with(5000, 100, 100);
    set_gate(1, true);
    uint64_t before[] = { 1, 2, 3 }, after[] = { 4, 5 };
    ebpo_cache_prefetch(cache, before, 3);
    await_loading(1);
    ebpo_cache_prefetch(cache, after, 2);
    set_gate(1, false);
    await_prefetched(3);
    usleep(10000);
    ck_assert_int_eq(loads_of(2), 0);
    ck_assert_int_eq(loads_of(3), 0);
    ck_assert(use(1) && use(4) && use(5));
    ebpo_cache_prefetch(cache, NULL, 0);
    finish();
}
END_TEST

START_TEST(test_get_waits_for_prefetch)
{
    getter g;
    begin_with(100, 100, 100);
    set_gate(1, true);
    uint64_t key = 1;
    ebpo_cache_prefetch(cache, &key, 1);
    await_loading(1);
    start(&g, 1);
    usleep(200000); /* on a busy machine, it takes some time until the other thread waits */
    set_gate(1, false);
    pthread_join(g.thread, NULL);
    ck_assert_int_eq(g.status, EBPO_OK);
    ck_assert(!g.hit);
    ck_assert_int_eq(loads_of(1), 1);
    ebpo_cache_stats s = stats();
    ck_assert(s.hits == 0 && s.loads == 0 && s.prefetched == 1 && s.load_seconds > 0.01);
    finish();
}
END_TEST

START_TEST(test_get_waits_for_memory_of_prefetch)
{
    getter g;
    begin_with(150, 100, 100);
    set_gate(1, true);
    uint64_t keys[] = { 1, 3, 4 };
    ebpo_cache_prefetch(cache, keys, 3);
    await_loading(1);
    start(&g, 2);
    usleep(20000);
    ck_assert_int_eq(loads_of(2), 0);
    set_gate(1, false);
    pthread_join(g.thread, NULL);
    ck_assert_int_eq(g.status, EBPO_OK);
    finish();
}
END_TEST

START_TEST(test_prefetch_failures_are_silent)
{
    begin_with(1000, 100, 100);
    src->failing[1] = true;
    src->peak[2] = 5000;
    uint64_t keys[] = { 1, 2, 3 };
    ebpo_cache_prefetch(cache, keys, 3);
    await_prefetched(1);
    ck_assert(use(3));
    ebpo_error error = EBPO_ERROR_INIT;
    void *it;
    ck_assert_int_eq(ebpo_cache_get(cache, 1, &it, NULL, &error), EBPO_E_IO);
    ck_assert_int_eq(ebpo_cache_get(cache, 2, &it, NULL, &error), EBPO_E_LIMIT);
    finish();
}
END_TEST

static void *open_gate_soon(void *context)
{
    usleep(20000);
    set_gate(*(uint64_t *)context, false);
    return NULL;
}

START_TEST(test_cache_free_stops_prefetch)
{
    begin_with(0, 100, 100);
    uint64_t keys[64];
    for (uint64_t i = 0; i < 64; i++)
        keys[i] = i;
    set_gate(2, true);
    ebpo_cache_prefetch(cache, keys, 64);
    await_loading(2);
    pthread_t opener;
    pthread_create(&opener, NULL, open_gate_soon, &keys[2]);
    ebpo_cache_free(cache);
    cache = NULL;
    pthread_join(opener, NULL);
    ck_assert_int_eq(src->ordered, 3);
    finish();
}
END_TEST

/* --- all at once --- */

typedef struct hammer {
    pthread_t thread;
    uint64_t seed;
    int wrong;
} hammer;

static void hammer_once(hammer *h, uint64_t key)
{
    void *it;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status = ebpo_cache_get(cache, key, &it, NULL, &error);
    bool fails = key % 50 == 49;
    if (status == EBPO_OK) {
        h->wrong += ((item *)it)->key != key || fails;
        if (key % 3 == 0)
            usleep(1);
        h->wrong += ((item *)it)->from != src;
        ebpo_cache_unpin(cache, key);
    } else {
        h->wrong += fails ? status != EBPO_E_IO && status != EBPO_E_LIMIT : status != EBPO_E_LIMIT;
    }
}

static void *run_hammer(void *context)
{
    hammer *h = context;
    uint64_t at = h->seed % KEYS;
    for (int i = 0; i < 4000; i++) {
        uint64_t r = ebpo_test_random(&h->seed);
        at = r % 20 == 0 ? r / 32 % KEYS : (at + r / 32 % 5) % KEYS;
        hammer_once(h, at);
        void *it;
        if (r % 7 == 0 && ebpo_cache_try(cache, (at + 1) % KEYS, &it))
            ebpo_cache_unpin(cache, (at + 1) % KEYS);
        if (r % 11 == 0) {
            uint64_t keys[8];
            for (uint64_t k = 0; k < 8; k++)
                keys[k] = (at + k) % KEYS;
            ebpo_cache_prefetch(cache, keys, 8);
        }
        if (r % 997 == 0)
            ebpo_cache_clear(cache);
    }
    return NULL;
}

START_TEST(test_budget_holds_with_threads_and_prefetch)
{
    hammer h[4];
    uint64_t random = 1 + (uint64_t)_i;
    uint64_t unit = _i == 3 ? 40 : 1; /* 40: small and large items */
    begin_with(unit * (_i == 1 ? 3000 : _i == 2 ? 400 : 700), 0, 0);
    src->jitter = true;
    for (int i = 0; i < KEYS; i++) {
        src->size[i] = unit * (20 + ebpo_test_random(&random) % 100);
        src->peak[i] = src->size[i] + unit * (ebpo_test_random(&random) % 80);
        src->failing[i] = i % 50 == 49;
    }
    for (int i = 0; i < 4; i++) {
        h[i] = (hammer){ .seed = 77 * (uint64_t)(i + 1) };
        pthread_create(&h[i].thread, NULL, run_hammer, &h[i]);
    }
    for (int i = 0; i < 4; i++) {
        pthread_join(h[i].thread, NULL);
        ck_assert_int_eq(h[i].wrong, 0);
    }
    ebpo_cache_stats s = stats();
    ck_assert_uint_le(s.peak_bytes, src->budget);
    ck_assert_uint_gt(s.prefetched, 0);
    ck_assert_uint_gt(s.hits, 0);
    finish();
}
END_TEST

TEST_SUITE(cache)
{
    Suite *suite = suite_create("cache");
    TCase *tests = tcase_create("cache");
    tcase_set_timeout(tests, 300);
    tcase_add_loop_test(tests, test_cache_random_operations_match_model, 1, 6);
    tcase_add_test(tests, test_cache_keeps_small_items_longer);
    tcase_add_test(tests, test_cache_reserve_evicts_items_when_needed);
    tcase_add_test(tests, test_shared_budget_evicts_least_recently_used);
    tcase_add_test(tests, test_shared_budget_permanent_use_evicts_items);
    tcase_add_test(tests, test_shared_budget_holds_with_four_threads);
    tcase_add_test(tests, test_cache_pinned_items_stay);
    tcase_add_test(tests, test_failed_load_reports_error);
    tcase_add_test(tests, test_item_beyond_estimate_keeps_budget);
    tcase_add_test(tests, test_load_can_request_more_memory);
    tcase_add_test(tests, test_cache_without_budget_keeps_all_items);
    tcase_add_test(tests, test_concurrent_gets_load_key_once);
    tcase_add_test(tests, test_waiters_of_failed_load_get_error);
    tcase_add_test(tests, test_get_waits_for_memory_of_load);
    tcase_add_test(tests, test_large_load_is_not_starved);
    tcase_add_test(tests, test_prefetch_loads_in_order);
    tcase_add_test(tests, test_prefetch_keeps_used_and_hinted_items);
    tcase_add_test(tests, test_new_prefetch_hint_replaces_old_one);
    tcase_add_test(tests, test_get_waits_for_prefetch);
    tcase_add_test(tests, test_get_waits_for_memory_of_prefetch);
    tcase_add_test(tests, test_prefetch_failures_are_silent);
    tcase_add_test(tests, test_cache_free_stops_prefetch);
    tcase_add_loop_test(tests, test_budget_holds_with_threads_and_prefetch, 0, 4);
    suite_add_tcase(suite, tests);
    return suite;
}
