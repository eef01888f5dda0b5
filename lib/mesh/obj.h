/* Reading OBJ files: polygons, colours, normals, texture coordinates, names of materials and
 * groups.
 */
#ifndef EBPO_MESH_OBJ_H
#define EBPO_MESH_OBJ_H

#include "mesh/import_build.h"
#include "mesh/obj_names.h"

/* Makes the mesh, and its attributes if they are kept. `runs`: NULL, or gets the runs of groups.
 * Errors are those of ebpo_import_memory. */
EBPO_MUST_USE ebpo_status ebpo_obj_read(import_build *b, const uint8_t *data, uint64_t size,
                                        ebpo_obj_runs *runs);

#endif
