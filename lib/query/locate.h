/* From a point to its cell. */
#ifndef EBPO_QUERY_LOCATE_H
#define EBPO_QUERY_LOCATE_H

#include <stdbool.h>

#include "octree/cells.h"
#include "subtree/subtree.h"

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
