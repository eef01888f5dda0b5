/* From a point to its cell. */
#ifndef EBPO_QUERY_LOCATE_H
#define EBPO_QUERY_LOCATE_H

#include <stdbool.h>

#include "subtree/subtree.h"

static inline uint32_t ebpo_locate_on_axis(const ebpo_box *box, int level, int axis, double p)
{
    double cells = (double)(1u << level), guess = (p - box->origin[axis]) / box->size[axis] * cells;
    /* The guess is right to 2^-30 of a cell: three roundings, of at most 2^20 cells. */
    uint32_t i = guess >= cells ? (1u << level) - 1 : (uint32_t)guess;
    double part = guess - (double)i;
    if (part > 0x1p-30 && part < 1 - 0x1p-30)
        return i;
    while (ebpo_wall(box, axis, level, i) > p)
        i--;
    while (ebpo_wall(box, axis, level, i + 1) <= p)
        i++;
    return i;
}

/* The cell of the given level that holds p (walls belong to the upper cell); false outside the root
 * cell. Exact: level <= grid_level. */
static inline bool ebpo_locate(const ebpo_box *box, int level, const double p[3], uint32_t at[3])
{
    for (int k = 0; k < 3; k++) {
        if (!(p[k] >= box->origin[k]) || !(p[k] < ebpo_wall(box, k, level, 1u << level)))
            return false;
        at[k] = ebpo_locate_on_axis(box, level, k, p[k]);
    }
    return true;
}

static inline unsigned ebpo_octant_at(const uint32_t at[3], int bit)
{
    return (at[0] >> bit & 1) | (at[1] >> bit & 1) << 1 | (at[2] >> bit & 1) << 2;
}

static inline uint64_t ebpo_grid_cell(const ebpo_nodes *nodes, int fine_level, const uint32_t at[3])
{
    int shift = fine_level - nodes->root_level - nodes->grid_bits;
    uint32_t mask = (1u << nodes->grid_bits) - 1;
    uint64_t x = at[0] >> shift & mask, y = at[1] >> shift & mask, z = at[2] >> shift & mask;
    return (z << nodes->grid_bits | y) << nodes->grid_bits | x;
}

/* The entry of the deepest node that holds cell `at` of `fine_level`; *level: its level. With a
 * grid, not above the grid's nodes. */
static inline uint32_t ebpo_descend(const ebpo_nodes *nodes, int fine_level, const uint32_t at[3],
                                    int *level)
{
    uint32_t entry = nodes->root;
    *level = nodes->root_level;
    if (nodes->grid) {
        uint64_t cell = ebpo_grid_cell(nodes, fine_level, at);
        entry = nodes->grid[cell];
        *level += nodes->grid_depth[cell];
    }
    while (ebpo_entry_kind_of(entry) == EBPO_ENTRY_GRAY) {
        ++*level;
        entry = nodes->group[ebpo_entry_value(entry)][ebpo_octant_at(at, fine_level - *level)];
    }
    return entry;
}

#endif
