/* Builds box trees of points and of items, such as faces. The tree divides items by one point of
 * each item, for example the centre of a face. */
#include "core/strict_fp.h"

#include "core/workspace.h"
#include "mesh/box_tree.h"

ebpo_tree_point *ebpo_box_tree_add(ebpo_box_tree *tree)
{
    if (!ebpo_array_grow_late(tree->workspace, &tree->point, &tree->capacity, tree->count + 1,
                              sizeof *tree->point))
        return NULL;
    return &tree->point[tree->count++];
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

/* Returns the axis of the longest side. Compares half lengths, because the full difference may
 * overflow. */
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

/* Reorders the points (Hoare's selection): along the axis, no point before p[middle] has a greater
 * coordinate than p[middle], and no point after p[middle] has a lesser coordinate. */
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

static void build_node(const ebpo_box_tree *tree, uint64_t node, ebpo_tree_point *p, uint64_t count)
{
    tree->node[node] = box_of_points(p, count);
    if (count <= EBPO_BOX_TREE_LEAF)
        return;
    split_points(p, count, count / 2, longest_axis(&tree->node[node]));
    build_node(tree, 2 * node + 1, p, count / 2);
    build_node(tree, 2 * node + 2, p + count / 2, count - count / 2);
}

static bool build_nodes(ebpo_box_tree *tree)
{
    uint64_t nodes = 1; /* number of nodes if all leaves are as deep as the deepest leaf */
    for (uint64_t most = tree->count; most > EBPO_BOX_TREE_LEAF; most -= most / 2)
        nodes = 2 * nodes + 1;
    if (tree->count == 0)
        return true;
    if (!ebpo_array_grow_late(tree->workspace, &tree->node, &tree->node_capacity, nodes,
                              sizeof *tree->node))
        return false;
    build_node(tree, 0, tree->point, tree->count);
    return true;
}

typedef struct filling {
    ebpo_box_tree *tree;
    ebpo_box_of_fn box_of;
    const void *user;
} filling;

/* Extends `box` by another box. */
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
    if (count <= EBPO_BOX_TREE_LEAF) {
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
    if (!build_nodes(tree))
        return false;
    if (tree->count == 0 || !box_of)
        return true;
    tree->filled = ebpo_array_alloc(tree->workspace, tree->node_capacity, sizeof *tree->filled);
    if (!tree->filled)
        return false;
    fill_node(&f, 0, tree->point, tree->count);
    return true;
}

void ebpo_box_tree_free(ebpo_box_tree *tree)
{
    ebpo_array_free(tree->workspace, tree->filled);
    ebpo_array_free(tree->workspace, tree->point);
    ebpo_array_free(tree->workspace, tree->node);
}

typedef struct walking {
    const ebpo_box_tree *tree;
    const ebpo_point_box *filled;
    ebpo_box_node_fn wanted;
    ebpo_tree_points_fn visit;
    void *user;
} walking;

/* Walks the subtree of a node, which contains the points p[0 .. count). Returns false as soon
 * as `visit` does. */
static bool walk_node(const walking *w, uint64_t node, ebpo_tree_point *p, uint64_t count)
{
    ebpo_box_node n = { &w->tree->node[node], &w->filled[node], count };
    if (!w->wanted(w->user, &n))
        return true;
    if (count <= EBPO_BOX_TREE_LEAF)
        return w->visit(w->user, p, count);
    return walk_node(w, 2 * node + 1, p, count / 2) &&
           walk_node(w, 2 * node + 2, p + count / 2, count - count / 2);
}

bool ebpo_box_tree_walk(const ebpo_box_tree *tree, ebpo_box_node_fn wanted,
                        ebpo_tree_points_fn visit, void *user)
{
    walking w = { tree, tree->filled ? tree->filled : tree->node, wanted, visit, user };
    return tree->count == 0 || walk_node(&w, 0, tree->point, tree->count);
}
