#include "geom/strict_fp.h"

#include "deviation/tree.h"

#include "base/error.h"
#include "container/reader.h"
#include "geom/plane_code.h"
#include "octree/cells.h"
#include "octree/node_types.h"

ebpo_status ebpo_tree_read_whole(ebpo_lod_model *out, ebpo_file *file, unsigned threads,
                                 ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    if (!(info->parts & EBPO_PART_MESH))
        return ebpo_fail(error, EBPO_E_ABSENT,
                         "%s: how far envelopes reach beyond the model is measured against its "
                         "mesh, which the file does not hold; take a file with it "
                         "(`ebpo convert`)",
                         file->in.shown);
    if (info->pruned)
        return ebpo_fail(error, EBPO_E_ABSENT,
                         "%s: is a subset, and how far envelopes reach beyond the model is "
                         "measured against all of its mesh; take the original",
                         file->in.shown);
    ebpo_status status = ebpo_lod_model_read(out, file, info->level_count - 1, threads, error);
    if (status == EBPO_OK && !out->mesh.faces)
        status = ebpo_file_read_mesh(file, &out->mesh, threads, error);
    if (status != EBPO_OK)
        ebpo_lod_model_free(out);
    return status;
}

/* --- half-spaces --- */

static void add(ebpo_halves *h, const uint32_t *codes, uint64_t count)
{
    for (uint64_t i = 0; i < count && h->count < EBPO_HALVES_MAX; i++) {
        int32_t d;
        ebpo_half *next = &h->half[h->count];
        if (!ebpo_plane_decode(codes[i], next->n, &d))
            continue;
        next->d = d;
        h->count++;
    }
}

static bool keeps_cell(const ebpo_half *h)
{
    int64_t most = 0;
    for (int k = 0; k < 3; k++)
        most += h->n[k] > 0 ? h->n[k] : 0;
    return EBPO_OFFSET_STEPS * most <= h->d;
}

static void to_child(ebpo_halves *h, unsigned octant)
{
    int kept = 0;
    for (int i = 0; i < h->count; i++) {
        ebpo_half half = h->half[i];
        half.d = ebpo_plane_to_child(half.n, half.d, octant);
        if (!keeps_cell(&half))
            h->half[kept++] = half;
    }
    h->count = kept;
}

void ebpo_halves_cut(const ebpo_halves *halves, double slack, ebpo_polytope *out)
{
    ebpo_polytope_cube(out);
    for (int i = 0; i < halves->count; i++) {
        double n[3], d = ebpo_plane_as_double(halves->half[i].n, halves->half[i].d, n);
        (void)ebpo_polytope_clip(out, n, d + slack, i);
    }
}

/* --- places --- */

bool ebpo_tree_is_pruned(const ebpo_lod_model *tree, const ebpo_tree_node *gray)
{
    return gray->cell.level >= tree->target ||
           tree->level[gray->cell.level + 1].types[gray->rank] == 0;
}

static void find_in_group(const ebpo_lod_model *tree, uint64_t group, unsigned octant,
                          ebpo_tree_node *out)
{
    const ebpo_lod_index *index = &tree->index[out->cell.level];
    uint16_t types = tree->level[out->cell.level].types[group];
    out->type = ebpo_group_type(types, octant);
    out->rank = ebpo_group_count(types, out->type, octant);
    if (out->type == EBPO_GRAY)
        out->rank += index->gray_before[group];
    else if (out->type == EBPO_LEAF)
        out->rank += index->leaf_before[group];
}

ebpo_tree_node ebpo_tree_child(const ebpo_lod_model *tree, const ebpo_tree_node *gray,
                               unsigned octant)
{
    ebpo_tree_node child = { ebpo_cell_child(gray->cell, octant), EBPO_WHITE, 0 };
    find_in_group(tree, gray->rank, octant, &child);
    return child;
}

static void add_own(const ebpo_lod_model *tree, const ebpo_tree_node *place, ebpo_halves *halves)
{
    const ebpo_level *level = &tree->level[place->cell.level];
    const ebpo_lod_index *index = &tree->index[place->cell.level];
    if (place->type == EBPO_GRAY && level->plane_counts)
        add(halves, level->planes + index->plane_first[place->rank],
            level->plane_counts[place->rank]);
    else if (place->type == EBPO_LEAF && tree->leaf_source == EBPO_LEAF_STORED &&
             index->leaf_plane_first)
        add(halves, level->leaf_planes + index->leaf_plane_first[place->rank],
            level->leaf_plane_counts[place->rank]);
}

bool ebpo_tree_find(const ebpo_lod_model *tree, ebpo_cell cell, bool planes, bool own,
                    ebpo_tree_node *out, ebpo_halves *halves)
{
    *out = (ebpo_tree_node){ { 0, { 0, 0, 0 } }, EBPO_WHITE, 0 };
    find_in_group(tree, 0, 0, out);
    if (halves)
        halves->count = 0;
    while (out->cell.level < cell.level) {
        if (out->type != EBPO_GRAY || ebpo_tree_is_pruned(tree, out))
            return false;
        unsigned octant = ebpo_cell_octant(cell, out->cell.level);
        if (halves && planes)
            add_own(tree, out, halves);
        if (halves)
            to_child(halves, octant);
        *out = ebpo_tree_child(tree, out, octant);
    }
    if (halves && planes && own)
        add_own(tree, out, halves);
    return true;
}

ebpo_status ebpo_tree_derive(const ebpo_lod_model *tree, const ebpo_tree_node *leaf,
                             ebpo_leaf_scratch *scratch, ebpo_halves *halves, ebpo_error *error)
{
    ebpo_polytope inherited;
    uint32_t codes[EBPO_PLANES_MAX];
    int count = 0;
    ebpo_halves_cut(halves, 0, &inherited);
    ebpo_status status = ebpo_lod_leaf_planes(tree, leaf->cell, leaf->rank, scratch, &inherited,
                                              codes, &count, error);
    if (status == EBPO_OK)
        add(halves, codes, (uint64_t)count);
    return status;
}
