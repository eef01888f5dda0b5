/* Moves a position in an octree from node to node. A holder is the data structure that has the
 * nodes; the cursor works for any holder.
 *
 * The cursor keeps the nodes from the root down to the current node, each with its children once
 * they have been read. Therefore a move to a parent reads nothing, and a move to a nearby cell
 * reads only nodes below the common ancestor. The functions of an ebpo_node_source read nodes from
 * the holder: levels in memory, a file, or the tables of a decoded tree. */
#include "core/strict_fp.h"

#include "geometry/cursor.h"

#include <string.h>

/* Makes `node` the current node, `depth` levels below the root of the cursor. */
static void arrive_at(ebpo_cursor *c, int depth, const ebpo_node *node)
{
    c->depth = depth;
    c->at[depth].node = *node;
    c->at[depth].requested = c->at[depth].has_children = false;
}

void ebpo_cursor_begin(ebpo_cursor *c, const ebpo_node_source *source, void *holder, ebpo_node root)
{
    c->source = source;
    c->holder = holder;
    arrive_at(c, 0, &root);
}

ebpo_status ebpo_cursor_children(ebpo_cursor *c, const ebpo_node **child, ebpo_error *error)
{
    ebpo_node *node = &c->at[c->depth].node;
    *child = NULL;
    if (!c->at[c->depth].requested && node->type == EBPO_GRAY && !node->pruned) {
        ebpo_status status = c->source->children(c->holder, node, c->at[c->depth].child, error);
        if (status != EBPO_OK)
            return status;
        c->at[c->depth].has_children = !node->pruned;
    }
    c->at[c->depth].requested = true;
    if (c->at[c->depth].has_children)
        *child = c->at[c->depth].child;
    return EBPO_OK;
}

void ebpo_cursor_down(ebpo_cursor *c, unsigned octant)
{
    arrive_at(c, c->depth + 1, &c->at[c->depth].child[octant]);
}

bool ebpo_cursor_up(ebpo_cursor *c)
{
    if (c->depth == 0)
        return false;
    c->depth--;
    return true;
}

ebpo_status ebpo_cursor_next(ebpo_cursor *c, bool over, bool *more, ebpo_error *error)
{
    const ebpo_node *child = NULL;
    ebpo_status status = over ? EBPO_OK : ebpo_cursor_children(c, &child, error);
    *more = status == EBPO_OK;
    if (child) {
        ebpo_cursor_down(c, 0);
        return status;
    }
    while (status == EBPO_OK && *more) {
        ebpo_cell cell = ebpo_cursor_node(c)->cell;
        unsigned next = ebpo_octant_at(cell.at, 0) + 1;
        *more = ebpo_cursor_up(c);
        if (*more && next < 8) {
            ebpo_cursor_down(c, next);
            break;
        }
    }
    return status;
}

/* Returns true if the node's cell contains `cell`. */
static bool node_holds(const ebpo_node *node, ebpo_cell cell)
{
    return node->cell.level <= cell.level &&
           ebpo_cell_equal(ebpo_cell_ancestor(cell, node->cell.level), node->cell);
}

ebpo_status ebpo_cursor_to_cell(ebpo_cursor *c, ebpo_cell cell, ebpo_error *error)
{
    const ebpo_node *child = NULL;
    ebpo_status status = EBPO_OK;
    while (!node_holds(ebpo_cursor_node(c), cell) && ebpo_cursor_up(c))
        ;
    while (ebpo_cursor_node(c)->cell.level < cell.level) {
        status = ebpo_cursor_children(c, &child, error);
        if (status != EBPO_OK || !child)
            break;
        ebpo_cursor_down(c, ebpo_cell_octant(cell, ebpo_cursor_node(c)->cell.level));
    }
    return status;
}

ebpo_status ebpo_cursor_to_point(ebpo_cursor *c, const ebpo_box *box, const double p[3], int level,
                                 bool *within, ebpo_error *error)
{
    ebpo_cell cell = { level, { 0, 0, 0 } };
    *within = ebpo_locate(box, level, p, cell.at) && node_holds(&c->at[0].node, cell);
    return *within ? ebpo_cursor_to_cell(c, cell, error) : EBPO_OK;
}

ebpo_status ebpo_cursor_planes(ebpo_cursor *c, uint32_t codes[EBPO_NODE_PLANES], unsigned *count,
                               ebpo_error *error)
{
    return c->source->planes(c->holder, ebpo_cursor_node(c), codes, count, error);
}

ebpo_status ebpo_cursor_winding(ebpo_cursor *c, int32_t *winding, ebpo_error *error)
{
    return c->source->winding(c->holder, ebpo_cursor_node(c), winding, error);
}

ebpo_status ebpo_cursor_half_spaces(ebpo_cursor *c, bool own, ebpo_half_spaces *out,
                                    ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    out->count = 0;
    for (int depth = 0; depth <= c->depth && status == EBPO_OK; depth++) {
        uint32_t codes[EBPO_NODE_PLANES];
        unsigned count = 0;
        const ebpo_node *node = &c->at[depth].node;
        if (depth)
            ebpo_half_spaces_to_child(out, ebpo_octant_at(node->cell.at, 0));
        if (depth < c->depth || own)
            status = c->source->planes(c->holder, node, codes, &count, error);
        if (status == EBPO_OK)
            ebpo_half_spaces_add(out, codes, count);
    }
    return status;
}

ebpo_status ebpo_cursor_envelope(ebpo_cursor *c, ebpo_envelope_stack *stack,
                                 const ebpo_polytope **out, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    *out = NULL;
    if (ebpo_cursor_node(c)->type == EBPO_BLACK) {
        *out = ebpo_envelope_put_cube(stack, ebpo_cursor_octcode(c));
        return EBPO_OK;
    }
    for (int depth = 0; depth <= c->depth && status == EBPO_OK; depth++) {
        uint32_t codes[EBPO_NODE_PLANES];
        unsigned count;
        ebpo_octcode code = ebpo_octcode_of_cell(c->at[depth].node.cell);
        if ((*out = ebpo_envelope_held(stack, code)))
            continue;
        status = c->source->planes(c->holder, &c->at[depth].node, codes, &count, error);
        if (status == EBPO_OK)
            *out = ebpo_envelope_put(stack, code, codes, count);
    }
    return status;
}
