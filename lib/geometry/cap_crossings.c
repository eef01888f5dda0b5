/* Finds caps in a tree of caps: the crossings of a path, and the caps near a box. Discs are caps
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

/* The arguments of ebpo_caps_visit. */
typedef struct cap_visit {
    const ebpo_cap_tree *tree;
    const double *low, *high; /* [3] the box */
    ebpo_cap_visit_fn *visit;
    void *context;
} cap_visit;

/* Visits the stretch's own triangle. Returns the result of the call, or false without a call if the
 * triangle's bounding box does not touch the box. */
static bool visit_triangle(const cap_visit *v, const ebpo_cap_node *n)
{
    const ebpo_cap_tree *t = v->tree;
    const double *a = t->position[n->from], *b = t->position[ebpo_cap_middle(n->from, n->to)],
                 *c = t->position[n->to];
    for (int k = 0; k < 3; k++)
        if ((a[k] < v->low[k] && b[k] < v->low[k] && c[k] < v->low[k]) ||
            (a[k] > v->high[k] && b[k] > v->high[k] && c[k] > v->high[k]))
            return false;
    return v->visit(v->context, a, b, c, n->weight);
}

/* Visits the discs below a node. Recursive, at most 64 deep. */
static bool visit_discs(const cap_visit *v, uint64_t at)
{
    const ebpo_cap_tree *t = v->tree;
    const ebpo_cap_node *n = &t->node[at];
    if (ball_is_apart(n, v->low, v->high))
        return false;
    if (n->weight == 0)
        return visit_discs(v, n->from) || visit_discs(v, n->to);
    uint64_t m = ebpo_cap_middle(n->from, n->to), first = ebpo_cap_count(n->from, m);
    return visit_triangle(v, n) || (first && visit_discs(v, at + 1)) ||
           (ebpo_cap_count(m, n->to) && visit_discs(v, at + 1 + first));
}

bool ebpo_caps_visit(const ebpo_cap_tree *tree, const double low[3], const double high[3],
                     ebpo_cap_visit_fn *visit, void *context)
{
    const cap_visit v = { tree, low, high, visit, context };
    return tree->node_count && visit_discs(&v, 0);
}

static bool stop_visit(void *context, const double a[3], const double b[3], const double c[3],
                       uint32_t weight)
{
    (void)context, (void)a, (void)b, (void)c, (void)weight;
    return true;
}

bool ebpo_caps_near(const ebpo_cap_tree *tree, const double low[3], const double high[3])
{
    return ebpo_caps_visit(tree, low, high, stop_visit, NULL);
}

bool ebpo_cap_list_near(const ebpo_cap_tree *tree, const uint32_t *entry, uint64_t count,
                        const double low[3], const double high[3])
{
    const cap_visit v = { tree, low, high, stop_visit, NULL };
    for (uint64_t i = 0; i < count; i++)
        if (entry[i] & EBPO_CAP_TRIANGLE
                ? visit_triangle(&v, &tree->node[entry[i] & ~EBPO_CAP_TRIANGLE])
                : visit_discs(&v, entry[i]))
            return true;
    return false;
}
