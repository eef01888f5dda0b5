/* What will be asked for next: the subtrees that queries about places around the last one may need.
 * EBP 2017, 4.2.3, loads the 26 neighbours of the subtree that holds the position instead. */
#include "core/strict_fp.h"

#include "query/prefetch.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "format/subtree_index.h"
#include "query/query_node.h"

typedef struct wanted {
    uint64_t key;
    double lower; /* bound of the distance */
} wanted;

/* The nearest subtrees within `limit` of p. */
typedef struct looking {
    ebpo_ranking ranking;
    double limit;
    unsigned count;
    wanted list[EBPO_CACHE_AHEAD]; /* the nearest first */
} looking;

static void add(looking *l, uint64_t key, double lower)
{
    unsigned at = l->count < EBPO_CACHE_AHEAD ? l->count++ : EBPO_CACHE_AHEAD - 1;
    for (; at > 0 && l->list[at - 1].lower > lower; at--)
        l->list[at] = l->list[at - 1];
    l->list[at] = (wanted){ key, lower };
    if (l->count == EBPO_CACHE_AHEAD)
        l->limit = fmin(l->limit, l->list[EBPO_CACHE_AHEAD - 1].lower);
}

static void look(looking *l, ebpo_node node, double lower)
{
    if (lower > l->limit || ebpo_node_is_uniform(&node) || node.pruned)
        return;
    if (ebpo_node_is_below(&node)) {
        add(l, ebpo_entry_value(node.entry), lower);
        return;
    }
    ebpo_ranked child[8];
    int count = ebpo_rank_children(&l->ranking, &node, lower, l->limit, child);
    for (int i = 0; i < count; i++)
        look(l, child[i].node, child[i].lower);
}

unsigned ebpo_subtrees_near(const ebpo_model *m, const double p[3], double limit,
                            uint64_t keys[EBPO_CACHE_AHEAD])
{
    looking l = { .ranking = ebpo_ranking_of(m, p, NULL), .limit = limit };
    look(&l, ebpo_model_root(m), ebpo_rank_root(&l.ranking));
    for (unsigned i = 0; i < l.count; i++)
        keys[i] = l.list[i].key;
    return l.count;
}

static double longest_side(const ebpo_box *box, int level)
{
    return ldexp(fmax(box->size[0], fmax(box->size[1], box->size[2])), -level);
}

static double apart(const double a[3], const double b[3])
{
    return fmax(fabs(a[0] - b[0]), fmax(fabs(a[1] - b[1]), fabs(a[2] - b[2])));
}

void ebpo_context_prefetch(ebpo_context *c, const double p[3], double reach)
{
    const ebpo_model *m = c->model;
    ebpo_box box = ebpo_model_box(m);
    double side = longest_side(&box, m->top->cut_level);
    if (c->has_prefetched && apart(p, c->prefetched_from) < side / 4 &&
        fabs(reach) <= c->prefetched_reach + side / 4)
        return;
    c->has_prefetched = true;
    c->prefetched_reach = fabs(reach);
    memcpy(c->prefetched_from, p, sizeof c->prefetched_from);
    /* Over a way w distances and their bounds change by at most w each: what is needed until then
     * is within the reach and 2 w. A cell's diagonal is 1.73 sides: where envelopes do not decide
     * (other rules than nonzero), the cell that holds the place is needed. */
    uint64_t keys[EBPO_CACHE_AHEAD];
    unsigned count = ebpo_subtrees_near(m, p, fabs(reach) + 2.25 * side, keys);
    for (unsigned i = 0; i < count; i++)
        keys[i] = ebpo_context_key(c, keys[i]);
    ebpo_cache_prefetch(m->cache, keys, count);
}

/* The number in the file's table of the subtree that this one is or lies in, when it is to be
 * loaded; UINT64_MAX: none. */
static uint64_t table_number(const ebpo_context *c, uint32_t below)
{
    const ebpo_model *m = c->model;
    const ebpo_node *root = &m->top->below[below];
    int level = root->cell.level;
    if (level < m->info->subtree_level || root->pruned ||
        ebpo_cache_has(m->cache, ebpo_context_key(c, below)))
        return UINT64_MAX;
    if (level == m->info->subtree_level)
        return root->type == EBPO_GRAY ? root->rank : UINT64_MAX;
    ebpo_subtree_row row;
    unsigned column =
        ebpo_subtree_column(m->info, level, root->type == EBPO_GRAY ? EBPO_S_GRAY : EBPO_S_LEAF);
    return ebpo_subtree_table_find(m->chunks, column, root->rank, &row, NULL) == EBPO_OK
               ? row.subtree
               : UINT64_MAX;
}

static int compare_numbers(const void *x, const void *y)
{
    uint64_t a = *(const uint64_t *)x, b = *(const uint64_t *)y;
    return (a > b) - (a < b);
}

/* Ascending, each once; returns how many. */
static uint64_t sort_numbers(uint64_t *numbers, uint64_t count)
{
    uint64_t kept = 0;
    if (count)
        qsort(numbers, count, sizeof *numbers, compare_numbers);
    for (uint64_t i = 0; i < count; i++)
        if (i == 0 || numbers[i] != numbers[kept - 1])
            numbers[kept++] = numbers[i];
    return kept;
}

void ebpo_context_announce(const ebpo_context *c, const uint32_t *below, uint64_t count)
{
    const ebpo_model *m = c->model;
    ebpo_expected expected = EBPO_EXPECTED_INIT(m->file);
    if (m->info->subtree_level == 0 || !ebpo_input_expects(&m->file->in) || count == 0)
        return;
    uint64_t found = 0, *numbers = ebpo_alloc(count, sizeof *numbers);
    for (uint64_t i = 0; numbers && i < count; i++) {
        uint64_t number = table_number(c, below[i]);
        if (number != UINT64_MAX)
            numbers[found++] = number;
    }
    found = sort_numbers(numbers, found);
    ebpo_subtree_table_expect(m->chunks, numbers, found);
    for (uint64_t i = 0; i < found; i++)
        ebpo_subtrees_expect(m->chunks, &expected, numbers[i], 1, ebpo_subtree_needs(c->planes),
                             EBPO_LEVELS_MAX, true);
    ebpo_expect_all(&expected);
    free(numbers);
}
