/* Implements the kernels of the query "inside" (inside.c). They process the faces that a leaf
 * lists, eight faces at a time.
 *
 * sum_crossings sums the crossings of the faces with a segment that is parallel to an axis. The
 * function uses single precision, or double precision in accels (acceleration structures of
 * subtrees) of doubles. Faces that are not certain in this precision ("open" faces) are decided
 * exactly by inside.c.
 *
 * find_reached_cell_faces finds the cell faces that the leaf's faces reach. A face reaches a cell
 * face if the extent of the face on the cell face's axis goes up to the cell face or beyond.
 * find_reached_cell_faces also computes the box of each block in the leaf's list. The function is
 * called once for each leaf, during one of the first queries in this leaf. The comparisons of
 * find_reached_cell_faces are exact.
 *
 * This file is compiled for several instruction sets with the same results (core/cpu.h). Error
 * bounds: docs/develop/bounds.md; crossings: EBP 2017, 4.2. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "core/simd.h"
#include "geometry/cells.h"
#include "geometry/vec3.h"
#include "query/face_block.h"
#include "query/query_kernels.h"

/* --- crossings --- */

/* The turns of eight faces around the segment's line: the directions in which their corners follow
 * each other around the line. Masks have a bit for each face. A face whose bit is 0 in all three
 * masks certainly has no point on the line. */
typedef struct turns {
    unsigned left;  /* all edges certainly turn left around the line */
    unsigned right; /* all edges certainly turn right around the line */
    unsigned open;  /* not certain */
} turns;

/* Combines the turns of the three edges of each face. some_left: an edge certainly turns left;
 * all_left: all edges certainly turn left. lanes: the lanes that the leaf lists. */
EBPO_EIGHT turns combine_turns(unsigned some_left, unsigned some_right, unsigned all_left,
                               unsigned all_right, unsigned lanes)
{
    return (turns){ lanes & all_left, lanes & all_right,
                    lanes & ~(all_left | all_right | (some_left & some_right)) };
}

/* Rounding in single precision: let R be the greatest |coordinate| of the model's box and M the
 * greatest side of the box. Two floats represent `from` with an error of at most 2^-48 R. So the
 * error of a difference d of coordinates is at most 2^-23 |d| plus 2^-47 R. No |d| is above M. So
 * the error of a cross product is at most 2^-45 R M plus 2^-21 of the sum of the absolute values of
 * its two products.
 *
 * The code uses larger bounds: 2^-43 R M (`turn_error_constant` of ebpo_accel) plus
 * TURN_ERROR_FACTOR times this sum. The larger bounds also cover the rounding of the bounds
 * themselves, and underflow: accels with blocks of floats have R above 2^-41 and M above 2^-40. */
#define TURN_ERROR_FACTOR 0x1p-20f

/* Computes the coordinates of the faces' corners on an axis, minus `from`. */
EBPO_EIGHT void load_relative(const ebpo_face_block *b, int axis, double from, f8 out[3])
{
    float high = (float)from, low = (float)(from - (double)high);
    ebpo_face_block_floats(b, axis, out);
    for (int i = 0; i < 3; i++)
        out[i] = f8_sub(f8_sub(out[i], f8_all(high)), f8_all(low));
}

/* Computes the turns of a block's faces in single precision. u, v: the two axes across the segment.
 * error_constant: the part of the error bound that does not depend on the face. */
EBPO_EIGHT turns turns_of_floats(const ebpo_face_block *b, unsigned lanes, int u, int v,
                                 const ebpo_axis_segment *g, float error_constant)
{
    f8 x[3], y[3], zero = f8_all(0), left[3], right[3];
    load_relative(b, u, g->from[u], x);
    load_relative(b, v, g->from[v], y);
    for (int i = 0; i < 3; i++) {
        int j = i == 2 ? 0 : i + 1;
        f8 p = f8_mul(x[i], y[j]), q = f8_mul(y[i], x[j]), turn = f8_sub(p, q);
        f8 size = f8_add(f8_abs(p), f8_abs(q));
        f8 error = f8_add(f8_mul(size, f8_all(TURN_ERROR_FACTOR)), f8_all(error_constant));
        left[i] = f8_less(error, turn);
        right[i] = f8_less(turn, f8_sub(zero, error));
    }
    return combine_turns(f8_bits(f8_or(left[0], f8_or(left[1], left[2]))),
                         f8_bits(f8_or(right[0], f8_or(right[1], right[2]))),
                         f8_bits(f8_and(left[0], f8_and(left[1], left[2]))),
                         f8_bits(f8_and(right[0], f8_and(right[1], right[2]))), lanes);
}

/* Rounding in double precision: the error of a difference of two doubles is at most 2^-53 of the
 * difference. The error of a cross product of two differences is at most CROSS_ERROR times the sum
 * of the absolute values of its two products. The height of a plane (compare_plane) is a sum of
 * three such cross products, each times a factor. The error of the height is at most HEIGHT_ERROR
 * times the sum of the absolute values of all products. UNDERFLOW_ERROR is added for underflow.
 * Overflow makes bounds infinite or NaN, and then nothing is certain. */
#define CROSS_ERROR     0x1p-50
#define HEIGHT_ERROR    0x1p-47
#define UNDERFLOW_ERROR 0x1p-960

/* Returns the cross product of the vectors (au, av) and (bu, bv) from the line to two corners.
 * *size: the sum of the absolute values of its two products. */
EBPO_EIGHT double cross_product(double au, double av, double bu, double bv, double *size)
{
    double p = au * bv, q = av * bu;
    *size = fabs(p) + fabs(q);
    return p - q;
}

/* Computes the turns of a block's faces in double precision. */
static turns turns_of_doubles(const ebpo_face_block *b, unsigned lanes, int u, int v,
                              const ebpo_axis_segment *g)
{
    double x[3][EBPO_BLOCK], y[3][EBPO_BLOCK];
    unsigned some[2] = { 0, 0 }, all[2] = { ~0u, ~0u };
    ebpo_face_block_doubles(b, u, x);
    ebpo_face_block_doubles(b, v, y);
    for (int i = 0; i < 3; i++) {
        unsigned left = 0, right = 0;
        for (unsigned lane = 0; lane < EBPO_BLOCK; lane++) {
            int j = i == 2 ? 0 : i + 1;
            double size,
                turn = cross_product(x[i][lane] - g->from[u], y[i][lane] - g->from[v],
                                     x[j][lane] - g->from[u], y[j][lane] - g->from[v], &size);
            double error = CROSS_ERROR * size + UNDERFLOW_ERROR;
            left |= (unsigned)(turn > error) << lane;
            right |= (unsigned)(turn < -error) << lane;
        }
        some[0] |= left;
        some[1] |= right;
        all[0] &= left;
        all[1] &= right;
    }
    return combine_turns(some[0], some[1], all[0], all[1], lanes);
}

/* Let x be the coordinate, on the segment's axis, of the point where the segment's line intersects
 * a face's plane. Returns 1 if x is greater than `at`, -1 if x is less, 0 if this is not certain.
 * weight[i]: cross_product of the two corners of edge i; size[i]: *size of the same call of
 * cross_product. k: the corners' coordinates on the axis. `turn`: 1 if the face turns left around
 * the line, -1 if it turns right. */
static int compare_plane(const double weight[3], const double size[3], const double k[3], double at,
                         int turn)
{
    double a = k[0] - at, b = k[1] - at, c = k[2] - at;
    double error = HEIGHT_ERROR * (size[1] * fabs(a) + size[2] * fabs(b) + size[0] * fabs(c)) +
                   UNDERFLOW_ERROR * (1 + fabs(a) + fabs(b) + fabs(c));
    double height = turn * (weight[1] * a + weight[2] * b + weight[0] * c);
    return height > error ? 1 : height < -error ? -1 : 0;
}

/* Tests if a face, which certainly intersects the segment's line, intersects the segment. Returns 1
 * if the face intersects the segment, 0 if it does not, -1 if this is not certain. t: the face's
 * corners. `turn`: as for compare_plane. */
static int intersects_segment(const double t[3][3], int u, int v, const ebpo_axis_segment *g,
                              int turn)
{
    double from = g->from[g->axis], weight[3], size[3], x[3], y[3],
           k[3] = { t[0][g->axis], t[1][g->axis], t[2][g->axis] };
    double least = k[0] < k[1] ? k[0] : k[1], most = k[0] < k[1] ? k[1] : k[0];
    least = k[2] < least ? k[2] : least;
    most = k[2] < most ? most : k[2];
    if (least > g->to || most < from)
        return 0;
    if (least > from && most < g->to)
        return 1;
    for (int i = 0; i < 3; i++) {
        x[i] = t[i][u] - g->from[u];
        y[i] = t[i][v] - g->from[v];
    }
    for (int i = 0; i < 3; i++) {
        int j = i == 2 ? 0 : i + 1;
        weight[i] = cross_product(x[i], y[i], x[j], y[j], &size[i]);
    }
    int at_from = least > from ? 1 : compare_plane(weight, size, k, from, turn),
        at_to = most < g->to ? -1 : compare_plane(weight, size, k, g->to, turn);
    return at_from < 0 || at_to > 0 ? 0 : at_from > 0 && at_to < 0 ? 1 : -1;
}

/* Returns the sum of the certain crossings of a block's faces with the segment. Appends the slots
 * of faces that are not certain to `open`. */
EBPO_EIGHT int32_t cross_block(const ebpo_accel *s, uint64_t listed, int u, int v,
                               const ebpo_axis_segment *segment, uint32_t *open,
                               uint32_t *open_count)
{
    uint32_t block = ebpo_listed_number(listed);
    ebpo_face_block b = ebpo_face_block_open(s, block);
    turns t = s->wide ? turns_of_doubles(&b, ebpo_listed_lanes(listed), u, v, segment)
                      : turns_of_floats(&b, ebpo_listed_lanes(listed), u, v, segment,
                                        s->turn_error_constant);
    int32_t sum = 0;
    for (unsigned lanes = t.left | t.right | t.open; lanes; lanes &= lanes - 1) {
        unsigned lane = (unsigned)__builtin_ctz(lanes);
        uint32_t slot = block * EBPO_BLOCK + lane;
        int crossings = -1, turn = t.left >> lane & 1 ? 1 : -1;
        if (!(t.open >> lane & 1)) {
            double corners[3][3];
            ebpo_accel_triangle(s, slot, corners);
            crossings = intersects_segment((const double(*)[3])corners, u, v, segment, turn);
        }
        if (crossings < 0)
            open[(*open_count)++] = slot;
        else
            sum -= crossings * turn;
    }
    return sum;
}

/* Sums the certain crossings of the segment with all listed faces. */
static int32_t sum_crossings(const ebpo_accel *s, const ebpo_listed_block *list,
                             const ebpo_axis_segment *segment, uint32_t *open, uint32_t *open_count)
{
    int axis = segment->axis, u = axis == 2 ? 0 : axis + 1, v = axis == 0 ? 2 : axis - 1;
    int32_t sum = 0;
    for (;; list++) {
        uint64_t listed = ebpo_listed(list);
        if (ebpo_axis_segment_intersects(segment, listed))
            sum += cross_block(s, listed, u, v, segment, open, open_count);
        if (listed & EBPO_LISTED_LAST)
            return sum;
    }
}

/* --- cell faces --- */

/* Coordinates of the cell faces: as doubles, and rounded down and up to the nearest floats. */
typedef struct faces_of_cell {
    double low[3], high[3];
    double inverse[3];              /* 1 / size of the cell */
    float low_down[3], low_up[3];   /* `low`, rounded down and up */
    float high_down[3], high_up[3]; /* `high`, rounded down and up */
    bool has_boxes; /* false if the cell is too small for boxes: each box is then the whole cell */
} faces_of_cell;

/* Returns f or a neighbour of f in the order of floats. `steps`: -1 (next lower float), 0 or 1. -0
 * and +0 are two neighbouring floats here. This is correct for the callers: rounding a tiny double
 * to a float gives the zero with the double's sign, so the next float is on the other side of the
 * double. */
static inline float step_float(float f, int32_t steps)
{
    uint32_t bits;
    memcpy(&bits, &f, sizeof bits);
    uint32_t reversed = bits >> 31 ? UINT32_C(0x7fffffff) : 0; /* bits of negative floats descend */
    bits = ((bits ^ reversed) + (uint32_t)steps) ^ reversed;
    memcpy(&f, &bits, sizeof bits);
    return f;
}

/* Returns the greatest float that is at most x. Avoids a branch on the direction of rounding, which
 * would be unpredictable. */
static inline float float_below(double x)
{
    float f = (float)x;
    return step_float(f, -(int32_t)((double)f > x));
}

/* Returns the least float that is at least x. */
static inline float float_above(double x)
{
    float f = (float)x;
    return step_float(f, (double)f < x);
}

static void find_cell_faces(const ebpo_accel *s, ebpo_cell cell, faces_of_cell *out)
{
    ebpo_cell_bounds(&s->box, cell, out->low, out->high);
    out->has_boxes = true;
    for (int k = 0; k < 3; k++) {
        double size = out->high[k] - out->low[k];
        out->inverse[k] = 1 / size;
        out->has_boxes = out->has_boxes && size > 0x1p-900;
        out->low_down[k] = float_below(out->low[k]);
        out->low_up[k] = float_above(out->low[k]);
        out->high_down[k] = float_below(out->high[k]);
        out->high_up[k] = float_above(out->high[k]);
    }
}

/* Extents of a block's faces on an axis, compared with the cell. Masks have a bit for each lane. */
typedef struct spans {
    f8 least, most;      /* rounded outward */
    unsigned away;       /* faces that are entirely outside the cell on this axis */
    unsigned reaches[2]; /* faces that reach the cell's lower face, and its upper face */
} spans;

/* Compares the faces of a block of floats with the cell on axis k. */
static inline spans span_floats(const ebpo_face_block *b, const faces_of_cell *sides, int k)
{
    f8 x[3];
    spans out;
    ebpo_face_block_floats(b, k, x);
    out.least = f8_min3(x[0], x[1], x[2]);
    out.most = f8_max3(x[0], x[1], x[2]);
    out.away = f8_bits(f8_or(f8_less(f8_all(sides->high_down[k]), out.least),
                             f8_less(out.most, f8_all(sides->low_up[k]))));
    out.reaches[0] = f8_bits(f8_at_most(out.least, f8_all(sides->low_down[k])));
    out.reaches[1] = f8_bits(f8_at_most(f8_all(sides->high_up[k]), out.most));
    return out;
}

/* Compares the faces of a block of doubles with the cell on axis k. */
static spans span_doubles(const ebpo_face_block *b, const faces_of_cell *sides, int k)
{
    double x[3][EBPO_BLOCK];
    float lows[EBPO_BLOCK], highs[EBPO_BLOCK];
    spans out = { .away = 0 };
    ebpo_face_block_doubles(b, k, x);
    for (unsigned lane = 0; lane < EBPO_BLOCK; lane++) {
        double least = ebpo_min3(x[0][lane], x[1][lane], x[2][lane]),
               most = ebpo_max3(x[0][lane], x[1][lane], x[2][lane]);
        lows[lane] = float_below(least);
        highs[lane] = float_above(most);
        out.away |= (unsigned)((least > sides->high[k]) | (most < sides->low[k])) << lane;
        out.reaches[0] |= (unsigned)(least <= sides->low[k]) << lane;
        out.reaches[1] |= (unsigned)(most >= sides->high[k]) << lane;
    }
    out.least = f8_load(lows);
    out.most = f8_load(highs);
    return out;
}

/* Converts a side of a box to sixteenths of the cell, 0 to 15. For the lower side (direction -1),
 * returns the index of the sixteenth that contains the side; for the upper side (direction 1), 15
 * minus this index. The box is first enlarged by 2^-8 of a sixteenth, which is far more than the
 * rounding error here and in queries (2^-20 of a sixteenth). */
static inline uint64_t find_sixteenth(float x, double low, double inverse, double direction)
{
    double sixteenths = ((double)x - low) * inverse * EBPO_LISTED_CELLS + direction * 0x1p-8;
    sixteenths = direction < 0 ? sixteenths : 16 - sixteenths;
    /* two separate comparisons, so that the compiler needs no branch */
    sixteenths = sixteenths > 0 ? sixteenths : 0;
    return (uint64_t)(int32_t)(sixteenths < 15 ? sixteenths : 15);
}

/* Returns a box around the faces in the lanes of `near`, encoded as in an ebpo_listed_block. */
static uint64_t box_of(const spans span[3], unsigned near, const faces_of_cell *sides)
{
    f8 none = f8_all(INFINITY), mask = f8_mask(near), zero = f8_all(0);
    uint64_t box = 0;
    for (int k = 0; k < 3; k++) {
        float least = f8_least(f8_pick(mask, span[k].least, none)),
              most = -f8_least(f8_pick(mask, f8_sub(zero, span[k].most), none));
        box |= find_sixteenth(least, sides->low[k], sides->inverse[k], -1) << 8 * k |
               find_sixteenth(most, sides->low[k], sides->inverse[k], 1) << (8 * k + 4);
    }
    return box << EBPO_LISTED_BOX;
}

/* Sets the box of a list entry to a box around the near faces: the listed faces of the block whose
 * bounding boxes intersect the cell. Returns the cell faces that the near faces reach, as bits
 * 2 axis + side. The comparisons are exact. */
static unsigned bound_block(const ebpo_accel *s, ebpo_listed_block *at, const faces_of_cell *sides)
{
    uint64_t listed = ebpo_listed(at);
    ebpo_face_block b = ebpo_face_block_open(s, ebpo_listed_number(listed));
    spans span[3];
    unsigned near = ebpo_listed_lanes(listed), reached = 0;
    for (int k = 0; k < 3; k++) {
        span[k] = s->wide ? span_doubles(&b, sides, k) : span_floats(&b, sides, k);
        near &= ~span[k].away;
    }
    for (int i = 0; i < 6; i++)
        reached |= (unsigned)((near & span[i / 2].reaches[i % 2]) != 0) << i;
    uint64_t box = !near              ? UINT64_MAX << EBPO_LISTED_BOX
                   : sides->has_boxes ? box_of(span, near, sides)
                                      : 0;
    ebpo_list(at, listed | box);
    return reached;
}

/* Prefetches the first eight blocks of the list (or all, if the list is shorter) into the
 * processor's cache. The blocks arrive while the cell's bounds are computed. */
static void fetch_blocks(const ebpo_accel *s, const ebpo_listed_block *list)
{
    for (int i = 0; i < 8; i++) {
        uint64_t listed = ebpo_listed(list + i);
        const ebpo_meshlet *m = ebpo_accel_meshlet(s, ebpo_listed_number(listed));
        for (int line = 0; line < (s->wide ? 4 : 2); line++)
            __builtin_prefetch((const char *)m + EBPO_MESHLET_UNIT * line);
        if (listed & EBPO_LISTED_LAST)
            return;
    }
}

/* Sets the boxes of all blocks in a leaf's list. Returns the cell faces that the leaf's faces
 * reach, as bits 2 axis + side. */
static unsigned find_reached_cell_faces(const ebpo_accel *s, ebpo_listed_block *list,
                                        ebpo_cell cell)
{
    faces_of_cell sides;
    unsigned out = 0;
    fetch_blocks(s, list);
    find_cell_faces(s, cell, &sides);
    for (;; list++) {
        out |= bound_block(s, list, &sides);
        if (ebpo_listed(list) & EBPO_LISTED_LAST)
            return out;
    }
}

const ebpo_inside_kernels EBPO_KERNEL(ebpo_inside_kernels) = { sum_crossings,
                                                               find_reached_cell_faces };
