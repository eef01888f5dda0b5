/* Pairs of subtrees are gone through once, each finds its pairs of faces. A face that several
 * subtrees list is met more than once, and pairs come in any order, so they wait, sorted now and
 * then. When they are too many for the collider's memory, those of the first model's later faces
 * are dropped, and found again when the others have been given. */
#include "core/strict_fp.h"

#include "extras/collide/gather_parts.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "extras/collide/subtree_walk.h"

static const char stage[] = "pairs of subtrees";

/* So many in a row for one thread: they have the first's subtree in common. */
enum { PAIRS_IN_A_ROW = 4 };

typedef struct gathering_parts {
    const ebpo_collision *question;
    bool self;
    ebpo_posed_subtrees subtrees[2];
    ebpo_subtree_pairs pairs;
    uint64_t *end; /* of each of the first's subtrees: its faces are before; 0: not known yet */
    ebpo_subtree_walk *walk; /* one for each thread */
    unsigned threads;
    uint64_t read_before;
    pthread_mutex_t lock; /* for what follows */
    uint64_t from, to;    /* faces of the first model that matter now */
    ebpo_told_pair *told;
    uint64_t count, capacity;
    uint64_t most; /* that wait */
} gathering_parts;

static void count(const gathering_parts *g, ebpo_subtree_walk *w)
{
    g->question->collider->loads += ebpo_subtree_walk_loads(w);
    ebpo_collider_count(g->question->collider, &w->walk);
}

/* --- what waits --- */

static void sort_once(gathering_parts *g)
{
    uint64_t kept = 0;
    if (g->count)
        qsort(g->told, g->count, sizeof *g->told, ebpo_told_pair_compare);
    for (uint64_t i = 0; i < g->count; i++)
        if (kept == 0 || ebpo_told_pair_compare(&g->told[kept - 1], &g->told[i]) != 0)
            g->told[kept++] = g->told[i];
    g->count = kept;
}

/* Half of what may wait stays; those of one face alone stay in any case. */
static void make_room(gathering_parts *g)
{
    sort_once(g);
    uint64_t half = g->most / 2;
    if (g->count <= half)
        return;
    uint64_t cut = g->told[half].file[0];
    if (cut == g->told[0].file[0])
        cut++;
    g->to = cut;
    while (g->count > 0 && g->told[g->count - 1].file[0] >= cut)
        g->count--;
    if (g->most < 2 * g->count)
        g->most = 2 * g->count;
}

static ebpo_status hold(gathering_parts *g, const ebpo_subtree_walk *w, ebpo_error *error)
{
    for (uint64_t i = 0; i < w->count; i++) {
        if (w->told[i].file[0] < g->from || w->told[i].file[0] >= g->to)
            continue;
        if (g->count >= g->most)
            make_room(g);
        if (w->told[i].file[0] >= g->to)
            continue;
        if (!ebpo_grow(&g->told, &g->capacity, g->count + 1, sizeof *g->told))
            return ebpo_fail_memory(error, (g->count + 1) * sizeof *g->told);
        g->told[g->count++] = w->told[i];
    }
    return EBPO_OK;
}

/* --- going through --- */

/* All faces that its first subtree lists have been given. */
static bool is_done(gathering_parts *g, const ebpo_subtree_pair *pair)
{
    (void)pthread_mutex_lock(&g->lock);
    uint64_t end = g->end[pair->a];
    (void)pthread_mutex_unlock(&g->lock);
    return end && end <= g->from;
}

static ebpo_status keep(gathering_parts *g, const ebpo_subtree_pair *pair,
                        const ebpo_subtree_walk *w, ebpo_error *error)
{
    (void)pthread_mutex_lock(&g->lock);
    g->end[pair->a] = w->first_end;
    ebpo_status status = hold(g, w, error);
    (void)pthread_mutex_unlock(&g->lock);
    return status;
}

static ebpo_status run_pairs(void *user, uint64_t begin, uint64_t end, unsigned worker,
                             ebpo_error *error)
{
    gathering_parts *g = user;
    ebpo_subtree_walk *w = &g->walk[worker];
    for (uint64_t i = begin; i < end; i++) {
        const ebpo_subtree_pair *pair = &g->pairs.pair[i];
        if (is_done(g, pair))
            continue;
        ebpo_status status = ebpo_subtree_walk_pair(w, pair, error);
        if (status == EBPO_OK)
            status = keep(g, pair, w, error);
        if (status != EBPO_OK)
            return status;
        if (w->late || ebpo_collision_is_late(g->question))
            return ebpo_fail(error, EBPO_E_CANCELLED, "%s: the deadline has passed", stage);
    }
    return EBPO_OK;
}

/* Several threads hold several subtrees; where the budget has no room for these, one goes on. */
static ebpo_status run_all(gathering_parts *g, ebpo_error *error)
{
    const ebpo_progress *progress = &g->question->options.progress;
    ebpo_error many = EBPO_ERROR_INIT;
    ebpo_status status = EBPO_E_LIMIT;
    if (g->threads > 1)
        status = ebpo_parallel_for(g->threads, NULL, g->pairs.count, PAIRS_IN_A_ROW, run_pairs, g,
                                   progress, stage, &many);
    if (status != EBPO_E_LIMIT) {
        if (status != EBPO_OK && error)
            *error = many;
        return status;
    }
    for (unsigned i = 1; i < g->threads; i++) {
        count(g, &g->walk[i]);
        ebpo_subtree_walk_free(&g->walk[i]);
    }
    g->threads = 1;
    g->count = 0;
    g->to = UINT64_MAX;
    return ebpo_parallel_for(1, NULL, g->pairs.count, PAIRS_IN_A_ROW, run_pairs, g, progress, stage,
                             error);
}

enum { GIVEN_AT_ONCE = 1024 };

/* False: enough. */
static bool give(const gathering_parts *g, ebpo_pairs_fn take, void *user)
{
    ebpo_face_pair out[GIVEN_AT_ONCE];
    for (unsigned i = 0; i < g->threads; i++) /* who takes them may want the room */
        ebpo_subtree_walk_let_go(&g->walk[i]);
    for (uint64_t at = 0; at < g->count; at += GIVEN_AT_ONCE) {
        uint64_t n = g->count - at < GIVEN_AT_ONCE ? g->count - at : GIVEN_AT_ONCE;
        for (uint64_t i = 0; i < n; i++)
            out[i] = ebpo_told_pair_tell(g->question, &g->told[at + i]);
        if (!take(user, out, n))
            return false;
    }
    return true;
}

static ebpo_status in_passes(gathering_parts *g, ebpo_pairs_fn take, void *user, ebpo_error *error)
{
    uint64_t most = g->question->collider->options.memory / (2 * sizeof *g->told) + 2;
    for (g->from = 0; g->from < UINT64_MAX; g->from = g->to) {
        g->to = UINT64_MAX;
        g->count = 0;
        g->most = most;
        ebpo_status status = run_all(g, error);
        if (status != EBPO_OK)
            return status;
        sort_once(g);
        if (!give(g, take, user))
            return EBPO_OK;
    }
    return EBPO_OK;
}

/* --- both questions --- */

static ebpo_status begin(gathering_parts *g, unsigned threads, ebpo_error *error)
{
    const ebpo_collision *q = g->question;
    ebpo_status status = EBPO_OK;
    g->walk = ebpo_alloc_zero(threads, sizeof *g->walk);
    if (!g->walk)
        return ebpo_fail_memory(error, threads * sizeof *g->walk);
    g->threads = threads;
    g->read_before = ebpo_collision_bytes_read(q);
    for (int i = 0; i < 2 && status == EBPO_OK; i++)
        status =
            ebpo_posed_subtrees_make(&g->subtrees[i], q->model[i], &q->posing[i].posing, error);
    for (unsigned i = 0; i < threads && status == EBPO_OK; i++)
        status = ebpo_subtree_walk_begin(&g->walk[i], q, g->self, error);
    if (status == EBPO_OK)
        status = ebpo_subtree_pairs_find(&g->pairs, &g->subtrees[0], &g->subtrees[1], q->reach,
                                         g->self, error);
    if (status != EBPO_OK)
        return status;
    q->collider->subtree_pairs += g->pairs.count;
    q->collider->subtrees += g->pairs.subtrees[0] + g->pairs.subtrees[1];
    g->end = ebpo_alloc_zero(g->subtrees[0].count, sizeof *g->end);
    return g->end ? EBPO_OK : ebpo_fail_memory(error, g->subtrees[0].count * sizeof *g->end);
}

static void end(gathering_parts *g)
{
    g->question->collider->bytes_read += ebpo_collision_bytes_read(g->question) - g->read_before;
    for (unsigned i = 0; i < g->threads; i++) {
        count(g, &g->walk[i]);
        ebpo_subtree_walk_free(&g->walk[i]);
    }
    for (int i = 0; i < 2; i++)
        ebpo_posed_subtrees_free(&g->subtrees[i]);
    free(g->walk);
    free(g->pairs.pair);
    free(g->end);
    free(g->told);
    (void)pthread_mutex_destroy(&g->lock);
}

ebpo_status ebpo_gather_parts(const ebpo_collision *q, bool self, ebpo_pairs_fn take, void *user,
                              ebpo_error *error)
{
    gathering_parts g = { .question = q, .self = self };
    (void)pthread_mutex_init(&g.lock, NULL);
    ebpo_status status = begin(&g, ebpo_thread_count(q->collider->options.threads), error);
    if (status == EBPO_OK)
        status = in_passes(&g, take, user, error);
    end(&g);
    return status;
}

/* The least of the pairs of faces that the first two subtrees have which have any. */
static ebpo_status search(gathering_parts *g, ebpo_face_pair *out, int32_t *found,
                          ebpo_error *error)
{
    const ebpo_collision *q = g->question;
    ebpo_subtree_walk *w = &g->walk[0];
    for (uint64_t i = 0; i < g->pairs.count; i++) {
        ebpo_status status = ebpo_subtree_walk_pair(w, &g->pairs.pair[i], error);
        if (status != EBPO_OK)
            return status;
        *found = w->late || ebpo_collision_is_late(q) ? -1 : w->count > 0;
        if (*found < 0)
            return EBPO_OK;
        if (*found) {
            qsort(w->told, w->count, sizeof *w->told, ebpo_told_pair_compare);
            *out = ebpo_told_pair_tell(q, &w->told[0]);
            return EBPO_OK;
        }
        if (!ebpo_progress_step(&q->options.progress, stage, i, g->pairs.count, error))
            return EBPO_E_CANCELLED;
    }
    return EBPO_OK;
}

ebpo_status ebpo_first_of_parts(const ebpo_collision *q, ebpo_face_pair *out, int32_t *found,
                                ebpo_error *error)
{
    gathering_parts g = { .question = q };
    (void)pthread_mutex_init(&g.lock, NULL);
    ebpo_status status = begin(&g, 1, error);
    if (status == EBPO_OK) {
        ebpo_subtree_pairs_nearest_first(&g.pairs);
        status = search(&g, out, found, error);
    }
    end(&g);
    return status;
}
