/* Node cells: the root box on a dyadic grid, and the cells below it, all of whose corners are exact
 * doubles. */
#ifndef EBPO_GEOMETRY_CELL_H
#define EBPO_GEOMETRY_CELL_H

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

enum { EBPO_MAX_LEVEL = 20 };

/* The root cell: [origin, origin + size] on each axis. origin is an integer multiple of a power of
 * two u (its own for each axis), and size an integer multiple of u * 2^grid_level, with every
 * corner at levels 0 .. grid_level exactly representable. size > 0 on every axis. */
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

/* 2^-n, 0 <= n <= 1000. Multiplying by it rounds as dividing by 2^n does, in a fraction of the
 * time. */
static inline double ebpo_half_power(int n)
{
    uint64_t bits = (uint64_t)(1023 - n) << 52;
    double out;
    memcpy(&out, &bits, sizeof out);
    return out;
}

/* Coordinate of the wall with number `k` (0 .. 2^level) at `level` on `axis`; exact for level <=
 * grid_level: origin + k * (size / 2^level). */
static inline double ebpo_wall(const ebpo_box *box, int axis, int level, uint32_t k)
{
    return box->origin[axis] + (double)k * (box->size[axis] * ebpo_half_power(level));
}

/* Builds the root box around [min, max] (finite, min <= max), strictly larger on every side, exact
 * down to `grid_level` (0 .. 20). False when the coordinates are too large (beyond 2^1000) for
 * that. */
bool ebpo_box_make(ebpo_box *out, const double min[3], const double max[3], int grid_level);

/* True when the box is what ebpo_box_make promises: used on boxes read from files. */
bool ebpo_box_valid(const ebpo_box *box);

#endif
