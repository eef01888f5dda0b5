/* Writes the triangles that bound the result into a mesh. */
#ifndef EBPO_BOOLEAN_RESULT_MESH_H
#define EBPO_BOOLEAN_RESULT_MESH_H

#include "extras/boolean/cut_mesh.h"

/* Makes the mesh of the result, and sets new_vertices, displacement, removed_faces and, if
 * requested, volume of the report. sign: result of ebpo_cut_mesh_classify. The caller frees the
 * mesh, also on failure. */
EBPO_MUST_USE ebpo_status ebpo_result_mesh_make(const ebpo_cut_mesh *cut, const int8_t *sign,
                                                const ebpo_boolean_mesh_options *options,
                                                ebpo_mesh *mesh, ebpo_boolean_mesh_report *report,
                                                ebpo_error *error);

#endif
