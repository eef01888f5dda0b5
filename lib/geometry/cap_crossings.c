/* Finds caps in a tree of caps: the crossings of a segment, and the caps near a box. Discs are caps
 * with the opposite orientation, so a crossing of a cap is minus the crossing of the disc. Nodes
 * are groups of loops, and stretches (paths along a loop, cap_triangles.h).
 *
 * A node of the tree is skipped if the ball around its caps is certainly apart from the box or the
 * segment. Crossings are exact (ebpo_axis_crossing). */
#include "core/strict_fp.h"

#include "geometry/cap_bounds.h"
#include "geometry/cap_triangles.h"
#include "geometry/predicates.h"

/* A segment from a point along an axis to coordinate `to`. */
typedef struct cap_segment {
    const ebpo_cap_tree *tree;
    const double *from; /* [3] */
    double to;
    int axis;
    double low[3], high[3]; /* the segment's box */
} cap_segment;

/* Returns true if the ball around a node's caps is certainly apart from the box. */
static bool ball_is_apart(const ebpo_cap_node *n, const double low[3], const double high[3])
{
    for (int k = 0; k < 3; k++)
        if ((low[k] - n->centre[k]) * (1 - 0x1p-50) > n->radius ||
            (n->centre[k] - high[k]) * (1 - 0x1p-50) > n->radius)
            return true;
    return false;
}

/* Returns the crossings of the stretch's own triangle, which belongs to neither half of the
 * stretch. */
static int32_t cross_triangle(const cap_segment *g, const ebpo_cap_node *n)
{
    const ebpo_cap_tree *t = g->tree;
    return (int32_t)n->weight * ebpo_axis_crossing(g->from, g->to, g->axis, t->position[n->from],
                                                   t->position[ebpo_cap_middle(n->from, n->to)],
                                                   t->position[n->to]);
}

/* Returns the crossings of the discs below a node. Recursive, at most 64 deep. */
static int32_t cross_discs(const cap_segment *g, uint64_t at)
{
    const ebpo_cap_tree *t = g->tree;
    const ebpo_cap_node *n = &t->node[at];
    if (ball_is_apart(n, g->low, g->high))
        return 0;
    if (n->weight == 0)
        return cross_discs(g, n->from) + cross_discs(g, n->to);
    uint64_t m = ebpo_cap_middle(n->from, n->to), first = ebpo_cap_count(n->from, m);
    int32_t sum = cross_triangle(g, n);
    if (first)
        sum += cross_discs(g, at + 1);
    if (ebpo_cap_count(m, n->to))
        sum += cross_discs(g, at + 1 + first);
    return sum;
}

int32_t ebpo_cap_crossings(const ebpo_cap_tree *tree, const double from[3], double to, int axis)
{
    cap_segment g = { .tree = tree, .from = from, .to = to, .axis = axis };
    for (int k = 0; k < 3; k++)
        g.low[k] = g.high[k] = from[k];
    g.high[axis] = to;
    return tree->node_count ? -cross_discs(&g, 0) : 0;
}

int32_t ebpo_cap_path_crossings(const ebpo_cap_tree *tree, uint32_t entry, const double low[3],
                                const double p[3])
{
    const ebpo_cap_node *n = &tree->node[entry & ~EBPO_CAP_TRIANGLE];
    cap_segment g = { .tree = tree };
    double from[3] = { low[0], low[1], low[2] };
    int32_t sum = 0;
    if (ball_is_apart(n, low, p))
        return 0;
    g.from = from;
    for (g.axis = 0; g.axis < 3; g.axis++) {
        for (int k = 0; k < 3; k++)
            g.low[k] = g.high[k] = from[k];
        g.to = g.high[g.axis] = p[g.axis];
        sum += entry & EBPO_CAP_TRIANGLE ? cross_triangle(&g, n) : cross_discs(&g, entry);
        from[g.axis] = p[g.axis];
    }
    return -sum;
}

/* Returns false if certainly no cap below a node touches the box. Recursive, at most 64 deep. */
static bool is_near(const ebpo_cap_tree *t, uint64_t at, const double low[3], const double high[3])
{
    const ebpo_cap_node *n = &t->node[at];
    if (ball_is_apart(n, low, high))
        return false;
    if (n->weight == 0)
        return is_near(t, n->from, low, high) || is_near(t, n->to, low, high);
    uint64_t m = ebpo_cap_middle(n->from, n->to), first = ebpo_cap_count(n->from, m);
    bool apart = false;
    for (int k = 0; k < 3; k++) {
        const double a = t->position[n->from][k], b = t->position[m][k], c = t->position[n->to][k];
        apart = apart || (a < low[k] && b < low[k] && c < low[k]) ||
                (a > high[k] && b > high[k] && c > high[k]);
    }
    return !apart || (first && is_near(t, at + 1, low, high)) ||
           (ebpo_cap_count(m, n->to) && is_near(t, at + 1 + first, low, high));
}

bool ebpo_caps_near(const ebpo_cap_tree *tree, const double low[3], const double high[3])
{
    return tree->node_count && is_near(tree, 0, low, high);
}
