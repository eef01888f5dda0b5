/* Guaranteed bounds of distances from a point to cells, to envelopes and, for a far point, also to
 * boxes and faces. */
#ifndef EBPO_QUERY_POINT_BOUNDS_H
#define EBPO_QUERY_POINT_BOUNDS_H

#include "geometry/cells.h"
#include "query/accel.h"

/* Returns the length of the cell's diagonal, rounded up so that it bounds the distance of any point
 * of the cell to a face that the node lists. */
double ebpo_cell_diagonal(const ebpo_box *box, ebpo_cell cell);

/* Returns true when p is certainly outside one of the half-spaces of a cell's envelope. */
bool ebpo_outside_planes(const ebpo_box *box, ebpo_cell cell, const uint32_t *codes, uint32_t count,
                         const double p[3]);

/* Returns a guaranteed lower bound of the distance of p to the cell cut by the half-spaces; the
 * computation may stop at any bound beyond `enough`. The other function returns an upper bound of
 * the distance to the farthest point of the cell. */
double ebpo_envelope_distance(const ebpo_box *box, ebpo_cell cell, const uint32_t *codes,
                              uint32_t count, const double p[3], double enough);
double ebpo_cell_far(const ebpo_box *box, ebpo_cell cell, const double p[3]);

/* --- far points ---
 *
 * For a point very far from a model, doubles hardly separate the distances to the model's parts, or
 * not at all. Keys separate them instead. With c the middle of the model's box,
 *   key(x) = (|p - x|^2 - |p - c|^2) / (2 |p - c|)
 * grows with the distance, and is about as large as the model for every p. With y the position of x
 * relative to c, in a unit of about the model's size, u the direction of p, and h = 1 / (2 |p - c|)
 * in that unit,
 *   key(x) = h |y|^2 - u . y:
 * a small square plus the height over a plane. Bounds of keys are certain; their error is about
 * 2^-46 of the model's size: docs/develop/bounds.md, "Points far away". */

typedef struct ebpo_far {
    bool far; /* if false, the following fields are not valid */
    double centre[3];
    double unit[2];   /* powers of two: y = (x - centre) * unit[0] * unit[1] */
    double toward[3]; /* u */
    double half;      /* h, at most 1/32; 0 where it would be too small for a double */
    double reach;     /* |p - c| in that unit, 16 at least, or INFINITY */
    double distance;  /* |p - c| with a relative error of 2^-50, or INFINITY */
} ebpo_far;

/* Sets all members. A point is far from about 16 sizes of the model's box on. */
void ebpo_far_make(ebpo_far *far, const ebpo_box *box, const double p[3]);

/* Converts a limit of distances, 0 or more or INFINITY, to a limit of keys, rounded up. The other
 * functions return lower and upper bounds of the distance for a key. */
double ebpo_far_limit(const ebpo_far *far, double distance);
double ebpo_far_lower(const ebpo_far *far, double key);
double ebpo_far_upper(const ebpo_far *far, double key);

/* Return bounds of the keys of the nearest and of the farthest point of a cell. The first is for a
 * cell cut by the half-spaces of its envelope, as ebpo_envelope_distance. The second includes the
 * parts of its faces outside the cell, as ebpo_cell_far. */
double ebpo_far_envelope(const ebpo_far *far, const ebpo_box *box, ebpo_cell cell,
                         const uint32_t *codes, uint32_t count, double enough);
double ebpo_far_cell_end(const ebpo_far *far, const ebpo_box *box, ebpo_cell cell);

/* Transform from the coordinates of an accel (acceleration structure of a subtree) to those of
 * keys. */
typedef struct ebpo_far_frame {
    double offset[3], ratio, margin;
} ebpo_far_frame;
ebpo_far_frame ebpo_far_frame_of(const ebpo_far *far, const double centre[3], double scale,
                                 double reach);
/* Return lower bounds of the keys of a node's children: from boxes, and from a bounding cylinder.
 */
void ebpo_far_boxes(const ebpo_far *far, const ebpo_far_frame *frame, const ebpo_bound *b,
                    double lower[8]);
double ebpo_far_cylinder(const ebpo_far *far, const ebpo_far_frame *frame, const ebpo_bound *b,
                         const ebpo_bound_cylinder *cylinder, int lane);

/* Bounds of a face's key. */
typedef struct ebpo_far_keys {
    double lo, hi;
} ebpo_far_keys;
ebpo_far_keys ebpo_far_face(const ebpo_far *far, const double triangle[3][3]);

#endif
