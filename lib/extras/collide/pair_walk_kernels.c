/* Walks through two hierarchies to find the pairs of faces that intersect, eight children at a
 * time, in floats. This file is compiled for several instruction sets with the same results.
 *
 * Boxes and bounding cylinders of one model's nodes are transformed into the other model's frame
 * and compared along the axes of both frames. Bounds are rounded outwards, so no pair is lost. Both
 * nodes of a pair are divided, or only the larger node if it is much larger. The faces of two
 * blocks are compared by the filter of pairs (pair_filter_kernels.c). The function
 * ebpo_pair_walk_decide decides the pairs that the filter does not exclude. See
 * docs/develop/collision.md, "Going down two hierarchies". */
#include "core/strict_fp.h"

#include <stddef.h>

#include "core/simd.h"
#include "extras/collide/hierarchy_walk.h"
#include "extras/collide/posed_eight.inc"

/* --- nodes --- */

/* Returns the scalar products of eight pairs of vectors. */
EBPO_EIGHT f8 vector_dot8(const f8 a[3], const f8 b[3])
{
    return f8_add(f8_add(f8_mul(a[0], b[0]), f8_mul(a[1], b[1])), f8_mul(a[2], b[2]));
}

/* Stores eight vectors. */
EBPO_EIGHT void store_vector8(float out[3][8], const f8 x[3])
{
    for (int k = 0; k < 3; k++)
        f8_store(out[k], x[k]);
}

/* Decodes the children's boxes. */
EBPO_EIGHT void decode_boxes(const ebpo_accel_pair *p, int side, const ebpo_bound *b,
                             ebpo_turned_node *out, f8 c[3])
{
    f8 e[3];
    float longest = 0;
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++) {
        float step = b->step[k] * p->unit[side];
        decode_boxes8(b, k, p->unit[side], &c[k], &e[k]);
        longest = step > longest ? step : longest;
    }
    out->size = 255 * longest; /* sides of boxes are coded as 0 to 255 steps */
    store_vector8(out->c, c);
    store_vector8(out->e, e);
    f8_store(out->extent, f8_add(f8_add(e[0], e[1]), e[2]));
}

/* Decodes the children's bounding cylinders. A child without a cylinder gets a cylinder of extreme
 * length, which excludes no pair. c: middles of the boxes. a, inverse, exists: from decode_axes8.
 * Sets mid to the middles of the cylinders. */
EBPO_EIGHT void decode_cylinders(const ebpo_accel_pair *p, int side, const ebpo_bound_cylinder *b,
                                 ebpo_turned_node *out, const f8 c[3], const f8 a[3], f8 inverse,
                                 f8 exists, f8 mid[3])
{
    f8 unit = f8_all(p->unit[side]);
    f8 along = f8_mul(f8_mul(inverse, unit), f8_all(0.5f * b->along_step)),
       from = f8_mul(f8_from_shorts(b->from), along), to = f8_mul(f8_from_shorts(b->to), along);
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++)
        mid[k] = f8_add(c[k], f8_mul(a[k], f8_add(from, to)));
    out->cylinders = p->cylinders && f8_bits(exists) != 0;
    out->large = b->large;
    f8_store(out->half, f8_pick(exists, f8_sub(to, from), f8_all(0x1p100f)));
    f8_store(out->radius, f8_mul(f8_mul(f8_from_shorts(b->radius), f8_all(b->aside_step)), unit));
    store_vector8(out->axis, a);
    store_vector8(out->mid, mid);
}

/* Returns four doubles. */
EBPO_EIGHT v4d load_doubles(const double x[4])
{
    v4d out;
    memcpy(&out, x, sizeof out);
    return out;
}

/* Computes the children of a node in both frames. The axes of cylinders need a square root and a
 * division, so they are decoded first: the processor computes the boxes meanwhile. */
static void transform_node(const ebpo_accel_pair *p, int side, uint32_t node, ebpo_turned_node *out)
{
    const ebpo_bound *b = &p->accel[side]->bound[node];
    const ebpo_bound_cylinder *cylinders = &p->accel[side]->cylinder[node];
    f8 c[3], a[3], mid[3], e[3], inverse, exists;
    decode_axes8(cylinders, a, &inverse, &exists);
    decode_boxes(p, side, b, out, c);
    decode_cylinders(p, side, cylinders, out, c, a, inverse, exists, mid);
    /* all vectors by one row of the matrix, because a row fits in the registers */
#pragma GCC unroll 3
    for (int i = 0; i < 3; i++) {
        const float *row = p->into[1 - side][i];
        f8 x = f8_all(row[0]), y = f8_all(row[1]), z = f8_all(row[2]);
        f8_store(out->c2[i], f8_add(f8_add(f8_mul(x, c[0]), f8_mul(y, c[1])), f8_mul(z, c[2])));
        f8_store(out->axis2[i], f8_add(f8_add(f8_mul(x, a[0]), f8_mul(y, a[1])), f8_mul(z, a[2])));
        f8_store(out->mid2[i],
                 f8_add(f8_add(f8_mul(x, mid[0]), f8_mul(y, mid[1])), f8_mul(z, mid[2])));
    }
    for (int k = 0; k < 3; k++)
        e[k] = f8_load(out->e[k]);
#pragma GCC unroll 3
    for (int i = 0; i < 3; i++)
        f8_store(out->e2[i], turned_row8(p->size[1 - side][i], e));
    double unit = (double)p->unit[side], x = (double)b->origin[0] * unit,
           y = (double)b->origin[1] * unit, z = (double)b->origin[2] * unit;
    v4d origin = { x, y, z, 0 };
    if (side == 1)
        origin = load_doubles(p->column[0]) * v4d_all(x) + load_doubles(p->column[1]) * v4d_all(y) +
                 load_doubles(p->column[2]) * v4d_all(z) + load_doubles(p->place);
    /* One store of all four doubles: two_nodes_of loads them together soon, and a processor waits
     * long for a load that needs several recent stores. The alignment keeps both in one line. */
    _Static_assert(offsetof(ebpo_turned_node, origin) % 32 == 0, "the origin is aligned");
    memcpy(out->origin, &origin, sizeof origin);
    out->node = node;
    out->lanes = (uint8_t)((1u << b->count) - 1);
}

/* Returns the children of a node in both frames; transforms them if the cache does not have them.
 */
EBPO_EIGHT const ebpo_turned_node *turned_node(ebpo_pair_walk *w, int side, uint32_t node)
{
    uint32_t entry = node * UINT32_C(0x9e3779b1) >> (32 - EBPO_TURNED_BITS);
    ebpo_turned_node *out = &w->turned[side][entry];
    if (__builtin_expect(w->turned_node[side][entry] != node, 0)) {
        transform_node(w->pair, side, node, out);
        w->turned_node[side][entry] = node;
    }
    return out;
}

/* --- eight children against one --- */

/* Two nodes P and Q, whose children are compared: all children of P with one child of Q. */
typedef struct two_nodes {
    const ebpo_turned_node *p, *q;
    float in_p[8];     /* Q's origin minus P's origin, in P's frame, twice; entries 3 and 7 are 0 */
    float in_q[8];     /* P's origin minus Q's origin, in Q's frame, in the same way */
    f8 slack;          /* greatest error by which computed gaps of boxes may be too large */
    f8 cylinder_slack; /* greatest error by which computed gaps of cylinders may be too large */
    float sine;        /* 1 plus ebpo_accel_pair.sine_capacity */
    bool cylinders;    /* a child has a cylinder */
} two_nodes;

/* Prepares the comparison of a, a node of the first model, and b, a node of the second model.
 * p_side: 0 if P is a, 1 if P is b. */
EBPO_EIGHT two_nodes two_nodes_of(const ebpo_accel_pair *pair, const ebpo_turned_node *a,
                                  const ebpo_turned_node *b, int p_side)
{
    two_nodes t = { .p = p_side == 0 ? a : b, .q = p_side == 0 ? b : a };
    v4d between = load_doubles(b->origin) - load_doubles(a->origin);
    f8 in_a = f8_from_doubles(between, between), x = f8_spread0(in_a), y = f8_spread1(in_a),
       z = f8_spread2(in_a);
    f8 in_b = f8_add(f8_add(f8_mul(f8_load_twice(pair->into_column[0]), x),
                            f8_mul(f8_load_twice(pair->into_column[1]), y)),
                     f8_mul(f8_load_twice(pair->into_column[2]), z));
    f8_store(p_side == 0 ? t.in_p : t.in_q, in_a);
    f8_store(p_side == 0 ? t.in_q : t.in_p, f8_sub(f8_all(0), in_b));
    f8 size = f8_add(f8_all(a->size + b->size), f8_max3(f8_abs(x), f8_abs(y), f8_abs(z))),
       uncertainty = f8_all(pair->uncertainty);
    t.slack = f8_add(f8_mul(f8_all(0x1p-18f), size), uncertainty);
    t.cylinder_slack = f8_add(f8_mul(f8_all(pair->cylinder_share), size), uncertainty);
    t.sine = 1 + pair->sine_capacity;
    t.cylinders = a->cylinders | b->cylinders;
    return t;
}

/* Returns, for each box of P, the greatest gap between this box and box j of Q along the six axes
 * of both frames; negative if the boxes overlap along all axes. */
EBPO_EIGHT f8 box_gaps(const two_nodes *t, int j)
{
    const ebpo_turned_node *p = t->p, *q = t->q;
    f8 gap = f8_all(-0x1p120f);
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++) {
        f8 far = f8_abs(f8_sub(f8_load(p->c[k]), f8_all(q->c2[k][j] + t->in_p[k])));
        gap = f8_max(f8_sub(far, f8_add(f8_load(p->e[k]), f8_all(q->e2[k][j]))), gap);
    }
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++) {
        f8 far = f8_abs(f8_add(f8_load(p->c2[k]), f8_all(t->in_q[k] - q->c[k][j])));
        gap = f8_max(f8_sub(far, f8_add(f8_load(p->e2[k]), f8_all(q->e[k][j]))), gap);
    }
    return gap;
}

/* Returns, for each cylinder of P, the greatest gap between P's child and child j of Q along the
 * axes of both cylinders, computed in P's frame. Along the axis of a cylinder, the extent of the
 * other child is bounded by its cylinder and by its box. Raises *key_gap to the gaps without the
 * cylinders of large children. */
EBPO_EIGHT f8 cylinder_gaps(const two_nodes *t, int j, f8 *key_gap)
{
    const ebpo_turned_node *p = t->p, *q = t->q;
    /* between_mids, to_q_box, to_p_box: vectors between the middles of both cylinders, between P's
     * cylinder and Q's box, and between Q's cylinder and P's box */
    f8 p_axis[3], p_size[3], q_axis[3], between_mids[3], to_q_box[3], to_p_box[3], e[3],
        zero = f8_all(0);
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++) {
        f8 mid = f8_load(p->mid[k]), q_mid = f8_all(q->mid2[k][j] + t->in_p[k]);
        p_axis[k] = f8_load(p->axis[k]);
        p_size[k] = f8_abs(f8_load(p->axis2[k]));
        q_axis[k] = f8_all(q->axis2[k][j]);
        between_mids[k] = f8_sub(mid, q_mid);
        to_q_box[k] = f8_sub(mid, f8_all(q->c2[k][j] + t->in_p[k]));
        to_p_box[k] = f8_sub(f8_load(p->c[k]), q_mid);
        e[k] = f8_all(q->e[k][j]);
    }
    f8 cosine = f8_abs(vector_dot8(p_axis, q_axis)),
       sine = f8_sqrt(f8_max(f8_sub(f8_all(t->sine), f8_mul(cosine, cosine)), zero));
    f8 p_half = f8_load(p->half), p_radius = f8_load(p->radius), q_half = f8_all(q->half[j]),
       q_radius = f8_all(q->radius[j]);
    f8 by_cylinder = f8_sub(f8_abs(vector_dot8(p_axis, between_mids)),
                            f8_add(f8_mul(cosine, q_half), f8_mul(sine, q_radius))),
       by_box = f8_sub(f8_abs(vector_dot8(p_axis, to_q_box)), vector_dot8(p_size, e));
    f8 gap = f8_sub(f8_max(by_cylinder, by_box), p_half), box_gap = f8_sub(by_box, p_half);
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++) {
        e[k] = f8_load(p->e[k]);
        p_axis[k] = f8_abs(q_axis[k]);
    }
    by_cylinder = f8_sub(f8_abs(vector_dot8(q_axis, between_mids)),
                         f8_add(f8_mul(cosine, p_half), f8_mul(sine, p_radius)));
    by_box = f8_sub(f8_abs(vector_dot8(q_axis, to_p_box)), vector_dot8(p_axis, e));
    f8 q_gap = f8_sub(f8_max(by_cylinder, by_box), q_half), both = f8_max(gap, q_gap), key = both;
    if (p->large | q->large) {
        f8 none = f8_all(-0x1p120f), large = f8_mask(p->large);
        key = q->large >> j & 1 ? f8_pick(large, none, box_gap)
                                : f8_max(f8_pick(large, none, gap),
                                         f8_pick(large, f8_sub(by_box, q_half), q_gap));
    }
    *key_gap = f8_max(*key_gap, key);
    return both;
}

/* Returns a bit for each child of P, 1 if the child may intersect child j of Q (or if the computed
 * gap is NaN). If `first`, sets key[i] to ebpo_node_pair.key of the pair of child i of P and child
 * j of Q. */
EBPO_EIGHT unsigned near_children_of(const two_nodes *t, int j, bool first, float key[8])
{
    f8 gap = box_gaps(t, j);
    unsigned near = t->p->lanes & ~f8_bits(f8_less(t->slack, gap));
    if (near && t->cylinders) {
        f8 cylinder = cylinder_gaps(t, j, &gap);
        near &= ~f8_bits(f8_less(t->cylinder_slack, cylinder));
    }
    if (first && near) {
        f8 sizes = f8_add(f8_load(t->p->extent), f8_all(t->q->extent[j]));
        f8_store(key, f8_max(f8_div(f8_sub(f8_all(0), gap), sizes), f8_all(-0x1p120f)));
    }
    return near;
}

/* --- pairs of nodes --- */

/* Begins a group: in a search for the first contact, the pairs into which one pair of nodes is
 * divided are a group on the stack. A group is not sorted, because the search leaves most groups
 * early; pop_deepest finds the pair with the deepest overlap when a pair of the group is needed.
 * Below each group on the stack is an entry with the start of the previous group. */
EBPO_EIGHT void open_group(ebpo_pair_walk *w)
{
    w->stack[w->top++] = (ebpo_node_pair){ 0, (uint32_t)w->group, 0 };
    w->group = w->top;
}

/* Pops the pair with the deepest overlap of the last group; of several pairs with equal overlap,
 * the pair with the greatest indices. Returns false if the stack is empty. */
EBPO_EIGHT bool pop_deepest(ebpo_pair_walk *w, ebpo_node_pair *out)
{
    ebpo_node_pair *s = w->stack;
    while (w->top == w->group) {
        if (w->top == 0)
            return false;
        w->top--;
        w->group = s[w->top].b;
    }
    uint64_t best = w->group, last = --w->top;
    for (uint64_t i = best + 1; i <= last; i++) {
        bool greater = s[i].b != s[best].b ? s[i].b > s[best].b : s[i].a > s[best].a;
        best = s[i].key > s[best].key || (s[i].key == s[best].key && greater) ? i : best;
    }
    *out = s[best];
    s[best] = s[last];
    return true;
}

/* Pushes a pair of children. */
EBPO_EIGHT void push_pair(ebpo_pair_walk *w, uint32_t a, uint32_t b, float key)
{
    w->stack[w->top++] = (ebpo_node_pair){ a, b, key };
}

/* Pushes the pairs of the children of p, a node of the first model, with the children of q whose
 * bits are set in `lanes_q`, if they may intersect. First collects a bit for each pair, because the
 * processor predicts one loop over these bits better than a loop for each child. first: computes
 * the keys of the pairs. */
EBPO_EIGHT void push_both(ebpo_pair_walk *w, const ebpo_turned_node *p, const ebpo_turned_node *q,
                          unsigned lanes_q, bool first)
{
    const ebpo_accel *a = w->pair->accel[0], *b = w->pair->accel[1];
    uint32_t node_a = p->node, node_b = q->node;
    two_nodes t = two_nodes_of(w->pair, p, q, 0);
    /* The cylinders of the roots' children exclude few pairs. Cylinders that are not large are
     * needed for keys. */
    if (node_a == a->root_bound && node_b == b->root_bound)
        t.cylinders &= p->large != p->lanes || q->large != q->lanes;
    float key[64];
    uint64_t near = 0;
    bool same_node = w->self && node_a == node_b;
    for (unsigned lanes = t.q->lanes & lanes_q; lanes; lanes &= lanes - 1) {
        int j = __builtin_ctz(lanes);
        unsigned with_j = near_children_of(&t, j, first, key + 8 * j);
        if (same_node)
            with_j &= (2u << j) - 1; /* only children 0 to j, so that each pair is pushed once */
        if (with_j)
            fetch_below(b, b->bound[node_b].child[j], t.cylinders);
        near |= (uint64_t)with_j << 8 * j;
    }
    for (; near; near &= near - 1) {
        uint32_t bit = (uint32_t)__builtin_ctzll(near), i = bit & 7;
        fetch_below(a, a->bound[node_a].child[i], t.cylinders);
        push_pair(w, node_a << 3 | i, node_b << 3 | bit >> 3, first ? key[bit] : 0);
    }
}

/* Returns a bit for each child of p, a node of model `side`, 1 if the child may intersect
 * `q_child`, a child of q (as in ebpo_node_pair). first, key: as for near_children_of. */
EBPO_EIGHT unsigned near_children_of_side(const ebpo_pair_walk *w, int side,
                                          const ebpo_turned_node *p, const ebpo_turned_node *q,
                                          uint32_t q_child, bool first, float key[8])
{
    two_nodes t = two_nodes_of(w->pair, side == 0 ? p : q, side == 0 ? q : p, side);
    return near_children_of(&t, (int)(q_child & 7), first, key);
}

/* Divides only one child of the pair r: pushes the pairs of the children of `node`, a node of model
 * `side`, with the other child of r. q: the node that has this other child. */
EBPO_EIGHT void push_one_side(ebpo_pair_walk *w, ebpo_node_pair r, int side, uint32_t node,
                              const ebpo_turned_node *q, bool first)
{
    const ebpo_accel *s = w->pair->accel[side];
    uint32_t undivided = side == 0 ? r.b : r.a;
    float key[8] = { 0 };
    for (unsigned near =
             near_children_of_side(w, side, turned_node(w, side, node), q, undivided, first, key);
         near; near &= near - 1) {
        uint32_t i = (uint32_t)__builtin_ctz(near), child = node << 3 | i;
        fetch_below(s, s->bound[node].child[i], w->pair->cylinders);
        push_pair(w, side == 0 ? child : undivided, side == 0 ? undivided : child, key[i]);
    }
}

/* If the box of a child is this many times larger than the box of the other child, only the larger
 * child is divided. */
#define LONGER 4.0f

/* Returns the index, 0 or 1, of the child to be divided; 2: both children. a, b: entries of the
 * children (nodes or blocks); at least one child is a node. size_a, size_b: sizes of the children's
 * boxes. */
EBPO_EIGHT int side_to_divide(uint32_t a, uint32_t b, float size_a, float size_b)
{
    if (a & EBPO_IS_BLOCK)
        return 1;
    if (b & EBPO_IS_BLOCK)
        return 0;
    return size_a > LONGER * size_b ? 0 : size_b > LONGER * size_a ? 1 : 2;
}

/* Divides a pair r of children, which are the nodes or blocks a and b, and pushes the new pairs
 * that may intersect. first: the new pairs are a group. Returns false if memory is short. */
EBPO_EIGHT bool divide_pair(ebpo_pair_walk *w, ebpo_node_pair r, uint32_t a, uint32_t b, bool first)
{
    w->node_pairs++;
    if (!ebpo_pair_walk_capacity(w, 65)) /* 8 x 8 pairs, and the entry of a group */
        return false;
    if (first)
        open_group(w);
    const ebpo_turned_node *of_a = turned_node(w, 0, r.a >> 3), *of_b = turned_node(w, 1, r.b >> 3);
    int side = side_to_divide(a, b, of_a->extent[r.a & 7], of_b->extent[r.b & 7]);
    if (side != 2) {
        push_one_side(w, r, side, side == 0 ? a : b, side == 0 ? of_b : of_a, first);
        return true;
    }
    const ebpo_turned_node *q = turned_node(w, 1, b); /* may overwrite of_b */
    float key[8];
    unsigned near = near_children_of_side(w, 1, q, of_a, r.a, false, key);
    if (near)
        push_both(w, turned_node(w, 0, a), q, near, first);
    return true;
}

/* --- pairs of blocks --- */

/* Returns the posed faces of a block. */
static const ebpo_posed_faces *posed_faces(ebpo_pair_walk *w, int side, uint32_t block)
{
    return posed_faces_of(&w->posed[side], w->pair->accel[side], w->pair->posing[side], block);
}

/* Computes the faces of a block relative to `origin`, as ebpo_posed_block_place does. Returns a
 * bound of the errors of their coordinates. */
EBPO_EIGHT float place_faces(const ebpo_posed_faces *b, double unit, const double origin[3],
                             float out[9][8])
{
    float most = 0;
    for (int k = 0; k < 3; k++) {
        float shift = (float)((b->base[k] - origin[k]) * unit), size = shift < 0 ? -shift : shift;
        most = size > most ? size : most;
        for (int i = 0; i < 3; i++)
            f8_store(out[3 * i + k], f8_add(f8_load(b->x[3 * i + k]), f8_all(shift)));
    }
    return b->error + 0x1.2p-24f * b->extent + 2.5f * 0x1p-24f * most;
}

/* Finds the pairs of intersecting faces of two blocks. Returns false if memory is short. */
static bool visit_blocks(ebpo_pair_walk *w, uint32_t block_a, uint32_t block_b)
{
    const ebpo_posed_faces *a = posed_faces(w, 0, block_a), *b = posed_faces(w, 1, block_b);
    float placed[9][8];
    float error = place_faces(b, w->pair->posing[0]->unit, a->base, placed);
    ebpo_block_pairs pairs;
    w->block_pairs++;
    w->filter->blocks(a->x[0], a->lanes, placed[0], b->lanes, error > a->error ? error : a->error,
                      &pairs);
    return pairs.count == 0 || ebpo_pair_walk_decide(w, block_a, block_b, &pairs);
}

/* --- the stack --- */

/* Visits at most `pairs` pairs of the stack. first: value of w->first, as a constant, so that the
 * compiler makes a separate loop for each value. Returns false if memory is short. */
EBPO_EIGHT bool run_any(ebpo_pair_walk *w, uint64_t pairs, bool first)
{
    const ebpo_accel *sa = w->pair->accel[0], *sb = w->pair->accel[1];
    for (uint64_t i = 0; i < pairs && w->top > 0; i++) {
        ebpo_node_pair r;
        if (!first)
            r = w->stack[--w->top];
        else if (!pop_deepest(w, &r))
            break;
        uint32_t a = below_child(sa, r.a), b = below_child(sb, r.b);
        bool ok = a & b & EBPO_IS_BLOCK ? visit_blocks(w, a & ~EBPO_IS_BLOCK, b & ~EBPO_IS_BLOCK)
                                        : divide_pair(w, r, a, b, first);
        if (!ok)
            return false;
        if (first && w->found_count)
            w->top = 0;
    }
    return true;
}

/* The functions of ebpo_walk_kernels. */
static bool walk_run(ebpo_pair_walk *w, uint64_t pairs)
{
    return w->first ? run_any(w, pairs, true) : run_any(w, pairs, false);
}

static bool walk_start(ebpo_pair_walk *w)
{
    if (!ebpo_pair_walk_capacity(w, 64))
        return false;
    push_both(w, turned_node(w, 0, w->pair->accel[0]->root_bound),
              turned_node(w, 1, w->pair->accel[1]->root_bound), 255, w->first);
    return true;
}

static bool walk_expand(ebpo_pair_walk *w, ebpo_node_pair r)
{
    uint32_t a = below_child(w->pair->accel[0], r.a), b = below_child(w->pair->accel[1], r.b);
    if (!(a & b & EBPO_IS_BLOCK))
        return divide_pair(w, r, a, b, false);
    if (!ebpo_pair_walk_capacity(w, 1))
        return false;
    push_pair(w, r.a, r.b, r.key);
    return true;
}

const ebpo_walk_kernels EBPO_KERNEL(ebpo_walk_kernels) = { walk_run, walk_start, walk_expand };
