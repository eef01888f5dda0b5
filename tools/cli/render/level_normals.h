/* Computes normals for the lighting of a level, and of the mesh beside it. */
#ifndef EBPO_TOOLS_LEVEL_NORMALS_H
#define EBPO_TOOLS_LEVEL_NORMALS_H

#include <ebpo/ebpo.h>

/* Sets *out to the normals of ebpo_lod_normals, one for each triangle of the mesh: [face_count][3],
 * as raster_style.normals. The caller frees *out. After a failure *out is NULL. */
EBPO_MUST_USE ebpo_status level_normals(const ebpo_info *info, const ebpo_mesh *mesh,
                                        const ebpo_lod_nodes *nodes, float **out,
                                        ebpo_error *error);

/* Sets *out to the mean normals of the faces around each vertex, weighted by area:
 * [vertex_count][3], as raster_style.vertex_normals. The normal of a vertex at an edge of more than
 * about 40 degrees is 0. The caller frees *out. After a failure *out is NULL. */
EBPO_MUST_USE ebpo_status mesh_normals(const ebpo_info *info, const ebpo_mesh *mesh, float **out,
                                       ebpo_error *error);

#endif
