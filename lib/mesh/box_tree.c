/* Trees of boxes: of points, and of faces, whose tree is built on that of their middles. */
#include "core/strict_fp.h"

#include "core/workspace.h"
#include "mesh/box_tree.h"

ebpo_tree_point *ebpo_point_tree_add(ebpo_point_tree *tree)
{
    if (!ebpo_array_grow_late(tree->workspace, &tree->point, &tree->capacity, tree->count + 1,
                              sizeof *tree->point))
        return NULL;
    return &tree->point[tree->count++];
}

void ebpo_point_tree_free(ebpo_point_tree *tree)
{
    ebpo_array_free(tree->workspace, tree->point);
    ebpo_array_free(tree->workspace, tree->node);
}

static ebpo_point_box box_of_points(const ebpo_tree_point *p, uint64_t count)
{
    ebpo_point_box box;
    for (int k = 0; k < 3; k++)
        box.min[k] = box.max[k] = p[0].at[k];
    for (uint64_t i = 1; i < count; i++)
        for (int k = 0; k < 3; k++) {
            box.min[k] = p[i].at[k] < box.min[k] ? p[i].at[k] : box.min[k];
            box.max[k] = p[i].at[k] > box.max[k] ? p[i].at[k] : box.max[k];
        }
    return box;
}

/* Halves, as their difference may be beyond the doubles. */
static int longest_axis(const ebpo_point_box *box)
{
    int best = 0;
    double most = -1;
    for (int k = 0; k < 3; k++) {
        double length = box->max[k] / 2 - box->min[k] / 2;
        if (length > most)
            best = k, most = length;
    }
    return best;
}

static void swap_points(ebpo_tree_point *a, ebpo_tree_point *b)
{
    ebpo_tree_point t = *a;
    *a = *b;
    *b = t;
}

/* What is before p[middle] is not greater along the axis, what is behind it not less (Hoare). */
static void split_points(ebpo_tree_point *p, uint64_t count, uint64_t middle, int axis)
{
    uint64_t low = 0, high = count - 1;
    while (low < high) {
        double pivot = p[low + (high - low) / 2].at[axis];
        uint64_t i = low, j = high;
        for (;;) {
            while (p[i].at[axis] < pivot)
                i++;
            while (p[j].at[axis] > pivot)
                j--;
            if (i >= j)
                break;
            swap_points(&p[i++], &p[j--]);
        }
        if (middle <= j)
            high = j;
        else
            low = j + 1;
    }
}

static void build_node(const ebpo_point_tree *tree, uint64_t node, ebpo_tree_point *p,
                       uint64_t count)
{
    tree->node[node] = box_of_points(p, count);
    if (count <= EBPO_POINT_TREE_LEAF)
        return;
    split_points(p, count, count / 2, longest_axis(&tree->node[node]));
    build_node(tree, 2 * node + 1, p, count / 2);
    build_node(tree, 2 * node + 2, p + count / 2, count - count / 2);
}

bool ebpo_point_tree_build(ebpo_point_tree *tree)
{
    uint64_t nodes = 1;
    for (uint64_t most = tree->count; most > EBPO_POINT_TREE_LEAF; most -= most / 2)
        nodes = 2 * nodes + 1;
    if (tree->count == 0)
        return true;
    if (!ebpo_array_grow_late(tree->workspace, &tree->node, &tree->node_capacity, nodes,
                              sizeof *tree->node))
        return false;
    build_node(tree, 0, tree->point, tree->count);
    return true;
}

typedef struct point_walking {
    const ebpo_point_tree *tree;
    ebpo_point_box_fn wanted;
    ebpo_tree_points_fn visit;
    void *user;
} point_walking;

static bool walk_points(const point_walking *w, uint64_t node, ebpo_tree_point *p, uint64_t count)
{
    if (!w->wanted(w->user, &w->tree->node[node]))
        return true;
    if (count <= EBPO_POINT_TREE_LEAF)
        return w->visit(w->user, p, count);
    return walk_points(w, 2 * node + 1, p, count / 2) &&
           walk_points(w, 2 * node + 2, p + count / 2, count - count / 2);
}

bool ebpo_point_tree_walk(const ebpo_point_tree *tree, ebpo_point_box_fn wanted,
                          ebpo_tree_points_fn visit, void *user)
{
    point_walking w = { tree, wanted, visit, user };
    return tree->count == 0 || walk_points(&w, 0, tree->point, tree->count);
}

typedef struct filling {
    ebpo_box_tree *tree;
    ebpo_box_of_fn box_of;
    const void *user;
} filling;

static void join_boxes(ebpo_point_box *box, const ebpo_point_box *other)
{
    for (int k = 0; k < 3; k++) {
        box->min[k] = other->min[k] < box->min[k] ? other->min[k] : box->min[k];
        box->max[k] = other->max[k] > box->max[k] ? other->max[k] : box->max[k];
    }
}

static void fill_node(const filling *f, uint64_t node, const ebpo_tree_point *p, uint64_t count)
{
    ebpo_point_box *box = &f->tree->filled[node], other;
    if (count <= EBPO_POINT_TREE_LEAF) {
        f->box_of(f->user, &p[0], box);
        for (uint64_t i = 1; i < count; i++) {
            f->box_of(f->user, &p[i], &other);
            join_boxes(box, &other);
        }
        return;
    }
    fill_node(f, 2 * node + 1, p, count / 2);
    fill_node(f, 2 * node + 2, p + count / 2, count - count / 2);
    *box = f->tree->filled[2 * node + 1];
    join_boxes(box, &f->tree->filled[2 * node + 2]);
}

bool ebpo_box_tree_build(ebpo_box_tree *tree, ebpo_box_of_fn box_of, const void *user)
{
    filling f = { tree, box_of, user };
    ebpo_point_tree *points = &tree->points;
    if (points->count == 0)
        return true;
    if (!ebpo_point_tree_build(points))
        return false;
    tree->filled = ebpo_array_alloc(points->workspace, points->node_capacity, sizeof *tree->filled);
    if (!tree->filled)
        return false;
    fill_node(&f, 0, points->point, points->count);
    return true;
}

void ebpo_box_tree_free(ebpo_box_tree *tree)
{
    ebpo_array_free(tree->points.workspace, tree->filled);
    ebpo_point_tree_free(&tree->points);
}

typedef struct box_walking {
    const ebpo_box_tree *tree;
    ebpo_box_node_fn wanted;
    ebpo_tree_points_fn visit;
    void *user;
} box_walking;

static bool walk_boxes(const box_walking *w, uint64_t node, ebpo_tree_point *p, uint64_t count)
{
    ebpo_box_node n = { &w->tree->points.node[node], &w->tree->filled[node], count };
    if (!w->wanted(w->user, &n))
        return true;
    if (count <= EBPO_POINT_TREE_LEAF)
        return w->visit(w->user, p, count);
    return walk_boxes(w, 2 * node + 1, p, count / 2) &&
           walk_boxes(w, 2 * node + 2, p + count / 2, count - count / 2);
}

bool ebpo_box_tree_walk(const ebpo_box_tree *tree, ebpo_box_node_fn wanted,
                        ebpo_tree_points_fn visit, void *user)
{
    box_walking w = { tree, wanted, visit, user };
    return tree->points.count == 0 || walk_boxes(&w, 0, tree->points.point, tree->points.count);
}
