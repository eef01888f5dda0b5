/* Octcodes: locational codes of octree nodes. 64 bits: a leading 1, then three bits for each level,
 * the most significant first; the root is 1. Numeric order is breadth-first order. Bit 0 of each
 * triple is x, bit 1 y, bit 2 z. Source: EBP 2017, section 3.3 (there with separate level bits and
 * at most 20 levels). */
#ifndef EBPO_GEOMETRY_OCTCODE_H
#define EBPO_GEOMETRY_OCTCODE_H

#include <stdbool.h>
#include <stdint.h>

#include "geometry/cell.h"

typedef uint64_t ebpo_octcode;

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

/* The octcodes of a node's descendants at `level` are [first, first + 8^(level - its level)). */
static inline ebpo_octcode ebpo_octcode_first_descendant(ebpo_octcode code, int level)
{
    return code << 3 * (level - ebpo_octcode_level(code));
}

/* Interleaves the cell's position; the plain twin (tests) goes bit by bit. */
ebpo_octcode ebpo_octcode_of_cell(ebpo_cell cell);
ebpo_cell ebpo_cell_of_octcode(ebpo_octcode code);

#endif
