#include "geometry/level_nodes.h"

#include <string.h>

/* Node of a group of the cell's level. */
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

static ebpo_status children(void *holder, ebpo_node *gray, ebpo_node child[8], ebpo_error *error)
{
    (void)error;
    for (unsigned octant = 0; octant < 8 && !gray->pruned; octant++)
        child[octant] = ebpo_level_child(holder, gray, octant);
    return EBPO_OK;
}

static ebpo_status planes(void *holder, const ebpo_node *node, uint32_t codes[EBPO_NODE_PLANES],
                          unsigned *count, ebpo_error *error)
{
    (void)error;
    const uint32_t *from = ebpo_level_planes(holder, node, count);
    if (*count)
        memcpy(codes, from, *count * sizeof *codes);
    return EBPO_OK;
}

static ebpo_status winding(void *holder, const ebpo_node *uniform, int32_t *out, ebpo_error *error)
{
    (void)error;
    *out = ebpo_level_winding(holder, uniform);
    return EBPO_OK;
}

const ebpo_node_source ebpo_level_source = { children, planes, winding };
