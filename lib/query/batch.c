/* Many questions at once: sorted along the curve, answered in the order in which they came. */
#include "core/strict_fp.h"

#include "query/load_ahead.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "format/reader.h"
#include "geometry/octcode.h"
#include "query/nearest.h"
#include "query/query_node.h"

/* Subtrees announced at a time, and points that they are gathered from: some megabytes, of which
 * two are under way. */
enum { SUBTREES_A_TIME = 128, POINTS_A_TIME = 4096 };

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

/* Of the nearest cell, for points outside the box. */
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

/* Points in no order are asked about along the curve also where everything is in memory: what one
 * reads the next one finds in the caches, and its answer is close. A path is in order already. */
static bool scattered(const ebpo_box *box, const double *points, uint64_t count)
{
    const double far = 0x1p-5;
    double sum = 0;
    for (uint64_t i = 1; i < count; i++) {
        double most = 0;
        for (int k = 0; k < 3; k++)
            most = fmax(most, fabs(points[3 * i + (unsigned)k] - points[3 * i + (unsigned)k - 3]) /
                                  box->size[k]);
        sum += most;
    }
    return count >= 32 && sum > far * (double)count;
}

void ebpo_batch_begin(ebpo_batch *b, ebpo_context *context, const double *points, uint64_t count,
                      bool reach)
{
    const ebpo_model *m = context->model;
    ebpo_box box = ebpo_model_box(m);
    *b = (ebpo_batch){ .context = context, .points = points, .count = count, .reach = reach };
    if (m->whole && reach && scattered(&box, points, count))
        b->order = ebpo_curve_order(&box, points, count);
    if (m->whole || count < 2 || m->options.loading != EBPO_LOAD_CACHE)
        return;
    b->order = ebpo_curve_order(&box, points, count);
    b->far = ebpo_input_expects(&m->file->in) && m->info->subtree_level &&
             m->info->parts & EBPO_PART_MESH;
}

void ebpo_batch_end(ebpo_batch *b)
{
    free(b->order);
    free(b->below);
}

/* --- announcing --- */

/* The subtree where the search for a point begins; EBPO_NO_SUBTREE: the top decides. */
#define EBPO_NO_SUBTREE UINT64_MAX
static uint64_t home_of(const ebpo_batch *b, const double p[3])
{
    const ebpo_model *m = b->context->model;
    uint64_t keys[EBPO_CACHE_AHEAD];
    uint32_t at[3];
    ebpo_box box = ebpo_model_box(m);
    int fine = m->info->level_count - 1;
    if (b->reach)
        return ebpo_subtrees_near(m, p, INFINITY, keys) ? keys[0] : EBPO_NO_SUBTREE;
    if (!ebpo_locate(&box, fine, p, at))
        return EBPO_NO_SUBTREE;
    uint32_t entry = ebpo_descend(&m->top->nodes, fine, at).entry;
    return ebpo_entry_kind_of(entry) == EBPO_ENTRY_BELOW ? ebpo_entry_value(entry)
                                                         : EBPO_NO_SUBTREE;
}

static void collect(ebpo_batch *b, uint64_t below)
{
    if (below != EBPO_NO_SUBTREE &&
        !ebpo_cache_has(b->context->model->cache, ebpo_context_key(b->context, below)) &&
        ebpo_grow(&b->below, &b->capacity, b->below_count + 1, sizeof *b->below))
        b->below[b->below_count++] = (uint32_t)below;
}

static void announce(ebpo_batch *b)
{
    ebpo_context_announce(b->context, b->below, b->below_count);
    b->below_count = 0;
}

static const double *point(const ebpo_batch *b, uint64_t i)
{
    return b->points + 3 * (b->order ? b->order[i] : i);
}

/* Subtrees that the next points begin with. */
static void tell_next(ebpo_batch *b)
{
    uint64_t begin = b->told;
    while (b->told < b->count && b->told - begin < POINTS_A_TIME &&
           b->below_count < SUBTREES_A_TIME) {
        uint64_t before = b->below_count, home = home_of(b, point(b, b->told++));
        if (before == 0 || b->below[before - 1] != home)
            collect(b, home);
    }
    announce(b);
}

/* What else is near, as far as where a point begins tells: with these, nothing is left that would
 * be asked for alone. A subtree that cannot be loaded ends it: the question will tell, and each
 * further try may wait as long as the first. */
static void search_around(ebpo_batch *b, uint64_t end)
{
    ebpo_context *c = b->context;
    for (bool fails = false; b->searched < end && !fails; b->searched++) {
        const double *p = point(b, b->searched);
        uint64_t home = home_of(b, p), keys[EBPO_CACHE_AHEAD];
        ebpo_accel *accel;
        ebpo_nearest n;
        if (home == EBPO_NO_SUBTREE || c->model->top->below[home].pruned)
            continue;
        fails = ebpo_context_subtree(c, (uint32_t)home, &accel, NULL) != EBPO_OK;
        if (fails)
            continue;
        ebpo_nearest_begin(&n, c->model, p, INFINITY);
        ebpo_nearest_search(&n, c, accel);
        unsigned count = ebpo_subtrees_near(c->model, p, fmin(n.upper, n.limit), keys);
        for (unsigned k = 0; k < count; k++)
            collect(b, keys[k]);
    }
    announce(b);
}

uint64_t ebpo_batch_next(ebpo_batch *b, uint64_t i)
{
    if (b->far && i == 0)
        tell_next(b);
    if (b->far && i >= (b->reach ? b->searched : b->told - (b->told != 0)) && i < b->count) {
        uint64_t end = b->told;
        if (b->told < b->count)
            tell_next(b);
        if (b->reach)
            search_around(b, end);
    }
    return b->order ? b->order[i] : i;
}
