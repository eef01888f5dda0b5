/* Levels and the mesh in other programs' formats: what is the same for all. */
#include <ebpo/export.h>

#include <stdio.h>
#include <string.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "core/sized.h"
#include "derive/formats.h"
#include "io/file_source.h"

const char *ebpo_export_format_name(ebpo_export_format format)
{
    static const char *const names[] = { "xdmf", "vtkhdf", "gltf", "glb", "obj", "stl" };
    return (unsigned)format < sizeof names / sizeof *names ? names[format] : NULL;
}

bool ebpo_export_second_file(ebpo_export_format format, const char *path, char *out,
                             size_t capacity)
{
    const char *name = ebpo_path_name(path), *dot = strrchr(name, '.');
    int length = -1;
    if (capacity)
        *out = 0;
    if (format == EBPO_EXPORT_XDMF) /* readers take what follows the first ":" as the path within
                                       the HDF5 file */
        length = strchr(name, ':') ? -1 : snprintf(out, capacity, "%s.h5", path);
    else if (format == EBPO_EXPORT_GLTF)
        length = snprintf(out, capacity, "%.*s.bin",
                          (int)(dot && dot != name ? dot - path : (int)strlen(path)), path);
    else
        return true;
    return length >= 0 && (size_t)length < capacity;
}

static ebpo_status check_export(const ebpo_info *info, ebpo_export_format format,
                         const ebpo_export_options *o, ebpo_error *error)
{
    int blocks = ebpo_block_count(o),
        asked = o->first_level < 0 || o->first_level >= info->level_count ? o->first_level
                                                                          : o->last_level;
    if (blocks == 0)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "there is nothing to export: ask for a level or for the mesh");
    if (o->first_level <= o->last_level && (asked < 0 || asked >= info->level_count))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "there is no level %d; this file has levels 0 to %d", asked,
                         info->level_count - 1);
    if (o->vertex_colours && (!o->mesh || (format != EBPO_EXPORT_GLTF &&
                                           format != EBPO_EXPORT_GLB && format != EBPO_EXPORT_OBJ)))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "colours can be given to the mesh in glTF, GLB and OBJ only");
    if (format == EBPO_EXPORT_STL && blocks > 1)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "an STL file holds one thing: one level, or the mesh");
    return EBPO_OK;
}

static ebpo_status write_format(ebpo_export_job *job, ebpo_error *error)
{
    switch (job->format) {
    case EBPO_EXPORT_XDMF: return ebpo_export_xdmf(job, error);
    case EBPO_EXPORT_VTKHDF: return ebpo_export_vtkhdf(job, error);
    case EBPO_EXPORT_GLTF:
    case EBPO_EXPORT_GLB: return ebpo_export_gltf(job, error);
    case EBPO_EXPORT_OBJ:
    case EBPO_EXPORT_STL: return ebpo_export_scene(job, error);
    }
    return ebpo_fail(error, EBPO_E_ARGUMENT, "%d is not an export format", (int)job->format);
}

ebpo_status ebpo_export(const ebpo_file *file, const char *path, ebpo_export_format format,
                        const ebpo_export_options *options, ebpo_export_report *report,
                        ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_export_options wanted = EBPO_EXPORT_OPTIONS_INIT;
    ebpo_export_report own = EBPO_EXPORT_REPORT_INIT;
    char second[4096];
    ebpo_status status = EBPO_TAKE(ebpo_export_options, &wanted, options, error);
    if (status == EBPO_OK && report)
        status = EBPO_CHECK_SIZED(ebpo_export_report, report, error);
    if (status == EBPO_OK)
        status = check_export(ebpo_file_info(file), format, &wanted, error);
    if (status != EBPO_OK)
        return status;
    if (!ebpo_export_second_file(format, path, second, sizeof second))
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, path,
                              "cannot be used with this format: it is too long or contains a ':'; "
                              "choose another name");
    if (wanted.first_level <= wanted.last_level)
        ebpo_file_prefetch_levels(file, 0, wanted.last_level);
    status = write_format(&(ebpo_export_job){ file, path, second, format, &wanted, &own }, error);
    if (report)
        EBPO_GIVE(ebpo_export_report, report, &own);
    return status;
}
