/* Which side of a solid at a pose a point of the world is on: exact on posed coordinates. Proofs:
 * docs/develop/booleans.md. Any thread, each with a context of its own. */
#ifndef EBPO_COLLIDE_POSED_SIDES_H
#define EBPO_COLLIDE_POSED_SIDES_H

#include "extras/collide/posed_solid.h"

/* Around a point of the world. */
typedef struct ebpo_posed_sides {
    bool on;            /* a posed face with an area goes through it */
    bool flat;          /* and all such faces have one plane */
    double plane[3][3]; /* on: corners of one of them */
    /* Winding numbers close to the point: on the side that is greater in x, or if the plane is
     * parallel to the x axis in y, or else in z, and on the other one. Equal unless `on`. If on and
     * not flat, `above` alone is right, somewhere near the point. */
    int32_t above, below;
} ebpo_posed_sides;

EBPO_MUST_USE ebpo_status ebpo_posed_solid_sides(const ebpo_posed_solid *s, ebpo_context *context,
                                                 const double w[3], ebpo_posed_sides *out,
                                                 ebpo_error *error);

#endif
