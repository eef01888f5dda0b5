#include "derive/export_job.h"

#include <inttypes.h>

#include "core/error.h"
#include "core/parallel.h"

static bool holds_colours(ebpo_export_format format, bool of_faces)
{
    return format == EBPO_EXPORT_XDMF || format == EBPO_EXPORT_VTKHDF ||
           (!of_faces && format != EBPO_EXPORT_STL);
}

static void report_colours(const ebpo_export_job *job, const ebpo_colours *colours)
{
    if (colours->vertex)
        job->report->vertex_colours =
            holds_colours(job->format, false) ? EBPO_EXPORT_WRITTEN : EBPO_EXPORT_LEFT_OUT;
    if (colours->face)
        job->report->face_colours =
            holds_colours(job->format, true) ? EBPO_EXPORT_WRITTEN : EBPO_EXPORT_LEFT_OUT;
}

ebpo_status ebpo_export_read_block(const ebpo_export_job *job, int i, ebpo_block_order order,
                                   ebpo_block *out, ebpo_error *error)
{
    *out = (ebpo_block){ 0 };
    if (!ebpo_progress_step(&job->options->progress, "exporting", (uint64_t)i,
                            (uint64_t)ebpo_block_count(job->options), error))
        return EBPO_E_CANCELLED;
    ebpo_status status = ebpo_block_read(out, job->file, ebpo_block_level(job->options, i), order,
                                         job->options, error);
    if (status == EBPO_OK)
        ebpo_block_report(out, job->report);
    if (status == EBPO_OK)
        report_colours(job, &out->colours);
    return status;
}

ebpo_status ebpo_export_check_glb(const char *path, uint64_t text, uint64_t bin, ebpo_error *error)
{
    uint64_t total = EBPO_GLB_HEADS + (text + 3) / 4 * 4 + bin;
    if (total <= UINT32_MAX)
        return EBPO_OK;
    return ebpo_fail_file(
        error, EBPO_E_LIMIT, path,
        "would have %" PRIu64
        " bytes or more, and a GLB file has less than 4 GiB; take gltf, or coarser levels",
        total);
}

ebpo_status ebpo_export_check_scene(const char *path, uint64_t vertices, uint64_t faces,
                                    ebpo_error *error)
{
    if (vertices <= UINT32_MAX && faces <= UINT32_MAX / 3)
        return EBPO_OK;
    return ebpo_fail_file(
        error, EBPO_E_LIMIT, path,
        "would have %" PRIu64 " vertices and %" PRIu64
        " triangles, more corners than assimp can number; take another format, or a coarser level",
        vertices, faces);
}
