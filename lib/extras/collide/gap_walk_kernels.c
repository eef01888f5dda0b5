/* Walks through pairs of nodes of two hierarchies to find the nearest faces of two models, eight
 * children at a time, in floats. Lengths are in the unit of ebpo_block_unit. This file is compiled
 * for several instruction sets with the same results. Names that end in 8 handle eight values at
 * once.
 *
 * The distance of two nodes has three lower bounds: the gap of the nodes' boxes, the gap of their
 * bounding cylinders, and their gap along the direction of the best pair. The best pair is the
 * nearest pair of faces so far. The walk is depth-first until a limit is known; then a heap returns
 * the pair with the least bound first. In a pair of blocks, the bounds of the distance of two faces
 * are computed from one point of each face. These two points are the nearest points except for
 * rounding. A pair is dropped only if it is certainly not nearer than the limit; collide_distance.c
 * decides the remaining pairs. Bounds: docs/develop/collision.md, "Bounds of pairs of nodes" and
 * "Distance of two faces". */
#include "core/strict_fp.h"

#include <math.h>

#include "core/simd.h"
#include "extras/collide/hierarchy_walk.h"
#include "extras/collide/posed_eight.inc"

/* --- pairs of faces --- */

/* Eight points or vectors. */
typedef struct point8 {
    f8 x[3];
} point8;

/* Eight faces. */
typedef struct triangle8 {
    point8 corner[3];
} triangle8;

/* Returns the scalar products of a and b. */
EBPO_EIGHT f8 point_dot8(const point8 *a, const point8 *b)
{
    return f8_add(f8_add(f8_mul(a->x[0], b->x[0]), f8_mul(a->x[1], b->x[1])),
                  f8_mul(a->x[2], b->x[2]));
}
/* Returns a - b. */
EBPO_EIGHT point8 point_minus8(const point8 *a, const point8 *b)
{
    point8 out;
    for (int k = 0; k < 3; k++)
        out.x[k] = f8_sub(a->x[k], b->x[k]);
    return out;
}
/* Returns a + t b. */
EBPO_EIGHT point8 point_along8(const point8 *a, f8 t, const point8 *b)
{
    point8 out;
    for (int k = 0; k < 3; k++)
        out.x[k] = f8_add(a->x[k], f8_mul(t, b->x[k]));
    return out;
}
/* Returns a d - b c. */
EBPO_EIGHT f8 minor_of8(f8 a, f8 b, f8 c, f8 d) { return f8_sub(f8_mul(a, d), f8_mul(b, c)); }
/* Returns the vector products of a and b. */
EBPO_EIGHT point8 point_cross8(const point8 *a, const point8 *b)
{
    return (point8){ { minor_of8(a->x[1], a->x[2], b->x[1], b->x[2]),
                       minor_of8(a->x[2], a->x[0], b->x[2], b->x[0]),
                       minor_of8(a->x[0], a->x[1], b->x[0], b->x[1]) } };
}
/* Limits t to 0 .. 1; NaN becomes 0. */
EBPO_EIGHT f8 within_unit8(f8 t) { return f8_min(f8_max(t, f8_all(0)), f8_all(1)); }

/* The nearest pair of points so far: the vector from A's point to B's point, and its squared
 * length. */
typedef struct nearest8 {
    f8 square;
    point8 direction;
} nearest8;

/* Keeps the vector `direction`, whose squared length is `square`, in each lane in which it is
 * shorter. */
EBPO_EIGHT void offer_nearest8(nearest8 *n, const point8 *direction, f8 square)
{
    f8 better = f8_less(square, n->square);
    n->square = f8_pick(better, square, n->square);
    for (int k = 0; k < 3; k++)
        n->direction.x[k] = f8_pick(better, direction->x[k], n->direction.x[k]);
}

/* The edges of eight faces. */
typedef struct edges8 {
    point8 edge[3];           /* vectors along the edges: edge i leads from corner i to the next */
    f8 square[3], inverse[3]; /* squared lengths, and their reciprocals */
} edges8;

/* Computes the edges of eight faces. */
EBPO_EIGHT edges8 edges_of8(const triangle8 *t)
{
    edges8 out;
#pragma GCC unroll 3
    for (int i = 0; i < 3; i++) {
        out.edge[i] = point_minus8(&t->corner[i == 2 ? 0 : i + 1], &t->corner[i]);
        out.square[i] = point_dot8(&out.edge[i], &out.edge[i]);
        out.inverse[i] = f8_div(f8_all(1), out.square[i]);
    }
    return out;
}

/* Offers the nearest points of two edges to n: edge i of a begins at p, and edge j of b begins at
 * q. */
EBPO_EIGHT void offer_edges8(nearest8 *n, const point8 *p, const edges8 *a, int i, const point8 *q,
                             const edges8 *b, int j)
{
    const point8 *e = &a->edge[i], *f = &b->edge[j];
    point8 w = point_minus8(q, p);
    f8 ef = point_dot8(e, f), ew = point_dot8(e, &w), fw = point_dot8(f, &w);
    f8 area = minor_of8(a->square[i], ef, ef, b->square[j]);
    f8 s = within_unit8(f8_div(minor_of8(ew, fw, ef, b->square[j]), area));
    f8 t = within_unit8(f8_mul(f8_sub(f8_mul(s, ef), fw), b->inverse[j]));
    s = within_unit8(f8_mul(f8_add(f8_mul(t, ef), ew), a->inverse[i]));
    point8 direction = point_along8(&w, t, f);
    direction = point_along8(&direction, f8_sub(f8_all(0), s), e);
    offer_nearest8(n, &direction, point_dot8(&direction, &direction));
}

/* Offers pairs of a corner and the nearest point of a face to n, for the corners whose projection
 * to the plane of the face is on the face. edges: edges of `face`. sign: 1 if the corners belong to
 * A, -1 if they belong to B. */
EBPO_EIGHT void offer_corners8(nearest8 *n, const triangle8 *face, const edges8 *edges,
                               const triangle8 *corners, float sign)
{
    const point8 *e = &edges->edge[0];
    point8 f = point_minus8(&face->corner[2], &face->corner[0]), normal = point_cross8(e, &f),
           to_e = point_cross8(&f, &normal), to_f = point_cross8(&normal, e);
    f8 inverse = f8_div(f8_all(1), point_dot8(&normal, &normal)), zero = f8_all(0);
#pragma GCC unroll 3
    for (int i = 0; i < 3; i++) {
        point8 d = point_minus8(&corners->corner[i], &face->corner[0]);
        f8 s = f8_mul(point_dot8(&d, &to_e), inverse), t = f8_mul(point_dot8(&d, &to_f), inverse);
        f8 over = f8_and(f8_and(f8_at_most(zero, s), f8_at_most(zero, t)),
                         f8_at_most(f8_add(s, t), f8_all(1)));
        point8 up = point_along8(&d, f8_sub(zero, s), e);
        up = point_along8(&up, f8_sub(zero, t), &f);
        f8 square = f8_pick(over, point_dot8(&up, &up), f8_all(INFINITY));
        for (int k = 0; k < 3; k++)
            up.x[k] = f8_mul(up.x[k], f8_all(-sign));
        offer_nearest8(n, &up, square);
    }
}

/* Bounds the distances of eight pairs of faces by *low and *high. *direction: the vectors from A's
 * nearest points to B's nearest points. Coordinates have absolute values of at most `size`, and
 * differ from their exact values by at most `error`. */
EBPO_EIGHT void bounds_of_pairs8(const triangle8 *a, const triangle8 *b, float size, float error,
                                 f8 *low, f8 *high, point8 *direction)
{
    edges8 of_a = edges_of8(a), of_b = edges_of8(b);
    nearest8 n = { f8_all(INFINITY), { { f8_all(0), f8_all(0), f8_all(0) } } };
#pragma GCC unroll 3
    for (int i = 0; i < 3; i++)
#pragma GCC unroll 3
        for (int j = 0; j < 3; j++)
            offer_edges8(&n, &a->corner[i], &of_a, i, &b->corner[j], &of_b, j);
    offer_corners8(&n, a, &of_a, b, -1);
    offer_corners8(&n, b, &of_b, a, 1);
    f8 most =
           f8_max3(point_dot8(&n.direction, &a->corner[0]), point_dot8(&n.direction, &a->corner[1]),
                   point_dot8(&n.direction, &a->corner[2])),
       least =
           f8_min3(point_dot8(&n.direction, &b->corner[0]), point_dot8(&n.direction, &b->corner[1]),
                   point_dot8(&n.direction, &b->corner[2]));
    f8 length = f8_sqrt(n.square), lost = f8_all(40 * 0x1p-24f * size + 4 * error + 0x1p-60f);
    f8 gap = f8_div(f8_mul(f8_sub(least, most), f8_all(1 - 0x1p-20f)), length);
    *low = f8_pick(f8_less(f8_all(0x1p-110f), n.square), f8_sub(gap, lost), f8_all(-1));
    *high = f8_add(f8_mul(length, f8_all(1 + 0x1p-20f)), lost);
    *direction = n.direction;
}

/* --- nodes --- */

/* Decodes centres and half sides of the children's boxes, and computes boxes around these boxes in
 * the other frame. */
EBPO_EIGHT void node_boxes(ebpo_gap_node *out, const ebpo_bound *b, const ebpo_turned_frame *f)
{
    f8 centre[3], half[3];
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++) {
        decode_boxes8(b, k, f->unit, &centre[k], &half[k]);
        centre[k] = f8_add(f8_all(b->origin[k] * f->unit), centre[k]);
        f8_store(out->centre[0][k], centre[k]);
        f8_store(out->half[0][k], half[k]);
    }
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++) {
        f8_store(out->centre[1][k], f8_add(turned_row8(f->turn[k], centre), f8_all(f->shift[k])));
        f8_store(out->half[1][k], turned_row8(f->turn_size[k], half));
    }
}

/* Decodes the children's bounding cylinders. A child without a cylinder gets a cylinder of extreme
 * length, which excludes no pair. */
EBPO_EIGHT void node_cylinders(ebpo_gap_node *out, const ebpo_bound_cylinder *b,
                               const ebpo_turned_frame *f, float slack)
{
    f8 axis[3], middle[3], inverse, exists;
    decode_axes8(b, axis, &inverse, &exists);
    f8 step = f8_mul(f8_all(b->along_step * f->unit * 0.5f), inverse),
       from = f8_from_shorts(b->from), to = f8_from_shorts(b->to),
       along = f8_mul(f8_add(from, to), step);
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++) {
        middle[k] = f8_add(f8_load(out->centre[0][k]), f8_mul(axis[k], along));
        f8_store(out->axis[0][k], axis[k]);
        f8_store(out->middle[0][k], middle[k]);
    }
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++) {
        f8_store(out->axis[1][k], turned_row8(f->turn[k], axis));
        f8_store(out->middle[1][k], f8_add(turned_row8(f->turn[k], middle), f8_all(f->shift[k])));
    }
    f8 thick = f8_add(f8_mul(f8_sub(to, from), step), f8_all(4 * slack));
    f8_store(out->thick, f8_pick(exists, thick, f8_all(0x1p60f)));
    f8_store(out->radius, f8_add(f8_mul(f8_from_shorts(b->radius), f8_all(b->aside_step * f->unit)),
                                 f8_all(4 * slack)));
}

/* Returns an upper bound of the sine of an angle with this cosine. */
EBPO_EIGHT f8 sine_of8(f8 cosine)
{
    return f8_sqrt(f8_max(f8_sub(f8_all(1 + 0x1p-18f), f8_mul(cosine, cosine)), f8_all(0)));
}

/* Computes how far the children extend along the search's direction; see ebpo_gap_node.extent. */
EBPO_EIGHT void node_extent(ebpo_gap_node *out, const float along[3])
{
    f8 boxes = f8_all(0), cylinders = f8_all(0), cosine = f8_all(0);
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++) {
        f8 a = f8_all(along[k]);
        boxes = f8_add(boxes, f8_add(f8_mul(f8_load(out->centre[0][k]), a),
                                     f8_mul(f8_load(out->half[0][k]), f8_abs(a))));
        cylinders = f8_add(cylinders, f8_mul(f8_load(out->middle[0][k]), a));
        cosine = f8_add(cosine, f8_mul(f8_load(out->axis[0][k]), a));
    }
    cylinders = f8_add(cylinders, f8_add(f8_mul(f8_abs(cosine), f8_load(out->thick)),
                                         f8_mul(sine_of8(cosine), f8_load(out->radius))));
    f8_store(out->extent, f8_min(boxes, cylinders));
}

/* Returns the decoded children of a node; decodes them if the cache does not have them. */
static const ebpo_gap_node *decoded_node(ebpo_gap_search *g, int side, uint32_t node)
{
    ebpo_gap_node *out = &g->node[side][node % EBPO_GAP_NODES];
    const ebpo_accel *s = g->accel[side];
    if (out->node != node) {
        node_boxes(out, &s->bound[node], &g->frames.frame[side]);
        node_cylinders(out, &s->cylinder[node], &g->frames.frame[side], g->frames.slack);
        out->node = node;
        out->direction = 0;
    }
    if (out->direction != g->direction_number) {
        node_extent(out, g->along[side]);
        out->direction = g->direction_number;
    }
    return out;
}

/* --- pairs of nodes --- */

/* Returns the sums of the squared gaps of the eight boxes of p and the box in lane j of q, along
 * the axes of frame f (0: the frame of p). Raises *most to the greatest gap. */
EBPO_EIGHT f8 box_gaps8(const ebpo_gap_node *p, const ebpo_gap_node *q, int j, int f, f8 slack,
                        f8 *most)
{
    f8 sum = f8_all(0);
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++) {
        f8 d = f8_abs(f8_sub(f8_load(p->centre[f][k]), f8_all(q->centre[1 - f][k][j])));
        f8 gap = f8_sub(d, f8_add(f8_load(p->half[f][k]), f8_all(q->half[1 - f][k][j])));
        gap = f8_sub(gap, slack);
        *most = f8_max(*most, gap);
        gap = f8_max(gap, f8_all(0));
        sum = f8_add(sum, f8_mul(gap, gap));
    }
    return sum;
}

/* Returns the greatest gap of the eight cylinders of p and cylinder j of q along their two axes, 0
 * or more. */
EBPO_EIGHT f8 cylinder_gaps8(const ebpo_gap_node *p, const ebpo_gap_node *q, int j)
{
    f8 dot = f8_all(0), by_p = dot, by_q = dot, box_p = dot, box_q = dot, size_p = dot,
       size_q = dot;
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++) {
        f8 ap = f8_load(p->axis[0][k]), aq = f8_all(q->axis[0][k][j]),
           aq_in_p = f8_all(q->axis[1][k][j]);
        dot = f8_add(dot, f8_mul(ap, aq_in_p));
        by_p =
            f8_add(by_p, f8_mul(ap, f8_sub(f8_load(p->middle[0][k]), f8_all(q->middle[1][k][j]))));
        by_q =
            f8_add(by_q, f8_mul(aq, f8_sub(f8_load(p->middle[1][k]), f8_all(q->middle[0][k][j]))));
        box_p =
            f8_add(box_p, f8_mul(ap, f8_sub(f8_load(p->middle[0][k]), f8_all(q->centre[1][k][j]))));
        box_q =
            f8_add(box_q, f8_mul(aq, f8_sub(f8_load(p->centre[1][k]), f8_all(q->middle[0][k][j]))));
        size_p = f8_add(size_p, f8_mul(f8_abs(f8_load(p->axis[1][k])), f8_all(q->half[0][k][j])));
        size_q = f8_add(size_q, f8_mul(f8_abs(aq_in_p), f8_load(p->half[0][k])));
    }
    f8 cosine = f8_abs(dot), sine = sine_of8(dot), thick_p = f8_load(p->thick),
       thick_q = f8_all(q->thick[j]), none = f8_all(0);
    f8 far_p =
        f8_sub(f8_abs(by_p), f8_add(f8_mul(cosine, thick_q), f8_mul(sine, f8_all(q->radius[j]))));
    f8 far_q =
        f8_sub(f8_abs(by_q), f8_add(f8_mul(cosine, thick_p), f8_mul(sine, f8_load(p->radius))));
    far_p = f8_sub(f8_max(far_p, f8_sub(f8_abs(box_p), size_p)), thick_p);
    far_q = f8_sub(f8_max(far_q, f8_sub(f8_abs(box_q), size_q)), thick_q);
    return f8_max3(far_p, far_q, none);
}

/* Returns the keys (ebpo_gap_visit.key) of the pairs of each child of p with child j of q: squared
 * lower bounds of their distances; 0 or negative if the boxes may intersect. */
EBPO_EIGHT f8 gap_keys8(const ebpo_gap_search *g, const ebpo_gap_node *p, const ebpo_gap_node *q,
                        int j)
{
    f8 slack = f8_all(g->frames.slack), most = f8_all(-INFINITY), zero = f8_all(0);
    f8 square = f8_max(box_gaps8(p, q, j, 0, slack, &most), box_gaps8(p, q, j, 1, slack, &most));
    f8 gap =
        f8_sub(f8_all(g->along_shift - q->extent[j] - 8 * g->frames.slack), f8_load(p->extent));
    gap = f8_max(gap, zero);
    square = f8_max(square, f8_mul(gap, gap));
    if (f8_bits(f8_at_most(square, f8_all(g->square)))) {
        gap = cylinder_gaps8(p, q, j);
        square = f8_max(square, f8_mul(gap, gap));
    }
    return f8_pick(f8_less(zero, square), square, f8_min(most, zero));
}

/* --- pairs to be visited --- */

/* Prefetches the memory of the pair that is now first on the stack or heap, and will be visited
 * next if no nearer pair is found. */
EBPO_EIGHT void fetch_next(const ebpo_gap_search *g)
{
    if (g->count == 0)
        return;
    const ebpo_gap_visit *v = &g->stack[g->is_heap ? 0 : g->count - 1];
    for (int i = 0; i < 2; i++)
        fetch_below(g->accel[i], below_child(g->accel[i], v->child[i]), true);
}

/* Adds a pair to the heap or stack. In a stack, keeps the pairs from index `base` on sorted, so
 * that the pair with the least key is on top. */
EBPO_EIGHT void push_visit(ebpo_gap_search *g, uint64_t base, ebpo_gap_visit v)
{
    uint64_t at = g->count++;
    if (g->is_heap)
        for (uint64_t up; at > 0 && g->stack[up = (at - 1) / 2].key > v.key; at = up)
            g->stack[at] = g->stack[up];
    else
        for (; at > base && g->stack[at - 1].key < v.key; at--)
            g->stack[at] = g->stack[at - 1];
    g->stack[at] = v;
}

/* Stores v in the heap at index `at` or below it. */
static void sift_down(ebpo_gap_search *g, uint64_t at, ebpo_gap_visit v)
{
    for (uint64_t next; (next = 2 * at + 1) < g->count; at = next) {
        next += next + 1 < g->count && g->stack[next + 1].key < g->stack[next].key;
        if (!(g->stack[next].key < v.key))
            break;
        g->stack[at] = g->stack[next];
    }
    g->stack[at] = v;
}

/* Makes a heap of the stack. From now on the pair with the least key is visited first, so that no
 * pair is visited whose bound is above the final distance. */
static void make_heap(ebpo_gap_search *g)
{
    uint64_t kept = 0;
    for (uint64_t i = 0; i < g->count; i++)
        if (!(g->stack[i].key > g->square))
            g->stack[kept++] = g->stack[i];
    g->count = kept;
    g->is_heap = true;
    for (uint64_t i = kept / 2; i-- > 0;)
        sift_down(g, i, g->stack[i]);
}

/* Removes and returns the pair that is visited next. */
EBPO_EIGHT ebpo_gap_visit pop_visit(ebpo_gap_search *g)
{
    ebpo_gap_visit last = g->stack[--g->count], out = last;
    if (g->is_heap && g->count > 0) {
        out = g->stack[0];
        sift_down(g, 0, last);
    }
    return out;
}

/* Pushes the pairs of each child of p, a node of model `side`, with child j of q. Omits pairs that
 * are too far apart. base: as for push_visit. */
EBPO_EIGHT void push_eight(ebpo_gap_search *g, uint64_t base, int side, const ebpo_gap_node *p,
                           const ebpo_gap_node *q, int j)
{
    const ebpo_bound *b = &g->accel[side]->bound[p->node];
    f8 keys = gap_keys8(g, p, q, j);
    unsigned near = f8_bits(f8_at_most(keys, f8_all(g->square))) & ((1u << b->count) - 1);
    float key[8];
    f8_store(key, keys);
    for (; near; near &= near - 1) {
        unsigned lane = (unsigned)__builtin_ctz(near);
        ebpo_gap_visit v = { .key = key[lane], .direction = g->direction_number };
        v.child[side] = p->node * 8 + lane;
        v.child[1 - side] = q->node * 8 + (uint32_t)j;
        push_visit(g, base, v);
    }
}

/* Pushes the pairs of children of two nodes. */
static void push_both(ebpo_gap_search *g, uint32_t node_a, uint32_t node_b)
{
    const ebpo_gap_node *p = decoded_node(g, 0, node_a), *q = decoded_node(g, 1, node_b);
    uint64_t base = g->count;
    for (int j = 0; j < g->accel[1]->bound[node_b].count; j++)
        push_eight(g, base, 0, p, q, j);
}

/* Pushes the pairs of each child of `node`, a node of model `side`, with `other`, a child of a node
 * of the other model (8 * the node's index + the child's lane). */
static void push_side(ebpo_gap_search *g, int side, uint32_t node, uint32_t other)
{
    const ebpo_gap_node *p = decoded_node(g, side, node), *q = decoded_node(g, 1 - side, other / 8);
    push_eight(g, g->count, side, p, q, (int)(other % 8));
}

/* --- pairs of blocks --- */

/* The pairs of faces of two blocks that may be nearer than the limit, by the faces' lanes. */
typedef struct near_lanes {
    int32_t lane[2][72]; /* [block][count + 8]: the entries after the last pair are 0, so that pairs
                          * can be loaded eight at a time */
    unsigned count;      /* at most 64 */
} near_lanes;

/* Finds the pairs of faces that may be nearer than the limit, by the gaps of their boxes and by
 * their gaps along the search's direction. shift: origin of b minus origin of a. */
EBPO_EIGHT void near_by_boxes(const ebpo_gap_search *g, const ebpo_posed_faces *a,
                              const ebpo_posed_faces *b, const float shift[3], float error,
                              near_lanes *out)
{
    f8 low[3], high[3], zero = f8_all(0), lost = f8_all(4 * error);
    float b_low[3][8], b_high[3][8], b_least[8];
    f8 a_most = zero,
       least = zero; /* along the direction: upper ends of a's faces, and lower ends of b's faces */
#pragma GCC unroll 3
    for (int i = 0; i < 3; i++) {
        f8 a_at = zero, b_at = zero;
#pragma GCC unroll 3
        for (int k = 0; k < 3; k++) {
            f8 direction = f8_all(g->direction[k]);
            a_at = f8_add(a_at, f8_mul(f8_load(a->x[3 * i + k]), direction));
            b_at =
                f8_add(b_at, f8_mul(f8_add(f8_load(b->x[3 * i + k]), f8_all(shift[k])), direction));
        }
        a_most = i ? f8_max(a_most, a_at) : a_at;
        least = i ? f8_min(least, b_at) : b_at;
    }
    f8_store(b_least, least);
    for (int k = 0; k < 3; k++) {
        f8 a0 = f8_load(a->x[k]), a1 = f8_load(a->x[3 + k]), a2 = f8_load(a->x[6 + k]);
        low[k] = f8_sub(f8_min3(a0, a1, a2), lost);
        high[k] = f8_add(f8_max3(a0, a1, a2), lost);
        f8 b0 = f8_load(b->x[k]), b1 = f8_load(b->x[3 + k]), b2 = f8_load(b->x[6 + k]);
        f8_store(b_low[k], f8_add(f8_min3(b0, b1, b2), f8_all(shift[k])));
        f8_store(b_high[k], f8_add(f8_max3(b0, b1, b2), f8_all(shift[k])));
    }
    out->count = 0;
    for (unsigned lanes = b->lanes; lanes; lanes &= lanes - 1) {
        int j = __builtin_ctz(lanes);
        f8 square = zero, gap = f8_sub(f8_all(b_least[j] - 8 * error), a_most);
        for (int k = 0; k < 3; k++) {
            f8 d = f8_max3(f8_sub(low[k], f8_all(b_high[k][j])),
                           f8_sub(f8_all(b_low[k][j]), high[k]), zero);
            square = f8_add(square, f8_mul(d, d));
        }
        gap = f8_max(gap, zero);
        square = f8_max(square, f8_mul(gap, gap));
        unsigned near = f8_bits(f8_at_most(square, f8_all(g->square))) & a->lanes;
        for (; near; near &= near - 1) {
            out->lane[0][out->count] = __builtin_ctz(near);
            out->lane[1][out->count++] = j;
        }
    }
    for (int i = 0; i < 8; i++)
        out->lane[0][out->count + i] = out->lane[1][out->count + i] = 0;
}

/* Loads the faces in eight lanes, and adds `shift` to their coordinates. */
EBPO_EIGHT triangle8 load_faces8(const ebpo_posed_faces *f, const int32_t *lane,
                                 const float shift[3])
{
    triangle8 out;
#pragma GCC unroll 9
    for (int i = 0; i < 9; i++)
        out.corner[i / 3].x[i % 3] = f8_add(f8_load_lanes(f->x[i], lane), f8_all(shift[i % 3]));
    return out;
}

/* If one of eight pairs is nearer than the best pair so far, makes the nearest of the eight pairs
 * the best pair, and the direction of this pair the direction of the search. high: upper bounds of
 * the distances. used: a bit for each valid pair. at: index in `near` of the first of the eight
 * pairs. */
EBPO_EIGHT void update_best(ebpo_gap_search *g, f8 high, const point8 *direction, unsigned used,
                            const uint32_t block[2], const near_lanes *near, unsigned at)
{
    unsigned nearer = used & f8_bits(f8_less(high, f8_all(g->best)));
    if (!nearer)
        return;
    float highs[8], directions[3][8];
    int best = -1;
    f8_store(highs, high);
    for (; nearer; nearer &= nearer - 1) {
        int i = __builtin_ctz(nearer);
        if (best < 0 || highs[i] < highs[best])
            best = i;
    }
    for (int k = 0; k < 3; k++)
        f8_store(directions[k], direction->x[k]);
    ebpo_gap_set_best(g, highs[best], block[0] * 8 + (uint32_t)near->lane[0][at + (unsigned)best],
                      block[1] * 8 + (uint32_t)near->lane[1][at + (unsigned)best]);
    ebpo_gap_set_direction(g, (const float[3]){ directions[0][best], directions[1][best],
                                                directions[2][best] });
}

/* Adds each of eight pairs that may be nearer than the limit to the waiting pairs. Returns true if
 * an added pair may intersect. low: lower bounds of the distances. used, at: as for update_best. */
EBPO_EIGHT bool add_candidates(ebpo_gap_search *g, f8 low, unsigned used, const uint32_t block[2],
                               const near_lanes *near, unsigned at)
{
    float lows[8];
    bool intersects = false;
    used &= f8_bits(f8_at_most(low, f8_all(g->limit)));
    if (!used)
        return false;
    f8_store(lows, low);
    for (; used; used &= used - 1) {
        unsigned i = (unsigned)__builtin_ctz(used);
        ebpo_gap_candidate *c = &g->waiting[g->waiting_count++];
        c->low = lows[i];
        for (int s = 0; s < 2; s++)
            c->slot[s] = block[s] * 8 + (uint32_t)near->lane[s][at + i];
        intersects = intersects || !(lows[i] > 0);
    }
    return intersects;
}

/* Visits the pairs of faces of two blocks. Returns false to end the walk. */
static bool visit_blocks(ebpo_gap_search *g, const uint32_t block[2])
{
    const ebpo_posed_faces *a = posed_faces_of(&g->faces[0], g->accel[0], &g->posing[0], block[0]),
                           *b = posed_faces_of(&g->faces[1], g->accel[1], &g->posing[1], block[1]);
    float shift[3], no_shift[3] = { 0, 0, 0 }, most = 0;
    for (int k = 0; k < 3; k++) {
        shift[k] = (float)((b->base[k] - a->base[k]) * g->posing[0].unit);
        most = fabsf(shift[k]) > most ? fabsf(shift[k]) : most;
    }
    float size = a->extent + b->extent + most;
    float error =
        a->error + b->error + 0x1.2p-24f * (a->extent + b->extent) + 2.5f * 0x1p-24f * most;
    near_lanes near;
    near_by_boxes(g, a, b, shift, error + 0x1p-22f * size, &near);
    g->block_pairs++;
    bool intersects = false;
    if (near.count && !ebpo_gap_wait_capacity(g))
        return false;
    for (unsigned at = 0; at < near.count; at += 8) {
        triangle8 p = load_faces8(a, near.lane[0] + at, no_shift),
                  q = load_faces8(b, near.lane[1] + at, shift);
        unsigned used = near.count - at < 8 ? (1u << (near.count - at)) - 1 : 255;
        f8 low, high;
        point8 direction;
        bounds_of_pairs8(&p, &q, size, error, &low, &high, &direction);
        update_best(g, high, &direction, used, block, &near, at);
        intersects |= add_candidates(g, low, used, block, &near, at);
    }
    return !intersects || g->decide_waiting(g);
}

/* --- the walk --- */

/* Returns true if a pair whose key was computed for an earlier direction is too far apart along the
 * current direction. */
static bool is_far_along(ebpo_gap_search *g, const ebpo_gap_visit *v)
{
    if (v->direction == g->direction_number)
        return false;
    float gap = g->along_shift - 8 * g->frames.slack;
    for (int s = 0; s < 2; s++)
        gap -= decoded_node(g, s, v->child[s] / 8)->extent[v->child[s] % 8];
    return gap > 0 && gap * gap > g->square;
}

/* Returns the sum of the half sides of a child's box: of two children, the child with the greater
 * sum is divided. */
static float child_size(ebpo_gap_search *g, int side, uint32_t child)
{
    const ebpo_gap_node *n = decoded_node(g, side, child / 8);
    return (n->half[0][0][child % 8] + n->half[0][1][child % 8]) + n->half[0][2][child % 8];
}

/* Divides a pair and pushes the new pairs, or visits a pair of blocks. Returns false to end the
 * walk. */
static bool visit_pair(ebpo_gap_search *g, const ebpo_gap_visit *v)
{
    uint32_t child[2];
    bool block[2];
    for (int s = 0; s < 2; s++) {
        child[s] = below_child(g->accel[s], v->child[s]);
        block[s] = child[s] & EBPO_IS_BLOCK;
    }
    if (block[0] && block[1])
        return visit_blocks(g, (const uint32_t[2]){ child[0] & ~EBPO_IS_BLOCK,
                                                    child[1] & ~EBPO_IS_BLOCK });
    g->node_pairs++;
    if (!ebpo_gap_capacity(g) || (g->node_pairs % 256 == 0 && !g->keep_going(g)))
        return false;
    if (block[0])
        push_side(g, 1, child[1], v->child[0]);
    else if (block[1])
        push_side(g, 0, child[0], v->child[1]);
    else {
        int larger = child_size(g, 0, v->child[0]) < child_size(g, 1, v->child[1]);
        push_side(g, larger, child[larger], v->child[1 - larger]);
    }
    return true;
}

/* Visits all pairs, as ebpo_gap_kernels.walk describes. */
static void walk_gaps(ebpo_gap_search *g)
{
    if (!ebpo_gap_capacity(g))
        return;
    push_both(g, g->accel[0]->root_bound, g->accel[1]->root_bound);
    while (g->count > 0) {
        if (!g->is_heap && g->limit < INFINITY)
            make_heap(g);
        if (g->count == 0 || (g->is_heap && g->stack[0].key > g->square))
            return;
        ebpo_gap_visit v = pop_visit(g);
        fetch_next(g);
        if (is_far_along(g, &v) || visit_pair(g, &v))
            continue;
        g->stack[g->count++] = v; /* the pair has not been visited completely */
        g->ended = true;
        return;
    }
}

const ebpo_gap_kernels EBPO_KERNEL(ebpo_gap_kernels) = { walk_gaps };
