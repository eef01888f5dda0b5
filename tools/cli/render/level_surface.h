/* Reads the simplified surface of a level as a mesh. */
#ifndef EBPO_TOOLS_LEVEL_SURFACE_H
#define EBPO_TOOLS_LEVEL_SURFACE_H

#include <ebpo/ebpo.h>

/* Sets *out to the simplified surface of a level, 0 or greater. Reads no other parts of the file.
 * The caller frees *out with ebpo_surface_mesh_free. */
EBPO_MUST_USE ebpo_status level_surface(const ebpo_file *file, int level, ebpo_surface_mesh *out,
                                        ebpo_error *error);

#endif
