/* Writes the cut of a view as a mesh. The cut is the set of nodes that a view-dependent stream has
 * delivered and not refined (ebpo/view.h). */
#ifndef EBPO_TOOLS_CUT_MESH_H
#define EBPO_TOOLS_CUT_MESH_H

#include <ebpo/ebpo.h>

/* Writes the envelopes of gray nodes and leaves, and the cells of black nodes, as triangles. Each
 * envelope or cell is closed. The stream must have been made with polygons. */
EBPO_MUST_USE ebpo_status cut_mesh_write(ebpo_view_stream *stream, const char *path,
                                         ebpo_error *error);

#endif
