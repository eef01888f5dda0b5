#include "core/strict_fp.h"

#include "derive/tree.h"

#include "core/error.h"
#include "format/reader.h"

ebpo_status ebpo_tree_read_whole(ebpo_lod_model *out, const ebpo_file *file, unsigned threads,
                                 ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    if (!(info->parts & EBPO_PART_MESH))
        return ebpo_fail_file(error, EBPO_E_ABSENT, file->in.shown,
                              "how far envelopes reach beyond the model is measured against its "
                              "mesh, which the file does not have; use a file with it "
                              "(`ebpo convert`)");
    if (info->pruned)
        return ebpo_fail_file(error, EBPO_E_ABSENT, file->in.shown,
                              "is a subset, and how far envelopes reach beyond the model is "
                              "measured against all of its mesh; use the original");
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    read.threads = threads;
    ebpo_status status = ebpo_lod_model_read(out, file, info->level_count - 1, &read, error);
    if (status == EBPO_OK && !out->mesh.faces)
        status = ebpo_file_read_mesh(file, &read, &out->mesh, error);
    if (status != EBPO_OK)
        ebpo_lod_model_free(out);
    return status;
}

static bool go_to(ebpo_cursor *c, ebpo_level_nodes *nodes, ebpo_cell cell, ebpo_node *out)
{
    ebpo_cursor_begin(c, &ebpo_level_source, nodes, ebpo_level_root(nodes));
    bool good = ebpo_cursor_to_cell(c, cell, NULL) == EBPO_OK;
    *out = *ebpo_cursor_node(c);
    return good && out->cell.level == cell.level;
}

bool ebpo_tree_find(const ebpo_lod_model *tree, ebpo_cell cell, ebpo_node *out)
{
    ebpo_level_nodes nodes = ebpo_lod_model_nodes(tree);
    ebpo_cursor c;
    return go_to(&c, &nodes, cell, out);
}

bool ebpo_tree_bounds(const ebpo_lod_model *tree, ebpo_cell cell, bool own, ebpo_node *out,
                      ebpo_half_spaces *halves)
{
    ebpo_level_nodes nodes = ebpo_lod_model_nodes(tree);
    ebpo_cursor c;
    return go_to(&c, &nodes, cell, out) &&
           ebpo_cursor_half_spaces(&c, own, halves, NULL) == EBPO_OK;
}

ebpo_status ebpo_tree_derive(const ebpo_lod_model *tree, const ebpo_node *leaf,
                             ebpo_leaf_scratch *scratch, ebpo_half_spaces *halves,
                             ebpo_error *error)
{
    ebpo_polytope inherited;
    uint32_t codes[EBPO_PLANES_MAX];
    int count = 0;
    ebpo_half_spaces_cut(halves, 0, &inherited);
    ebpo_status status = ebpo_lod_leaf_planes(tree, leaf->cell, leaf->rank, scratch, &inherited,
                                              codes, &count, error);
    if (status == EBPO_OK)
        ebpo_half_spaces_add(halves, codes, (uint64_t)count);
    return status;
}
