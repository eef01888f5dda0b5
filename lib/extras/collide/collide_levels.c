/* Bounds the distance of two posed models by the nodes of their octrees, without reading faces, and
 * reports if both solids certainly have a common point.
 *
 * Pairs of nodes are visited in the order of the gaps of their envelopes, the least first
 * (subtree_search.h). The gap of a pair is a lower bound of the distance of the models. If both
 * nodes have faces, the pair also gives an upper bound. A black cell belongs entirely to the
 * interior of its solid. So each of two conditions shows that the models certainly have a common
 * point. First, a black cell of one model and a black cell of the other model have a common point.
 * Second, a black cell of one model contains a whole cell of the other model, and this cell has
 * faces. A search runs in one thread. */
#include "core/strict_fp.h"

#include <math.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/collide/subtree_search.h"

/* The search through the levels. Zero at the beginning. */
typedef struct level_search {
    const ebpo_collision *collision;
    ebpo_node_gaps nodes; /* heap of the pairs that will be visited */
    /* Output: */
    double lo, hi;            /* bounds of the distance of faces */
    uint64_t undecided_pairs; /* number of undivided pairs of nodes whose faces may intersect */
    bool intersects;          /* the solids or faces certainly have a common point */
    bool may_intersect;       /* the nodes of an undivided pair may have a common point */
} level_search;

static const char stage[] = "pairs of nodes"; /* for the progress function */

/* Width of a margin along the sides of a black cell, as a share of the cell's edge. Points in the
 * margin do not count as inside the cell. */
static const double margin_share = 0x1p-14;

/* --- nodes --- */

/* Content of a node. */
typedef enum content {
    NOTHING, /* only the exterior of the model */
    FACES,   /* faces */
    SOLID    /* only the interior of the solid: a black node */
} content;

/* Returns the content of a node of model `side`. */
static content content_of(const level_search *g, int side, const ebpo_posed_node *node)
{
    const ebpo_info *info = g->nodes.side[side].model->info;
    if (ebpo_entry_kind_of(node->entry) != EBPO_ENTRY_UNIFORM)
        return FACES;
    return info->solid && ebpo_rule_inside(info->rule, ebpo_entry_winding(node->entry)) ? SOLID
                                                                                        : NOTHING;
}

/* Returns true if the search may divide a node: it has children on the levels that the caller wants
 * to use. */
static bool has_children(const level_search *g, const ebpo_posed_node *node)
{
    int level = g->collision->options.level;
    return ebpo_entry_kind_of(node->entry) == EBPO_ENTRY_GRAY &&
           (level < 0 || node->cell.level < level);
}

/* --- a common point of both solids --- */

/* Returns true if the posed point p is certainly within a posed cell with these corners, and not in
 * the margin. max_coordinate: upper bound of the absolute values of posed coordinates. */
static bool is_within(const double corner[8][3], const double p[3], double max_coordinate)
{
    for (int k = 0; k < 3; k++) {
        const double *from = corner[0], *to = corner[1 << k]; /* the cell's edge along axis k */
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

/* Widens a cell on all sides: multiplies its size by 1 + share, and keeps its middle. */
static void widen_cell(double corner[8][3], double share)
{
    double middle[3];
    for (int i = 0; i < 3; i++)
        middle[i] = corner[0][i] / 2 + corner[7][i] / 2;
    for (int c = 0; c < 8; c++)
        for (int i = 0; i < 3; i++)
            corner[c][i] = middle[i] + (corner[c][i] - middle[i]) * (1 + share);
}

/* Returns true if a black node certainly has a common point with the model of another node. black,
 * other: corners of both cells; other_black: the other node is black, too. If the other node is
 * black, the black cell must contain a corner or the middle of the other cell. If the other node
 * has faces, the black cell must contain the region in which these faces have a point: the other
 * cell, which this function widens by a margin. */
static bool shares_point(const level_search *g, double black[8][3], double other[8][3],
                         bool other_black)
{
    int within = 0;
    double middle[3], max_coordinate = g->collision->max_coordinate;
    if (!other_black)
        widen_cell(other, 2 * EBPO_FACE_MARGIN);
    for (int c = 0; c < 8; c++)
        within += is_within((const double(*)[3])black, other[c], max_coordinate);
    for (int i = 0; i < 3; i++)
        middle[i] = other[0][i] / 2 + other[7][i] / 2;
    return other_black ? within > 0 || is_within((const double(*)[3])black, middle, max_coordinate)
                       : within == 8;
}

/* Returns true if the models of two nodes certainly have a common point, because one of the nodes
 * is black. contents: contents of the nodes. */
static bool certainly_intersect(const level_search *g, const ebpo_posed_node node[2],
                                const content contents[2])
{
    for (int i = 0; i < 2; i++) {
        double black[8][3], other[8][3];
        if (contents[i] != SOLID)
            continue;
        ebpo_posed_cell(&g->nodes.side[i], node[i].cell, black);
        ebpo_posed_cell(&g->nodes.side[1 - i], node[1 - i].cell, other);
        if (shares_point(g, black, other, contents[1 - i] == SOLID))
            return true;
    }
    return false;
}

/* --- pairs --- */

/* Adds a pair of nodes to the heap if the pair can change the result. gap: lower bound of the
 * distance of the pair from which the nodes were made. */
static ebpo_status add_node_pair(level_search *g, const ebpo_posed_node node[2], double gap,
                                 ebpo_error *error)
{
    content contents[2] = { content_of(g, 0, &node[0]), content_of(g, 1, &node[1]) };
    ebpo_node_gap pair = { { node[0], node[1] }, 0 };
    bool both_faces = contents[0] == FACES && contents[1] == FACES;
    if (contents[0] == NOTHING || contents[1] == NOTHING || (!both_faces && g->intersects))
        return EBPO_OK;
    ebpo_status status = ebpo_node_gap_of(&g->nodes, node, &pair.gap, error);
    pair.gap = fmax(pair.gap, gap);
    if (status != EBPO_OK || pair.gap > g->hi || (!both_faces && pair.gap > 0))
        return status;
    if (both_faces)
        g->hi = fmin(g->hi, ebpo_node_far_bound(&g->nodes, node));
    else if (certainly_intersect(g, node, contents))
        g->intersects = true;
    return ebpo_node_gaps_push(&g->nodes, &pair, error);
}

/* Returns true if both nodes of a pair have faces. */
static bool both_have_faces(const level_search *g, const ebpo_node_gap *pair)
{
    return content_of(g, 0, &pair->node[0]) == FACES && content_of(g, 1, &pair->node[1]) == FACES;
}

/* Adds a pair that is not divided any further to the result. */
static void finish_pair(level_search *g, const ebpo_node_gap *pair)
{
    bool both_faces = both_have_faces(g, pair);
    if (both_faces)
        g->lo = fmin(g->lo, pair->gap);
    if (pair->gap > 0)
        return;
    g->may_intersect = true;
    g->undecided_pairs += both_faces;
}

/* Divides a node of a pair, and adds the pairs of its children with the other node. Divides the
 * larger node if both nodes have children. */
static ebpo_status divide_pair(level_search *g, const ebpo_node_gap *pair, ebpo_error *error)
{
    bool divisible[2] = { has_children(g, &pair->node[0]), has_children(g, &pair->node[1]) };
    int side = !divisible[0] ? 1 : !divisible[1] ? 0 : ebpo_node_larger(&g->nodes, pair->node);
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

/* Returns true if the search uses more than the memory that the collider's options allow. */
static bool is_full(const level_search *g)
{
    return g->nodes.count * sizeof *g->nodes.heap + g->nodes.side[0].bytes +
               g->nodes.side[1].bytes >
           g->collision->collider->options.memory;
}

/* Visits pairs in the order of their gaps. Skips pairs with a gap above g->lo (the least gap of the
 * pairs that are not divided further). Once a common point is certain, also skips pairs in which a
 * node has no faces. At the deadline, or if memory is used up, divides no more pairs. */
static ebpo_status search_levels(level_search *g, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    while (g->nodes.count > 0 && status == EBPO_OK) {
        ebpo_node_gap pair = ebpo_node_gaps_pop(&g->nodes);
        g->collision->collider->node_pairs++;
        if ((!both_have_faces(g, &pair) && g->intersects) || pair.gap > g->lo)
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

/* Begins and runs a search, and sets its output. */
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

/* Sets the caller's result; an unknown answer is -1. */
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
