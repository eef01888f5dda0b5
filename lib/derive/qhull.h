/* Volume of a convex hull, by qhull where the library has it. */
#ifndef EBPO_DERIVE_QHULL_H
#define EBPO_DERIVE_QHULL_H

#include <ebpo/base.h>

/* One for each thread. */
typedef struct ebpo_hull ebpo_hull;

/* EBPO_E_ABSENT when built without qhull. */
EBPO_MUST_USE ebpo_status ebpo_hull_new(ebpo_hull **out, ebpo_error *error);
void ebpo_hull_free(ebpo_hull *hull);

/* Volume of the hull of `count` points [count][3], of the order of 1; 0 when they lie in a plane,
 * or so nearly that rounding decides. */
double ebpo_hull_volume(ebpo_hull *hull, double *points, uint64_t count);

#endif
