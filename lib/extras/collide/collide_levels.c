/* Bounds the distance of two posed models by the nodes of their octrees, without reading faces, and
 * reports if both solids certainly have a common point.
 *
 * Pairs of nodes are visited in the order of the gaps of their envelopes, the least first
 * (subtree_search.h). A gap is a lower bound of the distance; two nodes with faces give an upper
 * bound. A black cell belongs entirely to its solid. So both solids have a common point in two
 * cases: a black cell contains all of a cell with faces of the other model, or a point of a black
 * cell of the other model. A search runs in one thread. */
#include "core/strict_fp.h"

#include <math.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/collide/subtree_search.h"

/* The search through the levels. Zero at the beginning. */
typedef struct level_search {
    const ebpo_collision *collision;
    ebpo_node_gaps nodes;
    /* Output: */
    double lo, hi;            /* bounds of the distance of faces */
    uint64_t undecided_pairs; /* pairs whose faces may intersect */
    bool intersects;          /* the solids or faces certainly have a common point */
    bool may_intersect;       /* an undecided pair may have a common point */
} level_search;

static const char stage[] = "pairs of nodes";

/* Width of the margin along the faces of a black cell, as a share of the cell's side. Points in the
 * margin are not counted as inside the cell. */
static const double margin_share = 0x1p-14;

/* --- nodes --- */

/* Content of a node: nothing, faces, or only the interior of the solid. */
typedef enum content { NOTHING, FACES, SOLID } content;

static content content_of(const level_search *g, int side, const ebpo_posed_node *node)
{
    const ebpo_info *info = g->nodes.side[side].model->info;
    if (ebpo_entry_kind_of(node->entry) != EBPO_ENTRY_UNIFORM)
        return FACES;
    return info->solid && ebpo_rule_inside(info->rule, ebpo_entry_winding(node->entry)) ? SOLID
                                                                                        : NOTHING;
}

static bool has_children(const level_search *g, const ebpo_posed_node *node)
{
    int level = g->collision->options.level;
    return ebpo_entry_kind_of(node->entry) == EBPO_ENTRY_GRAY &&
           (level < 0 || node->cell.level < level);
}

/* --- a common point of both solids --- */

/* Returns true if the posed point p is certainly within a posed cell. max_coordinate: bound of
 * posed coordinates. */
static bool is_within(const double corner[8][3], const double p[3], double max_coordinate)
{
    for (int k = 0; k < 3; k++) {
        const double *from = corner[0], *to = corner[1 << k];
        double length2 = 0, along = 0;
        for (int i = 0; i < 3; i++) {
            length2 += (to[i] - from[i]) * (to[i] - from[i]);
            along += (to[i] - from[i]) * (p[i] - from[i]);
        }
        if (!(length2 > 0x1p-900 && length2 < 0x1p900)) /* the squares overflow, underflow or are
                                                         * not numbers */
            return false;
        double space = margin_share * length2 + 0x1p-44 * max_coordinate * sqrt(length2);
        if (!(along > space && along < length2 - space))
            return false;
    }
    return true;
}

/* Widens a cell about its middle by a share of its size. */
static void widen_cell(double corner[8][3], double share)
{
    double middle[3];
    for (int i = 0; i < 3; i++)
        middle[i] = corner[0][i] / 2 + corner[7][i] / 2;
    for (int c = 0; c < 8; c++)
        for (int i = 0; i < 3; i++)
            corner[c][i] = middle[i] + (corner[c][i] - middle[i]) * (1 + share);
}

/* Returns true if `solid`, the cell of a black node, certainly has a common point with the model of
 * the other cell. black: the other node is black, too; then `solid` must contain a corner or the
 * middle of the other cell. Otherwise `solid` must contain the region in which the other node has
 * its faces. `other` may be changed. */
static bool shares_point(const level_search *g, double solid[8][3], double other[8][3], bool black)
{
    int within = 0;
    double middle[3], max_coordinate = g->collision->max_coordinate;
    if (!black)
        widen_cell(other, 2 * EBPO_FACE_MARGIN);
    for (int c = 0; c < 8; c++)
        within += is_within((const double(*)[3])solid, other[c], max_coordinate);
    for (int i = 0; i < 3; i++)
        middle[i] = other[0][i] / 2 + other[7][i] / 2;
    return black ? within > 0 || is_within((const double(*)[3])solid, middle, max_coordinate)
                 : within == 8;
}

/* Returns true if the models of two nodes certainly have a common point because of a black node. */
static bool certainly_intersect(const level_search *g, const ebpo_posed_node node[2],
                                const content has[2])
{
    for (int i = 0; i < 2; i++) {
        double solid[8][3], other[8][3];
        if (has[i] != SOLID)
            continue;
        ebpo_posed_cell(&g->nodes.side[i], node[i].cell, solid);
        ebpo_posed_cell(&g->nodes.side[1 - i], node[1 - i].cell, other);
        if (shares_point(g, solid, other, has[1 - i] == SOLID))
            return true;
    }
    return false;
}

/* --- pairs --- */

/* Adds a pair of nodes to the heap unless it cannot change the result. gap: lower bound of the
 * distance of their parents. */
static ebpo_status add_node_pair(level_search *g, const ebpo_posed_node node[2], double gap,
                                 ebpo_error *error)
{
    content has[2] = { content_of(g, 0, &node[0]), content_of(g, 1, &node[1]) };
    ebpo_node_gap pair = { { node[0], node[1] }, 0 };
    bool faces = has[0] == FACES && has[1] == FACES;
    if (has[0] == NOTHING || has[1] == NOTHING || (!faces && g->intersects))
        return EBPO_OK;
    ebpo_status status = ebpo_node_gap_of(&g->nodes, node, &pair.gap, error);
    pair.gap = fmax(pair.gap, gap); /* the gap of the parents is a bound, too */
    if (status != EBPO_OK || pair.gap > g->hi || (!faces && pair.gap > 0))
        return status;
    if (faces)
        g->hi = fmin(g->hi, ebpo_node_far_bound(&g->nodes, node));
    else if (certainly_intersect(g, node, has))
        g->intersects = true;
    return ebpo_node_gaps_push(&g->nodes, &pair, error);
}

static bool has_faces(const level_search *g, const ebpo_node_gap *pair)
{
    return content_of(g, 0, &pair->node[0]) == FACES && content_of(g, 1, &pair->node[1]) == FACES;
}

/* Adds a pair that is not divided any further to the result. */
static void finish_pair(level_search *g, const ebpo_node_gap *pair)
{
    bool faces = has_faces(g, pair);
    if (faces)
        g->lo = fmin(g->lo, pair->gap);
    if (pair->gap > 0)
        return;
    g->may_intersect = true;
    g->undecided_pairs += faces;
}

static ebpo_status divide_pair(level_search *g, const ebpo_node_gap *pair, ebpo_error *error)
{
    bool down[2] = { has_children(g, &pair->node[0]), has_children(g, &pair->node[1]) };
    int side = !down[0] ? 1 : !down[1] ? 0 : ebpo_node_larger(&g->nodes, pair->node);
    ebpo_posed_node part[2] = { pair->node[0], pair->node[1] };
    ebpo_status status = EBPO_OK;
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        part[side] = ebpo_posed_child(&g->nodes.side[side], &pair->node[side], octant);
        status = add_node_pair(g, part, pair->gap, error);
    }
    return status;
}

/* --- the search --- */

/* Adds all pairs of the heap to the result, without dividing them. */
static void finish_all_pairs(level_search *g)
{
    for (uint64_t i = 0; i < g->nodes.count; i++)
        finish_pair(g, &g->nodes.heap[i]);
    g->nodes.count = 0;
}

/* Returns true if the search uses more than the collider's memory. */
static bool is_full(const level_search *g)
{
    return g->nodes.count * sizeof *g->nodes.heap + g->nodes.side[0].bytes +
               g->nodes.side[1].bytes >
           g->collision->collider->options.memory;
}

/* Visits pairs in the order of their gaps. Skips pairs with a gap above g->lo, the least gap of the
 * pairs that are not divided further, and, once a common point is certain, pairs without faces. */
static ebpo_status search_levels(level_search *g, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    while (g->nodes.count > 0 && status == EBPO_OK) {
        ebpo_node_gap pair = ebpo_node_gaps_pop(&g->nodes);
        bool faces = has_faces(g, &pair);
        g->collision->collider->node_pairs++;
        if ((!faces && g->intersects) || pair.gap > g->lo)
            continue;
        if (ebpo_collision_is_late(g->collision) || is_full(g)) {
            finish_pair(g, &pair);
            finish_all_pairs(g);
        } else if (has_children(g, &pair.node[0]) || has_children(g, &pair.node[1])) {
            status = divide_pair(g, &pair, error);
        } else {
            finish_pair(g, &pair);
        }
        if (!ebpo_progress_step(&g->collision->options.progress, stage, 0, 0, error))
            return EBPO_E_CANCELLED;
    }
    return status;
}

static ebpo_status level_search_run(level_search *g, const ebpo_collision *q, ebpo_error *error)
{
    g->collision = q;
    g->lo = g->hi = INFINITY;
    ebpo_status status = ebpo_node_gaps_begin(&g->nodes, q, error);
    if (status != EBPO_OK)
        return status;
    ebpo_posed_node root[2] = { ebpo_posed_root(&g->nodes.side[0]),
                                ebpo_posed_root(&g->nodes.side[1]) };
    status = add_node_pair(g, root, 0, error);
    return status == EBPO_OK ? search_levels(g, error) : status;
}

static void level_search_free(level_search *g) { ebpo_node_gaps_free(&g->nodes); }

/* --- the query --- */

/* Returns the deepest level of a model that the search uses. */
static int32_t last_level(const ebpo_model *m, int level)
{
    int last = m->whole ? m->info->level_count - 1 : m->top->cut_level;
    return level < 0 || level > last ? last : level;
}

static void fill_result(const ebpo_collision *q, const level_search *g, ebpo_level_result *out)
{
    double lo = fmin(g->lo, g->hi);
    int32_t value_kind = isinf(lo)                 ? EBPO_VALUE_EXACT
                         : lo == 0 || isinf(g->hi) ? EBPO_VALUE_BOUND
                                                   : EBPO_VALUE_INTERVAL;
    out->distance = (ebpo_value_bounds){ lo, g->hi, value_kind, 0 };
    out->common = g->intersects ? 1 : g->may_intersect ? -1 : 0;
    out->contact = g->undecided_pairs ? -1 : 0;
    out->undecided_pairs = g->undecided_pairs;
    out->level_a = last_level(q->model[q->swapped], q->options.level);
    out->level_b = last_level(q->model[!q->swapped], q->options.level);
}

ebpo_status ebpo_collide_levels(ebpo_collider *c, const ebpo_collide_options *options,
                                ebpo_level_result *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_collision q;
    level_search g = { .undecided_pairs = 0 };
    *out = (ebpo_level_result){ .common = -1, .contact = -1 };
    ebpo_status status = ebpo_collision_begin(&q, c, options, error);
    if (status == EBPO_OK)
        status = level_search_run(&g, &q, error);
    if (status == EBPO_OK)
        fill_result(&q, &g, out);
    level_search_free(&g);
    return status;
}
