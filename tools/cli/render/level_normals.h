/* Computes normals for the lighting of a level. */
#ifndef EBPO_TOOLS_LEVEL_NORMALS_H
#define EBPO_TOOLS_LEVEL_NORMALS_H

#include <ebpo/ebpo.h>

/* Sets *out to the normals of ebpo_lod_normals, one for each triangle of the mesh: [face_count][3],
 * as raster_style.normals. The caller frees *out. After a failure *out is NULL. */
EBPO_MUST_USE ebpo_status level_normals(const ebpo_info *info, const ebpo_mesh *mesh,
                                        const ebpo_lod_nodes *nodes, float **out,
                                        ebpo_error *error);

#endif
