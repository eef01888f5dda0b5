#include "core/strict_fp.h"

#include "mesh/box_tree.h"

#include "core/workspace.h"

typedef struct filling {
    box_tree *tree;
    box_of_fn box_of;
    const void *user;
} filling;

static void join(point_box *box, const point_box *other)
{
    for (int k = 0; k < 3; k++) {
        box->min[k] = other->min[k] < box->min[k] ? other->min[k] : box->min[k];
        box->max[k] = other->max[k] > box->max[k] ? other->max[k] : box->max[k];
    }
}

static void fill(const filling *f, uint64_t node, const mesh_point *p, uint64_t count)
{
    point_box *box = &f->tree->filled[node], other;
    if (count <= POINT_TREE_LEAF) {
        f->box_of(f->user, &p[0], box);
        for (uint64_t i = 1; i < count; i++) {
            f->box_of(f->user, &p[i], &other);
            join(box, &other);
        }
        return;
    }
    fill(f, 2 * node + 1, p, count / 2);
    fill(f, 2 * node + 2, p + count / 2, count - count / 2);
    *box = f->tree->filled[2 * node + 1];
    join(box, &f->tree->filled[2 * node + 2]);
}

bool ebpo_box_tree_build(box_tree *tree, box_of_fn box_of, const void *user)
{
    filling f = { tree, box_of, user };
    point_tree *points = &tree->points;
    if (points->count == 0)
        return true;
    if (!ebpo_point_tree_build(points))
        return false;
    tree->filled = ebpo_array_alloc(points->workspace, points->node_capacity, sizeof *tree->filled);
    if (!tree->filled)
        return false;
    fill(&f, 0, points->point, points->count);
    return true;
}

void ebpo_box_tree_free(box_tree *tree)
{
    ebpo_array_free(tree->points.workspace, tree->filled);
    ebpo_point_tree_free(&tree->points);
}

typedef struct walking {
    const box_tree *tree;
    box_node_fn wanted;
    points_fn visit;
    void *user;
} walking;

static bool walk(const walking *w, uint64_t node, mesh_point *p, uint64_t count)
{
    box_node n = { &w->tree->points.node[node], &w->tree->filled[node], count };
    if (!w->wanted(w->user, &n))
        return true;
    if (count <= POINT_TREE_LEAF)
        return w->visit(w->user, p, count);
    return walk(w, 2 * node + 1, p, count / 2) &&
           walk(w, 2 * node + 2, p + count / 2, count - count / 2);
}

bool ebpo_box_tree_walk(const box_tree *tree, box_node_fn wanted, points_fn visit, void *user)
{
    walking w = { tree, wanted, visit, user };
    return tree->points.count == 0 || walk(&w, 0, tree->points.point, tree->points.count);
}
