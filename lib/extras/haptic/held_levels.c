/* Keeps the first levels of an octree in memory for probes. These levels give bounds of the
 * distance to the surface, and the winding numbers of cells without faces.
 *
 * Nodes of at most 6 levels below the root are kept; the caller limits their number. A node has its
 * box, its children, a flag for faces in or near its cell, and, if there are no such faces, its
 * winding number. Bounds are certain: they include the rounding of the model's coordinates. The
 * caller limits the number of visited nodes; with a smaller limit the bounds are wider. */
#include "core/strict_fp.h"

#include "extras/haptic/held_levels.h"

#include <ebpo/subtree.h>
#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "geometry/cells.h"

enum { DEEPEST = 6 };

static ebpo_status keep_nodes(const ebpo_file *file, const ebpo_subtree_nodes *nodes,
                              ebpo_held_levels *out, ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    ebpo_box box = ebpo_root_box(info);
    out->node = ebpo_alloc_zero(nodes->node_count, sizeof *out->node);
    if (!out->node)
        return ebpo_fail_memory(error, nodes->node_count * sizeof *out->node);
    out->count = nodes->node_count;
    for (int i = 0; i < 3; i++)
        out->slack += 0x1p-40 * (fabs(box.origin[i]) + box.size[i]);
    for (uint64_t i = 0; i < out->count; i++) {
        ebpo_held_node *n = &out->node[i];
        ebpo_cell_bounds(&box, ebpo_cell_of_octcode(nodes->octcodes[i]), n->low, n->high);
        n->children = nodes->children[i];
        n->has_faces = nodes->types[i] == EBPO_GRAY || nodes->types[i] == EBPO_LEAF;
        n->may_lack_faces =
            i > 0 && info->border_inside &&
            (nodes->types[i] == EBPO_LEAF || (info->pruned && n->children == EBPO_NO_CHILDREN));
        n->winding = nodes->windings ? nodes->windings[i] : 0;
    }
    return EBPO_OK;
}

ebpo_status ebpo_held_levels_read(const ebpo_file *file, uint64_t most, ebpo_held_levels *out,
                                  ebpo_error *error)
{
    *out = (ebpo_held_levels){ 0 };
    for (int levels = DEEPEST; levels >= 0; levels--) {
        ebpo_subtree_options options = EBPO_SUBTREE_OPTIONS_INIT;
        ebpo_subtree_nodes nodes = EBPO_SUBTREE_NODES_INIT;
        ebpo_subtree *tree = NULL;
        options.parts = 0;
        options.levels = levels;
        ebpo_status status = ebpo_subtree_open(file, 1, &options, &tree, error);
        if (status == EBPO_OK)
            status = ebpo_subtree_get_nodes(tree, &nodes);
        bool fits = status == EBPO_OK && (nodes.node_count <= most || levels == 0);
        if (fits)
            status = keep_nodes(file, &nodes, out, error);
        ebpo_subtree_close(tree);
        if (fits || status != EBPO_OK)
            return status;
    }
    return EBPO_OK;
}

void ebpo_held_levels_free(ebpo_held_levels *levels)
{
    free(levels->node);
    *levels = (ebpo_held_levels){ 0 };
}

/* Returns the distance of p from the cell of a node. */
static double distance_to_cell(const ebpo_held_node *n, const double p[3])
{
    double square = 0;
    for (int i = 0; i < 3; i++) {
        double d = fmax(0, fmax(n->low[i] - p[i], p[i] - n->high[i]));
        square += d * d;
    }
    return sqrt(square);
}

/* Returns the distance of p from the farthest corner of the cell of a node. */
static double distance_to_far_corner(const ebpo_held_node *n, const double p[3])
{
    double square = 0;
    for (int i = 0; i < 3; i++) {
        double d = fmax(fabs(n->low[i] - p[i]), fabs(n->high[i] - p[i]));
        square += d * d;
    }
    return sqrt(square);
}

typedef struct waiting_node {
    uint32_t node;
    double lower; /* distance of the query point from the node's cell */
} waiting_node;

/* Pushes the children with faces whose distance is below `limit` onto the stack, the nearest child
 * last. */
static void add_children(const ebpo_held_levels *levels, const double p[3], uint32_t first,
                         double limit, waiting_node *stack, int *depth)
{
    int begin = *depth;
    for (uint32_t c = first; c < first + 8; c++) {
        if (!levels->node[c].has_faces)
            continue;
        double lower = distance_to_cell(&levels->node[c], p);
        if (!(lower < limit))
            continue;
        int at = (*depth)++;
        for (; at > begin && stack[at - 1].lower < lower; at--)
            stack[at] = stack[at - 1];
        stack[at] = (waiting_node){ c, lower };
    }
}

void ebpo_held_levels_bound(const ebpo_held_levels *levels, const double p[3], int visits,
                            double *lo, double *hi)
{
    waiting_node stack[8 * (DEEPEST + 1)]; /* each level adds at most seven waiting nodes */
    int depth = 0;
    double lower = INFINITY, upper = INFINITY;
    if (levels->node[0].has_faces)
        stack[depth++] = (waiting_node){ 0, distance_to_cell(&levels->node[0], p) };
    while (depth > 0) {
        waiting_node w = stack[--depth];
        const ebpo_held_node *n = &levels->node[w.node];
        if (!(w.lower < lower))
            continue;
        if (!n->may_lack_faces)
            upper = fmin(upper, distance_to_far_corner(n, p));
        if (n->children == EBPO_NO_CHILDREN || visits-- <= 0)
            lower = w.lower;
        else
            add_children(levels, p, n->children, lower, stack, &depth);
    }
    /* both bounds are infinite if the model has no faces */
    *lo = isfinite(lower) ? fmax(0, lower - levels->slack - EBPO_LENGTH_SLACK * lower) : lower;
    *hi = upper + levels->slack + EBPO_LENGTH_SLACK * upper;
}

bool ebpo_held_levels_winding(const ebpo_held_levels *levels, const double p[3], double margin,
                              int32_t *winding)
{
    const ebpo_held_node *n = &levels->node[0];
    double away = distance_to_cell(n, p);
    *winding = 0;
    if (away > 0)
        return away > 2 * margin;
    while (n->children != EBPO_NO_CHILDREN) {
        uint32_t octant = 0;
        const ebpo_held_node *low = &levels->node[n->children]; /* first child; its high corner is
                                                                 * the middle of the cell */
        for (int i = 0; i < 3; i++)
            octant |= (uint32_t)(p[i] >= low->high[i]) << i;
        n = low + octant;
    }
    for (int i = 0; i < 3; i++)
        if (p[i] - margin < n->low[i] || p[i] + margin > n->high[i])
            return false;
    *winding = n->winding;
    return !n->has_faces;
}
