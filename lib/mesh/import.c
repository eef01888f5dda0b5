#include "core/strict_fp.h"

#include "mesh/import.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "mesh/attributes.h"
#include "core/workspace.h"
#include "core/error.h"
#include "mesh/import_build.h"
#include "mesh/obj.h"
#include "io/file_source.h"

void ebpo_import_clear(ebpo_mesh *mesh)
{
    ebpo_array_free(mesh->workspace, mesh->xyz32);
    ebpo_array_free(mesh->workspace, mesh->xyz64);
    ebpo_array_free(mesh->workspace, mesh->faces);
    ebpo_attributes_free(mesh->attributes);
    *mesh = (ebpo_mesh){ 0 };
}

static ebpo_status read_format(import_build *b, ebpo_import_format format, const uint8_t *data,
                               uint64_t size, ebpo_obj_runs *runs)
{
    switch (format) {
    case EBPO_IMPORT_OBJ: return ebpo_obj_read(b, data, size, runs);
    case EBPO_IMPORT_OFF: return ebpo_off_read(b, data, size);
    default: return ebpo_stl_read(b, data, size);
    }
}

/* None that would say nothing. */
static void drop_empty(ebpo_mesh *mesh)
{
    ebpo_attributes *a = mesh->attributes;
    if (!a || ebpo_attributes_hold(a) || a->lost[0] || a->unread[0])
        return;
    ebpo_attributes_free(a);
    mesh->attributes = NULL;
}

/* Reads the file with positions of floats or doubles; *again: floats do not keep its text. On
 * failure nothing is left but the mesh's workspace. */
static ebpo_status read_once(ebpo_mesh *mesh, ebpo_import_format format, const uint8_t *data,
                             uint64_t size, const char *name, bool attributes, bool doubles,
                             ebpo_obj_runs *runs, bool *again, ebpo_error *error)
{
    ebpo_workspace *workspace = mesh->workspace;
    import_build b;
    ebpo_status status = ebpo_import_begin(&b, mesh, name, attributes, doubles, error);
    if (status == EBPO_OK && attributes && !(mesh->attributes = ebpo_attributes_make(workspace)))
        status = ebpo_fail_memory(error, sizeof *mesh->attributes);
    if (status == EBPO_OK)
        status = read_format(&b, format, data, size, runs);
    ebpo_import_free(&b);
    *again = status != EBPO_OK && b.loses_digits && !doubles;
    if (status != EBPO_OK) {
        ebpo_import_clear(mesh);
        mesh->workspace = workspace;
        if (runs)
            ebpo_obj_runs_free(runs);
    }
    return status;
}

static ebpo_status import_import(ebpo_mesh *out, ebpo_import_format format, const uint8_t *data,
                                 uint64_t size, const char *name, ebpo_workspace *workspace,
                                 bool attributes, ebpo_obj_runs *runs, ebpo_error *error)
{
    static const char *const formats[] = { "obj", "stl", "off" };
    ebpo_mesh mesh = { .workspace = workspace };
    bool again;
    name = ebpo_path_name(name);
    ebpo_status status =
        read_once(&mesh, format, data, size, name, attributes, false, runs, &again, error);
    if (again)
        status = read_once(&mesh, format, data, size, name, attributes, true, runs, &again, error);
    if (status == EBPO_OK) {
        drop_empty(&mesh);
        snprintf(mesh.source_name, sizeof mesh.source_name, "%s", name);
        snprintf(mesh.source_format, sizeof mesh.source_format, "%s", formats[format]);
        mesh.source_size = size;
    } else {
        mesh.workspace = NULL;
    }
    *out = mesh;
    return status;
}

ebpo_status ebpo_import_groups(ebpo_mesh *out, const uint8_t *data, uint64_t size, const char *name,
                               ebpo_workspace *workspace, bool attributes, ebpo_obj_runs *runs,
                               ebpo_error *error)
{
    *runs = (ebpo_obj_runs){ 0 };
    return import_import(out, EBPO_IMPORT_OBJ, data, size, name, workspace, attributes, runs,
                         error);
}

/* --- which format it is --- */

/* An OBJ file has no mark: its first word is one of those that such files begin with. */
static bool is_obj(const uint8_t *data, uint64_t size)
{
    static const char *const words[] = { "v", "vt", "vn", "vp",     "f",
                                         "g", "o",  "s",  "mtllib", "usemtl" };
    obj_text t = ebpo_obj_text(data, size);
    obj_word word;
    if (!ebpo_obj_next_statement(&t, &word))
        return false;
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (ebpo_obj_word_is(word, words[i]))
            return true;
    return false;
}

bool ebpo_import_recognise(ebpo_import_format *format, const uint8_t *data, uint64_t size,
                           const char *name)
{
    size_t n = strlen(name);
    const char *ending = n >= 4 ? name + n - 4 : "";
    if (ebpo_off_recognise(data, size) || strcasecmp(ending, ".off") == 0)
        *format = EBPO_IMPORT_OFF;
    else if (ebpo_stl_recognise(data, size) || strcasecmp(ending, ".stl") == 0)
        *format = EBPO_IMPORT_STL;
    else if (strcasecmp(ending, ".obj") == 0 || is_obj(data, size))
        *format = EBPO_IMPORT_OBJ;
    else
        return false;
    return true;
}

/* OBJ has no mark, so a name that ends in .stl or .off hides one. */
static ebpo_status check_name(ebpo_import_format format, const uint8_t *data, uint64_t size,
                              const char *name, ebpo_error *error)
{
    bool marked = format == EBPO_IMPORT_OFF   ? ebpo_off_recognise(data, size)
                  : format == EBPO_IMPORT_STL ? ebpo_stl_recognise(data, size)
                                              : true;
    if (marked || !ebpo_bytes_are_text(data, size) || !is_obj(data, size))
        return EBPO_OK;
    return ebpo_fail_file(error, EBPO_E_FORMAT, ebpo_path_name(name),
                          "begins as an OBJ file does, but its name says %s; rename it to end in "
                          ".obj",
                          format == EBPO_IMPORT_OFF ? "OFF" : "STL");
}

ebpo_status ebpo_import_memory(ebpo_mesh *out, ebpo_import_format format, const uint8_t *data,
                               uint64_t size, const char *name, ebpo_workspace *workspace,
                               bool attributes, ebpo_error *error)
{
    ebpo_status status = check_name(format, data, size, name, error);
    if (status != EBPO_OK) {
        *out = (ebpo_mesh){ 0 };
        return status;
    }
    return import_import(out, format, data, size, name, workspace, attributes, NULL, error);
}
