/* Defines a cursor: a position in an octree, which moves to children and parents, to a cell or to a
 * point. A holder is a data structure that has the nodes: levels in memory, a file, or tables. A
 * cursor reads the nodes of any holder through the holder's ebpo_node_source. The cursor stores the
 * path from the root, so moves to a parent take almost no time, and nodes are not read again.
 *
 *     ebpo_cursor c;
 *     const ebpo_node *child;
 *     ebpo_cursor_begin(&c, &ebpo_level_source, &levels, ebpo_level_root(&levels));
 *     status = ebpo_cursor_children(&c, &child, error);
 *     if (status == EBPO_OK && child && child[5].type == EBPO_GRAY)
 *         ebpo_cursor_down(&c, 5);
 *
 * A cursor is for one thread. Cursors of several threads may use the same holder if the holder
 * allows reads by several threads. For a traversal in another order, use a queue of nodes and the
 * source itself: nodes are values. */
#ifndef EBPO_GEOMETRY_CURSOR_H
#define EBPO_GEOMETRY_CURSOR_H

#include "geometry/polytope.h"
#include "geometry/level_nodes.h"
#include "geometry/cells.h"

/* A cursor takes about 8 KB; avoid copies. */
typedef struct ebpo_cursor {
    const ebpo_node_source *source; /* functions of the holder */
    void *holder;
    int depth; /* depth of the current node below the root of the cursor */
    struct {
        ebpo_node node;
        bool requested; /* the children were requested: has_children is valid */
        bool has_children;
        ebpo_node child[8];
    } at[EBPO_LEVELS_MAX]; /* [depth + 1] the path from the root to the current node */
} ebpo_cursor;

/* Begins at `root`, which is the root of a tree or of any part of a tree. The cursor never moves
 * above this node. */
void ebpo_cursor_begin(ebpo_cursor *cursor, const ebpo_node_source *source, void *holder,
                       ebpo_node root);

/* Returns the current node. The member `pruned` of a gray node is valid only after the children
 * were requested. */
static inline const ebpo_node *ebpo_cursor_node(const ebpo_cursor *cursor)
{
    return &cursor->at[cursor->depth].node;
}

static inline ebpo_octcode ebpo_cursor_octcode(const ebpo_cursor *cursor)
{
    return ebpo_octcode_of_cell(ebpo_cursor_node(cursor)->cell);
}

/* Sets *child to the eight children of the current node, which are valid until the cursor leaves
 * the node's subtree. Sets *child to NULL if the node has no children, because it is white, black,
 * a leaf or pruned. */
EBPO_MUST_USE ebpo_status ebpo_cursor_children(ebpo_cursor *cursor, const ebpo_node **child,
                                               ebpo_error *error);

/* Moves to a child, which ebpo_cursor_children has returned. */
void ebpo_cursor_down(ebpo_cursor *cursor, unsigned octant);

/* Moves to the parent; returns false at the root. */
bool ebpo_cursor_up(ebpo_cursor *cursor);

/* Moves to the next node in depth-first order: the first child, or else the node after the subtree.
 * If `over` is true, skips the children. After the last node, *more is false and the cursor is at
 * the root. */
EBPO_MUST_USE ebpo_status ebpo_cursor_next(ebpo_cursor *cursor, bool over, bool *more,
                                           ebpo_error *error);

/* Moves to the node of `cell`. If the tree is less deep there, moves to the deepest node that
 * contains this cell. `cell` must be within the root's cell. Moves up no further than necessary. */
EBPO_MUST_USE ebpo_status ebpo_cursor_to_cell(ebpo_cursor *cursor, ebpo_cell cell,
                                              ebpo_error *error);

/* Moves to the deepest node that contains p and is not below level `level`. When p is outside the
 * root's cell, *within is false and the cursor does not move. */
EBPO_MUST_USE ebpo_status ebpo_cursor_to_point(ebpo_cursor *cursor, const ebpo_box *box,
                                               const double p[3], int level, bool *within,
                                               ebpo_error *error);

/* --- properties of the current node --- */

/* Returns the codes of the node's own planes, without the planes of its ancestors. */
EBPO_MUST_USE ebpo_status ebpo_cursor_planes(ebpo_cursor *cursor, uint32_t codes[EBPO_NODE_PLANES],
                                             unsigned *count, ebpo_error *error);

/* Returns the winding number of a white or black node of a solid. */
EBPO_MUST_USE ebpo_status ebpo_cursor_winding(ebpo_cursor *cursor, int32_t *winding,
                                              ebpo_error *error);

/* Returns the half-spaces that bound the node's envelope within its cell: the planes of its
 * ancestors from the root down and, if `own` is true, its own planes. */
EBPO_MUST_USE ebpo_status ebpo_cursor_half_spaces(ebpo_cursor *cursor, bool own,
                                                  ebpo_half_spaces *out, ebpo_error *error);

/* Sets *out to the node's envelope, as a polytope in coordinates of the node's cell. The planes of
 * the ancestors and the node's own planes bound the envelope; the envelope of a black node is the
 * cell. The polytope is valid until the next call with `stack`, which must be used only with this
 * cursor. This function and ebpo_cursor_half_spaces need a cursor that began at the root of the
 * whole tree. */
EBPO_MUST_USE ebpo_status ebpo_cursor_envelope(ebpo_cursor *cursor, ebpo_envelope_stack *stack,
                                               const ebpo_polytope **out, ebpo_error *error);

#endif
