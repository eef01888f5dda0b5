/* Computes winding numbers of the discs that close the border of a mesh.
 *
 * Caps are triangles that close the holes of a mesh S: each loop of its border (mesh/border.h) has
 * caps (geometry/cap_triangles.h). S and its caps together have an integer winding number k. The
 * discs D are the caps with the opposite orientation, so the boundary of the discs has the
 * direction of the border. Therefore the winding number of S is
 *
 *   w_S(p) = k(p) + w_D(p).
 *
 * w_D is a sum of solid angles over few triangles. A tree gives bounds of this sum. The bounds are
 * refined only until a decision is possible. At a point on a cap, k and w_D jump, but w_S does not.
 * There, k and w_D are computed after the infinitely small shift of ebpo_axis_crossing.
 */
#ifndef EBPO_GEOMETRY_CAP_TREE_H
#define EBPO_GEOMETRY_CAP_TREE_H

#include <ebpo/file.h>

#include "geometry/solid_angle.h"

/* A node of the tree is a stretch or a group. A stretch is a path along a loop
 * (geometry/cap_triangles.h), with all its triangles. A group has two nodes. The weight of a loop
 * is the number of times that the loop counts. The first node is the root. */
typedef struct ebpo_cap_node {
    double centre[3], radius; /* a ball around the triangles */
    double area;              /* upper bound of the sum of weight * area */
    double vector[3];         /* sum of weight * area * normal */
    double slack;             /* bound of the rounding error of `vector` */
    /* upper bound of the sum of weight * length over the border edges of the path. A node of a
     * whole loop also includes the loop's last edge */
    double length;
    double most;       /* pi times the sum of the weights: bounds the sum of the half angles */
    uint32_t from, to; /* a stretch: positions in ebpo_cap_tree.position; a group: its two nodes */
    uint32_t weight;   /* weight of the stretch's loop; 0: a group */
    /* `spread` and `moment` are means over the area. Let y be the difference between a point of the
     * triangles and the centre, divided by the radius. `spread`: upper bound of the root mean
     * square of |y|; INFINITY: area and radius are too small. `moment`: the symmetric part of the
     * mean of the matrix y normal^T (xx, yy, zz, xy, yz, zx), within 2^-24 */
    float spread, moment[6];
} ebpo_cap_node;

typedef struct ebpo_cap_tree {
    double (*position)[3]; /* [position_count] vertices of all loops */
    uint64_t position_count;
    ebpo_cap_node *node; /* NULL: no loops */
    uint64_t node_count;
    uint64_t triangle_count;
    /* true: bounds are of the second order, which is sharper (cap_bounds.c). False by default:
     * levels of files depend on bounds of the first order */
    bool second_order;
} ebpo_cap_tree;

/* Bytes of a tree for each point of its loops: a position and at most one node. */
enum { EBPO_CAPS_BYTES = sizeof(double[3]) + sizeof(ebpo_cap_node) };

/* Makes the tree of loops. Loop i has the positions first[i] .. first[i + 1] - 1 (at least three)
 * and the weight weight[i] (at least 1). The function takes over `position`, an array of malloc,
 * also on failure. EBPO_E_LIMIT: more than 2^31 - 1 positions. */
EBPO_MUST_USE ebpo_status ebpo_cap_tree_make(ebpo_cap_tree *out, double (*position)[3],
                                             const uint64_t *first, const uint32_t *weight,
                                             uint64_t loop_count, ebpo_error *error);
/* Makes the tree of the border loops that a file or a tree has. */
EBPO_MUST_USE ebpo_status ebpo_cap_tree_of_loops(ebpo_cap_tree *out, const ebpo_border_loops *loops,
                                                 ebpo_error *error);
void ebpo_cap_tree_free(ebpo_cap_tree *tree);

/* Sets `out` to a node of one triangle: the triangle of a stretch that belongs to neither of its
 * halves. The length of this node is 0. */
void ebpo_cap_triangle_node(const ebpo_cap_tree *tree, const ebpo_cap_node *stretch,
                            ebpo_cap_node *out);

/* Calls visit(context, a, b, c, weight) for each disc that may touch the box: a triangle a, b, c
 * that counts `weight` times. Returns true as soon as a call returns true. */
typedef bool ebpo_cap_visit_fn(void *context, const double a[3], const double b[3],
                               const double c[3], uint32_t weight);
bool ebpo_caps_visit(const ebpo_cap_tree *tree, const double low[3], const double high[3],
                     ebpo_cap_visit_fn *visit, void *context);
/* Returns false if certainly no cap touches the box. */
bool ebpo_caps_near(const ebpo_cap_tree *tree, const double low[3], const double high[3]);

/* Bounds the sum of the half angles, that is 2 pi w_D, at p. Nodes whose bounds have an error above
 * `tolerance` are refined, down to single triangles. */
ebpo_bounded ebpo_cap_tree_bound(const ebpo_cap_tree *tree, const double p[3], double tolerance);

/* Converts bounds of the half angles' sum to bounds of w_S = winding + w_D. Enlarges the error by
 * 2^-50 of the middle. This covers the rounding of middle - error and middle + error, and of the
 * rule's boundaries, with which the caller compares these two ends. */
ebpo_bounded ebpo_cap_winding_of(ebpo_bounded angles, int32_t winding);

/* Bounds w_S = winding + w_D at p, with an error of at most `width` / 2 if doubles suffice. */
ebpo_bounded ebpo_cap_winding(const ebpo_cap_tree *tree, const double p[3], int32_t winding,
                              double width);

/* Defines which points are inside, by the winding number w and a threshold t in (0, 1). nonzero:
 * |w| > t; positive: w > t; evenodd: |w - e| > t, where e is the even integer nearest to w. */
typedef struct ebpo_cap_rule {
    uint8_t rule; /* ebpo_rule */
    double threshold;
} ebpo_cap_rule;

typedef struct ebpo_cap_decision {
    bool inside;
    /* w_S equals a boundary of the rule, such as t, or 512 bits do not suffice to decide; then
     * `inside` is false */
    bool tie;
    ebpo_bounded winding; /* bounds of w_S, only as accurate as the decision needed */
} ebpo_cap_decision;

/* Decides by w_S = winding + w_D at p; exact. `winding` is the winding number of the shifted
 * point. */
ebpo_cap_decision ebpo_cap_decide(const ebpo_cap_tree *tree, const double p[3], int32_t winding,
                                  const ebpo_cap_rule *rule);

/* Returns 1 or 0 if the rule gives this result for all w in the interval, else -1. */
int ebpo_cap_rule_result(const ebpo_cap_rule *rule, double low, double high);

#endif
