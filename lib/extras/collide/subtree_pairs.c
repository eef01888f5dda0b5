#include "core/strict_fp.h"

#include "extras/collide/subtree_pairs.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "geometry/length.h"

typedef struct finding {
    ebpo_subtree_pairs *out;
    ebpo_posed_subtrees *side[2];
    double reach;
    bool self;
    ebpo_error *error;
} finding;

/* --- of two nodes --- */

static double slack_of(const finding *f, const ebpo_posed_node node[2])
{
    return ebpo_posed_slack(f->side[0], node[0].cell, f->reach) +
           ebpo_posed_slack(f->side[1], node[1].cell, f->reach);
}

static bool cells_apart(const finding *f, const ebpo_posed_node node[2])
{
    double corner[2][8][3], slack = slack_of(f, node);
    ebpo_convex convex[2];
    for (int i = 0; i < 2; i++) {
        ebpo_posed_cell(f->side[i], node[i].cell, corner[i]);
        convex[i] = (ebpo_convex){ 8, (const double(*)[3])corner[i] };
    }
    return ebpo_convex_gap(&convex[0], &convex[1], slack) > slack;
}

static double apart_of(const finding *f, const ebpo_posed_node node[2])
{
    double corner[2][8][3], d[3];
    for (int i = 0; i < 2; i++)
        ebpo_posed_cell(f->side[i], node[i].cell, corner[i]);
    for (int k = 0; k < 3; k++)
        d[k] = (corner[0][0][k] + corner[0][7][k]) - (corner[1][0][k] + corner[1][7][k]);
    return ebpo_length(d) / (ebpo_posed_diagonal(f->side[0], node[0].cell) +
                             ebpo_posed_diagonal(f->side[1], node[1].cell));
}

static bool is_pruned(const ebpo_posed_subtrees *s, uint32_t number)
{
    return !s->model->whole && s->model->top->below[number].pruned;
}

static ebpo_status add(const finding *f, const ebpo_posed_node node[2])
{
    uint32_t a = ebpo_entry_value(node[0].entry), b = ebpo_entry_value(node[1].entry);
    ebpo_convex convex[2];
    double slack = slack_of(f, node);
    if (is_pruned(f->side[0], a) || is_pruned(f->side[1], b))
        return EBPO_OK; /* what it had is not in this file */
    ebpo_subtree_pair pair = { a, b, f->side[0]->rank[a], f->side[1]->rank[b], apart_of(f, node) };
    if (f->self && pair.rank_a > pair.rank_b)
        return EBPO_OK;
    ebpo_status status = ebpo_posed_envelope(f->side[0], node[0].cell, &convex[0], f->error);
    if (status == EBPO_OK)
        status = ebpo_posed_envelope(f->side[1], node[1].cell, &convex[1], f->error);
    if (status != EBPO_OK || ebpo_convex_gap(&convex[0], &convex[1], slack) > slack)
        return status;
    ebpo_subtree_pairs *out = f->out;
    if (!ebpo_grow(&out->pair, &out->capacity, out->count + 1, sizeof *out->pair))
        return ebpo_fail_memory(f->error, (out->count + 1) * sizeof *out->pair);
    out->pair[out->count++] = pair;
    return EBPO_OK;
}

/* --- the descent --- */

static ebpo_status descend(const finding *f, const ebpo_posed_node node[2])
{
    bool below[2];
    for (int i = 0; i < 2; i++) {
        if (ebpo_entry_kind_of(node[i].entry) == EBPO_ENTRY_UNIFORM)
            return EBPO_OK;
        below[i] = ebpo_entry_kind_of(node[i].entry) == EBPO_ENTRY_BELOW;
    }
    if (cells_apart(f, node))
        return EBPO_OK;
    if (below[0] && below[1])
        return add(f, node);
    bool larger = ebpo_posed_diagonal(f->side[0], node[0].cell) >=
                  ebpo_posed_diagonal(f->side[1], node[1].cell);
    int down = below[0] ? 1 : below[1] ? 0 : larger ? 0 : 1;
    ebpo_posed_node part[2] = { node[0], node[1] };
    ebpo_status status = EBPO_OK;
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        part[down] = ebpo_posed_child(f->side[down], &node[down], octant);
        status = descend(f, part);
    }
    return status;
}

/* --- their order --- */

static int by_places(const void *x, const void *y)
{
    const ebpo_subtree_pair *p = x, *q = y;
    if (p->rank_a != q->rank_a)
        return p->rank_a < q->rank_a ? -1 : 1;
    return (p->rank_b > q->rank_b) - (p->rank_b < q->rank_b);
}

static void turn_round(ebpo_subtree_pair *pair, uint64_t count)
{
    for (uint64_t i = 0; i < count / 2; i++) {
        ebpo_subtree_pair other = pair[i];
        pair[i] = pair[count - 1 - i];
        pair[count - 1 - i] = other;
    }
}

static void sort_back_and_forth(ebpo_subtree_pairs *p)
{
    if (p->count)
        qsort(p->pair, p->count, sizeof *p->pair, by_places);
    for (uint64_t begin = 0, end; begin < p->count; begin = end) {
        for (end = begin + 1; end < p->count && p->pair[end].a == p->pair[begin].a;)
            end++;
        if (p->subtrees[0]++ % 2)
            turn_round(p->pair + begin, end - begin);
    }
}

static ebpo_status count_seconds(ebpo_subtree_pairs *p, uint64_t most, ebpo_error *error)
{
    bool *seen = ebpo_alloc_zero(most, sizeof *seen);
    if (!seen)
        return ebpo_fail_memory(error, most);
    for (uint64_t i = 0; i < p->count; i++) {
        p->subtrees[1] += !seen[p->pair[i].b];
        seen[p->pair[i].b] = true;
    }
    free(seen);
    return EBPO_OK;
}

ebpo_status ebpo_subtree_pairs_find(ebpo_subtree_pairs *out, ebpo_posed_subtrees *a,
                                    ebpo_posed_subtrees *b, double reach, bool self,
                                    ebpo_error *error)
{
    finding f = { out, { a, b }, reach, self, error };
    ebpo_posed_node root[2] = { ebpo_posed_subtree_root(a), ebpo_posed_subtree_root(b) };
    *out = (ebpo_subtree_pairs){ .count = 0 };
    ebpo_status status = descend(&f, root);
    if (status != EBPO_OK)
        return status;
    sort_back_and_forth(out);
    return count_seconds(out, b->count, error);
}

static int by_nearness(const void *x, const void *y)
{
    const ebpo_subtree_pair *p = x, *q = y;
    if (p->apart != q->apart)
        return p->apart < q->apart ? -1 : 1;
    return by_places(x, y);
}

void ebpo_subtree_pairs_nearest_first(ebpo_subtree_pairs *p)
{
    if (p->count)
        qsort(p->pair, p->count, sizeof *p->pair, by_nearness);
}
