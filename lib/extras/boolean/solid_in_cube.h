/* Whether a cube of the world is inside a solid at a pose, outside, or neither for certain. */
#ifndef EBPO_BOOLEAN_SOLID_IN_CUBE_H
#define EBPO_BOOLEAN_SOLID_IN_CUBE_H

#include "extras/boolean/expression.h"
#include "extras/collide/posed_solid.h"

/* What has decided. */
enum { EBPO_CUBE_BY_BOX, EBPO_CUBE_BY_NODES, EBPO_CUBE_BY_FACES, EBPO_CUBE_WAYS };

/* An axis-parallel cube by its centre and half its edge. *may: EBPO_MAY_IN when all of the closed
 * cube is inner to the solid, EBPO_MAY_OUT when none of it belongs to it, on posed coordinates;
 * EBPO_MAY_BOTH when a face may be within half the cube's diagonal of its centre. */
EBPO_MUST_USE ebpo_status ebpo_solid_in_cube(const ebpo_posed_solid *s, ebpo_context *context,
                                             const double centre[3], double half, unsigned *may,
                                             unsigned *way, ebpo_error *error);

#endif
