/* Computes normals for the lighting of a level. */
#ifndef EBPO_TOOLS_LEVEL_NORMALS_H
#define EBPO_TOOLS_LEVEL_NORMALS_H

#include <ebpo/ebpo.h>

/* Sets *out to the normals of ebpo_lod_normals for the triangles of polygons: [face_count][3], as
 * in raster_style. The caller frees them. After a failure *out is NULL. */
EBPO_MUST_USE ebpo_status level_normals(const ebpo_info *info, const ebpo_mesh *mesh,
                                        const ebpo_lod_nodes *nodes, float **out,
                                        ebpo_error *error);

#endif
