/* Points in a tree of boxes, so that those near something are found without looking at all. */
#ifndef EBPO_MESH_BOX_TREE_H
#define EBPO_MESH_BOX_TREE_H

#include <ebpo/workspace.h>

enum { EBPO_POINT_TREE_LEAF = 8 }; /* at most so many points in a node without halves */

typedef struct ebpo_tree_point {
    double at[3];
    uint32_t number; /* whose it is */
    int32_t value;
} ebpo_tree_point;

typedef struct ebpo_point_box {
    double min[3], max[3];
} ebpo_point_box;

/* Zero it to begin with, but for the workspace, which owns the arrays; it may be built again. */
typedef struct ebpo_point_tree {
    ebpo_workspace *workspace;
    ebpo_tree_point *point; /* added in any order; building sorts them */
    uint64_t count, capacity;
    ebpo_point_box
        *node; /* 2 i + 1 and 2 i + 2 are the halves of i, the first of count / 2 points */
    uint64_t node_capacity;
} ebpo_point_tree;

/* Room for one more; NULL when memory is short. */
ebpo_tree_point *ebpo_point_tree_add(ebpo_point_tree *tree);
/* False when memory is short. */
bool ebpo_point_tree_build(ebpo_point_tree *tree);
void ebpo_point_tree_free(ebpo_point_tree *tree);

/* Boxes that are not wanted are not entered; false stops the walk. */
typedef bool (*ebpo_point_box_fn)(void *user, const ebpo_point_box *box);
typedef bool (*ebpo_tree_points_fn)(void *user, ebpo_tree_point *points, uint64_t count);
/* False when `visit` has stopped it. */
bool ebpo_point_tree_walk(const ebpo_point_tree *tree, ebpo_point_box_fn wanted,
                          ebpo_tree_points_fn visit, void *user);

/* Things with boxes in a tree: a point tree over a point of each, and what each node's boxes fill.
 */

/* Zero it to begin with, but for the workspace of `points`, which owns the arrays; it is built
 * once. */
typedef struct ebpo_box_tree {
    ebpo_point_tree points;
    ebpo_point_box *filled; /* as points.node: what the boxes of a node's things fill together */
} ebpo_box_tree;

typedef void (*ebpo_box_of_fn)(const void *user, const ebpo_tree_point *p, ebpo_point_box *out);

/* When all points have been added. False when memory is short. */
bool ebpo_box_tree_build(ebpo_box_tree *tree, ebpo_box_of_fn box_of, const void *user);
void ebpo_box_tree_free(ebpo_box_tree *tree);

/* `count` things, whose points are in one box and whose boxes fill the other. */
typedef struct ebpo_box_node {
    const ebpo_point_box *points, *filled;
    uint64_t count;
} ebpo_box_node;

/* Nodes that are not wanted are not entered; false stops the walk. */
typedef bool (*ebpo_box_node_fn)(void *user, const ebpo_box_node *node);
/* False when `visit` has stopped it. */
bool ebpo_box_tree_walk(const ebpo_box_tree *tree, ebpo_box_node_fn wanted,
                        ebpo_tree_points_fn visit, void *user);

#endif
