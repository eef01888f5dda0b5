/* Loads subtrees before queries need them, and sends prefetch hints for remote files.
 *
 * After a query at a point, the context prefetches the subtrees that queries near this point may
 * need, the nearest subtree first. (EBP 2017, 4.2.3, loads the 26 neighbours of the subtree that
 * contains the point instead.)
 *
 * A batch evaluates many points in the order of the Morton curve, so that each subtree is loaded
 * few times. For a remote file, the batch sends prefetch hints for some thousand points at a time,
 * before their bytes are needed. A batch belongs to one thread. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "format/reader.h"
#include "geometry/cells.h"
#include "query/load_ahead.h"
#include "query/nearest.h"
#include "query/query_node.h"

/* A subtree that a query may need. */
typedef struct wanted {
    uint64_t below; /* index in ebpo_top.below, the list of subtrees that are loaded on demand */
    double lower;   /* lower bound of the distance */
} wanted;

/* A search for the nearest subtrees within a distance of a point. */
typedef struct subtree_search {
    ebpo_ranking ranking; /* computes lower bounds of the distance to nodes */
    double limit;         /* subtrees with greater lower bounds are not listed */
    unsigned count;
    wanted list[EBPO_CACHE_AHEAD]; /* the nearest first */
} subtree_search;

/* Inserts a subtree by its lower bound. If the list is full, drops the farthest subtree. */
static void add_subtree(subtree_search *l, uint64_t below, double lower)
{
    unsigned at = l->count < EBPO_CACHE_AHEAD ? l->count++ : EBPO_CACHE_AHEAD - 1;
    for (; at > 0 && l->list[at - 1].lower > lower; at--)
        l->list[at] = l->list[at - 1];
    l->list[at] = (wanted){ below, lower };
    if (l->count == EBPO_CACHE_AHEAD)
        l->limit = fmin(l->limit, l->list[EBPO_CACHE_AHEAD - 1].lower);
}

/* Adds the subtrees at or below a node. `lower`: lower bound of the distance to the node. */
static void search_below(subtree_search *l, ebpo_node node, double lower)
{
    if (lower > l->limit || ebpo_node_is_uniform(&node) || node.pruned)
        return;
    if (ebpo_node_is_subtree_root(&node)) {
        add_subtree(l, ebpo_entry_value(node.entry), lower);
        return;
    }
    ebpo_ranked child[8];
    int count = ebpo_rank_children(&l->ranking, &node, lower, l->limit, child);
    for (int i = 0; i < count; i++)
        search_below(l, child[i].node, child[i].lower);
}

unsigned ebpo_subtrees_near(const ebpo_model *m, const double p[3], double limit,
                            uint64_t below[EBPO_CACHE_AHEAD])
{
    subtree_search l = { .ranking = ebpo_ranking_of(m, p, NULL), .limit = limit };
    search_below(&l, ebpo_model_root(m), ebpo_rank_root(&l.ranking));
    for (unsigned i = 0; i < l.count; i++)
        below[i] = l.list[i].below;
    return l.count;
}

static double longest_side(const ebpo_box *box, int level)
{
    return ldexp(fmax(box->size[0], fmax(box->size[1], box->size[2])), -level);
}

/* Returns the largest difference of coordinates. */
static double largest_difference(const double a[3], const double b[3])
{
    return fmax(fabs(a[0] - b[0]), fmax(fabs(a[1] - b[1]), fabs(a[2] - b[2])));
}

void ebpo_context_prefetch(ebpo_context *c, const double p[3], double search_distance)
{
    const ebpo_model *m = c->model;
    ebpo_box box = ebpo_model_box(m);
    double side = longest_side(&box, m->top->cut_level);
    if (c->has_prefetched && largest_difference(p, c->prefetched_from) < side / 4 &&
        fabs(search_distance) <= c->prefetched_distance + side / 4)
        return;
    c->has_prefetched = true;
    c->prefetched_distance = fabs(search_distance);
    memcpy(c->prefetched_from, p, sizeof c->prefetched_from);
    /* Until the next prefetch, p moves by about side / 4. By this motion, envelopes come nearer by
     * at most side / 4, and the search distance grows by at most side / 4. So queries need subtrees
     * whose envelopes are within search_distance + side / 2. Under rules other than nonzero,
     * envelopes do not decide if a point is inside. Then a query needs the subtree whose cell
     * contains the point. The envelope of this subtree may be a cell's diagonal, 1.73 sides, away.
     * The sum of 0.5 and 1.73 is rounded up to 2.25. */
    uint64_t keys[EBPO_CACHE_AHEAD];
    unsigned count = ebpo_subtrees_near(m, p, fabs(search_distance) + 2.25 * side, keys);
    for (unsigned i = 0; i < count; i++)
        keys[i] = ebpo_context_key(c, keys[i]);
    ebpo_cache_prefetch(m->cache, keys, count);
}

void ebpo_context_hint(const ebpo_context *c, const uint32_t *below, uint64_t count)
{
    const ebpo_model *m = c->model;
    if (m->info->subtree_level == 0 || !ebpo_input_prefetches(&m->file->in) || count == 0)
        return;
    uint64_t absent = 0;
    uint32_t *needed = ebpo_alloc(count, sizeof *needed);
    for (uint64_t i = 0; needed && i < count; i++)
        if (!ebpo_cache_has(m->cache, ebpo_context_key(c, below[i])))
            needed[absent++] = below[i];
    ebpo_top_hint(m->top, m->chunks, needed, absent,
                  ebpo_subtree_needs(c->content) | (m->without_maps ? 0 : EBPO_NEEDS_MAPS),
                  EBPO_LEVELS_MAX);
    free(needed);
}

ebpo_status ebpo_context_read_envelopes(ebpo_context *c, const uint32_t *below, uint64_t count,
                                        ebpo_error *error)
{
    const ebpo_model *m = c->model;
    ebpo_status status = EBPO_OK;
    if (!c->envelopes_of)
        c->envelopes_of = ebpo_alloc_zero(m->top->below_count, sizeof(ebpo_top *));
    if (!c->envelopes_of)
        return ebpo_fail_memory(error, m->top->below_count * sizeof(ebpo_top *));
    ebpo_top_hint(m->top, m->chunks, below, count, EBPO_TOP_ENVELOPES,
                  m->top->cut_level + EBPO_DEEP_LEVELS);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        ebpo_top *read;
        status = ebpo_top_read_subtree(&read, m->chunks, &m->top->below[below[i]], error);
        if (status != EBPO_OK)
            break;
        if (!ebpo_skeletons_take(m->skeletons, read->bytes)) {
            ebpo_top_free(read);
            break;
        }
        c->envelopes_of[below[i]] = read;
        c->envelope_count++;
    }
    return status == EBPO_E_LIMIT ? EBPO_OK : status;
}

void ebpo_context_drop_envelopes(ebpo_context *c)
{
    for (uint64_t i = 0; c->envelope_count; i++)
        if (c->envelopes_of[i]) {
            ebpo_skeletons_give_back(c->model->skeletons, c->envelopes_of[i]->bytes);
            ebpo_top_free(c->envelopes_of[i]);
            c->envelopes_of[i] = NULL;
            c->envelope_count--;
        }
}

/* --- batches --- */

#define EBPO_NO_SUBTREE UINT64_MAX

/* Limits of a prefetch hint for homes (home_of: the subtree where the query of a point begins). The
 * data of two hints is being fetched at any time. */
enum {
    HINT_SUBTREES = 128, /* maximum number of subtrees: some megabytes of data */
    HINT_POINTS = 4096,  /* maximum number of points whose homes are in the hint */
    /* in a batch without hints, the maximum number of points that are evaluated after the first
     * point whose bytes are not available yet */
    POINTS_AFTER_PENDING = 256
};

/* A point, by its index, and its position on the curve (key). */
typedef struct placed {
    uint64_t key, point;
} placed;

static int compare_placed(const void *x, const void *y)
{
    const placed *a = x, *b = y;
    if (a->key != b->key)
        return a->key < b->key ? -1 : 1;
    return (a->point > b->point) - (a->point < b->point);
}

/* Returns the position on the curve of the cell that contains p, or of the nearest cell for a point
 * outside the box. */
static uint64_t curve_key(const ebpo_box *box, const double p[3])
{
    ebpo_cell cell = { .level = EBPO_MAX_LEVEL };
    for (int k = 0; k < 3; k++) {
        double part = (p[k] - box->origin[k]) / box->size[k] * 0x1p20;
        cell.at[k] = !(part > 0) ? 0 : part < 0x1p20 ? (uint32_t)part : (1u << 20) - 1;
    }
    return ebpo_octcode_of_cell(cell);
}

uint64_t *ebpo_curve_order(const ebpo_box *box, const double *points, uint64_t count)
{
    placed *list = ebpo_alloc(count, sizeof *list);
    uint64_t *order = ebpo_alloc(count, sizeof *order);
    for (uint64_t i = 0; list && i < count; i++)
        list[i] = (placed){ curve_key(box, points + 3 * i), i };
    if (list && order)
        qsort(list, count, sizeof *list, compare_placed);
    for (uint64_t i = 0; list && order && i < count; i++)
        order[i] = list[i].point;
    if (!list) {
        free(order);
        order = NULL;
    }
    free(list);
    return order;
}

/* Returns true if consecutive points are far apart. Such points are evaluated along the curve even
 * if the whole model is in memory. Along the curve, the data for the next point is often in the
 * processor's caches, and the next search starts from the previous point's result, which is close.
 * Consecutive points of a path are close to each other in the given order. */
static bool are_scattered(const ebpo_box *box, const double *points, uint64_t count)
{
    const double mean_least = 0x1p-5; /* least mean distance, as a share of the box's side */
    double sum = 0;
    for (uint64_t i = 1; i < count; i++) {
        double greatest = 0;
        for (int k = 0; k < 3; k++)
            greatest =
                fmax(greatest, fabs(points[3 * i + (unsigned)k] - points[3 * i + (unsigned)k - 3]) /
                                   box->size[k]);
        sum += greatest;
    }
    return count >= 32 && sum > mean_least * (double)count;
}

/* Sets the order of evaluation along the curve, without completed points. */
static void set_order(ebpo_batch *b, const ebpo_box *box)
{
    uint64_t kept = 0;
    b->order = ebpo_curve_order(box, b->points, b->count);
    for (uint64_t i = 0; b->order && i < b->count; i++)
        if (!b->done || !b->done[b->order[i]])
            b->order[kept++] = b->order[i];
    b->count = b->order ? kept : b->count;
}

void ebpo_batch_begin(ebpo_batch *b)
{
    const ebpo_model *m = b->context->model;
    ebpo_box box = ebpo_model_box(m);
    b->pending_home = EBPO_NO_SUBTREE;
    if (b->as_given)
        return;
    if (m->whole && b->searches_around && are_scattered(&box, b->points, b->count))
        set_order(b, &box);
    if (m->whole || b->count < 2 || m->options.loading != EBPO_LOAD_CACHE)
        return;
    set_order(b, &box);
    b->sends_hints = ebpo_input_prefetches(&m->file->in) && m->info->subtree_level &&
                     m->info->parts & EBPO_PART_MESH;
}

ebpo_status ebpo_batch_end(ebpo_batch *b, ebpo_status status, ebpo_error *error)
{
    free(b->order);
    free(b->below);
    if (!b->pending || (status != EBPO_OK && status != EBPO_E_PENDING))
        return status;
    return ebpo_fail_with(error, &b->pending_error); /* later points may have changed *error */
}

/* --- prefetch hints --- */

/* Returns the *home* of a point: the subtree where the query of the point begins, as an index in
 * top->below. EBPO_NO_SUBTREE: the query needs no subtree, because the top of the tree decides. */
static uint64_t home_of(const ebpo_batch *b, const double p[3])
{
    const ebpo_model *m = b->context->model;
    uint64_t near[EBPO_CACHE_AHEAD];
    uint32_t at[3];
    ebpo_box box = ebpo_model_box(m);
    int deepest = m->info->level_count - 1;
    if (b->searches_around)
        return ebpo_subtrees_near(m, p, INFINITY, near) ? near[0] : EBPO_NO_SUBTREE;
    if (!ebpo_locate(&box, deepest, p, at))
        return EBPO_NO_SUBTREE;
    uint32_t entry = ebpo_descend(&m->top->nodes, deepest, at).entry;
    return ebpo_entry_kind_of(entry) == EBPO_ENTRY_SUBTREE_ROOT ? ebpo_entry_value(entry)
                                                                : EBPO_NO_SUBTREE;
}

/* Adds a subtree to the next hint, if it is not in memory. */
static void collect_subtree(ebpo_batch *b, uint64_t below)
{
    if (below != EBPO_NO_SUBTREE &&
        !ebpo_cache_has(b->context->model->cache, ebpo_context_key(b->context, below)) &&
        ebpo_grow(&b->below, &b->capacity, b->below_count + 1, sizeof *b->below))
        b->below[b->below_count++] = (uint32_t)below;
}

/* Sends a hint for the collected subtrees. */
static void hint_collected(ebpo_batch *b)
{
    ebpo_context_hint(b->context, b->below, b->below_count);
    b->below_count = 0;
}

/* Returns the point with turn i, the i-th point in the order of evaluation. */
static const double *ordered_point(const ebpo_batch *b, uint64_t i)
{
    return b->points + 3 * (b->order ? b->order[i] : i);
}

/* Sends a prefetch hint for the homes of the next points. */
static void hint_next(ebpo_batch *b)
{
    uint64_t begin = b->hinted;
    while (b->hinted < b->count && b->hinted - begin < HINT_POINTS &&
           b->below_count < HINT_SUBTREES) {
        uint64_t before = b->below_count, home = home_of(b, ordered_point(b, b->hinted++));
        if (before == 0 || b->below[before - 1] != home)
            collect_subtree(b, home);
    }
    hint_collected(b);
}

/* Sends one hint for the subtrees, other than homes, that the points before turn `end` need, so
 * that queries do not request these subtrees one by one. Finds the nearest face in each point's
 * home. Subtrees that are farther away than this face are not needed. If a home cannot be loaded,
 * the loop ends, because the next home could again wait for a time-out; the query will return the
 * error. A home whose bytes are not available yet does not end the loop. */
static void search_around(ebpo_batch *b, uint64_t end)
{
    ebpo_context *c = b->context;
    for (bool fails = false; b->searched < end && !fails; b->searched++) {
        const double *p = ordered_point(b, b->searched);
        uint64_t home = home_of(b, p), near[EBPO_CACHE_AHEAD];
        ebpo_accel *accel;
        ebpo_nearest n;
        if (home == EBPO_NO_SUBTREE || c->model->top->below[home].pruned || home == b->pending_home)
            continue;
        ebpo_status status = ebpo_context_subtree(c, (uint32_t)home, &accel, NULL);
        fails = status != EBPO_OK && status != EBPO_E_PENDING;
        if (status == EBPO_E_PENDING)
            b->pending_home = home;
        if (status != EBPO_OK)
            continue;
        ebpo_nearest_begin(&n, c->model, p, INFINITY);
        ebpo_nearest_search(&n, c, accel);
        unsigned count = ebpo_subtrees_near(c->model, p, fmin(n.upper, n.limit), near);
        for (unsigned k = 0; k < count; k++)
            collect_subtree(b, near[k]);
    }
    hint_collected(b);
}

uint64_t ebpo_batch_next(ebpo_batch *b, uint64_t i)
{
    if (b->sends_hints && i == 0)
        hint_next(b);
    if (b->sends_hints && i >= (b->searches_around ? b->searched : b->hinted - (b->hinted != 0)) &&
        i < b->count) {
        uint64_t end = b->hinted;
        if (b->hinted < b->count)
            hint_next(b);
        if (b->searches_around)
            search_around(b, end);
    }
    return b->order ? b->order[i] : i;
}

/* Returns the turn at which a batch with pending points (whose bytes are not available yet) ends.
 * With hints, this is the first turn that would send another hint. */
static uint64_t end_of_pass(const ebpo_batch *b)
{
    if (!b->sends_hints)
        return b->first_pending + POINTS_AFTER_PENDING;
    return b->searches_around ? b->searched : b->hinted == b->count ? b->count : b->hinted - 1;
}

ebpo_status ebpo_batch_note(ebpo_batch *b, uint64_t i, uint64_t point, ebpo_status status,
                            const ebpo_error *error)
{
    if (status == EBPO_OK && b->done)
        b->done[point] = true;
    if (status == EBPO_E_PENDING && !b->pending) {
        b->pending = true;
        b->first_pending = i;
        b->pending_error = error ? *error : (ebpo_error){ .status = status, .offset = -1 };
    }
    if (!b->pending || (status != EBPO_OK && status != EBPO_E_PENDING))
        return status;
    return i + 1 < b->count && i + 1 < end_of_pass(b) ? EBPO_OK : EBPO_E_PENDING;
}
