/* The second pass over an OBJ file. */
#ifndef EBPO_MESH_OBJ_FACES_H
#define EBPO_MESH_OBJ_FACES_H

#include "mesh/obj_state.h"

/* The faces, with what is said on the way. Errors are those of ebpo_import_memory. */
EBPO_MUST_USE ebpo_status ebpo_obj_read_faces(obj_reading *r);

#endif
