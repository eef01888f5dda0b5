/* Inside lib/export: the writers. Each fills the report; `path` and `second` are the names that the
 * files get. */
#ifndef EBPO_EXPORT_FORMATS_H
#define EBPO_EXPORT_FORMATS_H

#include <ebpo/export.h>

typedef struct ebpo_export_job {
    ebpo_file *file;
    const char *path, *second;
    ebpo_export_format format;
    const ebpo_export_options *options;
    ebpo_export_report *report;
} ebpo_export_job;

EBPO_MUST_USE ebpo_status ebpo_export_xdmf(const ebpo_export_job *job, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_export_vtkhdf(const ebpo_export_job *job, ebpo_error *error);
/* and GLB */
EBPO_MUST_USE ebpo_status ebpo_export_gltf(const ebpo_export_job *job, ebpo_error *error);
/* OBJ, STL */
EBPO_MUST_USE ebpo_status ebpo_export_scene(const ebpo_export_job *job, ebpo_error *error);

/* EBPO_E_LIMIT for what a format cannot count. A GLB of so many bytes of text and of numbers: its
 * sizes have 32 bits. OBJ and STL: assimp numbers corners in 32 bits. */
enum { EBPO_GLB_HEADS = 28 };
EBPO_MUST_USE ebpo_status ebpo_export_check_glb(const char *path, uint64_t text, uint64_t bin,
                                                ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_export_check_scene(const char *path, uint64_t vertices,
                                                  uint64_t faces, ebpo_error *error);

/* Reports block i of the job; false when the caller wants to stop. */
bool ebpo_export_goes_on(const ebpo_export_job *job, int i);
EBPO_MUST_USE ebpo_status ebpo_export_stopped(ebpo_error *error);

#endif
