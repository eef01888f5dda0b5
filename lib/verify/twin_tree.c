#include "verify/twin_tree.h"

#include "core/error.h"
#include "core/workspace.h"

/* Adds what a group holds to the running counts. */
static void add_group(ebpo_twin_group *sum, const ebpo_twin_tree *view, const ebpo_level *level,
                      uint64_t group, unsigned octants)
{
    for (unsigned octant = 0; octant < octants; octant++) {
        ebpo_node_type type = ebpo_twin_type(level, group, octant);
        uint64_t rank = sum->of_type[type]++;
        if (type == EBPO_GRAY && view->has_planes)
            sum->planes += level->plane_counts[rank];
        if (type == EBPO_LEAF && view->has_mesh)
            sum->refs += level->leaf_ref_count[rank];
        if (type == EBPO_LEAF && view->has_leaf_planes)
            sum->leaf_planes += level->leaf_plane_counts[rank];
    }
}

static unsigned octants_at(int level) { return level == 0 ? 1 : 8; }

ebpo_status ebpo_twin_make(ebpo_twin_tree *out, const ebpo_tree *tree, ebpo_workspace *workspace,
                           ebpo_error *error)
{
    *out = (ebpo_twin_tree){ .tree = tree,
                             .workspace = workspace,
                             .box.grid_level = tree->info.grid_level };
    for (int k = 0; k < 3; k++) {
        out->box.origin[k] = tree->info.box_origin[k];
        out->box.size[k] = tree->info.box_size[k];
    }
    out->has_mesh = tree->info.parts & EBPO_PART_MESH;
    out->has_planes = tree->info.parts & EBPO_PART_PLANES;
    out->has_leaf_planes = tree->info.parts & EBPO_PART_LEAF_PLANES;
    for (int l = 0; l < tree->info.level_count; l++) {
        const ebpo_level *level = &tree->level[l];
        out->groups[l] = ebpo_array_alloc(workspace, level->group_count, sizeof *out->groups[l]);
        if (!out->groups[l]) {
            ebpo_twin_free(out);
            return ebpo_workspace_fail(workspace, level->group_count * sizeof *out->groups[l],
                                       error);
        }
        ebpo_twin_group sum = { 0 };
        EBPO_FOR_ITEMS(workspace, group, 0, level->group_count) {
            out->groups[l][group] = sum;
            add_group(&sum, out, level, group, octants_at(l));
        }
    }
    return EBPO_OK;
}

void ebpo_twin_free(ebpo_twin_tree *view)
{
    for (int l = 0; l < EBPO_LEVELS_MAX; l++)
        ebpo_array_free(view->workspace, view->groups[l]);
    *view = (ebpo_twin_tree){ 0 };
}

/* Fills in type and rank. */
static ebpo_twin_node place(const ebpo_twin_tree *view, ebpo_octcode code, ebpo_cell cell,
                            uint64_t group, unsigned octant)
{
    const ebpo_level *level = &view->tree->level[cell.level];
    ebpo_twin_node node = { code, cell, group, octant, ebpo_twin_type(level, group, octant), 0 };
    node.rank = view->groups[cell.level][group].of_type[node.type];
    for (unsigned i = 0; i < octant; i++)
        node.rank += ebpo_twin_type(level, group, i) == node.type;
    return node;
}

ebpo_twin_node ebpo_twin_root(const ebpo_twin_tree *view)
{
    return place(view, 1, (ebpo_cell){ 0, { 0, 0, 0 } }, 0, 0);
}

bool ebpo_twin_is_pruned(const ebpo_twin_tree *view, const ebpo_twin_node *node)
{
    const ebpo_tree *tree = view->tree;
    if (!tree->info.pruned || node->type != EBPO_GRAY)
        return false;
    return node->cell.level + 1 >= tree->info.level_count ||
           tree->level[node->cell.level + 1].types[node->rank] == 0;
}

ebpo_twin_node ebpo_twin_child(const ebpo_twin_tree *view, const ebpo_twin_node *node,
                               unsigned octant)
{
    ebpo_cell cell = { node->cell.level + 1, { 0 } };
    for (int k = 0; k < 3; k++)
        cell.at[k] = 2 * node->cell.at[k] + (octant >> k & 1);
    return place(view, ebpo_octcode_child(node->code, octant), cell, node->rank, octant);
}

/* Group of `level` that holds the gray node of this rank. */
static uint64_t group_of_gray(const ebpo_twin_tree *view, int level, uint64_t rank)
{
    uint64_t low = 0, high = view->tree->level[level].group_count;
    while (high - low > 1) {
        uint64_t middle = low + (high - low) / 2;
        if (view->groups[level][middle].of_type[EBPO_GRAY] <= rank)
            low = middle;
        else
            high = middle;
    }
    return low;
}

ebpo_twin_node ebpo_twin_at(const ebpo_twin_tree *view, int level, uint64_t group, unsigned octant)
{
    unsigned path[EBPO_LEVELS_MAX];
    path[level] = octant;
    for (int l = level - 1; l >= 0; l--) {
        uint64_t rank = group;
        group = group_of_gray(view, l, rank);
        uint64_t before = view->groups[l][group].of_type[EBPO_GRAY];
        unsigned i = 0;
        while (i < 7 &&
               !(ebpo_twin_type(&view->tree->level[l], group, i) == EBPO_GRAY && before++ == rank))
            i++;
        path[l] = i;
    }
    ebpo_twin_node node = ebpo_twin_root(view);
    for (int l = 1; l <= level; l++)
        node = ebpo_twin_child(view, &node, path[l]);
    return node;
}

const uint32_t *ebpo_twin_planes(const ebpo_twin_tree *view, const ebpo_twin_node *node,
                                 uint32_t *count)
{
    const ebpo_level *level = &view->tree->level[node->cell.level];
    const ebpo_twin_group *group = &view->groups[node->cell.level][node->group];
    bool gray = node->type == EBPO_GRAY;
    *count = 0;
    if (gray ? !view->has_planes : node->type != EBPO_LEAF || !view->has_leaf_planes)
        return NULL;
    const uint8_t *counts = gray ? level->plane_counts : level->leaf_plane_counts;
    uint64_t first = gray ? group->planes : group->leaf_planes;
    for (uint64_t rank = group->of_type[node->type]; rank < node->rank; rank++)
        first += counts[rank];
    *count = counts[node->rank];
    return *count ? (gray ? level->planes : level->leaf_planes) + first : NULL;
}

const uint32_t *ebpo_twin_refs(const ebpo_twin_tree *view, const ebpo_twin_node *leaf,
                               uint32_t *count)
{
    const ebpo_level *level = &view->tree->level[leaf->cell.level];
    const ebpo_twin_group *group = &view->groups[leaf->cell.level][leaf->group];
    uint64_t first = group->refs;
    for (uint64_t rank = group->of_type[EBPO_LEAF]; rank < leaf->rank; rank++)
        first += level->leaf_ref_count[rank];
    *count = level->leaf_ref_count[leaf->rank];
    return *count ? level->leaf_refs + first : NULL;
}

int64_t ebpo_twin_winding(const ebpo_twin_tree *view, const ebpo_twin_node *node)
{
    const ebpo_level *level = &view->tree->level[node->cell.level];
    switch (node->type) {
    case EBPO_WHITE: return level->white_winding ? level->white_winding[node->rank] : 0;
    case EBPO_BLACK: return level->black_winding ? level->black_winding[node->rank] : 1;
    case EBPO_LEAF: return level->leaf_winding ? level->leaf_winding[node->rank] : 0;
    default: return 0;
    }
}
