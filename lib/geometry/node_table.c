/* The grid that spares the first steps of the way down. */
#include "geometry/node_table.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"

typedef struct painter {
    ebpo_node_table *table;
    int bits;
} painter;

/* `cell` is counted from the table's root. */
static void paint(painter *p, uint32_t entry, ebpo_cell cell)
{
    if (ebpo_entry_kind_of(entry) == EBPO_ENTRY_GRAY && cell.level < p->bits) {
        for (unsigned octant = 0; octant < 8; octant++)
            paint(p, ebpo_table_child(p->table, entry, octant), ebpo_cell_child(cell, octant));
        return;
    }
    int shift = p->bits - cell.level;
    uint32_t span = 1u << shift, x = cell.at[0] << shift, y = cell.at[1] << shift,
             z = cell.at[2] << shift;
    for (uint32_t k = z; k < z + span; k++)
        for (uint32_t j = y; j < y + span; j++)
            for (uint32_t i = x; i < x + span; i++) {
                uint64_t at = ((uint64_t)k << p->bits | j) << p->bits | i;
                p->table->grid[at] = entry;
                p->table->grid_depth[at] = (uint8_t)cell.level;
            }
}

int ebpo_node_grid_bits(uint64_t groups)
{
    int bits = 0;
    while (bits < 8 && UINT64_C(1) << 3 * (bits + 1) <= 8 * groups)
        bits++;
    return bits < 2 ? 0 : bits;
}

void ebpo_node_table_make_grid(ebpo_node_table *table)
{
    int bits = ebpo_node_grid_bits(table->group_count);
    if (!bits)
        return;
    uint64_t cells = UINT64_C(1) << 3 * bits;
    table->grid = ebpo_alloc(cells, sizeof *table->grid);
    table->grid_depth = ebpo_alloc(cells, 1);
    if (!table->grid || !table->grid_depth) {
        free(table->grid);
        free(table->grid_depth);
        table->grid = NULL;
        table->grid_depth = NULL;
        return;
    }
    table->grid_bits = bits;
    paint(&(painter){ table, bits }, table->root, (ebpo_cell){ 0, { 0, 0, 0 } });
}

void ebpo_node_table_free(ebpo_node_table *table)
{
    free(table->group);
    free(table->grid);
    free(table->grid_depth);
    memset(table, 0, sizeof *table);
}
