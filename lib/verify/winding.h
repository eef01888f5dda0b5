/* Winding numbers by rays, made of orientation signs only.
 *
 * A point stands for itself shifted by (d0, d1, d2), infinitely small and positive, d0 >> d1 >> d2: what the format says about the corners of
 * cells. The ray runs in direction +axis; far out the winding number is 0, so a point's is the sum over the faces that its ray meets, each
 * +1 when the ray leaves through it (along its normal) and -1 when it enters. */
#ifndef EBPO_VERIFY_WINDING_H
#define EBPO_VERIFY_WINDING_H

#include <ebpo/mesh.h>

#include "verify/touch.h"

/* The face's share in the winding number of p: -1, 0 or 1. Exact. */
int ebpo_ray_hit(const double p[3], int axis, const ebpo_corners *face);

/* All faces sorted into columns along x, for rays in that direction: at most 40 bytes a face. */
typedef struct ebpo_columns {
    const ebpo_mesh *mesh; /* borrowed */
    double low[2], scale[2];
    uint64_t side;      /* columns on each of the axes y and z */
    uint64_t *first;    /* [side * side + 1] */
    uint32_t *faces;
} ebpo_columns;

/* The mesh is not empty, its coordinates finite and indices in range. Cleared on failure. */
EBPO_MUST_USE ebpo_status ebpo_columns_make(ebpo_columns *out, const ebpo_mesh *mesh, const ebpo_box *box, ebpo_error *error);
void ebpo_columns_free(ebpo_columns *columns);

/* Winding number of p, shifted, over the whole mesh. Exact. p lies in the box that the columns were made for. */
int64_t ebpo_columns_winding(const ebpo_columns *columns, const double p[3]);

/* Corners of a face of a mesh. */
void ebpo_face_corners(const ebpo_mesh *mesh, uint64_t face, ebpo_corners *out);

#endif
