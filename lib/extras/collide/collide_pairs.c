/* Finds the pairs of faces of two models that intersect: the first contact, or all pairs in a fixed
 * order.
 *
 * To find all pairs, the pair of both hierarchies' top nodes is divided repeatedly into pairs of
 * their children, until there are enough pairs of nodes (parts). The threads search the parts
 * (pair_walk_kernels.c). The results are sorted by the index of the first face, then by the index
 * of the second face, so the order does not depend on the number of threads. If the collider's
 * memory is too small for all pairs, runs of consecutive faces of the first model are searched one
 * run after another. Partly loaded models are searched by subtree_walk.c. */
#include "core/strict_fp.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/collide/collider.h"
#include "extras/collide/hierarchy_walk.h"
#include "extras/collide/subtree_walk.h"

/* The search for all intersecting pairs of faces of two hierarchies, for one run of faces of the
 * first hierarchy. Zero at the beginning. */
typedef struct pair_gathering {
    const ebpo_collision *collision;
    bool self;            /* both hierarchies are the same hierarchy at the same pose */
    ebpo_node_pair *part; /* [parts] pairs of nodes at which the searches of threads begin */
    uint64_t parts, part_capacity;
    ebpo_pair_walk *walk; /* [threads] the search of each thread */
    unsigned threads;
    uint64_t most;                /* maximum number of pairs */
    _Atomic uint64_t found;       /* number of pairs found by all threads */
    _Atomic bool full;            /* there are more than `most` pairs */
    ebpo_found_pair *found_pairs; /* [found_count] the sorted pairs of this run */
    uint64_t found_count, found_capacity;
} pair_gathering;

/* --- sorting --- */

/* Radix sort, beginning with the least significant digit. A digit has MIN_BITS to MAX_BITS bits, so
 * that counting digits takes no longer than moving the pairs. */
enum { MIN_BITS = 4, MAX_BITS = 11 };

/* Returns a digit of a pair's face index: `bits` bits, beginning with bit `shift`. by_a: of the
 * index a; otherwise of the index b. */
static inline uint32_t digit_of(const ebpo_found_pair *pair, bool by_a, unsigned shift,
                                unsigned bits)
{
    return (by_a ? pair->a : pair->b) >> shift & ((1u << bits) - 1);
}

/* Copies pairs to `to`, sorted by one digit; keeps the order of pairs with equal digits. */
static void sort_by_digit(const ebpo_found_pair *from, ebpo_found_pair *to, uint64_t count,
                          bool by_a, unsigned shift, unsigned bits)
{
    uint64_t begin[(1 << MAX_BITS) + 1];
    memset(begin, 0, ((1u << bits) + 1) * sizeof *begin);
    for (uint64_t i = 0; i < count; i++)
        begin[digit_of(&from[i], by_a, shift, bits) + 1]++;
    for (unsigned d = 0; d < 1u << bits; d++)
        begin[d + 1] += begin[d];
    for (uint64_t i = 0; i < count; i++)
        to[begin[digit_of(&from[i], by_a, shift, bits)]++] = from[i];
}

/* Returns the number of bits of a digit for sorting `count` pairs. */
static unsigned bits_for(uint64_t count)
{
    unsigned bits = MIN_BITS;
    while (bits < MAX_BITS && count >> bits > 1)
        bits++;
    return bits;
}

/* Sorts pairs by a, then by b; a < max_a and b < max_b. `spare` is workspace for `count` pairs. The
 * result is in `pairs`. */
static void sort_found_pairs(ebpo_found_pair *pairs, ebpo_found_pair *spare, uint64_t count,
                             uint32_t max_a, uint32_t max_b)
{
    ebpo_found_pair *from = pairs, *to = spare;
    unsigned bits = bits_for(count);
    if (count < 2)
        return;
    for (int by_a = 0; by_a < 2; by_a++)
        for (unsigned shift = 0; shift < 32 && (by_a ? max_a : max_b) >> shift; shift += bits) {
            sort_by_digit(from, to, count, by_a, shift, bits);
            ebpo_found_pair *sorted = to;
            to = from;
            from = sorted;
        }
    if (from != pairs)
        memcpy(pairs, from, count * sizeof *pairs);
}

/* --- the first contact --- */

/* Searches for a contact. *found: 1 if there is a contact, 0 if there is no contact, -1 if the
 * deadline has passed before the search has found a contact. */
static ebpo_status search_first(const ebpo_collision *q, ebpo_pair_walk *w, const char *stage,
                                int32_t *found, ebpo_error *error)
{
    if (!w->kernels->start(w))
        return ebpo_fail_memory(error, w->capacity * sizeof *w->stack);
    while (w->top > 0) {
        if (!w->kernels->run(w, EBPO_WALK_PAIRS))
            return ebpo_fail_memory(error, w->capacity * sizeof *w->stack);
        if (w->top > 0 && ebpo_collision_is_late(q)) {
            *found = -1;
            return EBPO_OK;
        }
        if (!ebpo_progress_step(&q->options.progress, stage, 0, 0, error))
            return EBPO_E_CANCELLED;
    }
    *found = w->found_count > 0;
    return EBPO_OK;
}

ebpo_status ebpo_collision_first(const ebpo_collision *q, const ebpo_accel *const accel[2],
                                 const char *stage, int32_t *found, ebpo_error *error)
{
    ebpo_pair_walk *w = &q->collider->walk;
    ebpo_accel_pair pair;
    const ebpo_block_posing *posing[2] = { &q->posing[0], &q->posing[1] };
    *found = 0;
    if (accel[0]->bound_count == 0 || accel[1]->bound_count == 0)
        return EBPO_OK;
    ebpo_accel_pair_make(&pair, accel, posing, q->max_coordinate);
    if (pair.apart)
        return EBPO_OK;
    ebpo_pair_walk_begin(w, &pair);
    w->first = true;
    w->self = false;
    ebpo_status status = search_first(q, w, stage, found, error);
    ebpo_collider_count(q->collider, w);
    return status;
}

ebpo_status ebpo_collide_first(ebpo_collider *c, const ebpo_collide_options *options,
                               ebpo_face_pair *out, int32_t *found, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_collision q;
    *out = (ebpo_face_pair){ EBPO_NO_FACE, EBPO_NO_FACE, EBPO_NO_FACE, EBPO_NO_FACE, 0, 0 };
    *found = 0;
    ebpo_status status = ebpo_collision_begin(&q, c, options, error);
    if (status == EBPO_OK && ebpo_collision_is_in_parts(&q))
        return ebpo_first_of_parts(&q, out, found, error);
    if (status != EBPO_OK)
        return status;
    const ebpo_accel *accel[2] = { q.model[0]->whole, q.model[1]->whole };
    status = ebpo_collision_first(&q, accel, "first contact", found, error);
    if (status != EBPO_OK || *found != 1)
        return status;
    *out = ebpo_collision_pair(&q, accel[0], accel[1], &c->walk.found_pairs[0]);
    return ebpo_collision_find_sources(&q, out, 1, error);
}

static const char stage[] = "pairs of faces"; /* for the progress function */

/* These numbers affect only how evenly the threads are used, not the result. */
enum {
    PARTS = 512, /* parts are divided until there are at least this many */
    TASKS = 64   /* number of groups of parts that are distributed to threads */
};

/* Fails because the stack of a walk cannot grow by the 64 pairs of children of two nodes. */
static ebpo_status no_memory(const ebpo_pair_walk *w, ebpo_error *error)
{
    return ebpo_fail_memory(error, (w->capacity + 64) * sizeof *w->stack);
}

/* Replaces the parts by `count` pairs of nodes. Returns false if memory is short. */
static bool store_parts(pair_gathering *g, const ebpo_node_pair *pairs, uint64_t count)
{
    if (!ebpo_grow(&g->part, &g->part_capacity, count, sizeof *g->part))
        return false;
    if (count)
        memcpy(g->part, pairs, count * sizeof *pairs);
    g->parts = count;
    return true;
}

/* Divides all parts repeatedly, until there are enough parts or all parts are pairs of blocks.
 * Returns false if memory is short. */
static bool make_parts(pair_gathering *g, ebpo_pair_walk *w)
{
    bool ok = w->kernels->start(w) && store_parts(g, w->stack, w->top);
    for (bool divisible = true; ok && divisible && g->parts && g->parts < PARTS;) {
        uint64_t node_pairs = w->node_pairs;
        w->top = 0;
        for (uint64_t i = 0; i < g->parts && ok; i++)
            ok = w->kernels->expand(w, g->part[i]);
        divisible = w->node_pairs > node_pairs; /* at least one part was a pair of nodes */
        ok = ok && store_parts(g, w->stack, w->top);
    }
    w->top = 0;
    return ok;
}

/* Searches the parts [begin, end) in a thread. Ends early if the threads have found too many pairs
 * in total. */
static ebpo_status run_parts(void *user, uint64_t begin, uint64_t end, unsigned worker,
                             ebpo_error *error)
{
    pair_gathering *g = user;
    ebpo_pair_walk *w = &g->walk[worker];
    if (!ebpo_pair_walk_capacity(w, end - begin))
        return no_memory(w, error);
    memcpy(w->stack, g->part + begin, (end - begin) * sizeof *w->stack);
    w->top = end - begin;
    while (w->top > 0 && !g->full) {
        uint64_t before = w->found_count;
        if (!w->kernels->run(w, EBPO_WALK_PAIRS))
            return no_memory(w, error);
        uint64_t more = w->found_count - before;
        if (atomic_fetch_add(&g->found, more) + more > g->most)
            g->full = true;
        if (ebpo_collision_is_late(g->collision))
            return ebpo_fail(error, EBPO_E_CANCELLED, "%s: the deadline has passed", stage);
    }
    return EBPO_OK;
}

/* Takes the walks that the collider keeps. Makes new walks if the collider keeps none. This happens
 * if the function that receives the pairs of a query begins another query of the same collider.
 * Returns false if memory is short. */
static bool acquire_walks(pair_gathering *g)
{
    ebpo_collider *c = g->collision->collider;
    if (c->walks) {
        g->walk = c->walks;
        g->threads = c->walk_count;
        c->walks = NULL;
        return true;
    }
    g->threads = ebpo_thread_count(c->options.threads);
    g->walk = ebpo_alloc_lines(g->threads, sizeof *g->walk);
    return g->walk != NULL;
}

/* Prepares the walks of all threads for the faces [begin, end) of the first hierarchy. */
static ebpo_status prepare_walks(pair_gathering *g, const ebpo_accel_pair *pair, uint32_t begin,
                                 uint32_t end, ebpo_error *error)
{
    if (!g->walk && !acquire_walks(g))
        return ebpo_fail_memory(error, g->threads * sizeof *g->walk);
    for (unsigned i = 0; i < g->threads; i++) {
        ebpo_pair_walk_begin(&g->walk[i], pair);
        g->walk[i].first = false;
        g->walk[i].self = g->walk[i].neighbours = g->self;
        g->walk[i].begin = begin;
        g->walk[i].end = end;
    }
    g->found = 0;
    g->full = false;
    return EBPO_OK;
}

/* Copies the pairs that the threads have found to g->found_pairs, and sorts them. */
static ebpo_status join_results(pair_gathering *g, const ebpo_accel_pair *pair, ebpo_error *error)
{
    uint64_t count = 0;
    for (unsigned i = 0; i < g->threads; i++)
        count += g->walk[i].found_count;
    if (!ebpo_grow(&g->found_pairs, &g->found_capacity, 2 * count, sizeof *g->found_pairs))
        return ebpo_fail_memory(error, 2 * count * sizeof *g->found_pairs);
    g->found_count = 0;
    for (unsigned i = 0; i < g->threads; i++) {
        const ebpo_pair_walk *w = &g->walk[i];
        if (w->found_count)
            memcpy(g->found_pairs + g->found_count, w->found_pairs,
                   w->found_count * sizeof *w->found_pairs);
        g->found_count += w->found_count;
    }
    if (count)
        sort_found_pairs(g->found_pairs, g->found_pairs + count, count, pair->accel[0]->face_count,
                         pair->accel[1]->face_count);
    return EBPO_OK;
}

/* Finds the pairs of the faces [begin, end) of the first hierarchy. Sets g->found_pairs; if there
 * are too many pairs, sets only g->full. */
static ebpo_status gather_pairs(pair_gathering *g, const ebpo_accel_pair *pair, uint32_t begin,
                                uint32_t end, ebpo_error *error)
{
    ebpo_status status = prepare_walks(g, pair, begin, end, error);
    if (status != EBPO_OK)
        return status;
    if (!make_parts(g, &g->walk[0]))
        return no_memory(&g->walk[0], error);
    uint64_t grain = g->parts / TASKS + 1;
    status = ebpo_parallel_for(g->threads, NULL, g->parts, grain, run_parts, g,
                               &g->collision->options.progress, stage, error);
    for (unsigned i = 0; i < g->threads; i++)
        ebpo_collider_count(g->collision->collider, &g->walk[i]);
    if (status != EBPO_OK || g->full)
        return status;
    return join_results(g, pair, error);
}

/* Gives the walks back to the collider, so that the next query can use them. Frees them if the
 * collider has walks already. */
static void return_walks(pair_gathering *g)
{
    ebpo_collider *c = g->collision->collider;
    for (unsigned i = 0; g->walk && i < g->threads; i++)
        ebpo_pair_walk_free(&g->walk[i]);
    if (c->walks) {
        free(g->walk);
        return;
    }
    c->walks = g->walk;
    c->walk_count = g->threads;
}

static void gathering_free(pair_gathering *g)
{
    return_walks(g);
    free(g->part);
    free(g->found_pairs);
}

/* --- all pairs --- */

/* The caller's function that receives pairs. */
typedef struct pair_receiver {
    const ebpo_collision *collision;
    const ebpo_accel_pair *pair;
    ebpo_pairs_fn take;
    void *user;
    bool enough; /* the function has returned false: the caller needs no more pairs */
} pair_receiver;

enum { PASSED_AT_ONCE = 1024 }; /* greatest number of pairs in a call of the caller's function */

/* Passes pairs to the caller, until there are no more pairs or the caller needs no more pairs. */
static ebpo_status pass_pairs(pair_receiver *v, const ebpo_found_pair *found_pairs, uint64_t count,
                              ebpo_error *error)
{
    ebpo_face_pair out[PASSED_AT_ONCE];
    ebpo_status status = EBPO_OK;
    for (uint64_t at = 0; at < count && !v->enough && status == EBPO_OK; at += PASSED_AT_ONCE) {
        uint64_t n = count - at < PASSED_AT_ONCE ? count - at : PASSED_AT_ONCE;
        for (uint64_t i = 0; i < n; i++)
            out[i] = ebpo_collision_pair(v->collision, v->pair->accel[0], v->pair->accel[1],
                                         &found_pairs[at + i]);
        status = ebpo_collision_find_sources(v->collision, out, n, error);
        v->enough = status != EBPO_OK || !v->take(v->user, out, n);
    }
    return status;
}

/* Searches runs of consecutive faces of the first model. If the pairs of a run do not fit in
 * memory, the run is halved. After a run that fits, the next run is twice as long. The pairs of a
 * single face are stored even if they do not fit. */
static ebpo_status search_in_runs(pair_receiver *v, pair_gathering *g, ebpo_error *error)
{
    uint32_t faces = v->pair->accel[0]->face_count, run = faces;
    uint64_t most = v->collision->collider->options.memory / (2 * sizeof(ebpo_found_pair)) + 1;
    for (uint32_t begin = 0; begin < faces && !v->enough;) {
        uint32_t end = faces - begin > run ? begin + run : faces;
        g->most = end - begin == 1 ? UINT64_MAX : most;
        ebpo_status status = gather_pairs(g, v->pair, begin, end, error);
        if (status != EBPO_OK)
            return status;
        run = end - begin;
        if (g->full) {
            run = run / 2;
            continue;
        }
        status = pass_pairs(v, g->found_pairs, g->found_count, error);
        if (status != EBPO_OK)
            return status;
        begin = end;
        run = run < faces / 2 ? 2 * run : faces;
    }
    return EBPO_OK;
}

/* Finds all intersecting pairs of faces and passes them to `take`. self: as in ebpo_gather_parts.
 */
static ebpo_status all_pairs(const ebpo_collision *q, bool self, ebpo_pairs_fn take, void *user,
                             ebpo_error *error)
{
    if (ebpo_collision_is_in_parts(q))
        return ebpo_gather_parts(q, self, take, user, error);
    const ebpo_accel *accel[2] = { q->model[0]->whole, q->model[1]->whole };
    const ebpo_block_posing *posing[2] = { &q->posing[0], &q->posing[1] };
    ebpo_accel_pair pair;
    if (accel[0]->bound_count == 0 || accel[1]->bound_count == 0)
        return EBPO_OK;
    ebpo_accel_pair_make(&pair, accel, posing, q->max_coordinate);
    if (pair.apart)
        return EBPO_OK;
    pair_receiver v = { q, &pair, take, user, false };
    pair_gathering g = { .collision = q, .self = self };
    ebpo_status status = search_in_runs(&v, &g, error);
    gathering_free(&g);
    return status;
}

ebpo_status ebpo_collide_all(ebpo_collider *c, const ebpo_collide_options *options,
                             ebpo_pairs_fn take, void *user, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_collision q;
    ebpo_status status = ebpo_collision_begin(&q, c, options, error);
    return status == EBPO_OK ? all_pairs(&q, false, take, user, error) : status;
}

ebpo_status ebpo_collide_self(ebpo_collider *c, const ebpo_collide_options *options,
                              ebpo_pairs_fn take, void *user, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_collision q;
    ebpo_collide_options unposed = EBPO_COLLIDE_OPTIONS_INIT;
    if (c->model[0] != c->model[1])
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "a collision of a model with itself needs a collider whose two models are "
                         "the same model");
    ebpo_status status = ebpo_collision_begin(&q, c, options, error);
    if (status != EBPO_OK)
        return status;
    unposed.deadline_ns = q.options.deadline_ns;
    unposed.progress = q.options.progress;
    return ebpo_collide_self_posed(c, &unposed, take, user, error);
}

ebpo_status ebpo_collide_self_posed(ebpo_collider *c, const ebpo_collide_options *options,
                                    ebpo_pairs_fn take, void *user, ebpo_error *error)
{
    ebpo_collision q;
    ebpo_status status = ebpo_collision_begin(&q, c, options, error);
    return status == EBPO_OK ? all_pairs(&q, true, take, user, error) : status;
}
