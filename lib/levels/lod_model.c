#include "core/strict_fp.h"

#include "levels/lod_model.h"

#include <stdlib.h>
#include <string.h>

#include "core/error.h"

void ebpo_lod_model_free(ebpo_lod_model *model)
{
    for (int i = 0; i < EBPO_LEVELS_MAX; i++) {
        ebpo_level_free(&model->level[i]);
        ebpo_level_ranks_free(&model->ranks[i]);
    }
    ebpo_mesh_free(&model->mesh);
}

static ebpo_status read_levels(ebpo_lod_model *out, const ebpo_file *file,
                               const ebpo_read_options *read, ebpo_error *error)
{
    ebpo_file_prefetch_levels(file, 0, out->target);
    for (int i = 0; i <= out->target; i++) {
        ebpo_status status = ebpo_file_read_level(file, i, read, &out->level[i], error);
        if (status == EBPO_OK)
            status = ebpo_level_ranks_make(&out->ranks[i], &out->level[i], i, error);
        if (status != EBPO_OK)
            return status;
        uint64_t expected = i == 0 ? 1 : out->level[i - 1].gray_count;
        if (out->level[i].group_count != expected)
            return ebpo_fail(error, EBPO_E_FORMAT,
                             "level %d: %llu groups of siblings, but %llu parents; run ebpo verify",
                             i, (unsigned long long)out->level[i].group_count,
                             (unsigned long long)expected);
    }
    return EBPO_OK;
}

static bool has_leaves(const ebpo_lod_model *model)
{
    for (int i = 0; i <= model->target; i++)
        if (model->level[i].leaf_count)
            return true;
    return false;
}

ebpo_status ebpo_lod_model_read(ebpo_lod_model *out, const ebpo_file *file, int target,
                                const ebpo_read_options *read, ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    out->info = ebpo_file_info(file);
    out->target = target;
    out->box = ebpo_root_box(out->info);
    uint32_t parts = out->info->parts;
    out->leaf_source = parts & EBPO_PART_LEAF_PLANES ? EBPO_LEAF_STORED
                       : parts & EBPO_PART_MESH      ? EBPO_LEAF_DERIVED
                                                     : EBPO_LEAF_INHERITED;
    ebpo_status status = read_levels(out, file, read, error);
    if (status == EBPO_OK && out->leaf_source == EBPO_LEAF_DERIVED && has_leaves(out))
        status = ebpo_file_read_mesh(file, read, &out->mesh, error);
    if (status != EBPO_OK)
        ebpo_lod_model_free(out);
    return status;
}
