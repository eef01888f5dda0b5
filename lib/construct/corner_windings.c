/* Computes winding numbers at the corners of cells. The winding number of a corner decides whether
 * the corner is inside the solid. The winding number of a cell without faces decides whether the
 * whole cell is inside.
 *
 * In one cell, the winding numbers at two corners differ by the sum of the signed crossings of
 * faces along the cell's edges between the two corners. All corners are shifted by the same
 * infinitely small amount, so a face through a corner is no special case (ebpo_axis_crossing). Each
 * node of the tree stores corner differences: the winding numbers at its corners minus the winding
 * number at its corner 0, the lowest corner. The corner differences of a gray node are computed
 * from the corner differences of its children: they are added along the children's edges. The
 * root's lowest corner is outside the model: its winding number is 0. This method replaces the
 * special cases of BP 2008, 3.4.1.1. If two paths to a corner give different winding numbers, some
 * edge of the mesh is not used equally often in both directions. Such a mesh does not bound a
 * solid. */
#include "core/strict_fp.h"

#include <string.h>

#include "construct/capped.h"
#include "construct/construct_stages.h"
#include "construct/planes.h"
#include "core/error.h"

/* --- the corners of a tree's nodes --- */

void ebpo_branch_corners(const ebpo_builder *b, const ebpo_branch *s, ebpo_cell cell,
                         const uint32_t *entries, uint64_t count, ebpo_triangle *buffer,
                         int32_t delta[8])
{
    memset(delta, 0, 8 * sizeof *delta);
    ebpo_workspace *workspace = count < EBPO_CORNER_FACES ? NULL : b->workspace;
    EBPO_FOR_PIECES(workspace, first, count, EBPO_CORNER_FACES) {
        uint64_t part = count - first < EBPO_CORNER_FACES ? count - first : EBPO_CORNER_FACES;
        int32_t part_delta[8];
        for (uint64_t i = 0; i < part; i++)
            ebpo_branch_triangle(b, s, entries ? entries[first + i] : (uint32_t)(first + i),
                                 &buffer[i]);
        ebpo_corner_windings(&b->box, cell, buffer, part, part_delta);
        for (int i = 0; i < 8; i++)
            delta[i] += part_delta[i];
    }
    if (b->capped)
        ebpo_capped_add_corners(b->capped, cell, delta);
}

/* Computes the offsets of the children (ebpo_child_windings). Returns false if two paths to a
 * child's corner 0 give different offsets. */
static bool child_offsets(const int32_t *child_delta[8], int32_t offset[8])
{
    offset[0] = 0;
    bool agree = true;
    for (int i = 1; i < 8; i++) {
        bool known = false;
        for (int axis = 0; axis < 3; axis++) {
            if (!(i >> axis & 1))
                continue;
            int before = i & ~(1 << axis);
            int32_t winding = offset[before] + child_delta[before][1 << axis];
            agree = agree && (!known || winding == offset[i]);
            offset[i] = winding;
            known = true;
        }
    }
    return agree;
}

/* Sets child_delta[o] to the corner differences of child o; those of an empty child are zero,
 * except for the crossings of caps, which are written to `caps`. `cell`: the parent's cell;
 * `child`: index of the first child's node. */
static void child_deltas(const ebpo_builder *b, const ebpo_branch *s, ebpo_cell cell,
                         uint32_t child, int32_t caps[8][8], const int32_t *child_delta[8])
{
    static const int32_t none[8];
    for (uint32_t o = 0; o < 8; o++) {
        const ebpo_build_node *n = &s->nodes[child + o];
        if (n->type == EBPO_WHITE && b->capped) {
            memset(caps[o], 0, sizeof caps[o]);
            ebpo_capped_add_corners(b->capped, ebpo_cell_child(cell, o), caps[o]);
            child_delta[o] = caps[o];
        } else if (n->type == EBPO_WHITE)
            child_delta[o] = none;
        else if (s == &b->top && n->type == EBPO_LEAF)
            child_delta[o] = b->piece[n->detail].root_delta;
        else
            child_delta[o] = s->details[n->detail].delta;
    }
}

void ebpo_child_windings(const ebpo_builder *b, const ebpo_branch *s, ebpo_cell cell,
                         uint32_t child, int32_t offset[8])
{
    const int32_t *child_delta[8];
    int32_t caps[8][8];
    child_deltas(b, s, cell, child, caps, child_delta);
    child_offsets(child_delta, offset);
}

bool ebpo_gather_delta(const ebpo_builder *b, const ebpo_branch *s, ebpo_cell cell, uint32_t child,
                       int32_t delta[8])
{
    const int32_t *child_delta[8];
    int32_t offset[8], caps[8][8];
    child_deltas(b, s, cell, child, caps, child_delta);
    bool agree = child_offsets(child_delta, offset);
    for (int i = 0; i < 8; i++)
        delta[i] = offset[i] + child_delta[i][i];
    return agree;
}

/* Computes the corner differences of a node of the top and of all nodes below. Returns false if
 * they disagree (ebpo_gather_delta). */
static bool top_deltas(ebpo_builder *b, uint32_t index, ebpo_cell cell)
{
    ebpo_branch *s = &b->top;
    ebpo_build_node *node = &s->nodes[index];
    if (node->type != EBPO_GRAY)
        return true;
    bool agree = true;
    for (uint32_t o = 0; o < 8; o++)
        agree = top_deltas(b, node->child + o, ebpo_cell_child(cell, o)) && agree;
    return ebpo_gather_delta(b, s, cell, node->child, s->details[node->detail].delta) && agree;
}

ebpo_status ebpo_build_corner_windings(ebpo_builder *b, ebpo_error *error)
{
    if (!ebpo_build_closed(b))
        return EBPO_OK;
    if (!top_deltas(b, 0, b->top.cell))
        return ebpo_fail(
            error, EBPO_E_NOT_SOLID,
            "winding numbers disagree: the mesh does not balance; check it again before building");
    return EBPO_OK;
}

unsigned ebpo_inside_corners(const ebpo_builder *b, int32_t winding, const int32_t delta[8])
{
    unsigned mask = 0;
    if (ebpo_build_closed(b))
        for (int i = 0; i < 8; i++)
            if (ebpo_rule_inside(b->options->rule, winding + delta[i]))
                mask |= 1u << i;
    return mask;
}

unsigned ebpo_leaf_corners(const ebpo_builder *b, ebpo_cell cell, int32_t winding,
                           const int32_t delta[8])
{
    return b->capped && ebpo_capped_overlap(b->capped, cell) != EBPO_CAP_NONE
               ? 0xff
               : ebpo_inside_corners(b, winding, delta);
}

ebpo_node_type ebpo_empty_type(const ebpo_builder *b, ebpo_cell cell, int32_t winding)
{
    if (b->capped)
        return ebpo_capped_may_hold(b->capped, cell, winding) ? EBPO_LEAF : EBPO_WHITE;
    return b->solid && ebpo_rule_inside(b->options->rule, winding) ? EBPO_BLACK : EBPO_WHITE;
}
