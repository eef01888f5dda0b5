/* Winding numbers by rays, made of orientation signs only.
 *
 * A point stands for itself shifted by (d0, d1, d2), infinitely small and positive, d0 >> d1 >> d2:
 * what the format says about the corners of cells. The ray runs in direction +axis; far out the
 * winding number is 0, so a point's is the sum over the faces that its ray meets, each +1 when the
 * ray leaves through it (along its normal) and -1 when it enters. */
#ifndef EBPO_VERIFY_WINDING_H
#define EBPO_VERIFY_WINDING_H

#include <ebpo/mesh.h>

#include "verify/touch.h"

/* The face's share in the winding number of p: -1, 0 or 1. Exact. */
int ebpo_ray_hit(const double p[3], int axis, const ebpo_corners *face);

/* Corners of a face of a mesh. */
void ebpo_face_corners(const ebpo_mesh *mesh, uint64_t face, ebpo_corners *out);

#endif
