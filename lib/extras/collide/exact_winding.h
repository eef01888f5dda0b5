/* The winding number of a posed model at a point whose coordinates are fractions. Proofs:
 * docs/develop/collision.md, "Relation of two models". One thread with its context. */
#ifndef EBPO_COLLIDE_EXACT_WINDING_H
#define EBPO_COLLIDE_EXACT_WINDING_H

#include <gmp.h>

#include "extras/collide/posed_sides.h"

/* At x shifted by (d0, d1, d2) as in ebpo_axis_crossing: never on a face. Coordinates are canonical
 * and no farther than doubles reach. */
EBPO_MUST_USE ebpo_status ebpo_exact_winding(const ebpo_posed_solid *s, ebpo_context *context,
                                             const mpq_t x[3], int32_t *winding, ebpo_error *error);

#endif
