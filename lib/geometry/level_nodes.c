/* Reads the nodes of an octree in memory: as levels, and as a table of children.
 *
 * Levels store node types in groups of eight siblings. A group is a word of 16 bits, with two bits
 * for each sibling. A node is found by its rank: the number of preceding nodes of its type in its
 * level. Ranks are prefix sums of the counts in the groups, and are computed once for each level.
 * Contradictory counts are rejected.
 *
 * The table of children stores four bytes for each node. A grid over its top levels replaces the
 * first steps from the root. The grid has at most as many cells as the groups of the table have
 * entries. */
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "geometry/level_nodes.h"

/* --- counts of node types --- */

static const uint64_t EVEN = UINT64_C(0x5555555555555555), PAIRS = UINT64_C(0x3333333333333333),
                      NIBBLES = UINT64_C(0x0f0f0f0f0f0f0f0f), BYTES = UINT64_C(0x00ff00ff00ff00ff);

/* Counts the set bits of each byte of x. Only even bits of x may be set. */
static inline uint64_t bits_of_bytes(uint64_t x)
{
    x = (x & PAIRS) + (x >> 2 & PAIRS);
    return (x + (x >> 4)) & NIBBLES;
}

/* Returns the sum of the eight bytes of x. */
static inline uint64_t sum_of_bytes(uint64_t x)
{
    return ((x & BYTES) + (x >> 8 & BYTES)) * UINT64_C(0x0001000100010001) >> 48;
}

/* Adds the counts of black, leaf and gray nodes to `counts`. A word has four groups. At most 32
 * words are allowed, so that no byte of the sums exceeds 255. */
static void count_words(const uint8_t *types, unsigned words, uint64_t counts[4])
{
    uint64_t low = 0, high = 0, both = 0;
    for (unsigned i = 0; i < words; i++) {
        uint64_t word;
        memcpy(&word, types + 8 * (size_t)i, sizeof word);
        low += bits_of_bytes(word & EVEN);
        high += bits_of_bytes(word >> 1 & EVEN);
        both += bits_of_bytes(word & word >> 1 & EVEN);
    }
    uint64_t gray = sum_of_bytes(both);
    counts[EBPO_GRAY] += gray;
    counts[EBPO_BLACK] += sum_of_bytes(low) - gray;
    counts[EBPO_LEAF] += sum_of_bytes(high) - gray;
}

void ebpo_groups_count(const void *types, uint64_t groups, uint64_t counts[4])
{
    const uint8_t *at = types;
    uint64_t words = groups / 4;
    memset(counts, 0, 4 * sizeof *counts);
    for (; words; at += 8 * 32, words -= 32) {
        count_words(at, words < 32 ? (unsigned)words : 32, counts);
        if (words < 32)
            break;
    }
    uint8_t rest[8] = { 0 };
    memcpy(rest, (const uint8_t *)types + groups / 4 * 8, groups % 4 * 2);
    count_words(rest, 1, counts);
    counts[EBPO_WHITE] = 8 * groups - counts[EBPO_BLACK] - counts[EBPO_LEAF] - counts[EBPO_GRAY];
}

/* --- ranks --- */

void ebpo_level_ranks_free(ebpo_level_ranks *ranks)
{
    for (int type = 0; type < 4; type++)
        free(ranks->before[type]);
    free(ranks->plane_first);
    free(ranks->leaf_plane_first);
    free(ranks->ref_first);
    memset(ranks, 0, sizeof *ranks);
}

/* Computes for each group the number of nodes of a type in the preceding groups. */
static ebpo_status count_before(uint64_t **out, const ebpo_level *level, ebpo_node_type type,
                                uint64_t *count, ebpo_error *error)
{
    *count = 0;
    if (!(*out = ebpo_alloc(level->group_count, sizeof **out)))
        return ebpo_fail_memory(error, level->group_count * sizeof **out);
    for (uint64_t i = 0; i < level->group_count; i++) {
        (*out)[i] = *count;
        *count += ebpo_group_count(level->types[i], type, 8);
    }
    return EBPO_OK;
}

/* Computes out->before, and checks the level's counts of nodes. `number`: number of the level, for
 * messages. */
static ebpo_status make_ranks(ebpo_level_ranks *out, const ebpo_level *level, int number,
                              ebpo_error *error)
{
    const bool wanted[4] = { [EBPO_WHITE] = level->white_winding,
                             [EBPO_BLACK] = level->black_winding,
                             [EBPO_LEAF] = true,
                             [EBPO_GRAY] = true };
    uint64_t count[4] = { level->white_count, level->black_count, 0, 0 };
    ebpo_status status = EBPO_OK;
    for (int type = 0; type < 4 && status == EBPO_OK; type++)
        if (wanted[type])
            status =
                count_before(&out->before[type], level, (ebpo_node_type)type, &count[type], error);
    if (status != EBPO_OK)
        return status;
    if (number == 0 && wanted[EBPO_WHITE])
        count[EBPO_WHITE] -=
            7; /* the root's group has only octant 0; its other octants are not nodes */
    if (count[EBPO_GRAY] != level->gray_count || count[EBPO_LEAF] != level->leaf_count ||
        count[EBPO_BLACK] != level->black_count || count[EBPO_WHITE] != level->white_count)
        return ebpo_fail(error, EBPO_E_FORMAT,
                         "level %d: its types and its node counts disagree; run ebpo verify",
                         number);
    return EBPO_OK;
}

static ebpo_status fail_counts(int number, const char *what, ebpo_error *error)
{
    return ebpo_fail(error, EBPO_E_FORMAT,
                     "level %d: the counts of its %s do not add up; run ebpo verify", number, what);
}

/* Computes for each count the sum of the preceding counts, and checks the total. `bytes`: size of a
 * count, 1 or 4. */
static ebpo_status sum_before(uint64_t **out, const void *counts, size_t bytes, uint64_t count,
                              uint64_t total, int number, const char *what, ebpo_error *error)
{
    const uint8_t *narrow = counts;
    const uint32_t *wide = counts;
    if (!(*out = ebpo_alloc(count, sizeof **out)))
        return ebpo_fail_memory(error, count * sizeof **out);
    uint64_t sum = 0;
    for (uint64_t i = 0; i < count; i++) {
        (*out)[i] = sum;
        sum += bytes == 1 ? narrow[i] : wide[i];
    }
    return sum == total ? EBPO_OK : fail_counts(number, what, error);
}

ebpo_status ebpo_level_ranks_make(ebpo_level_ranks *out, const ebpo_level *level, int number,
                                  ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    ebpo_status status = make_ranks(out, level, number, error);
    if (status == EBPO_OK && level->plane_counts)
        status = sum_before(&out->plane_first, level->plane_counts, 1, level->gray_count,
                            level->plane_count, number, "planes", error);
    if (status == EBPO_OK && level->leaf_plane_counts)
        status = sum_before(&out->leaf_plane_first, level->leaf_plane_counts, 1, level->leaf_count,
                            level->leaf_plane_count, number, "leaf planes", error);
    if (status == EBPO_OK && level->leaf_ref_count)
        status = sum_before(&out->ref_first, level->leaf_ref_count, 4, level->leaf_count,
                            level->ref_count, number, "face lists", error);
    if (status != EBPO_OK)
        ebpo_level_ranks_free(out);
    return status;
}

/* --- nodes of levels --- */

/* Returns the node of an octant in a group. `cell`: the node's cell, at the group's level. */
static ebpo_node node_of(const ebpo_level_nodes *n, uint64_t group, unsigned octant, ebpo_cell cell)
{
    uint16_t types = n->level[cell.level].types[group];
    ebpo_node_type type = ebpo_group_type(types, octant);
    const uint64_t *before = n->ranks[cell.level].before[type];
    ebpo_node node = { .cell = cell,
                       .type = type,
                       .rank =
                           ebpo_group_count(types, type, octant) + (before ? before[group] : 0) };
    node.pruned = type == EBPO_GRAY && (cell.level + 1 >= n->level_count ||
                                        n->level[cell.level + 1].types[node.rank] == 0);
    return node;
}

ebpo_node ebpo_level_root(const ebpo_level_nodes *n)
{
    return node_of(n, 0, 0, (ebpo_cell){ 0, { 0, 0, 0 } });
}

ebpo_node ebpo_level_child(const ebpo_level_nodes *n, const ebpo_node *gray, unsigned octant)
{
    return node_of(n, gray->rank, octant, ebpo_cell_child(gray->cell, octant));
}

const uint32_t *ebpo_level_planes(const ebpo_level_nodes *n, const ebpo_node *node, unsigned *count)
{
    const ebpo_level *level = &n->level[node->cell.level];
    const ebpo_level_ranks *ranks = &n->ranks[node->cell.level];
    *count = 0;
    if (node->type == EBPO_GRAY && ranks->plane_first) {
        *count = level->plane_counts[node->rank];
        return *count ? level->planes + ranks->plane_first[node->rank] : NULL;
    }
    if (node->type == EBPO_LEAF && ranks->leaf_plane_first) {
        *count = level->leaf_plane_counts[node->rank];
        return *count ? level->leaf_planes + ranks->leaf_plane_first[node->rank] : NULL;
    }
    return NULL;
}

int32_t ebpo_level_winding(const ebpo_level_nodes *n, const ebpo_node *node)
{
    const ebpo_level *level = &n->level[node->cell.level];
    if (node->type == EBPO_LEAF)
        return level->leaf_winding[node->rank];
    const int32_t *stored = node->type == EBPO_BLACK ? level->black_winding : level->white_winding;
    return stored ? stored[node->rank] : node->type == EBPO_BLACK;
}

/* --- for cursors --- */

static ebpo_status source_children(void *holder, ebpo_node *gray, ebpo_node child[8],
                                   ebpo_error *error)
{
    (void)error;
    for (unsigned octant = 0; octant < 8 && !gray->pruned; octant++)
        child[octant] = ebpo_level_child(holder, gray, octant);
    return EBPO_OK;
}

static ebpo_status source_planes(void *holder, const ebpo_node *node,
                                 uint32_t codes[EBPO_NODE_PLANES], unsigned *count,
                                 ebpo_error *error)
{
    (void)error;
    const uint32_t *from = ebpo_level_planes(holder, node, count);
    if (*count)
        memcpy(codes, from, *count * sizeof *codes);
    return EBPO_OK;
}

static ebpo_status source_winding(void *holder, const ebpo_node *uniform, int32_t *out,
                                  ebpo_error *error)
{
    (void)error;
    *out = ebpo_level_winding(holder, uniform);
    return EBPO_OK;
}

const ebpo_node_source ebpo_level_source = { source_children, source_planes, source_winding };

/* --- the table of children, and its grid --- */

typedef struct painter {
    ebpo_node_table *table;
    int bits; /* the grid has 2^bits cells along each axis */
} painter;

/* Writes `entry` to the grid cells that its node contains. If the node is gray and larger than a
 * grid cell, writes the entries of its descendants instead. `cell`: cell of the node, relative to
 * the table's root. */
static void paint_grid(painter *p, uint32_t entry, ebpo_cell cell)
{
    if (ebpo_entry_kind_of(entry) == EBPO_ENTRY_GRAY && cell.level < p->bits) {
        for (unsigned octant = 0; octant < 8; octant++)
            paint_grid(p, ebpo_table_child(p->table, entry, octant), ebpo_cell_child(cell, octant));
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
    paint_grid(&(painter){ table, bits }, table->root, (ebpo_cell){ 0, { 0, 0, 0 } });
}

void ebpo_node_table_free(ebpo_node_table *table)
{
    free(table->group);
    free(table->grid);
    free(table->grid_depth);
    free(table->split);
    free(table->near);
    free(table->disc);
    memset(table, 0, sizeof *table);
}
