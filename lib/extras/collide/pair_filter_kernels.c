/* Filters pairs of faces, eight at a time in floats: finds pairs that are certainly apart and pairs
 * that certainly cross. This file is compiled for several instruction sets with the same results.
 *
 * Three tests follow each other, each with a proved error bound. The first test compares the boxes
 * of both faces. The second test compares the corners of each face with the plane of the other
 * face. The third test compares the intervals of both faces on the common line of the planes. Pairs
 * that no test decides are undecided; the caller decides them exactly. docs/develop/collision.md
 * ("The filter of eight pairs") explains the letters in the code. Names that end in 8 handle eight
 * values at once. */
#include "core/strict_fp.h"

#include "core/simd.h"
#include "extras/collide/face_pairs.h"

/* Eight points or vectors. */
typedef struct vector8 {
    f8 x[3];
} vector8;

/* Returns a - b. */
EBPO_EIGHT vector8 vector8_minus(vector8 a, vector8 b)
{
    return (vector8){ { f8_sub(a.x[0], b.x[0]), f8_sub(a.x[1], b.x[1]), f8_sub(a.x[2], b.x[2]) } };
}

EBPO_EIGHT vector8 vector8_pick(f8 mask, vector8 yes, vector8 no)
{
    return (vector8){ { f8_pick(mask, yes.x[0], no.x[0]), f8_pick(mask, yes.x[1], no.x[1]),
                        f8_pick(mask, yes.x[2], no.x[2]) } };
}

/* Returns the scalar products of a and b. */
EBPO_EIGHT f8 vector8_dot(vector8 a, vector8 b)
{
    return f8_add(f8_add(f8_mul(a.x[0], b.x[0]), f8_mul(a.x[1], b.x[1])), f8_mul(a.x[2], b.x[2]));
}

/* Returns a d - b c. */
EBPO_EIGHT f8 minor_of8(f8 a, f8 b, f8 c, f8 d) { return f8_sub(f8_mul(a, d), f8_mul(b, c)); }

/* Returns the vector products of a and b. */
EBPO_EIGHT vector8 vector8_cross(vector8 a, vector8 b)
{
    return (vector8){ { minor_of8(a.x[1], a.x[2], b.x[1], b.x[2]),
                        minor_of8(a.x[2], a.x[0], b.x[2], b.x[0]),
                        minor_of8(a.x[0], a.x[1], b.x[0], b.x[1]) } };
}

/* Returns the 1-norm, which is at least the length. */
EBPO_EIGHT f8 vector8_size(vector8 a)
{
    return f8_add(f8_add(f8_abs(a.x[0]), f8_abs(a.x[1])), f8_abs(a.x[2]));
}

/* Eight faces. */
typedef struct face8 {
    vector8 corner[3];
} face8;

/* --- boxes --- */

/* Eight boxes. */
typedef struct box8 {
    f8 low[3], high[3];
} box8;

/* Returns the boxes of eight faces. */
EBPO_EIGHT box8 box_of8(const face8 *f)
{
    const vector8 *c = f->corner;
    box8 b;
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++) {
        b.low[k] = f8_min3(c[0].x[k], c[1].x[k], c[2].x[k]);
        b.high[k] = f8_max3(c[0].x[k], c[1].x[k], c[2].x[k]);
    }
    return b;
}

/* Returns a bit for each pair of boxes, 1: certainly apart. e: error of coordinates. */
EBPO_EIGHT unsigned boxes_apart8(const box8 *a, const box8 *b, f8 e)
{
    f8 far = f8_all(-1);
#pragma GCC unroll 3
    for (int k = 0; k < 3; k++)
        far = f8_max3(f8_sub(a->low[k], b->high[k]), f8_sub(b->low[k], a->high[k]), far);
    return f8_bits(f8_less(f8_mul(e, f8_all(4)), far));
}

/* --- sides of planes --- */

/* The sides of a face's plane on which the three corners of the other face are. */
typedef struct sides8 {
    f8 above[3];      /* masks: the corner is above; valid only where `certain` is set */
    unsigned same;    /* bits: all corners are certainly on one side */
    unsigned certain; /* bits: the sides of all three corners are certain */
} sides8;

/* Finds the sides. e1, e2: edges of the plane's face from its first corner; d: corners of the other
 * face minus this first corner; bound: greatest error of the determinants. */
EBPO_EIGHT sides8 sides_of8(vector8 e1, vector8 e2, const vector8 d[3], f8 bound)
{
    vector8 n = vector8_cross(e1, e2);
    f8 zero = f8_all(0), g[3];
    sides8 s;
#pragma GCC unroll 3
    for (int i = 0; i < 3; i++) {
        g[i] = vector8_dot(n, d[i]);
        s.above[i] = f8_less(zero, g[i]);
    }
    f8 lowest = f8_min3(g[0], g[1], g[2]), highest = f8_max3(g[0], g[1], g[2]);
    s.same = f8_bits(f8_or(f8_less(bound, lowest), f8_less(highest, f8_sub(zero, bound))));
    f8 least = f8_min3(f8_abs(g[0]), f8_abs(g[1]), f8_abs(g[2]));
    s.certain = f8_bits(f8_less(bound, least));
    return s;
}

/* --- the common line --- */

/* Masks for a face: the other two corners are on the other side of the other face's plane, so one
 * corner is alone on its side. */
typedef struct alone8 {
    f8 is0, is1; /* corner 0 is alone; corner 1 is alone; if neither is set, corner 2 is alone */
    f8 above;    /* the corner that is alone is above the plane */
} alone8;

/* Finds the corners that are alone. above: as in sides8. */
EBPO_EIGHT alone8 alone_of8(const f8 above[3])
{
    f8 differ01 = f8_xor(above[0], above[1]), differ12 = f8_xor(above[1], above[2]),
       differ02 = f8_xor(above[0], above[2]);
    alone8 out;
    out.is0 = f8_and(differ01, differ02);
    out.is1 = f8_and(differ01, differ12);
    out.above = f8_pick(out.is0, above[0], f8_pick(out.is1, above[1], above[2]));
    return out;
}

/* Returns the corner that is `first` positions after the corner that is alone. */
EBPO_EIGHT vector8 turned_corner8(const face8 *f, const alone8 *alone, int first)
{
    const vector8 *c = f->corner;
    return vector8_pick(alone->is0, c[first],
                        vector8_pick(alone->is1, c[(first + 1) % 3], c[(first + 2) % 3]));
}

/* Finds the pairs that are apart, and the pairs that cross, by the intervals of both faces on the
 * common line. The results are valid only for pairs whose sides are all certain. bound: greatest
 * error of the determinants. */
EBPO_EIGHT ebpo_pair_masks decide_on_line8(const face8 *a, const face8 *b, const sides8 *side_a,
                                           const sides8 *side_b, f8 bound)
{
    alone8 alone_a = alone_of8(side_a->above), alone_b = alone_of8(side_b->above);
    vector8 p = turned_corner8(a, &alone_a, 0), a1 = turned_corner8(a, &alone_a, 1),
            a2 = turned_corner8(a, &alone_a, 2);
    vector8 u = turned_corner8(b, &alone_b, 0), b1 = turned_corner8(b, &alone_b, 1),
            b2 = turned_corner8(b, &alone_b, 2);
    vector8 q = vector8_minus(vector8_pick(alone_b.above, a1, a2), p),
            r = vector8_minus(vector8_pick(alone_b.above, a2, a1), p),
            v = vector8_minus(vector8_pick(alone_a.above, b1, b2), p),
            w = vector8_minus(vector8_pick(alone_a.above, b2, b1), p), y = vector8_minus(u, p);
    f8 lower = vector8_dot(vector8_cross(q, y), v), upper = vector8_dot(vector8_cross(r, w), y);
    f8 minus = f8_sub(f8_all(0), bound);
    f8 apart = f8_or(f8_less(bound, lower), f8_less(bound, upper)),
       intersects = f8_and(f8_less(lower, minus), f8_less(upper, minus));
    return (ebpo_pair_masks){ (uint8_t)f8_bits(apart), (uint8_t)f8_bits(intersects) };
}

/* --- bounds --- */

/* Returns a bound of the error of determinants: m * (4 e n1 + 12 v n2), where v is 2^-24. */
EBPO_EIGHT f8 error_bound8(f8 e, f8 m, f8 n1, f8 n2)
{
    f8 inputs = f8_mul(f8_mul(e, f8_all(4)), n1), rounding = f8_mul(n2, f8_all(12 * 0x1p-24f));
    return f8_mul(m, f8_add(inputs, rounding));
}

/* Returns a bound of the error of the determinants that compare corners of one face with the plane
 * of the other face. l: greatest length of an edge of the plane's face. d: greatest distance of a
 * compared corner from the first corner of the plane's face. */
EBPO_EIGHT f8 plane_bound8(f8 e, f8 l, f8 d)
{
    return error_bound8(e, l, f8_add(f8_add(d, d), l), f8_mul(l, d));
}

/* Returns an upper bound of the lengths of two edges. */
EBPO_EIGHT f8 edges_size8(vector8 e1, vector8 e2, f8 e)
{
    return f8_add(f8_max(vector8_size(e1), vector8_size(e2)), f8_mul(e, f8_all(4)));
}

/* Decides pairs by the planes and intervals of their faces. e: error of coordinates. out.apart: the
 * pairs that are already known to be apart. Returns `out` with all decisions. */
EBPO_EIGHT ebpo_pair_masks decide_faces8(const face8 *a, const face8 *b, f8 e, ebpo_pair_masks out)
{
    vector8 e1 = vector8_minus(a->corner[1], a->corner[0]),
            e2 = vector8_minus(a->corner[2], a->corner[0]),
            f1 = vector8_minus(b->corner[1], b->corner[0]),
            f2 = vector8_minus(b->corner[2], b->corner[0]), to_b[3], to_a[3];
#pragma GCC unroll 3
    for (int i = 0; i < 3; i++) {
        to_b[i] = vector8_minus(b->corner[i], a->corner[0]);
        to_a[i] = vector8_minus(a->corner[i], b->corner[0]);
    }
    f8 la = edges_size8(e1, e2, e), lb = edges_size8(f1, f2, e),
       d = f8_add(vector8_size(to_b[0]), f8_mul(e, f8_all(4)));
    sides8 side_b = sides_of8(e1, e2, to_b, plane_bound8(e, la, f8_add(d, lb))),
           side_a = sides_of8(f1, f2, to_a, plane_bound8(e, lb, f8_add(d, la)));
    out.apart |= (uint8_t)(side_a.same | side_b.same);
    unsigned certain = side_a.certain & side_b.certain & ~(unsigned)out.apart;
    if (!certain)
        return out;
    f8 w = f8_add(f8_add(d, la), lb), la2 = f8_add(la, la),
       bound = error_bound8(e, w, f8_add(w, f8_add(la2, la2)), f8_mul(la2, w));
    ebpo_pair_masks line = decide_on_line8(a, b, &side_a, &side_b, bound);
    out.apart |= (uint8_t)(line.apart & certain);
    out.crossing = (uint8_t)(line.crossing & certain);
    return out;
}

/* Loads eight faces from [9][8] floats. */
EBPO_EIGHT face8 load_eight(const float *block)
{
    face8 f;
#pragma GCC unroll 9
    for (int i = 0; i < 9; i++)
        f.corner[i / 3].x[i % 3] = f8_load(block + 8 * i);
    return f;
}

/* Returns the error, but at least 2^-40, which covers underflow. */
EBPO_EIGHT f8 usable_error8(float error) { return f8_all(error > 0x1p-40f ? error : 0x1p-40f); }

/* Decides eight pairs of faces by all tests. */
EBPO_EIGHT ebpo_pair_masks filter_faces8(const face8 *a, const face8 *b, float error)
{
    f8 e = usable_error8(error);
    box8 box_a = box_of8(a), box_b = box_of8(b);
    ebpo_pair_masks out = { (uint8_t)boxes_apart8(&box_a, &box_b, e), 0 };
    return out.apart == 255 ? out : decide_faces8(a, b, e, out);
}

static ebpo_pair_masks filter_one(const float *a, const float *b, float error)
{
    face8 f, g = load_eight(b);
#pragma GCC unroll 9
    for (int i = 0; i < 9; i++)
        f.corner[i / 3].x[i % 3] = f8_all(a[i]);
    return filter_faces8(&f, &g, error);
}

static ebpo_pair_masks filter_eight(const float *a, const float *b, float error)
{
    face8 f = load_eight(a), g = load_eight(b);
    return filter_faces8(&f, &g, error);
}

/* --- blocks --- */

/* Pairs of lanes of two blocks. */
typedef struct lane_pairs {
    int32_t a[72], b[72]; /* [count + 8] */
    int count;            /* at most 64 */
} lane_pairs;

/* Lists the pairs whose boxes are not certainly apart. The eight entries after the last pair are
 * valid lanes, too, so that pairs can be loaded eight at a time. */
EBPO_EIGHT void pairs_by_boxes(const face8 *a, unsigned lanes_a, const face8 *b, unsigned lanes_b,
                               f8 e, lane_pairs *out)
{
    box8 box_a = box_of8(a), box_b = box_of8(b), box;
    float low[3][8], high[3][8];
    uint64_t near = 0; /* a bit for each pair to be listed: the processor predicts one loop over
                        * these bits better than eight loops */
    for (int k = 0; k < 3; k++) {
        f8_store(low[k], box_b.low[k]);
        f8_store(high[k], box_b.high[k]);
    }
    for (unsigned lanes = lanes_b; lanes; lanes &= lanes - 1) {
        int j = __builtin_ctz(lanes);
        for (int k = 0; k < 3; k++) {
            box.low[k] = f8_all(low[k][j]);
            box.high[k] = f8_all(high[k][j]);
        }
        near |= (uint64_t)(lanes_a & ~boxes_apart8(&box_a, &box, e)) << 8 * j;
    }
    for (out->count = 0; near; near &= near - 1) {
        int bit = __builtin_ctzll(near);
        out->a[out->count] = bit & 7;
        out->b[out->count++] = bit >> 3;
    }
    for (int i = 0; i < 8; i++)
        out->a[out->count + i] = out->b[out->count + i] = 0;
}

/* Loads the faces in eight lanes of a block. */
EBPO_EIGHT face8 load_lanes(const float *block, const int32_t *lane)
{
    face8 f;
#pragma GCC unroll 9
    for (int i = 0; i < 9; i++)
        f.corner[i / 3].x[i % 3] = f8_load_lanes(block + 8 * i, lane);
    return f;
}

static void filter_blocks(const float *a, unsigned lanes_a, const float *b, unsigned lanes_b,
                          float error, ebpo_block_pairs *out)
{
    face8 f = load_eight(a), g = load_eight(b);
    f8 e = usable_error8(error);
    lane_pairs near;
    pairs_by_boxes(&f, lanes_a, &g, lanes_b, e, &near);
    out->count = 0;
    for (int at = 0; at < near.count; at += 8) {
        face8 x = load_lanes(a, near.a + at), y = load_lanes(b, near.b + at);
        unsigned used = near.count - at < 8 ? (1u << (near.count - at)) - 1 : 255;
        ebpo_pair_masks m = decide_faces8(&x, &y, e, (ebpo_pair_masks){ (uint8_t)~used, 0 });
        for (unsigned kept = used & ~(unsigned)m.apart; kept; kept &= kept - 1) {
            int i = __builtin_ctz(kept);
            int crossing = m.crossing >> i & 1 ? EBPO_CERTAINLY_CROSSING : 0;
            out->pair[out->count++] = (uint8_t)(near.a[at + i] | near.b[at + i] << 3 | crossing);
        }
    }
}

const ebpo_pair_kernels EBPO_KERNEL(ebpo_pair_kernels) = { filter_one, filter_eight,
                                                           filter_blocks };
