/* Computes with cells of an octree: the root box, positions in the grid of a level, and octcodes.
 *
 * Each axis of the root box has a unit u = 2^e. The unit is chosen so that the coordinates of the
 * cell faces of all levels are u times integers of at most 53 bits. So the coordinate of every cell
 * face is an exact double, and is the same for both cells at this face.
 *
 * An octcode is a leading 1, followed by three bits for each level (EBP 2017, section 3.2.3). These
 * are the interleaved bits of the cell's position. */
#include "core/strict_fp.h"

#include <math.h>

#include "geometry/cells.h"

/* --- the root box --- */

enum { MANTISSA_BITS = 53, LEAST_EXPONENT = -1074, LARGEST_EXPONENT = 1000 };

/* The root box has a margin on each side of the model. On each axis the margin is own_margin times
 * the extent along this axis, but at least flat_margin times the largest extent. With a smaller
 * margin, cells of flat models would be too thin for arithmetic. */
static const double own_margin = 0x1p-22, flat_margin = 0x1p-32;

/* Returns false if min > max on an axis, or a coordinate is too large or NaN. */
static bool extents_usable(const double min[3], const double max[3])
{
    for (int k = 0; k < 3; k++)
        /* the negation makes the test fail for NaN */
        if (!(min[k] <= max[k] && min[k] >= -ldexp(1, LARGEST_EXPONENT) &&
              max[k] <= ldexp(1, LARGEST_EXPONENT)))
            return false;
    return true;
}

/* Returns a length that represents the model's size, and is never 0. */
static double model_size(const double min[3], const double max[3])
{
    double extent = 0, magnitude = 0;
    for (int k = 0; k < 3; k++) {
        extent = fmax(extent, max[k] - min[k]);
        magnitude = fmax(magnitude, fmax(fabs(min[k]), fabs(max[k])));
    }
    if (extent > 0)
        return extent;
    return magnitude > 0 ? magnitude : 1;
}

/* Sets the box's origin and size on one axis, with the unit 2^e. Returns false when the unit is too
 * fine. `min`, `max`: the model's extent; `low`, `high`: the extent with margins. */
static bool axis_with_unit(ebpo_box *box, int axis, double min, double max, double low, double high,
                           int e)
{
    double limit = ldexp(1, MANTISSA_BITS);
    double unit = ldexp(1, e), first = floor(ldexp(low, -e));
    if (fabs(first) >= limit - 4)
        return false;
    while (first * unit >= min)
        first--;
    double cells = ldexp(1, box->grid_level);
    double steps = fmax(1, ceil((ldexp(high, -e) - first) / cells));
    while (steps * cells < limit && (first + steps * cells) * unit <= max)
        steps++;
    if (steps * cells >= limit || first + steps * cells >= limit)
        return false;
    box->origin[axis] = first * unit;
    box->size[axis] = steps * cells * unit;
    return true;
}

bool ebpo_box_make(ebpo_box *out, const double min[3], const double max[3], int grid_level)
{
    ebpo_box box = { .grid_level = grid_level };
    if (grid_level < 0 || grid_level > EBPO_MAX_LEVEL || !extents_usable(min, max))
        return false;
    double flat = flat_margin * model_size(min, max);
    for (int k = 0; k < 3; k++) {
        double margin = fmax(own_margin * (max[k] - min[k]), flat);
        double low = min[k] - margin, high = max[k] + margin;
        int e = LEAST_EXPONENT + MANTISSA_BITS;
        double magnitude = fmax(fabs(low), fabs(high));
        if (magnitude > 0)
            frexp(magnitude, &e);
        e = e - MANTISSA_BITS < LEAST_EXPONENT ? LEAST_EXPONENT : e - MANTISSA_BITS;
        /* The finest unit may be too fine for the margins. Then one of the next coarser units is
         * used. */
        while (!axis_with_unit(&box, k, min[k], max[k], low, high, e))
            e++;
    }
    *out = box;
    return true;
}

/* Returns the exponent of the lowest bit set in x, which is finite and not 0. */
static int low_bit(double x)
{
    int e;
    int64_t m = (int64_t)ldexp(frexp(x, &e), MANTISSA_BITS);
    return e - MANTISSA_BITS + __builtin_ctzll((uint64_t)m);
}

static bool axis_valid(double origin, double size, int grid_level)
{
    double largest = ldexp(1, LARGEST_EXPONENT + 2);
    if (!(fabs(origin) <= largest && size > 0 && size <= largest))
        return false;
    int e = low_bit(size) - grid_level;
    if (origin != 0 && low_bit(origin) < e)
        e = low_bit(origin);
    if (e < LEAST_EXPONENT)
        return false;
    double limit = ldexp(1, MANTISSA_BITS), first = ldexp(origin, -e), length = ldexp(size, -e);
    if (!(fabs(first) <= limit && length <= limit))
        return false;
    return (int64_t)first + (int64_t)length <= (int64_t)limit;
}

bool ebpo_box_valid(const ebpo_box *box)
{
    if (box->grid_level < 0 || box->grid_level > EBPO_MAX_LEVEL)
        return false;
    for (int k = 0; k < 3; k++)
        if (!axis_valid(box->origin[k], box->size[k], box->grid_level))
            return false;
    return true;
}

/* --- cells and positions --- */

bool ebpo_cells_touch(ebpo_cell a, ebpo_cell b)
{
    int fine = a.level > b.level ? a.level : b.level;
    for (int k = 0; k < 3; k++) {
        uint64_t a_low = (uint64_t)a.at[k] << (fine - a.level),
                 a_high = ((uint64_t)a.at[k] + 1) << (fine - a.level),
                 b_low = (uint64_t)b.at[k] << (fine - b.level),
                 b_high = ((uint64_t)b.at[k] + 1) << (fine - b.level);
        if (a_high < b_low || b_high < a_low)
            return false;
    }
    return true;
}

double ebpo_cell_volume(const ebpo_box *box, int level)
{
    double cells = (double)(1u << level);
    return box->size[0] / cells * (box->size[1] / cells) * (box->size[2] / cells);
}

bool ebpo_locator_decide(const ebpo_locator *l, const double p[3], ebpo_position *out)
{
    if (!ebpo_locate(&l->box, l->level, p, out->at))
        return false;
    for (int k = 0; k < 3; k++)
        out->cells[k] = (p[k] - l->box.origin[k]) / l->box.size[k] * (2 * l->half);
    return true;
}

/* --- octcodes --- */

/* Spreads the low 21 bits of x to every third bit, by halves, quarters and so on. */
static inline uint64_t spread_bits(uint64_t x)
{
    x &= 0x1fffff;
    x = (x | x << 32) & 0x001f00000000ffff;
    x = (x | x << 16) & 0x001f0000ff0000ff;
    x = (x | x << 8) & 0x100f00f00f00f00f;
    x = (x | x << 4) & 0x10c30c30c30c30c3;
    x = (x | x << 2) & 0x1249249249249249;
    return x;
}

/* Gathers every third bit; the inverse of spread_bits. */
static inline uint32_t gather_bits(uint64_t x)
{
    x &= 0x1249249249249249;
    x = (x | x >> 2) & 0x10c30c30c30c30c3;
    x = (x | x >> 4) & 0x100f00f00f00f00f;
    x = (x | x >> 8) & 0x001f0000ff0000ff;
    x = (x | x >> 16) & 0x001f00000000ffff;
    x = (x | x >> 32) & 0x1fffff;
    return (uint32_t)x;
}

ebpo_octcode ebpo_octcode_of_cell(ebpo_cell cell)
{
    return (uint64_t)1 << 3 * cell.level | spread_bits(cell.at[0]) | spread_bits(cell.at[1]) << 1 |
           spread_bits(cell.at[2]) << 2;
}

ebpo_cell ebpo_cell_of_octcode(ebpo_octcode code)
{
    int level = ebpo_octcode_level(code);
    uint64_t path = code ^ (uint64_t)1 << 3 * level;
    return (ebpo_cell){ level,
                        { gather_bits(path), gather_bits(path >> 1), gather_bits(path >> 2) } };
}
