/* Computes guaranteed bounds of the distances from a point to cells and envelopes. For a far point
 * (see below), also computes bounds for the boxes, bounding cylinders and faces of subtrees. */
#ifndef EBPO_QUERY_POINT_BOUNDS_H
#define EBPO_QUERY_POINT_BOUNDS_H

#include "geometry/cells.h"
#include "query/accel.h"

/* Returns the length of the cell's diagonal, enlarged so that no point of the cell is farther away
 * from a face that the cell's node lists. */
double ebpo_cell_diagonal(const ebpo_box *box, ebpo_cell cell);

/* Returns true if p is certainly outside one of the half-spaces (`count` plane codes) of a cell's
 * envelope. */
bool ebpo_outside_planes(const ebpo_box *box, ebpo_cell cell, const uint32_t *codes, uint32_t count,
                         const double p[3]);

/* Returns a guaranteed lower bound of the distance of p to the part of the cell in all half-spaces
 * (`count` plane codes). Once a bound is beyond `enough`, no better bound is searched for. */
double ebpo_envelope_distance(const ebpo_box *box, ebpo_cell cell, const uint32_t *codes,
                              uint32_t count, const double p[3], double enough);

/* A half-space, seen from a point p. normal: unit vector, out of the half-space. beyond: distance
 * of p from the half-space's plane, rounded down; negative if p is inside. */
typedef struct ebpo_facing_plane {
    double normal[3], beyond;
} ebpo_facing_plane;
/* The half-spaces of an envelope that decide its distance from p: the nearest point of the envelope
 * is on their planes. */
typedef struct ebpo_facing {
    int count;
    ebpo_facing_plane at[3];
} ebpo_facing;
/* Returns a lower bound of the same distance as ebpo_envelope_distance, but from all half-spaces
 * together, so the bound is nearly the distance. Also uses *facing, half-spaces that contain the
 * envelope of the parent (count 0: none are known). Replaces *facing by the half-spaces that decide
 * the bound, which contain the envelopes of all children. */
double ebpo_facing_distance(const ebpo_box *box, ebpo_cell cell, const uint32_t *codes,
                            uint32_t count, const double p[3], double enough, ebpo_facing *facing);

/* Returns false if the points origin + t direction with `begin` <= t <= `end` are certainly not in
 * the part of the cell in all half-spaces (`count` plane codes). 0 <= `begin`. The points must be
 * in the cell, except for rounding. */
bool ebpo_ray_may_enter(const ebpo_box *box, ebpo_cell cell, const uint32_t *codes, uint32_t count,
                        const double origin[3], const double direction[3], double begin,
                        double end);
/* Returns an upper bound of the distance of p to the farthest point of the cell, and to any face
 * that the cell's node lists. (Such a face has a point that is at most 1/256 of the cell's size
 * outside the cell: format-spec, section 7.) */
double ebpo_cell_far(const ebpo_box *box, ebpo_cell cell, const double p[3]);

/* --- far points ---
 *
 * If a point p is very far from a model, its distances to different parts of the model are nearly
 * or exactly equal as doubles. Keys replace these distances. Keys are numbers that have the same
 * order as the distances. Let c be the middle of the model's box. The key of a point x is
 *     key(x) = (|p - x|^2 - |p - c|^2) / (2 |p - c|).
 * Its absolute value is at most about the model's size. Let y be the position of x relative to c,
 * in a unit of about the model's size. Let u be the direction from c to p, and h = 1 / (2 |p - c|)
 * in that unit. Then key(x) = h |y|^2 - u . y. Bounds of keys are guaranteed; their error is about
 * 2^-46 of the model's size (docs/develop/bounds.md, "Points far away"). */

typedef struct ebpo_far {
    bool far;                 /* p is far; if false, the following fields are not valid */
    double centre[3];         /* c */
    double unit[2];           /* powers of two: y = (x - centre) * unit[0] * unit[1] */
    double toward[3];         /* u */
    double half;              /* h, at most 1/32; 0 if h is too small for a double */
    double distance_in_units; /* |p - c| in the unit of y, at least 16, or INFINITY */
    double distance;          /* |p - c| with a relative error of 2^-50, or INFINITY */
} ebpo_far;

/* Sets all members. A point is far if its distance from c is at least about 16 times the longest
 * side of the model's box. */
void ebpo_far_make(ebpo_far *far, const ebpo_box *box, const double p[3]);

/* Converts a limit of distances, 0 or more or INFINITY, to a limit of keys, rounded up. */
double ebpo_far_limit(const ebpo_far *far, double distance);
/* ebpo_far_lower and ebpo_far_upper return a lower and an upper bound of the distance for a key. */
double ebpo_far_lower(const ebpo_far *far, double key);
double ebpo_far_upper(const ebpo_far *far, double key);

/* ebpo_far_envelope and ebpo_far_cell_end return the same bounds as ebpo_envelope_distance and
 * ebpo_cell_far, but as keys. */
double ebpo_far_envelope(const ebpo_far *far, const ebpo_box *box, ebpo_cell cell,
                         const uint32_t *codes, uint32_t count, double enough);
double ebpo_far_cell_end(const ebpo_far *far, const ebpo_box *box, ebpo_cell cell);

/* Converts coordinates in the frame of an accel (acceleration structure of a subtree) to y:
 * y = offset + ratio * (coordinate in the frame). */
typedef struct ebpo_far_frame {
    double offset[3], ratio;
    double margin; /* bound of the error of keys in this accel */
} ebpo_far_frame;
/* Makes an ebpo_far_frame. `centre`, `scale`: centre and scale of the accel's frame. `largest`:
 * bound of the absolute coordinates in the frame. */
ebpo_far_frame ebpo_far_frame_of(const ebpo_far *far, const double centre[3], double scale,
                                 double largest);
/* ebpo_far_boxes and ebpo_far_cylinder compute lower bounds of the keys of a node's children: of
 * all children from their boxes, and of one child (`lane`) from its bounding cylinder. */
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
