/* Builds a tree of boxes over points, or over items with boxes, to find neighbours without
 * comparing all pairs. */
#ifndef EBPO_MESH_BOX_TREE_H
#define EBPO_MESH_BOX_TREE_H

#include <ebpo/workspace.h>

enum { EBPO_BOX_TREE_LEAF = 8 }; /* maximum number of points in a leaf node */

typedef struct ebpo_tree_point {
    double at[3];
    uint32_t number; /* index of the point's item, set by the caller */
    int32_t value;   /* any value of the caller; the tree does not use it */
} ebpo_tree_point;

typedef struct ebpo_point_box {
    double min[3], max[3];
} ebpo_point_box;

/* A tree of items, each with a point by which the tree divides the items. Initialise the struct
 * with zeros, except the workspace, which owns the arrays. */
typedef struct ebpo_box_tree {
    ebpo_workspace *workspace;
    ebpo_tree_point *point; /* added in any order; sorted by the build */
    uint64_t count, capacity;
    /* for each node, the box of its points. Nodes 2 i + 1 and 2 i + 2 are the halves of node i. If
     * node i has n points, node 2 i + 1 has n / 2 (rounded down) of them */
    ebpo_point_box *node;
    uint64_t node_capacity;
    /* for each node, the box that contains the boxes of its items; NULL: a tree of points */
    ebpo_point_box *filled;
} ebpo_box_tree;

/* Appends a point, and returns the address where the caller stores it. Returns NULL when out of
 * memory. */
ebpo_tree_point *ebpo_box_tree_add(ebpo_box_tree *tree);

/* Writes the box of an item. */
typedef void (*ebpo_box_of_fn)(const void *user, const ebpo_tree_point *p, ebpo_point_box *out);

/* Builds the tree after all points are added. If `box_of` is NULL, the tree is a tree of points,
 * which may be built again after further points are added. Otherwise the tree is a tree of items
 * with these boxes, and may be built only once. Returns false when out of memory. */
bool ebpo_box_tree_build(ebpo_box_tree *tree, ebpo_box_of_fn box_of, const void *user);
void ebpo_box_tree_free(ebpo_box_tree *tree);

/* A node of `count` items, with the box of the items' points and the box that contains the items'
 * boxes. In a tree of points, `points` and `filled` are equal. */
typedef struct ebpo_box_node {
    const ebpo_point_box *points, *filled;
    uint64_t count;
} ebpo_box_node;

/* An ebpo_box_node_fn returns false to skip a node. An ebpo_tree_points_fn receives the points of a
 * leaf node, and returns false to stop the walk. */
typedef bool (*ebpo_box_node_fn)(void *user, const ebpo_box_node *node);
typedef bool (*ebpo_tree_points_fn)(void *user, ebpo_tree_point *points, uint64_t count);
/* Walks the tree: calls `wanted` for nodes and `visit` for leaf nodes. Returns false if `visit`
 * stopped the walk. */
bool ebpo_box_tree_walk(const ebpo_box_tree *tree, ebpo_box_node_fn wanted,
                        ebpo_tree_points_fn visit, void *user);

#endif
