/* Reading STL files, in text and binary. Source: "StereoLithography Interface Specification", 3D
 * Systems, 1989. */
#ifndef EBPO_IMPORT_STL_H
#define EBPO_IMPORT_STL_H

#include "import/import_build.h"

/* Whether the bytes are of an STL file: binary if the size is that of the faces it states, whatever
 * stands first. */
bool ebpo_stl_recognise(const uint8_t *data, uint64_t size);

/* Makes the mesh. A file that is called STL is text if it says so and has the word facet. Normals
 * are not read: they follow from corners. Errors are those of ebpo_import_memory. */
EBPO_MUST_USE ebpo_status ebpo_stl_read(import_build *b, const uint8_t *data, uint64_t size);

#endif
