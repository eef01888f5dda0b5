/* Defines nodes of an octree, their types in groups of eight siblings, their ranks in levels, and
 * tables of children. A group is a 16-bit word with two bits for each octant; octant 0 has the
 * lowest bits. Level 0 has one group, in which only octant 0 exists. */
#ifndef EBPO_GEOMETRY_LEVEL_NODES_H
#define EBPO_GEOMETRY_LEVEL_NODES_H

#include <ebpo/file.h>

#include "geometry/cells.h"

/* Returns the number of octants in a group of this level. */
static inline unsigned ebpo_group_octants(int level) { return level ? 8 : 1; }

static inline ebpo_node_type ebpo_group_type(uint16_t types, unsigned octant)
{
    return (ebpo_node_type)(types >> 2 * octant & 3);
}

/* Returns the word of a group in which only this octant is not white. */
static inline uint16_t ebpo_group_of(ebpo_node_type type, unsigned octant)
{
    return (uint16_t)((unsigned)type << 2 * octant);
}

/* Returns the word `types`, changed so that this octant has the type `type`. */
static inline uint16_t ebpo_group_set(uint16_t types, unsigned octant, ebpo_node_type type)
{
    return (uint16_t)((types & ~(3u << 2 * octant)) | ebpo_group_of(type, octant));
}

/* Returns a word whose bit 2 * i is set when octant i is a leaf or gray, that is, when faces touch
 * this octant. */
static inline unsigned ebpo_group_filled(uint16_t types) { return types >> 1 & 0x5555u; }

/* Returns how many of the octants 0 to octants - 1 have this type; `octants` is at most 8. If
 * `octants` is the number of an octant, the result is this octant's rank among its siblings of this
 * type. */
static inline unsigned ebpo_group_count(uint16_t types, ebpo_node_type type, unsigned octants)
{
    unsigned differs = types ^ 0x5555u * (unsigned)type;
    unsigned bits = ~(differs | differs >> 1) & 0x5555u & ((1u << 2 * octants) - 1);
    bits = (bits & 0x3333) + (bits >> 2 & 0x3333);
    bits = (bits + (bits >> 4)) & 0x0f0f;
    return (bits + (bits >> 8)) & 0xf;
}

/* Counts nodes of each type in groups, which are little-endian words at any address. */
void ebpo_groups_count(const void *types, uint64_t groups, uint64_t counts[4]);

/* Returns true if one of the eight nodes is gray or a leaf, which have bit 1 of their type set. */
static inline bool ebpo_group_lists_faces(uint16_t types) { return types & 0xaaaa; }

/* Same as ebpo_groups_count for groups of one level. Level 0 has only its root. */
static inline void ebpo_groups_count_at(int level, const uint16_t *types, uint64_t groups,
                                        uint64_t counts[4])
{
    if (level)
        ebpo_groups_count(types, groups, counts);
    else
        for (int type = 0; type < 4; type++)
            counts[type] = ebpo_group_count(types[0], (ebpo_node_type)type, 1);
}

/* A node of an octree, identified by its position. A holder is a data structure that has nodes:
 * levels in memory, a file, or the tables of a decoded tree. All holders use this type. A node is a
 * value and may be copied, kept and queued. */

typedef struct ebpo_node {
    ebpo_cell cell;
    ebpo_node_type type;
    bool pruned; /* true: a gray node, and its holder is known to have no children of it */
    /* key by which the holder finds the node */
    union {
        uint64_t rank;  /* in levels and files: rank among the nodes of its type in its level */
        uint32_t entry; /* in tables: see ebpo_node_table */
    };
    /* the node's subtree in a model whose subtrees are loaded on demand; else NULL */
    const struct ebpo_accel *subtree;
} ebpo_node;

/* Returns true for a white or black node: no face touches the node, which is completely inside or
 * completely outside. */
static inline bool ebpo_node_is_uniform(const ebpo_node *node)
{
    return node->type == EBPO_WHITE || node->type == EBPO_BLACK;
}

/* Returns a gray node's child. `types`: types in the group of the children. `ranks`: for each type,
 * the number of nodes of this type that precede the group in the children's level. */
static inline ebpo_node ebpo_node_child(const ebpo_node *gray, unsigned octant, uint16_t types,
                                        const uint64_t ranks[4])
{
    ebpo_node_type type = ebpo_group_type(types, octant);
    return (ebpo_node){ .cell = ebpo_cell_child(gray->cell, octant),
                        .type = type,
                        .rank = ranks[type] + ebpo_group_count(types, type, octant) };
}

/* Returns true if points with this winding number belong to the solid. */
static inline bool ebpo_rule_inside(ebpo_rule rule, int32_t winding)
{
    switch (rule) {
    case EBPO_RULE_EVENODD: return winding & 1;
    case EBPO_RULE_POSITIVE: return winding > 0;
    case EBPO_RULE_NONZERO: break;
    }
    return winding != 0;
}

/* The functions through which a cursor reads the nodes of a holder. A holder may also be a model
 * that loads subtrees when they are needed. */

enum { EBPO_NODE_PLANES = 255 }; /* most planes of a node; files store this count in a byte */

typedef struct ebpo_node_source {
    /* Returns the eight children of a gray node. If the holder has none, marks the node as pruned
     * instead. May also store other results in the node, so that they are not computed again. */
    ebpo_status (*children)(void *holder, ebpo_node *gray, ebpo_node child[8], ebpo_error *error);
    /* Returns the codes of the planes that a gray node adds to its parent's envelope. Leaves have
     * planes only if the levels store the planes of leaves. Other nodes have no planes. */
    ebpo_status (*planes)(void *holder, const ebpo_node *node, uint32_t codes[EBPO_NODE_PLANES],
                          unsigned *count, ebpo_error *error);
    /* Returns the winding number in a white or black node of a solid. */
    ebpo_status (*winding)(void *holder, const ebpo_node *uniform, int32_t *winding,
                           ebpo_error *error);
} ebpo_node_source;

/* Ranks in one level of a tree in memory. They give the index of a group's first node of each type,
 * of a node's first plane, and of the first face in a leaf's list. Ranks are sums over all
 * preceding items, so nodes can be visited in any order. */

typedef struct ebpo_level_ranks {
    /* [group_count] by type: number of nodes of this type in the preceding groups; NULL for white
     * and black nodes if the level has no winding numbers for them */
    uint64_t *before[4];
    uint64_t *plane_first;      /* [gray_count]; NULL: the level has no planes */
    uint64_t *leaf_plane_first; /* [leaf_count]; NULL: no stored leaf planes */
    uint64_t *ref_first;        /* [leaf_count]; NULL: no face lists */
} ebpo_level_ranks;

/* Makes ranks. EBPO_E_FORMAT when the level's counts contradict each other. On failure all memory
 * is freed. `number` is for messages. */
EBPO_MUST_USE ebpo_status ebpo_level_ranks_make(ebpo_level_ranks *out, const ebpo_level *level,
                                                int number, ebpo_error *error);
void ebpo_level_ranks_free(ebpo_level_ranks *ranks);

/* The nodes of levels in memory, from the root down to some level. The caller owns the arrays. Gray
 * nodes without children in these levels are pruned; all gray nodes of the last level are also
 * pruned. */
typedef struct ebpo_level_nodes {
    const ebpo_level *level;       /* [level_count] */
    const ebpo_level_ranks *ranks; /* [level_count] */
    int level_count;
} ebpo_level_nodes;

ebpo_node ebpo_level_root(const ebpo_level_nodes *nodes);

/* Returns a child of a gray node that is not pruned. The rank of a white or black child is valid
 * only if the level has winding numbers for this type. */
ebpo_node ebpo_level_child(const ebpo_level_nodes *nodes, const ebpo_node *gray, unsigned octant);

/* Returns the codes of the planes that a gray node adds to its parent's envelope, or the codes that
 * are stored for a leaf. Returns NULL if the node has no planes. */
const uint32_t *ebpo_level_planes(const ebpo_level_nodes *nodes, const ebpo_node *node,
                                  unsigned *count);

/* Returns the winding number of a white or black node, or the winding number at the lowest corner
 * of a leaf. Solids only. */
int32_t ebpo_level_winding(const ebpo_level_nodes *nodes, const ebpo_node *node);

/* For cursors; the holder is an ebpo_level_nodes. */
extern const ebpo_node_source ebpo_level_source;

/* --- a decoded tree as a table of children ---
 *
 * The table has an entry of four bytes for each node. The entry of a gray node refers to the node's
 * children by index. The table is used for many successive queries, because the search for a
 * point's node is a loop of one line. An entry has two bits for its kind and 30 bits for its value.
 */
typedef enum ebpo_entry_kind {
    EBPO_ENTRY_UNIFORM = 0, /* white or black; value: winding number + EBPO_ENTRY_ZERO */
    EBPO_ENTRY_LEAF = 1,    /* value: index of the leaf */
    EBPO_ENTRY_GRAY = 2,    /* value: index of the group of its eight children */
    /* A pruned node is a gray node whose children are not in the file. In the top of a tree (the
     * levels that stay in memory), the entry is the root of a subtree that is loaded on demand, or
     * a pruned node; value: index of the subtree. In a subtree, the entry is a pruned node; value:
     * index of this node among the gray nodes. */
    EBPO_ENTRY_SUBTREE_ROOT = 3
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

/* Makes the entry of a white or black node; returns false for a winding number that an entry cannot
 * hold. */
static inline bool ebpo_entry_uniform(int32_t winding, uint32_t *entry)
{
    if (winding <= -EBPO_ENTRY_ZERO || winding >= EBPO_ENTRY_ZERO)
        return false;
    *entry = ebpo_entry(EBPO_ENTRY_UNIFORM, (uint32_t)(winding + EBPO_ENTRY_ZERO));
    return true;
}

/* Returns the node that an entry describes. */
static inline ebpo_node ebpo_entry_node(uint32_t entry, ebpo_cell cell, ebpo_rule rule)
{
    ebpo_node node = { .cell = cell, .entry = entry, .type = EBPO_GRAY };
    switch (ebpo_entry_kind_of(entry)) {
    case EBPO_ENTRY_UNIFORM:
        node.type = ebpo_rule_inside(rule, ebpo_entry_winding(entry)) ? EBPO_BLACK : EBPO_WHITE;
        break;
    case EBPO_ENTRY_LEAF: node.type = EBPO_LEAF; break;
    case EBPO_ENTRY_SUBTREE_ROOT: node.pruned = true; break;
    case EBPO_ENTRY_GRAY: break;
    }
    return node;
}

typedef struct ebpo_node_table {
    int root_level;       /* level of the node that `root` describes */
    uint32_t root;        /* entry of the root */
    uint32_t (*group)[8]; /* entries of the children, octant by octant */
    uint32_t group_count;
    /* the grid over the cells of level root_level + grid_bits; 0: no grid */
    int grid_bits;
    uint32_t *grid;      /* [z][y][x] entry of the node that is or contains the cell */
    uint8_t *grid_depth; /* [z][y][x] depth below the root of the node in `grid` */
    /* marks of parts of leaves and uniform nodes, octant by octant: query/holes.h */
    int32_t (*split)[8];
    uint32_t split_count;
    /* cells near the border of a surface, and their lists of entries: geometry/cap_bounds.h */
    struct ebpo_near_cell *near;
    uint32_t near_count;
    uint32_t *disc;
    uint64_t disc_count;
} ebpo_node_table;

/* Returns ebpo_node_table.grid_bits for a table with this number of groups; 0: no grid. */
int ebpo_node_grid_bits(uint64_t groups);
/* Makes the grid, with at most eight cells for each group. The grid is optional: when memory is
 * short, the table has no grid. */
void ebpo_node_table_make_grid(ebpo_node_table *table);
void ebpo_node_table_free(ebpo_node_table *table);

static inline uint32_t ebpo_table_child(const ebpo_node_table *table, uint32_t gray,
                                        unsigned octant)
{
    return table->group[ebpo_entry_value(gray)][octant];
}

/* --- descent towards a cell: `at` is the cell's position in the level `fine_level`; the cell must
 * be within the root's cell --- */

/* The state of a descent. */
typedef struct ebpo_descent {
    uint32_t entry;
    int level; /* level of the entry's node */
} ebpo_descent;

/* Returns the index of the grid cell that contains cell `at` of `fine_level`. */
static inline uint64_t ebpo_grid_cell(const ebpo_node_table *table, int fine_level,
                                      const uint32_t at[3])
{
    int shift = fine_level - table->root_level - table->grid_bits;
    uint32_t mask = (1u << table->grid_bits) - 1;
    uint64_t x = at[0] >> shift & mask, y = at[1] >> shift & mask, z = at[2] >> shift & mask;
    return (z << table->grid_bits | y) << table->grid_bits | x;
}

/* Begins at the node in the grid, or at the root if there is no grid. */
static inline ebpo_descent ebpo_descent_begin(const ebpo_node_table *table, int fine_level,
                                              const uint32_t at[3])
{
    if (!table->grid)
        return (ebpo_descent){ table->root, table->root_level };
    uint64_t cell = ebpo_grid_cell(table, fine_level, at);
    uint32_t entry = table->grid[cell];
    /* A gray node in the grid is always at the level of the grid's cells. So grid_depth, which is
     * in another cache line, is not read for gray nodes. */
    bool deep = ebpo_entry_kind_of(entry) == EBPO_ENTRY_GRAY;
    int depth = deep ? table->grid_bits : table->grid_depth[cell];
    return (ebpo_descent){ entry, table->root_level + depth };
}

/* Moves one level down. Returns false if the node has no children in the table. */
static inline bool ebpo_descent_step(ebpo_descent *d, const ebpo_node_table *table, int fine_level,
                                     const uint32_t at[3])
{
    if (ebpo_entry_kind_of(d->entry) != EBPO_ENTRY_GRAY)
        return false;
    d->level++;
    d->entry = ebpo_table_child(table, d->entry, ebpo_octant_at(at, fine_level - d->level));
    return true;
}

/* Prefetches the children's entries into the processor's cache for a later step. Returns false if
 * the node has no children in the table. */
static inline bool ebpo_descent_prefetch(const ebpo_descent *d, const ebpo_node_table *table)
{
    if (ebpo_entry_kind_of(d->entry) != EBPO_ENTRY_GRAY)
        return false;
    __builtin_prefetch(table->group[ebpo_entry_value(d->entry)]);
    return true;
}

/* Returns the node's cell. */
static inline ebpo_cell ebpo_descent_cell(const ebpo_descent *d, int fine_level,
                                          const uint32_t at[3])
{
    return ebpo_cell_ancestor((ebpo_cell){ fine_level, { at[0], at[1], at[2] } }, d->level);
}

/* Descends to the deepest node in the table that contains the cell. */
static inline ebpo_descent ebpo_descend(const ebpo_node_table *table, int fine_level,
                                        const uint32_t at[3])
{
    ebpo_descent d = ebpo_descent_begin(table, fine_level, at);
    while (ebpo_descent_step(&d, table, fine_level, at))
        ;
    return d;
}

#endif
