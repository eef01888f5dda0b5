#include "cli/mesh_input.h"

#include <string.h>

ebpo_status mesh_input_read_groups(mesh_input *out, const char *path, mending asked,
                                   bool attributes, ebpo_mesh_groups **groups,
                                   ebpo_workspace *workspace, unsigned threads,
                                   ebpo_progress progress, ebpo_error *error)
{
    ebpo_mesh_read_options how = EBPO_MESH_READ_OPTIONS_INIT;
    ebpo_prepare_options wanted = EBPO_PREPARE_OPTIONS_INIT;
    how.progress = wanted.progress = progress;
    how.threads = wanted.threads = threads;
    how.workspace = workspace;
    how.attributes = attributes;
    wanted.weld = asked.weld;
    wanted.orient = asked.orient;
    wanted.fill_holes = asked.fill_holes;
    memset(out, 0, sizeof *out);
    out->prepared = (ebpo_prepared)EBPO_PREPARED_INIT;
    ebpo_status status = groups ? ebpo_mesh_read_groups(path, &how, &out->mesh, groups, error)
                                : ebpo_mesh_read(path, &how, &out->mesh, error);
    if (status != EBPO_OK)
        return status;
    out->as_read = out->mesh;
    out->as_read.faces = NULL;
    out->as_read.attributes = NULL;
    status = ebpo_mesh_prepare(&out->mesh, &wanted, &out->prepared, error);
    if (status == EBPO_OK)
        return EBPO_OK;
    ebpo_mesh_free(&out->mesh);
    if (groups) {
        ebpo_mesh_groups_free(*groups);
        *groups = NULL;
    }
    return status;
}

ebpo_status mesh_input_read(mesh_input *out, const char *path, mending asked, bool attributes,
                            ebpo_workspace *workspace, unsigned threads, ebpo_progress progress,
                            ebpo_error *error)
{
    return mesh_input_read_groups(out, path, asked, attributes, NULL, workspace, threads, progress,
                                  error);
}
