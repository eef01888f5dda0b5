/* Points in a tree of boxes, so that those near something are found without looking at all. */
#ifndef EBPO_MESH_BOX_TREE_H
#define EBPO_MESH_BOX_TREE_H

#include <ebpo/workspace.h>

enum { POINT_TREE_LEAF = 8 }; /* at most so many points in a node without halves */

typedef struct mesh_point {
    double at[3];
    uint32_t number; /* whose it is */
    int32_t value;
} mesh_point;

typedef struct point_box {
    double min[3], max[3];
} point_box;

/* Zero it to begin with, but for the workspace, which owns the arrays; it may be built again. */
typedef struct point_tree {
    ebpo_workspace *workspace;
    mesh_point *point; /* added in any order; building sorts them */
    uint64_t count, capacity;
    point_box *node; /* 2 i + 1 and 2 i + 2 are the halves of i, the first of count / 2 points */
    uint64_t node_capacity;
} point_tree;

/* Room for one more; NULL when memory is short. */
mesh_point *ebpo_point_tree_add(point_tree *tree);
/* False when memory is short. */
bool ebpo_point_tree_build(point_tree *tree);
void ebpo_point_tree_free(point_tree *tree);

/* Boxes that are not wanted are not entered; false stops the walk. */
typedef bool (*point_box_fn)(void *user, const point_box *box);
typedef bool (*points_fn)(void *user, mesh_point *points, uint64_t count);
/* False when `visit` has stopped it. */
bool ebpo_point_tree_walk(const point_tree *tree, point_box_fn wanted, points_fn visit, void *user);

/* Things with boxes in a tree: a point tree over a point of each, and what each node's boxes fill.
 */

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
