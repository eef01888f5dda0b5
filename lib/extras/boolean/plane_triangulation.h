/* Triangulates points of a plane, so that given segments are edges. Exact; for one thread. */
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
    int axis; /* the points are seen against this axis */
    ebpo_plane_triangle *triangle;
    uint64_t count, capacity;
    /* indexed by points: a triangle of the point; while the hull grows: the neighbours on the hull,
     * and the triangle inside the edge to the next one */
    uint32_t *any, *next, *last, *inside;
    uint32_t *order;
    uint64_t any_capacity, next_capacity, last_capacity, inside_capacity, order_capacity;
    uint64_t *queue; /* edges to examine */
    uint64_t queue_begin, queue_end, queue_capacity;
    double origin[2], size; /* frame for the shape of triangles */
} ebpo_triangulation;

/* Triangulates the convex hull of different points, not all on a line: all points are vertices, and
 * no triangle is without area. Triangles are of nearly the best shape (Delaunay). Returns false
 * without memory. */
bool ebpo_triangulate_points(ebpo_triangulation *t, int axis, const ebpo_exact_point *point,
                             uint32_t points);

/* Makes a segment between two vertices an edge. The segment contains no other vertex, and crosses
 * no segment that was made an edge before. Returns false without memory. */
bool ebpo_triangulation_insert(ebpo_triangulation *t, uint32_t from, uint32_t to);

void ebpo_triangulation_free(ebpo_triangulation *t);

#endif
