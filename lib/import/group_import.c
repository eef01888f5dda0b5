/* Reading with and without groups. */
#include <string.h>

#include "attributes/attributes.h"
#include "base/arrays.h"
#include "base/error.h"
#include "import/import.h"
#include "import/obj_losses.h"
#include "io/file_source.h"

ebpo_status ebpo_import_memory(ebpo_mesh *out, ebpo_import_format format, const uint8_t *data,
                               uint64_t size, const char *name, ebpo_workspace *workspace,
                               bool attributes, ebpo_error *error)
{
    ebpo_status status =
        ebpo_import_runs(out, format, data, size, name, workspace, attributes, NULL, error);
    if (status != EBPO_OK || !attributes || format != EBPO_IMPORT_OBJ ||
        !ebpo_obj_names(data, size))
        return status;
    if (!out->attributes && !(out->attributes = ebpo_attributes_make(workspace))) {
        ebpo_import_clear(out);
        return ebpo_fail_memory(error, sizeof *out->attributes);
    }
    ebpo_attributes_lose(out->attributes, "names of groups and objects");
    return EBPO_OK;
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
                                          runs->text_size, name, workspace, false, runs, error);
    if (status == EBPO_OK && !equal(mesh, &again))
        status = ebpo_fail_no_runs(ebpo_path_name(name), error);
    ebpo_import_clear(&again);
    return status;
}

ebpo_status ebpo_import_groups(ebpo_mesh *out, const uint8_t *data, uint64_t size, const char *name,
                               ebpo_workspace *workspace, bool attributes, ebpo_obj_runs *runs,
                               ebpo_error *error)
{
    *runs = (ebpo_obj_runs){ 0 };
    ebpo_status status = ebpo_import_runs(out, EBPO_IMPORT_OBJ, data, size, name, workspace,
                                          attributes, NULL, error);
    if (status != EBPO_OK)
        return status;
    status = ebpo_obj_runs_find(runs, data, size, ebpo_path_name(name), error);
    if (status == EBPO_OK && runs->count > 1)
        status = count_faces(out, runs, name, workspace, error);
    if (status == EBPO_OK)
        return EBPO_OK;
    ebpo_obj_runs_free(runs);
    ebpo_import_clear(out);
    return status;
}
