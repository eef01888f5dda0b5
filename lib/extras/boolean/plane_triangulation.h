/* Triangulates points of a plane so that given segments are edges. The topology is exact. A
 * triangulation is for one thread. */
#ifndef EBPO_BOOLEAN_PLANE_TRIANGULATION_H
#define EBPO_BOOLEAN_PLANE_TRIANGULATION_H

#include <stdbool.h>
#include <stdint.h>

#include "extras/boolean/exact_point.h"

/* Edge i of a triangle runs from corner i to the next corner. */
typedef struct ebpo_plane_triangle {
    uint32_t corner[3]; /* counter-clockwise, seen against the axis */
    uint32_t across[3]; /* the triangle on the other side of edge i; EBPO_NO_TRIANGLE: none */
} ebpo_plane_triangle;

#define EBPO_NO_TRIANGLE UINT32_MAX

/* A triangulation and its scratch memory. A zero struct is empty. */
typedef struct ebpo_triangulation {
    const ebpo_exact_point *point;
    uint32_t points;
    int axis; /* the points are seen against this axis (exact_point.h) */
    ebpo_plane_triangle *triangle;
    uint64_t count, capacity;
    uint32_t *any; /* [points] a triangle that has the point as a corner */
    /* [points] for points on the convex hull, while the hull grows: the next and the previous point
     * on the hull, and the triangle at the edge to the next point */
    uint32_t *next, *last, *inside;
    uint32_t *order; /* [points] the points in the order of their coordinates */
    uint64_t any_capacity, next_capacity, last_capacity, inside_capacity, order_capacity;
    uint64_t *queue; /* edges to examine */
    uint64_t queue_begin, queue_end, queue_capacity;
    double origin[2], size; /* coordinates for approximate shapes: (x - origin) / size */
} ebpo_triangulation;

/* Triangulates the convex hull of the points, which are different and not all on a line. All points
 * become vertices, and all triangles have an area. The triangulation is nearly that of Delaunay,
 * which avoids thin triangles. Returns false without memory. */
bool ebpo_triangulate_points(ebpo_triangulation *t, int axis, const ebpo_exact_point *point,
                             uint32_t points);

/* Changes triangles so that a segment between two vertices becomes an edge. The segment must not
 * contain another vertex, nor cross a segment that was inserted before. Returns false without
 * memory. */
bool ebpo_triangulation_insert(ebpo_triangulation *t, uint32_t from, uint32_t to);

void ebpo_triangulation_free(ebpo_triangulation *t);

#endif
