/* Points, or things with boxes, in a tree of boxes, so that those near something are found without
 * looking at all. */
#ifndef EBPO_MESH_BOX_TREE_H
#define EBPO_MESH_BOX_TREE_H

#include <ebpo/workspace.h>

enum { EBPO_BOX_TREE_LEAF = 8 }; /* at most so many points in a node without halves */

typedef struct ebpo_tree_point {
    double at[3];
    uint32_t number; /* whose it is */
    int32_t value;
} ebpo_tree_point;

typedef struct ebpo_point_box {
    double min[3], max[3];
} ebpo_point_box;

/* Things have a point each, by which the tree divides them. Zero it to begin with, but for the
 * workspace, which owns the arrays. */
typedef struct ebpo_box_tree {
    ebpo_workspace *workspace;
    ebpo_tree_point *point; /* added in any order; building sorts them */
    uint64_t count, capacity;
    /* of points; 2 i + 1 and 2 i + 2 are the halves of i, the first of count / 2 points */
    ebpo_point_box *node;
    uint64_t node_capacity;
    /* as node: what the boxes of a node's things fill; NULL: there are points alone */
    ebpo_point_box *filled;
} ebpo_box_tree;

/* Returns room for one more; NULL when memory is short. */
ebpo_tree_point *ebpo_box_tree_add(ebpo_box_tree *tree);

typedef void (*ebpo_box_of_fn)(const void *user, const ebpo_tree_point *p, ebpo_point_box *out);

/* Builds the tree when all points have been added: of points alone, which may be built again, where
 * `box_of` is NULL; else of things with these boxes, once. False when memory is short. */
bool ebpo_box_tree_build(ebpo_box_tree *tree, ebpo_box_of_fn box_of, const void *user);
void ebpo_box_tree_free(ebpo_box_tree *tree);

/* `count` things, whose points are in one box and whose boxes fill the other; of points alone these
 * are one. */
typedef struct ebpo_box_node {
    const ebpo_point_box *points, *filled;
    uint64_t count;
} ebpo_box_node;

/* Nodes that are not wanted are not entered; false stops the walk. */
typedef bool (*ebpo_box_node_fn)(void *user, const ebpo_box_node *node);
typedef bool (*ebpo_tree_points_fn)(void *user, ebpo_tree_point *points, uint64_t count);
/* False when `visit` has stopped it. */
bool ebpo_box_tree_walk(const ebpo_box_tree *tree, ebpo_box_node_fn wanted,
                        ebpo_tree_points_fn visit, void *user);

#endif
