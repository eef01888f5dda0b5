/* Writes the cut of a view as a mesh. */
#ifndef EBPO_TOOLS_CUT_MESH_H
#define EBPO_TOOLS_CUT_MESH_H

#include <ebpo/ebpo.h>

/* Writes the envelopes of gray nodes and leaves, and black cells, each closed, as triangles. The
 * stream must be made with polygons. */
EBPO_MUST_USE ebpo_status cut_mesh_write(ebpo_view_stream *stream, const char *path,
                                         ebpo_error *error);

#endif
