/* Exports levels (as the envelopes of nodes) and the mesh in other programs' formats. The table
 * `formats` has one row for each format: its name, the ending of its second file, the colours that
 * it can hold, and the function that writes it. To add a format, add a value of ebpo_export_format,
 * a row of the table, and a file export_NAME.c with the function, which is declared in
 * export_job.h. The simplified surface has separate writers: export_surface.c for GLB, and
 * export_tiles.c. The functions that the writers share are in export_job.c. */
#include <ebpo/export.h>

#include <stdio.h>
#include <string.h>

#include "ebpo_config.h"

#include "core/error.h"
#include "core/fp_env.h"
#include "derive/export_job.h"
#include "io/file_source.h"

#if EBPO_HAVE_ASSIMP
#define WRITE_BY_ASSIMP ebpo_export_assimp
#else
#define WRITE_BY_ASSIMP NULL
#endif

/* Indexed by ebpo_export_format. */
static const ebpo_export_row formats[] = {
    [EBPO_EXPORT_XDMF] = { .name = "xdmf",
                           .second_ending = ".h5",
                           .holds_vertex_colours = true,
                           .holds_face_colours = true,
                           .write = ebpo_export_xdmf },
    [EBPO_EXPORT_VTKHDF] = { .name = "vtkhdf",
                             .holds_vertex_colours = true,
                             .holds_face_colours = true,
                             .write = ebpo_export_vtkhdf },
    [EBPO_EXPORT_GLTF] = { .name = "gltf",
                           .second_ending = ".bin",
                           .replaces_ending = true,
                           .holds_vertex_colours = true,
                           .takes_colours = true,
                           .write = ebpo_export_gltf },
    [EBPO_EXPORT_GLB] = { .name = "glb",
                          .holds_vertex_colours = true,
                          .takes_colours = true,
                          .write = ebpo_export_gltf },
    [EBPO_EXPORT_OBJ] = { .name = "obj",
                          .holds_vertex_colours = true,
                          .takes_colours = true,
                          .write = WRITE_BY_ASSIMP },
    [EBPO_EXPORT_TILES] = { .name = "tiles",
                            .folder = true,
                            .holds_vertex_colours = true,
                            .write = ebpo_export_tiles },
    [EBPO_EXPORT_STL] = { .name = "stl", .one_block = true, .write = WRITE_BY_ASSIMP },
};

/* Returns the row of a format, or NULL for an invalid value. */
static const ebpo_export_row *format_row(ebpo_export_format format)
{
    return (unsigned)format < sizeof formats / sizeof *formats ? &formats[format] : NULL;
}

const char *ebpo_export_format_name(ebpo_export_format format)
{
    const ebpo_export_row *row = format_row(format);
    return row ? row->name : NULL;
}

bool ebpo_export_second_file(ebpo_export_format format, const char *path, char *out,
                             size_t capacity)
{
    const ebpo_export_row *row = format_row(format);
    const char *name = ebpo_path_name(path), *dot = strrchr(name, '.');
    int length = -1;
    if (capacity)
        *out = 0;
    if (!row || !row->second_ending)
        return true;
    if (row->replaces_ending)
        length = snprintf(out, capacity, "%.*s%s",
                          (int)(dot && dot != name ? dot - path : (int)strlen(path)), path,
                          row->second_ending);
    else /* readers take the text after the first ":" as the path within the HDF5 file */
        length = strchr(name, ':') ? -1 : snprintf(out, capacity, "%s%s", path, row->second_ending);
    /* With the ending of the second file, both files would have the same name. */
    return length >= 0 && (size_t)length < capacity && strcmp(out, path) != 0;
}

static ebpo_status check_export(const ebpo_info *info, const ebpo_export_row *row,
                                const ebpo_export_options *o, ebpo_error *error)
{
    /* requested: the level that is checked: first_level if it is invalid, otherwise last_level */
    int blocks = ebpo_block_count(o),
        requested = o->first_level < 0 || o->first_level >= info->level_count ? o->first_level
                                                                              : o->last_level;
    if (blocks == 0)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "nothing to export; give a level or the mesh");
    if (o->first_level <= o->last_level && (requested < 0 || requested >= info->level_count))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "there is no level %d; this file has levels 0 to %d", requested,
                         info->level_count - 1);
    if (o->vertex_colours && (!o->mesh || !row || !row->takes_colours))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "colours of the caller are supported only for the mesh, and only in glTF, "
                         "GLB and OBJ");
    if (row && row->one_block && blocks > 1)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "an STL file contains one object; give one level, or the mesh");
    return EBPO_OK;
}

/* Checks an export of the simplified surface. */
static ebpo_status check_surface(const ebpo_info *info, const ebpo_export_row *row,
                                 ebpo_export_format format, const ebpo_export_options *o,
                                 ebpo_error *error)
{
    if (o->vertex_colours)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "colours are supported for the mesh in glTF, GLB and OBJ only");
    if (row->folder)
        return EBPO_OK;
    if (format != EBPO_EXPORT_GLB)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "the surface is exported as GLB or 3D Tiles only");
    if (o->mesh)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the surface and the mesh cannot be exported together");
    if (o->triangles == 0 && (o->first_level != o->last_level || o->last_level < 0 ||
                              o->last_level >= info->level_count))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "give one level of the surface, 0 to %d, or a number of triangles",
                         info->level_count - 1);
    return EBPO_OK;
}

static ebpo_status write_format(const ebpo_export_job *job, ebpo_error *error)
{
    if (!job->row)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "invalid export format %d", (int)job->format);
    if (!job->row->write)
        return ebpo_fail_file(error, EBPO_E_UNSUPPORTED, job->path,
                              "this build has no assimp, which writes %s; build with "
                              "libassimp-dev installed, or export XDMF or VTKHDF",
                              job->row->name);
    return job->options->surface && !job->row->folder ? ebpo_export_surface(job, error)
                                                      : job->row->write(job, error);
}

ebpo_status ebpo_export(const ebpo_file *file, const char *path, ebpo_export_format format,
                        const ebpo_export_options *options, ebpo_export_report *report,
                        ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_export_options wanted = EBPO_EXPORT_OPTIONS_INIT;
    ebpo_export_report own_report = EBPO_EXPORT_REPORT_INIT;
    const ebpo_export_row *row = format_row(format);
    char second[4096];
    ebpo_status status = EBPO_TAKE(ebpo_export_options, &wanted, options, error);
    if (status == EBPO_OK && report)
        status = EBPO_CHECK_SIZED(ebpo_export_report, report, error);
    if (status == EBPO_OK)
        status = row && (row->folder || wanted.surface)
                     ? check_surface(ebpo_file_info(file), row, format, &wanted, error)
                     : check_export(ebpo_file_info(file), row, &wanted, error);
    if (status != EBPO_OK)
        return status;
    if (!ebpo_export_second_file(format, path, second, sizeof second))
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, path,
                              "cannot be used with this format: the name is too long, contains a "
                              "':' or is that of the second file; choose another name");
    if (wanted.first_level <= wanted.last_level && !wanted.surface && !(row && row->folder))
        ebpo_file_prefetch_levels(file, 0, wanted.last_level);
    status =
        write_format(&(ebpo_export_job){ file, path, second, format, row, &wanted, &own_report },
                     error);
    if (report)
        EBPO_GIVE(ebpo_export_report, report, &own_report);
    return status;
}
