/* Visits pairs of nodes of two posed trees, the pair with the least gap first, down to subtrees,
 * which are loaded on demand. The gap of two nodes' envelopes is a lower bound of the distance of
 * the nodes' faces.
 *
 * Queries of levels, distances and separation distances use this search, and decide when it ends.
 * The larger of two nodes is divided first. If one model is entirely in memory and the other model
 * is partly loaded, several pairs of nodes may need the same pair of subtrees, which is visited
 * once. A search runs in one thread. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/sort.h"
#include "extras/collide/subtree_search.h"

ebpo_status ebpo_node_gaps_begin(ebpo_node_gaps *g, const ebpo_collision *q, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    g->max_coordinate = q->max_coordinate;
    for (int i = 0; i < 2 && status == EBPO_OK; i++)
        status = ebpo_posed_subtrees_make(&g->side[i], q->model[i], &q->posing[i].posing, error);
    return status;
}

void ebpo_node_gaps_free(ebpo_node_gaps *g)
{
    for (int i = 0; i < 2; i++)
        ebpo_posed_subtrees_free(&g->side[i]);
    free(g->heap);
}

int ebpo_node_larger(const ebpo_node_gaps *g, const ebpo_posed_node node[2])
{
    return ebpo_posed_diagonal(&g->side[0], node[0].cell) <
           ebpo_posed_diagonal(&g->side[1], node[1].cell);
}

/* Returns the sum of the error bounds of both nodes' envelopes. */
static double slack_of(const ebpo_node_gaps *g, const ebpo_posed_node node[2])
{
    return ebpo_posed_slack(&g->side[0], node[0].cell, g->max_coordinate) +
           ebpo_posed_slack(&g->side[1], node[1].cell, g->max_coordinate);
}

static bool is_nearer(const ebpo_node_gap *a, const ebpo_node_gap *b) { return a->gap < b->gap; }

EBPO_HEAP(heap, ebpo_node_gap, is_nearer)

ebpo_status ebpo_node_gaps_push(ebpo_node_gaps *g, const ebpo_node_gap *pair, ebpo_error *error)
{
    if (!ebpo_grow(&g->heap, &g->capacity, g->count + 1, sizeof *g->heap))
        return ebpo_fail_memory(error, (g->count + 1) * sizeof *g->heap);
    heap_add(g->heap, g->count++, pair);
    return EBPO_OK;
}

ebpo_node_gap ebpo_node_gaps_pop(ebpo_node_gaps *g) { return heap_take(g->heap, g->count--); }

double ebpo_node_far_bound(const ebpo_node_gaps *g, const ebpo_posed_node node[2])
{
    double corner[2][8][3], margin = 0; /* margin: for faces outside the cells */
    ebpo_convex convex[2];
    for (int i = 0; i < 2; i++) {
        ebpo_posed_cell(&g->side[i], node[i].cell, corner[i]);
        convex[i] = (ebpo_convex){ 8, (const double(*)[3])corner[i] };
        margin += EBPO_FACE_MARGIN * ebpo_posed_diagonal(&g->side[i], node[i].cell);
    }
    return ebpo_convex_span(&convex[0], &convex[1]) + margin + slack_of(g, node);
}

ebpo_status ebpo_node_gap_of(ebpo_node_gaps *g, const ebpo_posed_node node[2], double *out,
                             ebpo_error *error)
{
    ebpo_convex convex[2];
    for (int i = 0; i < 2; i++) {
        ebpo_status status = ebpo_posed_envelope(&g->side[i], node[i].cell, &convex[i], error);
        if (status != EBPO_OK)
            return status;
    }
    *out = fmax(ebpo_convex_gap(&convex[0], &convex[1], INFINITY) - slack_of(g, node), 0);
    return EBPO_OK;
}

ebpo_status ebpo_subtree_search_begin(ebpo_subtree_search *s, const ebpo_collision *q,
                                      ebpo_error *error)
{
    s->collision = q;
    s->read_before = ebpo_collision_bytes_read(q);
    ebpo_status status = ebpo_node_gaps_begin(&s->nodes, q, error);
    for (int i = 0; i < 2 && status == EBPO_OK; i++) {
        s->visited[i] = ebpo_alloc_zero(s->nodes.side[i].count + 1, sizeof *s->visited[i]);
        if (!s->visited[i])
            return ebpo_fail_memory(error, s->nodes.side[i].count);
        if (!q->model[i]->whole)
            status = ebpo_context_new(q->model[i], &s->context[i], error);
        if (status == EBPO_OK && s->context[i])
            s->context[i]->content = EBPO_ACCEL_FACES;
    }
    return status;
}

void ebpo_subtree_search_end(ebpo_subtree_search *s)
{
    ebpo_collider *c = s->collision->collider;
    c->bytes_read += ebpo_collision_bytes_read(s->collision) - s->read_before;
    for (int i = 0; i < 2; i++) {
        c->loads += s->context[i] ? s->context[i]->loaded : 0;
        ebpo_context_free(s->context[i]);
        free(s->visited[i]);
    }
    ebpo_node_gaps_free(&s->nodes);
}

/* Returns true if a node has children in memory. */
static bool is_gray(const ebpo_posed_node *node)
{
    return ebpo_entry_kind_of(node->entry) == EBPO_ENTRY_GRAY;
}

/* The nodes of a model that is entirely in memory are divided only to get better bounds, and only
 * if they are larger than the other model's node. */
int ebpo_subtree_search_side(const ebpo_subtree_search *s, const ebpo_posed_node node[2])
{
    int larger = ebpo_node_larger(&s->nodes, node);
    if (is_gray(&node[larger]))
        return larger;
    return is_gray(&node[!larger]) && !s->collision->model[!larger]->whole ? !larger : -1;
}

/* Returns true if a pair of subtrees has been visited. This happens if one model is entirely in
 * memory and the other model is partly loaded, because then several pairs of nodes need the same
 * pair of subtrees. */
static bool was_visited(const ebpo_subtree_search *s, const uint32_t number[2])
{
    for (int i = 0; i < 2; i++)
        if (s->collision->model[!i]->whole && s->visited[i][number[i]])
            return true;
    return false;
}

ebpo_status ebpo_subtree_search_load(ebpo_subtree_search *s, const ebpo_posed_node node[2],
                                     const ebpo_accel *accel[2], bool *loaded, ebpo_error *error)
{
    ebpo_collider *c = s->collision->collider;
    uint32_t number[2];
    *loaded = false;
    for (int i = 0; i < 2; i++) {
        const ebpo_model *m = s->collision->model[i];
        number[i] = m->whole ? 0 : ebpo_entry_value(node[i].entry);
        if (!m->whole && m->top->below[number[i]].pruned)
            return EBPO_OK; /* the faces of a pruned node are not in this file */
    }
    if (was_visited(s, number))
        return EBPO_OK;
    c->subtree_pairs++;
    for (int i = 0; i < 2; i++) {
        ebpo_accel *subtree = s->collision->model[i]->whole; /* NULL: partly loaded */
        ebpo_status status =
            subtree ? EBPO_OK : ebpo_context_subtree(s->context[i], number[i], &subtree, error);
        if (status != EBPO_OK)
            return status;
        c->subtrees += !s->visited[i][number[i]];
        s->visited[i][number[i]] = true;
        accel[i] = subtree;
    }
    *loaded = true;
    return EBPO_OK;
}
