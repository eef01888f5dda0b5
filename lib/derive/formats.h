/* Inside lib/derive: the writers. Each fills the report. */
#ifndef EBPO_DERIVE_FORMATS_H
#define EBPO_DERIVE_FORMATS_H

#include "derive/export_job.h"

EBPO_MUST_USE ebpo_status ebpo_export_xdmf(const ebpo_export_job *job, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_export_vtkhdf(const ebpo_export_job *job, ebpo_error *error);
/* and GLB */
EBPO_MUST_USE ebpo_status ebpo_export_gltf(const ebpo_export_job *job, ebpo_error *error);
/* OBJ, STL */
EBPO_MUST_USE ebpo_status ebpo_export_scene(const ebpo_export_job *job, ebpo_error *error);

#endif
