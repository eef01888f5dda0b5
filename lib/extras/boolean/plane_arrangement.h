/* Divides segments in one plane at the points where they intersect. Exact; for one thread. */
#ifndef EBPO_BOOLEAN_PLANE_ARRANGEMENT_H
#define EBPO_BOOLEAN_PLANE_ARRANGEMENT_H

#include "extras/boolean/exact_point.h"

/* A segment between two points of the set; equal numbers: a single point. */
typedef struct ebpo_plane_segment {
    uint32_t from, to;
    double low[2], high[2]; /* box of the rounded coordinates */
} ebpo_plane_segment;

/* A point in the interior of a segment; and an undivided part of a segment. */
typedef struct ebpo_point_on_segment {
    uint32_t segment, point;
} ebpo_point_on_segment;

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
    ebpo_point_on_segment *on;
    uint64_t on_count, on_capacity;
    ebpo_plane_edge *edge; /* the result; parts that several segments share are listed repeatedly */
    uint64_t edges, edge_capacity;
    ebpo_exact_point meeting;
    ebpo_exact_plane line;
} ebpo_arrangement_2d;

void ebpo_arrangement_2d_init(ebpo_arrangement_2d *a);
void ebpo_arrangement_2d_free(ebpo_arrangement_2d *a);

/* Removes all points and segments; keeps the memory. */
void ebpo_arrangement_2d_begin(ebpo_arrangement_2d *a, int axis, int unit);

/* Adds a segment, or with equal ends a point. Returns false without memory. */
bool ebpo_arrangement_2d_add(ebpo_arrangement_2d *a, uint32_t from, uint32_t to);

/* Computes the edges: no point of the set is inside an edge, and different edges have at most ends
 * in common. Adds the points where segments cross to the set. Returns false without memory. */
bool ebpo_arrangement_2d_divide(ebpo_arrangement_2d *a);

#endif
