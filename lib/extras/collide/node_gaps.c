#include "core/strict_fp.h"

#include "extras/collide/node_gaps.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/sort.h"

ebpo_status ebpo_node_gaps_begin(ebpo_node_gaps *g, const ebpo_collision *q, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    g->reach = q->reach;
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

static double slack_of(const ebpo_node_gaps *g, const ebpo_posed_node node[2])
{
    return ebpo_posed_slack(&g->side[0], node[0].cell, g->reach) +
           ebpo_posed_slack(&g->side[1], node[1].cell, g->reach);
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
    double corner[2][8][3], near = 0;
    ebpo_convex convex[2];
    for (int i = 0; i < 2; i++) {
        ebpo_posed_cell(&g->side[i], node[i].cell, corner[i]);
        convex[i] = (ebpo_convex){ 8, (const double(*)[3])corner[i] };
        near += EBPO_NEAR_SHARE * ebpo_posed_diagonal(&g->side[i], node[i].cell);
    }
    return ebpo_convex_span(&convex[0], &convex[1]) + near + slack_of(g, node);
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
