/* Reading STL files, in text and binary. Source: "StereoLithography Interface Specification", 3D
 * Systems, 1989. */
#ifndef EBPO_MESH_STL_H
#define EBPO_MESH_STL_H

#include "mesh/import_build.h"

/* True for the bytes of an STL file: binary if all of them are those of the faces that it states,
 * whatever it begins with; else text that begins with the word solid. */
bool ebpo_stl_recognise(const uint8_t *data, uint64_t size);

/* Makes the mesh. A file that is called STL is text if it says so and has the word facet. Normals
 * are not read: they follow from corners. Errors are those of ebpo_import_memory. */
EBPO_MUST_USE ebpo_status ebpo_stl_read(import_build *b, const uint8_t *data, uint64_t size);

#endif
