/* By digits from the least on, of so many bits that counting them takes no longer than moving. */
#include "core/strict_fp.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "extras/collide/gathering.h"
#include "extras/collide/pair_walk.h"

/* Pairs of faces in the order of the first's number, then the second's. */

enum { LEAST_BITS = 4, MOST_BITS = 11 };

static inline uint32_t digit_of(const ebpo_met_pair *m, bool by_a, unsigned shift, unsigned bits)
{
    return (by_a ? m->a : m->b) >> shift & ((1u << bits) - 1);
}

static void met_sort_pass(const ebpo_met_pair *from, ebpo_met_pair *to, uint64_t count, bool by_a,
                          unsigned shift, unsigned bits)
{
    uint64_t begin[(1 << MOST_BITS) + 1];
    memset(begin, 0, ((1u << bits) + 1) * sizeof *begin);
    for (uint64_t i = 0; i < count; i++)
        begin[digit_of(&from[i], by_a, shift, bits) + 1]++;
    for (unsigned d = 0; d < 1u << bits; d++)
        begin[d + 1] += begin[d];
    for (uint64_t i = 0; i < count; i++)
        to[begin[digit_of(&from[i], by_a, shift, bits)]++] = from[i];
}

static unsigned bits_for(uint64_t count)
{
    unsigned bits = LEAST_BITS;
    while (bits < MOST_BITS && count >> bits > 1)
        bits++;
    return bits;
}

/* `spare` has room for as many; the result is in `met`. The numbers are below most_a and most_b. */
static void ebpo_met_sort(ebpo_met_pair *met, ebpo_met_pair *spare, uint64_t count, uint32_t most_a,
                          uint32_t most_b)
{
    ebpo_met_pair *from = met, *to = spare;
    unsigned bits = bits_for(count);
    if (count < 2)
        return;
    for (int by_a = 0; by_a < 2; by_a++)
        for (unsigned shift = 0; shift < 32 && (by_a ? most_a : most_b) >> shift; shift += bits) {
            met_sort_pass(from, to, count, by_a, shift, bits);
            ebpo_met_pair *other = from;
            from = to;
            to = other;
        }
    if (from != met)
        memcpy(met, from, count * sizeof *met);
}

/* Which kernels a walk uses. */

void ebpo_pair_walk_begin(ebpo_pair_walk *w, const ebpo_accel_pair *pair)
{
    w->pair = pair;
    w->kernels = ebpo_walk_kernels_best();
    w->filter = ebpo_pair_kernels_best();
    w->top = w->group = w->met_count = 0;
    w->begin = 0;
    w->end = pair->accel[0]->face_count;
    for (int i = 0; i < 2 * EBPO_TURNED_NODES; i++)
        w->turned[i / EBPO_TURNED_NODES][i % EBPO_TURNED_NODES].node = EBPO_NO_CHILD;
    ebpo_posed_faces_forget(w->posed);
}

static const char stage[] = "pairs of faces";

/* Enough for any number of threads: results do not depend on it, but the work's evenness does. */
enum { PARTS = 512, PARTS_EACH = 64 };

static ebpo_status no_memory(const ebpo_pair_walk *w, ebpo_error *error)
{
    return ebpo_fail_memory(error, (w->capacity + 64) * sizeof *w->stack);
}

static bool gathering_hold(ebpo_gathering *g, const ebpo_node_pair *pairs, uint64_t count)
{
    if (!ebpo_grow(&g->part, &g->part_capacity, count, sizeof *g->part))
        return false;
    if (count)
        memcpy(g->part, pairs, count * sizeof *pairs);
    g->parts = count;
    return true;
}

/* One generation of the descent after the other, until there are parts enough or only blocks. */
static bool make_parts(ebpo_gathering *g, ebpo_pair_walk *w)
{
    bool fine = w->kernels->start(w) && gathering_hold(g, w->stack, w->top);
    for (bool more = true; fine && more && g->parts && g->parts < PARTS;) {
        uint64_t divided = w->node_pairs;
        w->top = 0;
        for (uint64_t i = 0; i < g->parts && fine; i++)
            fine = w->kernels->expand(w, g->part[i]);
        more = w->node_pairs > divided;
        fine = fine && gathering_hold(g, w->stack, w->top);
    }
    w->top = 0;
    return fine;
}

static ebpo_status run_parts(void *user, uint64_t begin, uint64_t end, unsigned worker,
                             ebpo_error *error)
{
    ebpo_gathering *g = user;
    ebpo_pair_walk *w = &g->walk[worker];
    if (!ebpo_pair_walk_room(w, end - begin))
        return no_memory(w, error);
    memcpy(w->stack, g->part + begin, (end - begin) * sizeof *w->stack);
    w->top = end - begin;
    while (w->top > 0 && !g->full) {
        uint64_t before = w->met_count;
        if (!w->kernels->run(w, EBPO_WALK_PAIRS))
            return no_memory(w, error);
        uint64_t more = w->met_count - before;
        if (atomic_fetch_add(&g->found, more) + more > g->most)
            g->full = true;
        if (ebpo_collision_is_late(g->question))
            return ebpo_fail(error, EBPO_E_CANCELLED, "%s: the deadline has passed", stage);
    }
    return EBPO_OK;
}

/* The collider's, if they are not in use: a question may be asked by what is given another's pairs.
 */
static bool take_walks(ebpo_gathering *g)
{
    ebpo_collider *c = g->question->collider;
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

static ebpo_status gathering_prepare(ebpo_gathering *g, const ebpo_accel_pair *pair, uint32_t begin,
                                     uint32_t end, ebpo_error *error)
{
    if (!g->walk && !take_walks(g))
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

/* Puts together what threads have found. */
static ebpo_status put_together(ebpo_gathering *g, const ebpo_accel_pair *pair, ebpo_error *error)
{
    uint64_t count = 0;
    for (unsigned i = 0; i < g->threads; i++)
        count += g->walk[i].met_count;
    if (!ebpo_grow(&g->met, &g->met_capacity, 2 * count, sizeof *g->met))
        return ebpo_fail_memory(error, 2 * count * sizeof *g->met);
    g->met_count = 0;
    for (unsigned i = 0; i < g->threads; i++) {
        const ebpo_pair_walk *w = &g->walk[i];
        if (w->met_count)
            memcpy(g->met + g->met_count, w->met, w->met_count * sizeof *w->met);
        g->met_count += w->met_count;
    }
    if (count)
        ebpo_met_sort(g->met, g->met + count, count, pair->accel[0]->face_count,
                      pair->accel[1]->face_count);
    return EBPO_OK;
}

ebpo_status ebpo_gather(ebpo_gathering *g, const ebpo_accel_pair *pair, uint32_t begin,
                        uint32_t end, ebpo_error *error)
{
    ebpo_status status = gathering_prepare(g, pair, begin, end, error);
    if (status != EBPO_OK)
        return status;
    if (!make_parts(g, &g->walk[0]))
        return no_memory(&g->walk[0], error);
    uint64_t grain = g->parts / PARTS_EACH + 1;
    status = ebpo_parallel_for(g->threads, NULL, g->parts, grain, run_parts, g,
                               &g->question->options.progress, stage, error);
    for (unsigned i = 0; i < g->threads; i++)
        ebpo_collider_count(g->question->collider, &g->walk[i]);
    if (status != EBPO_OK || g->full)
        return status;
    return put_together(g, pair, error);
}

/* For the next question; stacks and pairs have another size then. */
static void give_walks_back(ebpo_gathering *g)
{
    ebpo_collider *c = g->question->collider;
    for (unsigned i = 0; g->walk && i < g->threads; i++)
        ebpo_pair_walk_free(&g->walk[i]);
    if (c->walks) {
        free(g->walk);
        return;
    }
    c->walks = g->walk;
    c->walk_count = g->threads;
}

void ebpo_gathering_free(ebpo_gathering *g)
{
    give_walks_back(g);
    free(g->part);
    free(g->met);
}
