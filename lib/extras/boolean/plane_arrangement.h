/* Divides segments in one plane at the points where they intersect. Results are exact. An
 * arrangement is for one thread. */
#ifndef EBPO_BOOLEAN_PLANE_ARRANGEMENT_H
#define EBPO_BOOLEAN_PLANE_ARRANGEMENT_H

#include "extras/boolean/exact_point.h"

/* A segment between two points of the set, given by their indices. Equal indices: a single point.
 */
typedef struct ebpo_plane_segment {
    uint32_t from, to;
    double low[2], high[2]; /* box of the rounded coordinates on the two axes of the projection */
} ebpo_plane_segment;

/* A point of the set that is on a segment: an end, or a point in the interior. */
typedef struct ebpo_point_on_segment {
    uint32_t segment, point;
} ebpo_point_on_segment;

/* A part of a segment that no other segment divides, between two points of the set. */
typedef struct ebpo_plane_edge {
    uint32_t from, to;
} ebpo_plane_edge;

/* Points and segments of one plane, projected along an axis that is not parallel to the plane. A
 * zero struct is empty. */
typedef struct ebpo_arrangement_2d {
    int axis, unit; /* coordinates are multiples of 2^unit */
    ebpo_point_set set;
    ebpo_plane_segment *segment;
    uint64_t segments, segment_capacity;
    ebpo_point_on_segment *recorded; /* points on segments, found so far */
    uint64_t recorded_count, recorded_capacity;
    ebpo_plane_edge *edge; /* the result; an edge of several segments is listed several times */
    uint64_t edges, edge_capacity;
    ebpo_exact_point crossing; /* scratch memory */
    ebpo_exact_plane line;     /* scratch memory: a plane through a segment, along the axis */
} ebpo_arrangement_2d;

void ebpo_arrangement_2d_init(ebpo_arrangement_2d *a);
void ebpo_arrangement_2d_free(ebpo_arrangement_2d *a);

/* Removes all points and segments; keeps the memory. */
void ebpo_arrangement_2d_begin(ebpo_arrangement_2d *a, int axis, int unit);

/* Adds a segment, or a single point if `from` and `to` are equal. Returns false without memory. */
bool ebpo_arrangement_2d_add(ebpo_arrangement_2d *a, uint32_t from, uint32_t to);

/* Computes the edges. No point of the set is in the interior of an edge, and different edges have
 * at most ends in common. Adds the points where segments cross to the set. Returns false without
 * memory. */
bool ebpo_arrangement_2d_divide(ebpo_arrangement_2d *a);

#endif
