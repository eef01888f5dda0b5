/* Reading with and without groups. */
#include <string.h>

#include "base/arrays.h"
#include "base/error.h"
#include "import/import.h"
#include "io/file_source.h"

ebpo_status ebpo_import_memory(ebpo_mesh *out, ebpo_import_format format, const uint8_t *data,
                               uint64_t size, const char *name, ebpo_workspace *workspace,
                               ebpo_error *error)
{
    return ebpo_import_runs(out, format, data, size, name, workspace, NULL, error);
}

static bool equal(const ebpo_mesh *a, const ebpo_mesh *b)
{
    return a->vertex_count == b->vertex_count && a->face_count == b->face_count &&
           memcmp(a->xyz32, b->xyz32, a->vertex_count * 3 * sizeof *a->xyz32) == 0 &&
           memcmp(a->faces, b->faces, a->face_count * 3 * sizeof *a->faces) == 0;
}

/* Read again, with names that tell the runs apart. */
static ebpo_status count_faces(const ebpo_mesh *mesh, ebpo_obj_runs *runs, const char *name,
                               ebpo_workspace *workspace, ebpo_error *error)
{
    ebpo_mesh again;
    ebpo_status status = ebpo_import_runs(&again, EBPO_IMPORT_OBJ, (const uint8_t *)runs->text,
                                          runs->text_size, name, workspace, runs, error);
    if (status == EBPO_OK && !equal(mesh, &again))
        status = ebpo_fail_no_runs(ebpo_path_name(name), error);
    ebpo_array_free(workspace, again.xyz32);
    ebpo_array_free(workspace, again.faces);
    return status;
}

ebpo_status ebpo_import_groups(ebpo_mesh *out, const uint8_t *data, uint64_t size, const char *name,
                               ebpo_workspace *workspace, ebpo_obj_runs *runs, ebpo_error *error)
{
    *runs = (ebpo_obj_runs){ 0 };
    ebpo_status status =
        ebpo_import_memory(out, EBPO_IMPORT_OBJ, data, size, name, workspace, error);
    if (status != EBPO_OK)
        return status;
    status = ebpo_obj_runs_find(runs, data, size, ebpo_path_name(name), error);
    if (status == EBPO_OK && runs->count > 1)
        status = count_faces(out, runs, name, workspace, error);
    if (status == EBPO_OK)
        return EBPO_OK;
    ebpo_obj_runs_free(runs);
    ebpo_array_free(workspace, out->xyz32);
    ebpo_array_free(workspace, out->faces);
    *out = (ebpo_mesh){ 0 };
    return status;
}
