/* Pieces of an envelope: convex polytopes in the cell coordinates of the node, which together cover
 * it. Every cut leaves a little too much on both sides, so that nothing is lost between them to the
 * tolerances of ebpo_polytope_clip. */
#ifndef EBPO_DERIVE_CUT_H
#define EBPO_DERIVE_CUT_H

#include "geometry/polytope.h"

/* How much: more than the clipping's tolerance, for normals of Euclidean length 1/sqrt(3) and up.
 */
#define EBPO_CUT_SLACK 4e-10

typedef struct ebpo_extent {
    double min[3], max[3];
} ebpo_extent;

void ebpo_extent_of(const ebpo_polytope *p, ebpo_extent *out);

/* A part of so little width goes with the other side; less than a quarter of the smallest piece
 * that is cut. */
#define EBPO_CUT_THIN 1.2e-7 /* ebpo_polytope_clip refuses 1e-7 */

/* The part with x[axis] <= at (side 0) or >= at (side 1), and what of the other side is thin.
 * False: there is none, or it is thin. */
bool ebpo_cut_axis(const ebpo_polytope *p, int axis, int side, double at, ebpo_polytope *out);

/* The part with n . x <= d, |n| = 1; false when clipping gives up. */
bool ebpo_cut_plane(const ebpo_polytope *p, const double n[3], double d, ebpo_polytope *out);

#endif
