/* Implements the kernel that finds the nearest face of one accel (acceleration structure of a
 * subtree). Faces are in blocks of eight, and a hierarchy of nodes with up to eight children is
 * above the blocks. The kernel walks through the nodes, and tests eight children or faces at a time
 * in single precision.
 *
 * The walk drops only nodes and faces that are certainly farther than the best upper bound. All
 * other faces become candidates, which nearest.c compares.
 *
 * This file is compiled for several instruction sets with the same results (core/cpu.h). Error
 * bounds: docs/develop/bounds.md. */
#include "core/strict_fp.h"

#include <math.h>

#include "query/face_block.h"
#include "query/query_kernels.h"

/* --- boxes and bounding cylinders --- */

/* The boxes of a node's children relative to the point: the lower sides, and the upper sides
 * negated. */
typedef struct near_boxes {
    f8 low[3], minus_high[3];
} near_boxes;

EBPO_EIGHT f8 near_square_sum(const f8 x[3])
{
    return f8_add(f8_add(f8_mul(x[0], x[0]), f8_mul(x[1], x[1])), f8_mul(x[2], x[2]));
}

/* Returns squared lower bounds of the distances of the children, from boxes. */
EBPO_EIGHT f8 near_by_boxes(const ebpo_bound *b, const ebpo_probe *probe, near_boxes *out)
{
    f8 d[3];
    for (int k = 0; k < 3; k++) {
        float origin = b->origin[k] - probe->local[k];
        f8 step = f8_all(b->step[k]);
        out->low[k] = f8_add(f8_all(origin), f8_mul(f8_from_bytes(b->low[k]), step));
        out->minus_high[k] = f8_sub(f8_all(-origin), f8_mul(f8_from_bytes(b->high[k]), step));
        d[k] = f8_max3(out->low[k], out->minus_high[k], f8_all(0));
    }
    return near_square_sum(d);
}

/* Returns squared lower bounds of the distances of the children, from bounding cylinders. */
EBPO_EIGHT f8 near_by_cylinders(const ebpo_bound_cylinder *cylinder, const near_boxes *boxes)
{
    f8 zero = f8_all(0), twice[3], part[3];
    for (int k = 0; k < 3; k++) {
        twice[k] = f8_sub(boxes->low[k], boxes->minus_high[k]);
        part[k] = f8_mul(twice[k], f8_mul(f8_from_shorts(cylinder->axis[k]), f8_all(0x1p-16f)));
    }
    /* along: scalar product of the axis and the vector from the point to the box's centre */
    f8 along = f8_add(f8_add(part[0], part[1]), part[2]), step = f8_all(cylinder->along_step),
       from = f8_mul(f8_from_shorts(cylinder->from), step),
       to = f8_mul(f8_from_shorts(cylinder->to), step),
       radius = f8_mul(f8_from_shorts(cylinder->radius), f8_all(cylinder->aside_step));
    f8 over = f8_max3(f8_add(along, from), f8_sub(f8_sub(zero, along), to), zero);
    /* away2: square of the distance of the box's centre from the point. The distance of the centre
     * from the line through the point along the axis is the root of away2 - along^2. If both
     * squares are large, their difference has a large error, so away2 is reduced by a margin: the
     * root is a lower bound. */
    f8 away2 = f8_mul(near_square_sum(twice), f8_all(0.25f * (1 - 0x1p-19f))),
       aside2 = f8_max(f8_sub(away2, f8_mul(along, along)), zero),
       aside = f8_max(f8_sub(f8_sqrt(aside2), radius), zero);
    return f8_add(f8_mul(aside, aside), f8_mul(over, over));
}

/* Returns a bit for each child whose bound is at most the limit. */
EBPO_EIGHT unsigned near_children(const ebpo_near_search *g, uint32_t node, float lower2[8])
{
    const ebpo_bound *b = &g->s->bound[node];
    near_boxes boxes;
    f8 bound = near_by_boxes(b, &g->probe, &boxes);
    if (g->limit2 > b->cylinder_limit2)
        bound = f8_max(bound, near_by_cylinders(&g->s->cylinder[node], &boxes));
    f8_store(lower2, bound);
    return f8_bits(f8_at_most(bound, f8_all(g->limit2))) & ((1u << b->count) - 1);
}

/* --- faces --- */

/* Eight vectors of three coordinates. */
typedef struct three {
    f8 x, y, z;
} three;

EBPO_EIGHT f8 three_dot(three a, three b)
{
    return f8_add(f8_add(f8_mul(a.x, b.x), f8_mul(a.y, b.y)), f8_mul(a.z, b.z));
}
EBPO_EIGHT f8 minor_of_four(f8 a, f8 b, f8 c, f8 d) { return f8_sub(f8_mul(a, d), f8_mul(b, c)); }
EBPO_EIGHT three three_cross(three a, three b)
{
    return (three){ minor_of_four(a.y, a.z, b.y, b.z), minor_of_four(a.z, a.x, b.z, b.x),
                    minor_of_four(a.x, a.y, b.x, b.y) };
}
/* Returns the sum of the absolute coordinates, an upper bound of the length. */
EBPO_EIGHT f8 three_size(three a) { return f8_add(f8_add(f8_abs(a.x), f8_abs(a.y)), f8_abs(a.z)); }

/* Returns the squared distance of the origin to the segment from a to a + e. ee: e . e. */
EBPO_EIGHT f8 edge_distance2(three a, three e, f8 ee)
{
    f8 t = f8_sub(f8_all(0), f8_mul(three_dot(a, e), f8_inverse(ee)));
    t = f8_min(f8_max(t, f8_all(0)), f8_all(1));
    three q = { f8_add(a.x, f8_mul(t, e.x)), f8_add(a.y, f8_mul(t, e.y)),
                f8_add(a.z, f8_mul(t, e.z)) };
    return three_dot(q, q);
}

/* Corners of eight faces relative to the point, and edges of the faces, in the subtree's frame.
 * Edges are computed from the stored corners, not from `corner`, because the error of `corner`
 * grows with the point's distance. */
typedef struct near_faces {
    three corner[3], edge[3];
} near_faces;

/* Reads one coordinate of corners and edges from a block of floats. */
EBPO_EIGHT void near_axis32(const ebpo_near_search *g, const ebpo_face_block *b, int k,
                            f8 corner[3], f8 edge[3])
{
    f8 scale = f8_all(g->probe.scale), raw[3];
    ebpo_face_block_floats(b, k, raw);
    for (int i = 0; i < 3; i++) {
        corner[i] =
            f8_mul(f8_sub(f8_sub(raw[i], f8_all(g->probe.high[k])), f8_all(g->probe.low[k])),
                   scale);
    }
    edge[0] = f8_mul(f8_sub(raw[1], raw[0]), scale);
    edge[1] = f8_mul(f8_sub(raw[2], raw[1]), scale);
}

/* Reads one coordinate of corners and edges from a block of doubles. */
EBPO_EIGHT void near_axis64(const ebpo_near_search *g, const ebpo_face_block *b, int k,
                            f8 corner[3], f8 edge[3])
{
    double x[3][EBPO_BLOCK];
    float out[5][EBPO_BLOCK];
    ebpo_face_block_doubles(b, k, x);
    for (int i = 0; i < 3; i++)
        for (int lane = 0; lane < EBPO_BLOCK; lane++) {
            out[i][lane] = (float)((x[i][lane] - g->probe.p[k]) * g->probe.scale64);
            if (i < 2)
                out[3 + i][lane] = (float)((x[i + 1][lane] - x[i][lane]) * g->probe.scale64);
        }
    for (int i = 0; i < 3; i++)
        corner[i] = f8_load(out[i]);
    edge[0] = f8_load(out[3]);
    edge[1] = f8_load(out[4]);
}

EBPO_EIGHT near_faces near_load(const ebpo_near_search *g, const ebpo_face_block *b, bool wide)
{
    f8 c[3][3], e[3][3], zero = f8_all(0);
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++) {
        if (wide)
            near_axis64(g, b, k, c[k], e[k]);
        else
            near_axis32(g, b, k, c[k], e[k]);
        e[k][2] = f8_sub(f8_sub(zero, e[k][0]), e[k][1]);
    }
    near_faces out;
    for (int i = 0; i < 3; i++) {
        out.corner[i] = (three){ c[0][i], c[1][i], c[2][i] };
        out.edge[i] = (three){ e[0][i], e[1][i], e[2][i] };
    }
    return out;
}

/* Computes bounds of the distances of eight faces: the computed distance minus and plus a margin.
 * The margin is 2^-16 r + EBPO_NEAR_UNDERFLOW. r is the sum of the absolute coordinates of a corner
 * and two edges; the second term is for the underflow of squares. The height of a "sturdy" face is
 * at least an eighth of the face's longest edge. For a sturdy face, the computed distance is the
 * distance to the face's plane if the point projects into the face, otherwise the distance to the
 * face's edges. For other faces, the computed distance is always the distance to the edges. No
 * point of a face is farther from the edges than the face's height, so for these faces the height
 * is subtracted from the lower bound. Proof: docs/develop/bounds.md, "Points against eight faces".
 */
EBPO_EIGHT void near_bounds(const near_faces *f, f8 *low, f8 *high)
{
    f8 zero = f8_all(0), length[3], longest2;
    for (int i = 0; i < 3; i++)
        length[i] = three_dot(f->edge[i], f->edge[i]);
    longest2 = f8_max3(length[0], length[1], length[2]);
    three n = three_cross(f->edge[0], f->edge[1]);
    f8 nn = three_dot(n, n), edges = f8_all(INFINITY), outside = f8_less(zero, zero);
    for (int i = 0; i < 3; i++) {
        edges = f8_min(edge_distance2(f->corner[i], f->edge[i], length[i]), edges);
        outside =
            f8_or(outside, f8_less(three_dot(three_cross(f->edge[i], n), f->corner[i]), zero));
    }
    /* `plane` is an^2 / nn, computed without an^2, which would underflow for a small triangle close
     * to the point. */
    f8 an = three_dot(f->corner[0], n);
    f8 sturdy = f8_and(f8_at_most(f8_mul(f8_mul(longest2, longest2), f8_all(0x1p-6f)), nn),
                       f8_less(f8_all(0x1p-54f), longest2));
    f8 plane = f8_mul(f8_mul(an, f8_inverse(nn)), an);
    f8 distance = f8_sqrt(f8_pick(sturdy, f8_pick(outside, edges, plane), edges));
    f8 sizes =
        f8_add(three_size(f->corner[0]), f8_add(three_size(f->edge[0]), three_size(f->edge[1])));
    f8 margin = f8_add(f8_mul(sizes, f8_all(0x1p-16f)), f8_all(EBPO_NEAR_UNDERFLOW));
    *low = f8_sub(distance, margin);
    *high = f8_add(distance, margin);
    if (f8_bits(sturdy) == 255)
        return;
    f8 height2 = f8_pick(f8_less(f8_all(0x1p-54f), longest2),
                         f8_min(f8_div(nn, longest2), longest2), longest2);
    height2 = f8_add(height2, f8_mul(longest2, f8_all(0x1p-16f)));
    *low = f8_sub(*low, f8_pick(sturdy, zero, f8_mul(f8_sqrt(height2), f8_all(1 + 0x1p-10f))));
}

/* --- the walk --- */

/* Visits a block, whose parent is `node`. First lowers the limit to the smallest of the upper
 * bounds of the eight faces. Then adds the faces whose lower bounds are not above the limit to the
 * candidates. */
EBPO_EIGHT void near_block_in(ebpo_near_search *g, uint32_t block, uint32_t node, bool wide)
{
    ebpo_face_block faces = ebpo_face_block_open(g->s, block);
    near_faces f = near_load(g, &faces, wide);
    f8 low, high;
    float lows[EBPO_BLOCK];
    near_bounds(&f, &low, &high);
    float least = f8_least(f8_min(high, f8_all(INFINITY)));
    if (least < g->best)
        ebpo_near_set_best(g, least);
    unsigned lanes = f8_bits(f8_at_most(low, f8_all(g->best))) & ebpo_face_block_lanes(&faces);
    f8_store(lows, low);
    for (; lanes; lanes &= lanes - 1) {
        unsigned lane = (unsigned)__builtin_ctz(lanes);
        if (g->count == EBPO_NEAR_CANDIDATES)
            ebpo_near_drop_far(g);
        if (g->count == EBPO_NEAR_CANDIDATES)
            g->judge(g);
        g->waiting[g->count++] =
            (ebpo_near_candidate){ lows[lane], block * EBPO_BLOCK + lane, node };
    }
}

static __attribute__((noinline)) void near_floats(ebpo_near_search *g, uint32_t block,
                                                  uint32_t node)
{
    near_block_in(g, block, node, false);
}

static __attribute__((noinline)) void near_doubles(ebpo_near_search *g, uint32_t block,
                                                   uint32_t node)
{
    near_block_in(g, block, node, true);
}

/* Visits a block. The two functions that do the work are not inlined here. Their code is long, and
 * one copy of each is enough: engines of WebAssembly compile each copy at the first query. */
EBPO_EIGHT void near_block(ebpo_near_search *g, uint32_t block, uint32_t node)
{
    if (g->s->wide)
        near_doubles(g, block, node);
    else
        near_floats(g, block, node);
}

EBPO_EIGHT void near_fetch(const ebpo_accel *s, uint32_t child)
{
    ebpo_visit_fetch(s, child);
    if (!(child & EBPO_IS_BLOCK))
        ebpo_visit_fetch_cylinder(s, child);
}

/* Prefetches the data of the next visit during the current visit, because far from the surface a
 * visit takes two cache misses. */
EBPO_EIGHT void near_fetch_next(const ebpo_near_search *g, uint32_t top)
{
    if (top)
        near_fetch(g->s, (uint32_t)g->stack[top - 1]);
}

/* A search is called small compared with a node if its squared limit is at most this multiple of
 * the node's cylinder_limit2. */
#define NEAR_SMALL 25.0f

/* Pushes the children `lanes` of a node, farthest first; returns the new top of the stack. */
EBPO_EIGHT uint32_t near_push(ebpo_near_search *g, uint32_t top, uint32_t node, unsigned lanes,
                              const float lower2[8])
{
    uint32_t above = ebpo_visit_push(g->stack, top, &g->s->bound[node], lanes, lower2);
    for (; top < above; top++)
        g->from[top] = node;
    return above;
}

/* Descends from *child to a block, always to the nearest child, and pushes the other children. Sets
 * *child to the block and *node to the block's parent. Returns false if all children of a node on
 * the way are beyond the limit. */
EBPO_EIGHT bool near_descend(ebpo_near_search *g, uint32_t *top, uint32_t *child, uint32_t *node)
{
    while (!(*child & EBPO_IS_BLOCK)) {
        float lower2[8];
        const ebpo_bound *b = &g->s->bound[*child];
        unsigned lanes = near_children(g, *child, lower2);
        if (!lanes)
            return false;
        *node = *child;
        if (!(lanes & (lanes - 1))) {
            *child = b->child[__builtin_ctz(lanes)];
            continue;
        }
        *top = near_push(g, *top, *node, lanes, lower2);
        *child = (uint32_t)g->stack[--*top];
        near_fetch(g->s, *child);
        near_fetch_next(g, *top);
    }
    return true;
}

/* Visits the first block (g->first_block), if there is one. Returns the node where the walk begins.
 * Without a first block, the walk begins at the root. Otherwise the walk begins at an ancestor of
 * the block: the lowest one that is large compared with the search (NEAR_SMALL). Nodes outside this
 * ancestor are hardly ever needed. */
EBPO_EIGHT uint32_t near_begin(ebpo_near_search *g)
{
    const ebpo_bound *bound = g->s->bound;
    uint32_t node = g->first_node;
    if (g->first_block == EBPO_NO_BLOCK)
        return g->s->root_bound;
    near_block(g, g->first_block, node);
    if (g->late) /* with a deadline, each unvisited node must be a descendant of a node on the stack
                  */
        return g->s->root_bound;
    while (node != g->s->root_bound && g->limit2 > bound[node].cylinder_limit2 * NEAR_SMALL)
        node = bound[node].parent;
    return node;
}

/* Pushes all children of a node within the limit, except `child`, onto the empty stack. Returns the
 * new top. */
EBPO_EIGHT uint32_t near_other_children(ebpo_near_search *g, uint32_t node, uint32_t child)
{
    float lower2[8];
    unsigned lanes = near_children(g, node, lower2);
    for (unsigned more = lanes; more; more &= more - 1)
        if (g->s->bound[node].child[__builtin_ctz(more)] == child)
            lanes &= ~(more & -more);
    return lanes ? near_push(g, 0, node, lanes, lower2) : 0;
}

/* Visits everything on the stack. Returns false at the deadline. */
EBPO_EIGHT bool near_walk_down(ebpo_near_search *g, uint32_t top)
{
    uint32_t steps = 0;
    while (top) {
        ebpo_visit v = g->stack[--top];
        uint32_t child = (uint32_t)v, node = g->from[top];
        near_fetch_next(g, top);
        if (ebpo_visit_key(v) > g->limit2)
            continue;
        if (g->late && (++steps & 3) == 0 && g->late(g)) {
            g->top = top + 1;
            return false;
        }
        if (near_descend(g, &top, &child, &node) && (child & ~EBPO_IS_BLOCK) != g->first_block)
            near_block(g, child & ~EBPO_IS_BLOCK, node);
    }
    return true;
}

/* Walks down from the node that near_begin returns. Then goes up to the root, one node at a time,
 * and walks down through the other children of each node. */
static void near_walk(ebpo_near_search *g)
{
    uint32_t node = near_begin(g), top = 1;
    g->stack[0] = ebpo_visit_make(0, node);
    g->from[0] = node;
    g->top = 0;
    while (near_walk_down(g, top) && node != g->s->root_bound) {
        uint32_t child = node;
        node = g->s->bound[node].parent;
        top = near_other_children(g, node, child);
    }
}

const ebpo_nearest_kernels EBPO_KERNEL(ebpo_nearest_kernels) = { near_walk };
