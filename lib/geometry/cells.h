/* Defines cells of nodes: the root box, and the cells that result from halving it. All corners are
 * exact doubles, because the root box is aligned to multiples of powers of two. */
#ifndef EBPO_GEOMETRY_CELLS_H
#define EBPO_GEOMETRY_CELLS_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include <ebpo/file.h>

enum { EBPO_MAX_LEVEL = 20 };

/* The root cell: [origin, origin + size] on each axis, size > 0. Each axis has a unit u, which is a
 * power of two. The origin is an integer multiple of u, and the size an integer multiple of
 * u * 2^grid_level. So every cell corner at levels 0 .. grid_level is an exact double. */
typedef struct ebpo_box {
    double origin[3];
    double size[3];
    int grid_level; /* deepest level for which corners are exact */
} ebpo_box;

/* A cell by level and integer position, 0 .. 2^level - 1 on each axis. */
typedef struct ebpo_cell {
    int level;
    uint32_t at[3];
} ebpo_cell;

/* Returns 2^-n, 0 <= n <= 1000. A multiplication by this number rounds as a division by 2^n does,
 * and is much faster. */
static inline double ebpo_half_power(int n)
{
    uint64_t bits = (uint64_t)(1023 - n) << 52;
    double out;
    memcpy(&out, &bits, sizeof out);
    return out;
}

/* Returns the coordinate of cell face `k` (0 .. 2^level) at `level` on `axis`: origin + k * (size /
 * 2^level). The result is exact if level <= grid_level. */
static inline double ebpo_cell_face(const ebpo_box *box, int axis, int level, uint32_t k)
{
    return box->origin[axis] + (double)k * (box->size[axis] * ebpo_half_power(level));
}

/* Makes the root box around [min, max] (finite, min <= max). The box is strictly larger on every
 * side, and has exact cell corners down to `grid_level` (0 .. 20). Returns false if coordinates are
 * beyond 2^1000. */
bool ebpo_box_make(ebpo_box *out, const double min[3], const double max[3], int grid_level);

/* Returns true when a box that was read from a file has the properties that ebpo_box_make
 * guarantees. */
bool ebpo_box_valid(const ebpo_box *box);

/* Cells of an octree: children and parents, neighbours, positions of points. */

/* Returns a file's root cell. */
static inline ebpo_box ebpo_root_box(const ebpo_info *info)
{
    const double *origin = info->box_origin, *size = info->box_size;
    return (ebpo_box){ { origin[0], origin[1], origin[2] },
                       { size[0], size[1], size[2] },
                       info->grid_level };
}

static inline ebpo_cell ebpo_cell_child(ebpo_cell cell, unsigned octant)
{
    return (ebpo_cell){ cell.level + 1,
                        { 2 * cell.at[0] + (octant & 1), 2 * cell.at[1] + (octant >> 1 & 1),
                          2 * cell.at[2] + (octant >> 2 & 1) } };
}

/* Returns the cell of the coarser level `level` that contains `cell`. */
static inline ebpo_cell ebpo_cell_ancestor(ebpo_cell cell, int level)
{
    int up = cell.level - level;
    return (ebpo_cell){ level, { cell.at[0] >> up, cell.at[1] >> up, cell.at[2] >> up } };
}

static inline ebpo_cell ebpo_cell_parent(ebpo_cell cell)
{
    return ebpo_cell_ancestor(cell, cell.level - 1);
}

static inline bool ebpo_cell_equal(ebpo_cell a, ebpo_cell b)
{
    return a.level == b.level && a.at[0] == b.at[0] && a.at[1] == b.at[1] && a.at[2] == b.at[2];
}

/* Takes the cell at position `at`, and its ancestor `up` levels above. Returns the octant of this
 * ancestor, that is, its position in its parent cell. */
static inline unsigned ebpo_octant_at(const uint32_t at[3], int up)
{
    return (at[0] >> up & 1) | (at[1] >> up & 1) << 1 | (at[2] >> up & 1) << 2;
}

/* Returns the octant (position in the parent cell) of the cell's ancestor at level + 1. `level`
 * must be less than the cell's level. */
static inline unsigned ebpo_cell_octant(ebpo_cell cell, int level)
{
    return ebpo_octant_at(cell.at, cell.level - level - 1);
}

/* Computes the neighbour of the same level that is step[k] (-1, 0 or 1) cells away on each axis k.
 * Returns false if the neighbour is outside the root cell. */
static inline bool ebpo_cell_neighbour(ebpo_cell cell, const int step[3], ebpo_cell *out)
{
    *out = cell;
    for (int k = 0; k < 3; k++) {
        out->at[k] += (uint32_t)step[k];
        if (out->at[k] >> cell.level) /* also true for a value that wrapped around below 0 */
            return false;
    }
    return true;
}

/* Returns true if two closed cells, of any levels, have a point in common. */
bool ebpo_cells_touch(ebpo_cell a, ebpo_cell b);

/* Returns true if the closed cell has a point in common with the box [min, max]. */
static inline bool ebpo_cell_intersects(const ebpo_box *box, ebpo_cell cell, const double min[3],
                                        const double max[3])
{
    for (int k = 0; k < 3; k++)
        if (ebpo_cell_face(box, k, cell.level, cell.at[k]) > max[k] ||
            ebpo_cell_face(box, k, cell.level, cell.at[k] + 1) < min[k])
            return false;
    return true;
}

/* Returns the volume of each cell of a level, in the model's unit cubed. */
double ebpo_cell_volume(const ebpo_box *box, int level);

/* Returns the cell's bounds: low and high coordinates. */
static inline void ebpo_cell_bounds(const ebpo_box *box, ebpo_cell cell, double low[3],
                                    double high[3])
{
    for (int k = 0; k < 3; k++) {
        low[k] = ebpo_cell_face(box, k, cell.level, cell.at[k]);
        high[k] = ebpo_cell_face(box, k, cell.level, cell.at[k] + 1);
    }
}

/* Returns the position on an axis of the cell that contains the coordinate p, which must be within
 * the root cell. */
static inline uint32_t ebpo_locate_on_axis(const ebpo_box *box, int level, int axis, double p)
{
    double cells = (double)(1u << level), guess = (p - box->origin[axis]) / box->size[axis] * cells;
    /* The guess is accurate to 2^-30 of a cell, because it is rounded three times and is at most
     * 2^20 cells. */
    uint32_t i = guess >= cells ? (1u << level) - 1 : (uint32_t)guess;
    double part = guess - (double)i;
    if (part > 0x1p-30 && part < 1 - 0x1p-30)
        return i;
    while (ebpo_cell_face(box, axis, level, i) > p)
        i--;
    while (ebpo_cell_face(box, axis, level, i + 1) <= p)
        i++;
    return i;
}

/* Finds the cell of the given level that contains p. A point on a cell face belongs to the cell
 * with the higher coordinates. Returns false if p is outside the root cell. The result is exact if
 * level <= grid_level. */
static inline bool ebpo_locate(const ebpo_box *box, int level, const double p[3], uint32_t at[3])
{
    for (int k = 0; k < 3; k++) {
        if (!(p[k] >= box->origin[k]) || !(p[k] < ebpo_cell_face(box, k, level, 1u << level)))
            return false;
        at[k] = ebpo_locate_on_axis(box, level, k, p[k]);
    }
    return true;
}

/* Precomputed data to find the cells of one level. For most points, ebpo_locator_find divides
 * nothing and computes no cell face. */
typedef struct ebpo_locator {
    ebpo_box box;
    int level;
    double scale[3]; /* cells per unit of length */
    double half;     /* half of the number of cells along an axis */
} ebpo_locator;

/* A point's position in the grid of a locator's level. */
typedef struct ebpo_position {
    uint32_t at[3];  /* the cell that contains the point */
    double cells[3]; /* the point's coordinates in cells, accurate to 2^-30 */
} ebpo_position;

static inline ebpo_locator ebpo_locator_make(const ebpo_box *box, int level)
{
    ebpo_locator l = { .box = *box, .level = level, .half = (double)(1u << level) / 2 };
    for (int k = 0; k < 3; k++)
        l.scale[k] = 2 * l.half / box->size[k]; /* infinite if the size is almost 0 */
    return l;
}

/* Completes ebpo_locator_find for a point that is near a cell face or outside the root cell. */
bool ebpo_locator_decide(const ebpo_locator *locator, const double p[3], ebpo_position *out);

/* Same as ebpo_locate, for the locator's level. */
static inline bool ebpo_locator_find(const ebpo_locator *l, const double p[3], ebpo_position *out)
{
    bool sure = true;
    for (int k = 0; k < 3; k++) {
        double cells = (p[k] - l->box.origin[k]) * l->scale[k];
        bool within = __builtin_fabs(cells - l->half) < l->half;
        int32_t i = within ? (int32_t)cells : 0;
        sure &= within & (__builtin_fabs(cells - (double)i - 0.5) < 0.5 - 0x1p-30);
        out->cells[k] = cells;
        out->at[k] = (uint32_t)i;
    }
    return __builtin_expect(sure, 1) || ebpo_locator_decide(l, p, out);
}

/* Converts `xi`, a coordinate within the cell (0 .. 1), to a coordinate of the model. `sides`: the
 * cell faces on which the point is; bit 2 * axis is the low face, and bit 2 * axis + 1 the high
 * face. A point on a cell face gets exactly the coordinate of this face, so that neighbouring cells
 * have equal points. */
static inline double ebpo_cell_face_point(const ebpo_box *box, ebpo_cell cell, int axis, double xi,
                                          unsigned sides)
{
    double low = ebpo_cell_face(box, axis, cell.level, cell.at[axis]);
    if (xi <= 0 || sides >> 2 * axis & 1)
        return low;
    if (xi >= 1 || sides >> (2 * axis + 1) & 1)
        return ebpo_cell_face(box, axis, cell.level, cell.at[axis] + 1);
    return low + xi * (box->size[axis] / (double)(1u << cell.level));
}

/* Octcodes: locational codes of octree nodes. 64 bits: a leading 1, then three bits for each level,
 * the most significant first; the root is 1. Numeric order is breadth-first order. Bit 0 of each
 * triple is x, bit 1 y, bit 2 z. Source: EBP 2017, section 3.2.3; the codes of that thesis have
 * separate bits for the level, and at most 20 levels. */

typedef uint64_t ebpo_octcode;

/* Returns true if the code is the code of a cell at one of the levels 0 .. EBPO_MAX_LEVEL. */
static inline bool ebpo_octcode_valid(ebpo_octcode code)
{
    if (code == 0)
        return false;
    int top = 63 - __builtin_clzll(code);
    return top % 3 == 0 && top / 3 <= EBPO_MAX_LEVEL;
}

static inline int ebpo_octcode_level(ebpo_octcode code) { return (63 - __builtin_clzll(code)) / 3; }

static inline ebpo_octcode ebpo_octcode_parent(ebpo_octcode code) { return code >> 3; }

static inline ebpo_octcode ebpo_octcode_child(ebpo_octcode code, unsigned octant)
{
    return code << 3 | octant;
}

/* Returns the first octcode of a node's descendants at `level`. The octcodes of these descendants
 * are first .. first + 8^(level - the node's level) - 1. */
static inline ebpo_octcode ebpo_octcode_first_descendant(ebpo_octcode code, int level)
{
    return code << 3 * (level - ebpo_octcode_level(code));
}

/* Returns the octcode of a cell. The reference implementation in the tests works bit by bit. */
ebpo_octcode ebpo_octcode_of_cell(ebpo_cell cell);
ebpo_cell ebpo_cell_of_octcode(ebpo_octcode code);

#endif
