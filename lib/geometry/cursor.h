/* A place in an octree: goes to children and back up, to a cell or to a point, whatever holds the
 * nodes. It keeps the way from the root, so that going up costs nothing and what was read on the
 * way down is not read again.
 *
 *     ebpo_cursor c;
 *     const ebpo_node *child;
 *     ebpo_cursor_begin(&c, &ebpo_level_source, &levels, ebpo_level_root(&levels));
 *     status = ebpo_cursor_children(&c, &child, error);
 *     if (status == EBPO_OK && child && child[5].type == EBPO_GRAY)
 *         ebpo_cursor_down(&c, 5);
 *
 * One thread; any number of cursors on what any number of threads may read. For queues of nodes in
 * an order of their own, ask the source itself: nodes are values. */
#ifndef EBPO_GEOMETRY_CURSOR_H
#define EBPO_GEOMETRY_CURSOR_H

#include "geometry/polytope.h"
#include "geometry/level_nodes.h"
#include "geometry/cells.h"

/* About 8 KB; not to be copied about. */
typedef struct ebpo_cursor {
    const ebpo_node_source *source;
    void *holder;
    int depth; /* below the node where it began */
    struct {
        ebpo_node node;
        bool asked; /* for children; there are some: */
        bool has_children;
        ebpo_node child[8];
    } at[EBPO_LEVELS_MAX];
} ebpo_cursor;

/* At `root`, above which it never goes: of a tree, or of any part of one. */
void ebpo_cursor_begin(ebpo_cursor *cursor, const ebpo_node_source *source, void *holder,
                       ebpo_node root);

/* The node at hand. Whether a gray node is pruned is certain after asking for its children. */
static inline const ebpo_node *ebpo_cursor_node(const ebpo_cursor *cursor)
{
    return &cursor->at[cursor->depth].node;
}

static inline ebpo_octcode ebpo_cursor_octcode(const ebpo_cursor *cursor)
{
    return ebpo_octcode_of_cell(ebpo_cursor_node(cursor)->cell);
}

/* The eight children of the node at hand, lent until the cursor leaves its subtree; NULL when it
 * has none: it is white, black, a leaf or pruned. */
EBPO_MUST_USE ebpo_status ebpo_cursor_children(ebpo_cursor *cursor, const ebpo_node **child,
                                               ebpo_error *error);

/* To a child, which ebpo_cursor_children has given. */
void ebpo_cursor_down(ebpo_cursor *cursor, unsigned octant);

/* To the parent; false at the root. */
bool ebpo_cursor_up(ebpo_cursor *cursor);

/* To the next node in depth-first order: the first child, or, without children or with `over`, what
 * comes after all that is below the node. *more is false after the last: it is at the root then. */
EBPO_MUST_USE ebpo_status ebpo_cursor_next(ebpo_cursor *cursor, bool over, bool *more,
                                           ebpo_error *error);

/* To the node of this cell, which lies in the root's; or to the deepest one around it, where the
 * tree does not go so deep. Steps up no farther than it must. */
EBPO_MUST_USE ebpo_status ebpo_cursor_to_cell(ebpo_cursor *cursor, ebpo_cell cell,
                                              ebpo_error *error);

/* To the deepest node around p, of `level` at most; *within is false, and nothing moves, when p is
 * outside the root's cell. */
EBPO_MUST_USE ebpo_status ebpo_cursor_to_point(ebpo_cursor *cursor, const ebpo_box *box,
                                               const double p[3], int level, bool *within,
                                               ebpo_error *error);

/* --- what the node at hand is --- */

/* Codes of its own planes. */
EBPO_MUST_USE ebpo_status ebpo_cursor_planes(ebpo_cursor *cursor, uint32_t codes[EBPO_NODE_PLANES],
                                             unsigned *count, ebpo_error *error);

/* Winding number of a white or black node of a solid. */
EBPO_MUST_USE ebpo_status ebpo_cursor_winding(ebpo_cursor *cursor, int32_t *winding,
                                              ebpo_error *error);

/* All that bounds it beside its cell, from the root of the tree down; with `own` its own planes,
 * too. */
EBPO_MUST_USE ebpo_status ebpo_cursor_half_spaces(ebpo_cursor *cursor, bool own,
                                                  ebpo_half_spaces *out, ebpo_error *error);

/* The same as a polytope in coordinates of its cell, with its own planes; of a black node the cell.
 * Lent by the stack, which serves this cursor alone. Both need a cursor that began at the root of
 * the whole tree. */
EBPO_MUST_USE ebpo_status ebpo_cursor_envelope(ebpo_cursor *cursor, ebpo_envelope_stack *stack,
                                               const ebpo_polytope **out, ebpo_error *error);

#endif
