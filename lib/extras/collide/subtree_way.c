/* The point that two faces have in common last is in a cell of each model that lists its face, one
 * of which has been moved: so their subtrees have it in both envelopes, and these part no sooner.
 */
#include "core/strict_fp.h"

#include "extras/collide/subtree_way.h"

#include <math.h>

#include "core/error.h"
#include "core/parallel.h"
#include "extras/collide/subtree_search.h"

typedef struct searching {
    ebpo_subtree_search subtrees; /* `gap`: less the time until which they may meet */
    ebpo_way_search *way;
} searching;

static ebpo_status extent_of(searching *s, int which, ebpo_cell cell, ebpo_way_extent *out,
                             ebpo_error *error)
{
    ebpo_posed_subtrees *side = &s->subtrees.nodes.side[which];
    ebpo_convex hull;
    double slack = ebpo_posed_slack(side, cell, s->subtrees.question->reach);
    ebpo_status status = ebpo_posed_envelope(side, cell, &hull, error);
    for (int i = 0; i < 3 && status == EBPO_OK; i++) {
        const double *axis = s->way->axis[i];
        out->low[i] = INFINITY;
        out->high[i] = -INFINITY;
        for (int v = 0; v < hull.count; v++) {
            const double *x = hull.point[v];
            double at = axis[0] * x[0] + axis[1] * x[1] + axis[2] * x[2];
            out->low[i] = fmin(out->low[i], at - slack);
            out->high[i] = fmax(out->high[i], at + slack);
        }
    }
    return status;
}

static ebpo_status add(searching *s, const ebpo_posed_node node[2], ebpo_error *error)
{
    ebpo_way_extent extent[2];
    for (int i = 0; i < 2; i++) {
        if (ebpo_entry_kind_of(node[i].entry) == EBPO_ENTRY_UNIFORM)
            return EBPO_OK;
        ebpo_status status = extent_of(s, i, node[i].cell, &extent[i], error);
        if (status != EBPO_OK)
            return status;
    }
    ebpo_node_gap pair = { { node[0], node[1] }, -ebpo_way_most(s->way, &extent[0], &extent[1]) };
    return -pair.gap < s->way->sure ? EBPO_OK
                                    : ebpo_node_gaps_push(&s->subtrees.nodes, &pair, error);
}

static ebpo_status divide(searching *s, const ebpo_node_gap *pair, int side, ebpo_error *error)
{
    ebpo_posed_node part[2] = { pair->node[0], pair->node[1] };
    ebpo_status status = EBPO_OK;
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        part[side] = ebpo_posed_child(&s->subtrees.nodes.side[side], &pair->node[side], octant);
        status = add(s, part, error);
    }
    return status;
}

static ebpo_status look_at(searching *s, const ebpo_node_gap *pair, ebpo_error *error)
{
    const ebpo_accel *accel[2];
    bool there;
    int side = ebpo_subtree_search_side(&s->subtrees, pair->node);
    if (side >= 0)
        return divide(s, pair, side, error);
    ebpo_status status = ebpo_subtree_search_load(&s->subtrees, pair->node, accel, &there, error);
    return status == EBPO_OK && there ? ebpo_way_search_run(s->way, accel, error) : status;
}

static ebpo_status search(searching *s, ebpo_error *error)
{
    const ebpo_collision *q = s->subtrees.question;
    ebpo_node_gaps *nodes = &s->subtrees.nodes;
    ebpo_posed_node root[2] = { ebpo_posed_root(&nodes->side[0]),
                                ebpo_posed_root(&nodes->side[1]) };
    ebpo_status status = add(s, root, error);
    while (status == EBPO_OK && nodes->count > 0) {
        ebpo_node_gap pair = ebpo_node_gaps_pop(nodes);
        if (-pair.gap < s->way->sure)
            return EBPO_OK;
        if (ebpo_collision_is_late(q)) {
            s->way->hi = fmax(s->way->hi, -pair.gap);
            return EBPO_OK;
        }
        status = look_at(s, &pair, error);
        if (!ebpo_progress_step(&q->options.progress, "way out", 0, 0, error))
            return EBPO_E_CANCELLED;
    }
    return status;
}

ebpo_status ebpo_way_of_parts(ebpo_way_search *way, ebpo_error *error)
{
    searching s = { .way = way };
    ebpo_status status = ebpo_subtree_search_begin(&s.subtrees, way->question, error);
    if (status == EBPO_OK)
        status = search(&s, error);
    ebpo_subtree_search_end(&s.subtrees);
    return status;
}
