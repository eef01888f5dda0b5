/* Where two crossing faces meet: docs/develop/collision.md, "Contact of a crossing pair". Pure
 * functions, any thread. */
#ifndef EBPO_COLLIDE_CONTACT_H
#define EBPO_COLLIDE_CONTACT_H

#include "geometry/distance.h"

/* An end of the common segment. Each coordinate is within 0.51 units in its last place, and 2^-60
 * of the greatest |coordinate| on that axis of the edge that pierces the other face, of the exact
 * one; corners are exact. */
typedef struct ebpo_contact_end {
    double point[3];
    ebpo_feature on_a, on_b; /* the lowest of each face that it is on; one is no interior */
} ebpo_contact_end;

/* The ends, in the direction of A's normal x B's. The faces are EBPO_PAIR_CROSSING; coordinates are
 * finite. Bits of `point` do not depend on which face is A, or on numbers of corners. */
void ebpo_triangle_contact(const double a[3][3], const double b[3][3], ebpo_contact_end out[2]);

#endif
