/* Notes for each face of a result from which face of which operand it comes. */
#ifndef EBPO_BOOLEAN_BOOLEAN_ORIGINS_H
#define EBPO_BOOLEAN_BOOLEAN_ORIGINS_H

#include "extras/boolean/face_list.h"

/* Adds the attributes `operand` and `operand_face` to the faces of the mesh. origin[i] is the face
 * in the list from which face i of the mesh comes. */
EBPO_MUST_USE ebpo_status ebpo_boolean_origins(const ebpo_face_list *faces, const uint32_t *origin,
                                               ebpo_mesh *mesh, ebpo_error *error);

#endif
