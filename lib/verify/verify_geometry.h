/* Tests faces exactly against cells and planes, and computes winding numbers by rays. Any thread
 * may call these functions. */
#ifndef EBPO_VERIFY_VERIFY_GEOMETRY_H
#define EBPO_VERIFY_VERIFY_GEOMETRY_H

#include <stdbool.h>
#include <stdint.h>

#include <ebpo/mesh.h>

#include "geometry/cells.h"
#include "verify/tally.h"
#include "verify/verify_tree.h"

/* --- tests in rational arithmetic: exact and slow --- */

/* A face, given by its corners in the model's coordinates, without rounding. */
typedef struct ebpo_corners {
    double at[3][3];
} ebpo_corners;

/* Returns true when the closed face intersects the closed box [low, high]. */
bool ebpo_exact_touches(const double low[3], const double high[3], const ebpo_corners *face);

/* Returns true when every point of the face in the closed box satisfies 4096 * (n . x) <= d, where
 * x = (point - low) / (high - low) for each coordinate. */
bool ebpo_exact_half_space(const double low[3], const double high[3], const ebpo_corners *face,
                           const int32_t n[3], int32_t d);

/* --- tests in floating point with error bounds; undecided cases use rational arithmetic --- */

/* A cell. `low`, `high`: the coordinates of its cell faces (exact). `inverse`: the reciprocals of
 * its sides (rounded). */
typedef struct ebpo_frame {
    double low[3], high[3], inverse[3];
} ebpo_frame;

ebpo_frame ebpo_frame_make(const ebpo_box *box, ebpo_cell cell);

/* Returns true if the point is in the closed cell. */
static inline bool ebpo_corner_in_cell(const ebpo_frame *frame, const double p[3])
{
    return p[0] >= frame->low[0] && p[0] <= frame->high[0] && p[1] >= frame->low[1] &&
           p[1] <= frame->high[1] && p[2] >= frame->low[2] && p[2] <= frame->high[2];
}

/* Returns true if the closed triangle and the closed cell have a common point. The result is exact.
 * Counts tests in rational arithmetic in the tally. */
bool ebpo_face_touches(const ebpo_frame *frame, const ebpo_corners *face, ebpo_tally *tally);

/* --- winding numbers by rays --- */

/* A point is shifted by (d0, d1, d2), infinitely small and positive, where d0 is much greater than
 * d1, and d1 is much greater than d2. The format defines this shift for the corners of cells. The
 * ray leads from the point in the positive direction of an axis. Its far end is outside the model,
 * where the winding number is 0. So the point's winding number is a sum over the faces that the ray
 * crosses: +1 if the ray crosses the face along its normal, -1 if it crosses against the normal.
 * The computation uses only signs of orientation predicates. */

/* Returns the face's exact contribution to the winding number of p: -1, 0 or 1. */
int ebpo_ray_hit(const double p[3], int axis, const ebpo_corners *face);

/* Returns the corners of a face of a mesh. */
void ebpo_face_corners(const ebpo_mesh *mesh, uint64_t face, ebpo_corners *out);

/* --- containment --- */

/* A node's planes must not cut off a point of a face in the cell, or a corner of the cell that is
 * in the solid. */

enum { EBPO_NODE_PLANES_MAX = 255 }; /* the file stores the number of planes in a byte */

/* The decoded planes that the file stores for a node. Invalid codes are omitted, because
 * ebpo_check_nesting reports them. */
typedef struct ebpo_node_planes {
    int count;
    /* half-space n . x <= bound in cell coordinates (exact) */
    double n[EBPO_NODE_PLANES_MAX][3], bound[EBPO_NODE_PLANES_MAX];
    /* the same half-space as 4096 (normal . x) <= d */
    int32_t normal[EBPO_NODE_PLANES_MAX][3], d[EBPO_NODE_PLANES_MAX];
    uint32_t number[EBPO_NODE_PLANES_MAX]; /* index among the node's codes */
} ebpo_node_planes;

void ebpo_node_planes_of(ebpo_node_planes *out, const ebpo_reference_tree *view,
                         const ebpo_reference_node *node);

/* Checks that no plane cuts off a part of the face in the cell. The face must touch the cell.
 * `number`: index of the face in the file. */
void ebpo_check_face_contained(ebpo_tally *tally, const ebpo_node_planes *planes,
                               const ebpo_reference_node *node, const ebpo_frame *frame,
                               const ebpo_corners *face, uint64_t number);

/* Checks that no plane cuts off a corner of the cell that is in the solid. `corners`: bit i is set
 * if corner i is in the solid; bits 0, 1 and 2 of i are set for the upper end in x, y and z. */
void ebpo_check_corners_contained(ebpo_tally *tally, const ebpo_node_planes *planes,
                                  const ebpo_reference_node *node, unsigned corners);

#endif
