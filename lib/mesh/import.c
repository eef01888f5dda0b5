/* Reads meshes of all formats. The table `formats` has one row for each format. To add a format:
 * write NAME.c with the format's reader and row, declare the row in import_build.h, and add a line
 * to the table `formats`. */
#include "core/strict_fp.h"

#include "mesh/import.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "mesh/attributes.h"
#include "core/parallel.h"
#include "core/workspace.h"
#include "core/error.h"
#include "mesh/import_build.h"
#include "io/file_source.h"

/* The formats in the order of recognition. Messages list them in reverse order. */
static const ebpo_import_format *const formats[] = {
    &ebpo_import_off,
    &ebpo_import_stl,
    &ebpo_import_obj,
    &ebpo_import_ply,
};

enum {
    FORMATS = sizeof formats / sizeof *formats,
    LIST_TEXT = 24 * FORMATS /* bytes for the names of all formats, with separators */
};

/* --- building the mesh from a reader's values and faces --- */

void ebpo_import_clear(ebpo_mesh *mesh)
{
    ebpo_array_free(mesh->workspace, mesh->xyz32);
    ebpo_array_free(mesh->workspace, mesh->xyz64);
    ebpo_array_free(mesh->workspace, mesh->faces);
    ebpo_attributes_free(mesh->attributes);
    *mesh = (ebpo_mesh){ 0 };
}

/* Frees empty attributes. */
static void drop_empty(ebpo_mesh *mesh)
{
    ebpo_attributes *a = mesh->attributes;
    if (!a || ebpo_attributes_hold(a) || a->lost[0] || a->unread[0])
        return;
    ebpo_attributes_free(a);
    mesh->attributes = NULL;
}

/* Reads the file with float or double positions. Sets *again to true if the file must be read again
 * with doubles, because a float does not reproduce all digits of some coordinate in the file. On
 * failure, only the workspace of the mesh remains. */
static ebpo_status read_once(ebpo_mesh *mesh, const ebpo_import_format *format,
                             const ebpo_import_job *job, bool doubles, bool *again,
                             ebpo_error *error)
{
    ebpo_workspace *workspace = mesh->workspace;
    ebpo_import_build b;
    ebpo_status status =
        ebpo_import_begin(&b, mesh, ebpo_path_name(job->name), job->attributes, doubles, error);
    if (status == EBPO_OK && job->attributes)
        status = ebpo_mesh_need_attributes(mesh, error);
    if (status == EBPO_OK)
        status = format->build(&b, job);
    ebpo_import_free(&b);
    *again = status != EBPO_OK && b.loses_digits && !doubles;
    if (status != EBPO_OK) {
        ebpo_import_clear(mesh);
        mesh->workspace = workspace;
        if (job->runs)
            ebpo_import_runs_free(job->runs);
    }
    return status;
}

static ebpo_status build_mesh(ebpo_mesh *out, const ebpo_import_format *format,
                              const ebpo_import_job *job, ebpo_error *error)
{
    ebpo_mesh mesh = { .workspace = job->workspace };
    bool again;
    ebpo_status status = read_once(&mesh, format, job, false, &again, error);
    if (again)
        status = read_once(&mesh, format, job, true, &again, error);
    if (status == EBPO_OK) {
        drop_empty(&mesh);
        snprintf(mesh.source_name, sizeof mesh.source_name, "%s", ebpo_path_name(job->name));
        snprintf(mesh.source_format, sizeof mesh.source_format, "%s", format->ending + 1);
        mesh.source_size = job->size;
    } else {
        mesh.workspace = NULL;
    }
    *out = mesh;
    return status;
}

/* --- recognition of the format --- */

static bool name_ends(const char *name, const char *ending)
{
    size_t n = strlen(name), length = strlen(ending);
    return n >= length && strcasecmp(name + n - length, ending) == 0;
}

const ebpo_import_format *ebpo_import_recognise(const uint8_t *data, uint64_t size,
                                                const char *name)
{
    for (size_t i = 0; i < FORMATS; i++)
        if (formats[i]->beginning_decides && formats[i]->recognise(data, size))
            return formats[i];
    for (size_t i = 0; i < FORMATS; i++)
        if (formats[i]->recognise(data, size) || name_ends(name, formats[i]->ending))
            return formats[i];
    return NULL;
}

/* Returns true if the file begins with the signature of a format. */
static bool has_signature(const uint8_t *data, uint64_t size)
{
    for (size_t i = 0; i < FORMATS; i++)
        if (!formats[i]->has_no_signature && formats[i]->recognise(data, size))
            return true;
    return false;
}

/* Checks the ending of the name. `format`: the format that the ending indicates. Rejects the file
 * if it begins like a file of another format that has no signature. */
static ebpo_status check_name(const ebpo_import_format *format, const ebpo_import_job *job,
                              ebpo_error *error)
{
    if (format->has_no_signature || format->recognise(job->data, job->size) ||
        !ebpo_bytes_are_text(job->data, job->size))
        return EBPO_OK;
    for (size_t i = 0; i < FORMATS; i++) {
        const ebpo_import_format *other = formats[i];
        if (other->has_no_signature && other->recognise(job->data, job->size))
            return ebpo_fail_file(error, EBPO_E_FORMAT, ebpo_path_name(job->name),
                                  "begins like %s file, but its name indicates %s; rename it to "
                                  "end in %s",
                                  other->called, ebpo_import_name(format), other->ending);
    }
    return EBPO_OK;
}

/* Writes "PLY, OBJ, STL or OFF". */
static void list_names(char text[LIST_TEXT])
{
    int at = 0;
    for (size_t i = FORMATS; i-- > 0 && at < LIST_TEXT;)
        at += snprintf(text + at, (size_t)(LIST_TEXT - at), "%s%s",
                       i == FORMATS - 1 ? ""
                       : i > 0          ? ", "
                                        : " or ",
                       ebpo_import_name(formats[i]));
}

ebpo_status ebpo_import_memory(ebpo_mesh *out, const ebpo_import_format *format,
                               const ebpo_import_job *job, ebpo_error *error)
{
    *out = (ebpo_mesh){ 0 };
    if (format->read)
        return format->read(out, job, error);
    if (!ebpo_progress_stage(job->progress, "reading", error))
        return EBPO_E_CANCELLED;
    ebpo_status status = check_name(format, job, error);
    return status == EBPO_OK ? build_mesh(out, format, job, error) : status;
}

ebpo_status ebpo_import_any(ebpo_mesh *out, const ebpo_import_job *job, ebpo_error *error)
{
    /* the message for a file of a known type that is no mesh, such as an image; else NULL */
    const char *foreign = ebpo_wrong_kind_of_file(job->data, job->size),
               *name = ebpo_path_name(job->name);
    const ebpo_import_format *format = ebpo_import_recognise(job->data, job->size, job->name);
    char list[LIST_TEXT];
    /* a file with the signature of a mesh format is a mesh: a binary STL file may begin like a file
     * of another type */
    if (foreign && has_signature(job->data, job->size))
        foreign = NULL;
    if (!foreign && format)
        return ebpo_import_memory(out, format, job, error);
    *out = (ebpo_mesh){ 0 };
    if (foreign)
        return ebpo_fail_file(error, EBPO_E_FORMAT, name, "%s", foreign);
    list_names(list);
    return ebpo_fail_file(error, EBPO_E_FORMAT, name, "unrecognised format; expected %s", list);
}
