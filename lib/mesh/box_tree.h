/* Things with boxes in a tree: a point tree over a point of each, and what each node's boxes fill.
 */
#ifndef EBPO_MESH_BOX_TREE_H
#define EBPO_MESH_BOX_TREE_H

#include "mesh/point_tree.h"

/* Zero it to begin with, but for the workspace of `points`, which owns the arrays; it is built
 * once. */
typedef struct box_tree {
    point_tree points;
    point_box *filled; /* as points.node: what the boxes of a node's things fill together */
} box_tree;

typedef void (*box_of_fn)(const void *user, const mesh_point *p, point_box *out);

/* When all points have been added. False when memory is short. */
bool ebpo_box_tree_build(box_tree *tree, box_of_fn box_of, const void *user);
void ebpo_box_tree_free(box_tree *tree);

/* `count` things, whose points are in one box and whose boxes fill the other. */
typedef struct box_node {
    const point_box *points, *filled;
    uint64_t count;
} box_node;

/* Nodes that are not wanted are not entered; false stops the walk. */
typedef bool (*box_node_fn)(void *user, const box_node *node);
/* False when `visit` has stopped it. */
bool ebpo_box_tree_walk(const box_tree *tree, box_node_fn wanted, points_fn visit, void *user);

#endif
