/* Vertices of a PLY that cannot be used and are not. */
#ifndef EBPO_MESH_PLY_UNUSED_H
#define EBPO_MESH_PLY_UNUSED_H

#include "mesh/ply_state.h"

/* Leaves out the vertices that no face names and whose coordinates are not finite, and notes how
 * many. All rows have been read. EBPO_E_MEMORY, EBPO_E_IO. */
EBPO_MUST_USE ebpo_status ebpo_ply_leave_unused(ply_parser *p);

#endif
