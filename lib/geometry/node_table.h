/* A decoded tree as a table of children: four bytes a node, found by following numbers. What is
 * asked of many times in a row stands in this form; a point's way down it is a loop of one line. */
#ifndef EBPO_GEOMETRY_NODE_TABLE_H
#define EBPO_GEOMETRY_NODE_TABLE_H

#include "geometry/node.h"
#include "geometry/rule.h"

/* An entry: two bits of kind, 30 of value. */
typedef enum ebpo_entry_kind {
    EBPO_ENTRY_UNIFORM = 0, /* white or black; value: winding number + EBPO_ENTRY_ZERO */
    EBPO_ENTRY_LEAF = 1,    /* value: number of the leaf */
    EBPO_ENTRY_GRAY = 2,    /* value: number of the group of its eight children */
    /* in the top of a tree: value: number of a subtree that is loaded on demand; in a subtree: a
       pruned node, of which value is the number among gray nodes */
    EBPO_ENTRY_BELOW = 3
} ebpo_entry_kind;
enum { EBPO_ENTRY_ZERO = 1 << 29 };

static inline uint32_t ebpo_entry(ebpo_entry_kind kind, uint32_t value)
{
    return (uint32_t)kind << 30 | value;
}
static inline ebpo_entry_kind ebpo_entry_kind_of(uint32_t entry)
{
    return (ebpo_entry_kind)(entry >> 30);
}
static inline uint32_t ebpo_entry_value(uint32_t entry) { return entry & 0x3fffffff; }
static inline int32_t ebpo_entry_winding(uint32_t entry)
{
    return (int32_t)ebpo_entry_value(entry) - EBPO_ENTRY_ZERO;
}

/* The entry of a white or black node; false for a winding number that it cannot hold. */
static inline bool ebpo_entry_uniform(int32_t winding, uint32_t *entry)
{
    if (winding <= -EBPO_ENTRY_ZERO || winding >= EBPO_ENTRY_ZERO)
        return false;
    *entry = ebpo_entry(EBPO_ENTRY_UNIFORM, (uint32_t)(winding + EBPO_ENTRY_ZERO));
    return true;
}

/* The node that an entry describes. */
static inline ebpo_node ebpo_entry_node(uint32_t entry, ebpo_cell cell, ebpo_rule rule)
{
    ebpo_node node = { .cell = cell, .entry = entry, .type = EBPO_GRAY };
    switch (ebpo_entry_kind_of(entry)) {
    case EBPO_ENTRY_UNIFORM:
        node.type = ebpo_rule_inside(rule, ebpo_entry_winding(entry)) ? EBPO_BLACK : EBPO_WHITE;
        break;
    case EBPO_ENTRY_LEAF: node.type = EBPO_LEAF; break;
    case EBPO_ENTRY_BELOW: node.pruned = true; break;
    case EBPO_ENTRY_GRAY: break;
    }
    return node;
}

typedef struct ebpo_node_table {
    int root_level;       /* level of the node that `root` describes */
    uint32_t root;        /* its entry */
    uint32_t (*group)[8]; /* entries of the children, octant by octant */
    uint32_t group_count;
    /* 0: no grid. The entry of the node that contains the cell at level root_level + grid_bits, or
     * of this cell, */
    int grid_bits;
    uint32_t *grid;      /* at [z][y][x]; */
    uint8_t *grid_depth; /* and the depth of that node below the root */
} ebpo_node_table;

/* Bits of the grid of a table of so many groups; 0: none. */
int ebpo_node_grid_bits(uint64_t groups);
/* Makes the grid: fewer cells than about twice the groups. Optional; without memory there is none.
 */
void ebpo_node_table_make_grid(ebpo_node_table *table);
void ebpo_node_table_free(ebpo_node_table *table);

static inline uint32_t ebpo_table_child(const ebpo_node_table *table, uint32_t gray,
                                        unsigned octant)
{
    return table->group[ebpo_entry_value(gray)][octant];
}

/* --- the way down to cell `at` of `fine_level`, which the root holds --- */

/* Where a descent has come to. */
typedef struct ebpo_descent {
    uint32_t entry;
    int level; /* of the entry's node */
} ebpo_descent;

static inline uint64_t ebpo_grid_cell(const ebpo_node_table *table, int fine_level,
                                      const uint32_t at[3])
{
    int shift = fine_level - table->root_level - table->grid_bits;
    uint32_t mask = (1u << table->grid_bits) - 1;
    uint64_t x = at[0] >> shift & mask, y = at[1] >> shift & mask, z = at[2] >> shift & mask;
    return (z << table->grid_bits | y) << table->grid_bits | x;
}

/* At the root, or at once at the node that the grid names. */
static inline ebpo_descent ebpo_descent_begin(const ebpo_node_table *table, int fine_level,
                                              const uint32_t at[3])
{
    if (!table->grid)
        return (ebpo_descent){ table->root, table->root_level };
    uint64_t cell = ebpo_grid_cell(table, fine_level, at);
    uint32_t entry = table->grid[cell];
    /* most gray ones are of the grid's own level: a cache line less */
    bool deep = ebpo_entry_kind_of(entry) == EBPO_ENTRY_GRAY;
    int depth = deep ? table->grid_bits : table->grid_depth[cell];
    return (ebpo_descent){ entry, table->root_level + depth };
}

/* One level down; false where there is none. */
static inline bool ebpo_descent_step(ebpo_descent *d, const ebpo_node_table *table, int fine_level,
                                     const uint32_t at[3])
{
    if (ebpo_entry_kind_of(d->entry) != EBPO_ENTRY_GRAY)
        return false;
    d->level++;
    d->entry = ebpo_table_child(table, d->entry, ebpo_octant_at(at, fine_level - d->level));
    return true;
}

/* Brings the children's entries nearer to the processor, for a step to come; false at the deepest
 * node. */
static inline bool ebpo_descent_prefetch(const ebpo_descent *d, const ebpo_node_table *table)
{
    if (ebpo_entry_kind_of(d->entry) != EBPO_ENTRY_GRAY)
        return false;
    __builtin_prefetch(table->group[ebpo_entry_value(d->entry)]);
    return true;
}

/* The node's cell. */
static inline ebpo_cell ebpo_descent_cell(const ebpo_descent *d, int fine_level,
                                          const uint32_t at[3])
{
    return ebpo_cell_ancestor((ebpo_cell){ fine_level, { at[0], at[1], at[2] } }, d->level);
}

/* To the deepest node. */
static inline ebpo_descent ebpo_descend(const ebpo_node_table *table, int fine_level,
                                        const uint32_t at[3])
{
    ebpo_descent d = ebpo_descent_begin(table, fine_level, at);
    while (ebpo_descent_step(&d, table, fine_level, at))
        ;
    return d;
}

#endif
