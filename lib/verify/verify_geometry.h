/* Exact tests of faces against cells and planes, and winding numbers by rays (verify_geometry.c).
 * Pure; any thread. */
#ifndef EBPO_VERIFY_VERIFY_GEOMETRY_H
#define EBPO_VERIFY_VERIFY_GEOMETRY_H

#include <stdbool.h>
#include <stdint.h>

#include <ebpo/mesh.h>

#include "geometry/cells.h"
#include "verify/tally.h"
#include "verify/verify_tree.h"

/* --- rationals: slow, exact --- */

/* A face: corners in the model's coordinates, exact. */
typedef struct ebpo_corners {
    double at[3][3];
} ebpo_corners;

/* True when the closed face meets the closed box [low, high]. */
bool ebpo_exact_touches(const double low[3], const double high[3], const ebpo_corners *face);

/* True when every point of the face in the closed box satisfies 4096 * (n . xi) <= d, xi = (point -
 * low) / (high - low). */
bool ebpo_exact_half_space(const double low[3], const double high[3], const ebpo_corners *face,
                           const int32_t n[3], int32_t d);

/* --- floating point with error bounds, rationals when in doubt --- */

/* A cell: its walls (exact) and the reciprocals of its sizes (rounded). */
typedef struct ebpo_frame {
    double low[3], high[3], inverse[3];
} ebpo_frame;

ebpo_frame ebpo_frame_make(const ebpo_box *box, ebpo_cell cell);

static inline bool ebpo_corner_in_cell(const ebpo_frame *frame, const double p[3])
{
    return p[0] >= frame->low[0] && p[0] <= frame->high[0] && p[1] >= frame->low[1] &&
           p[1] <= frame->high[1] && p[2] >= frame->low[2] && p[2] <= frame->high[2];
}

/* Exact: the closed triangle and the closed cell have a point in common. Counts questions that went
 * to rationals. */
bool ebpo_face_touches(const ebpo_frame *frame, const ebpo_corners *face, ebpo_tally *tally);

/* Winding numbers by rays, made of orientation signs only.
 *
 * A point stands for itself shifted by (d0, d1, d2), infinitely small and positive, d0 >> d1 >> d2:
 * what the format says about the corners of cells. The ray runs in direction +axis; far out the
 * winding number is 0, so a point's is the sum over the faces that its ray meets, each +1 when the
 * ray leaves through it (along its normal) and -1 when it enters. */

/* The face's share in the winding number of p: -1, 0 or 1. Exact. */
int ebpo_ray_hit(const double p[3], int axis, const ebpo_corners *face);

/* Corners of a face of a mesh. */
void ebpo_face_corners(const ebpo_mesh *mesh, uint64_t face, ebpo_corners *out);

/* --- containment: no point of a face in the cell, and no inside corner, is cut off by the node's
 * planes --- */

enum { EBPO_NODE_PLANES_MAX = 255 }; /* counts are bytes */

/* A node's own planes, decoded. Codes that stand for no plane are left out (they are violations
 * elsewhere). */
typedef struct ebpo_node_planes {
    int count;
    double n[EBPO_NODE_PLANES_MAX][3], bound[EBPO_NODE_PLANES_MAX]; /* n . xi <= bound; exact */
    int32_t normal[EBPO_NODE_PLANES_MAX][3], d[EBPO_NODE_PLANES_MAX];
    uint32_t number[EBPO_NODE_PLANES_MAX]; /* place among the node's codes */
} ebpo_node_planes;

void ebpo_node_planes_of(ebpo_node_planes *out, const ebpo_twin_tree *view,
                         const ebpo_twin_node *node);

/* A face that touches the cell. */
void ebpo_check_face_contained(ebpo_tally *tally, const ebpo_node_planes *planes,
                               const ebpo_twin_node *node, const ebpo_frame *frame,
                               const ebpo_corners *face, uint64_t number);

/* Cell corners, bit i for corner i (bit 0 x, bit 1 y, bit 2 z). */
void ebpo_check_corners_contained(ebpo_tally *tally, const ebpo_node_planes *planes,
                                  const ebpo_twin_node *node, unsigned corners);

#endif
