/* Polyhedra as triangles, collected piece by piece and joined in a fixed order. */
#ifndef EBPO_LEVELS_POLYHEDRA_H
#define EBPO_LEVELS_POLYHEDRA_H

#include <ebpo/lod.h>

#include "geometry/cell.h"
#include "geometry/polytope.h"

/* What one walk found at one level. */
typedef struct ebpo_polyhedra {
    double *xyz;     /* [vertex_count][3] */
    uint32_t *faces; /* [face_count][3], numbers within the piece */
    uint64_t vertex_count, vertex_capacity, face_count, face_capacity;
    bool wants_nodes; /* keep the two arrays below */
    ebpo_lod_node *nodes;
    uint8_t *corners;
    uint64_t node_count, node_capacity, polygon_count, polygon_capacity;
    double volume;
} ebpo_polyhedra;

void ebpo_polyhedra_free(ebpo_polyhedra *piece);

/* Appends the polytope (cell coordinates) of a cell's node as triangle fans; with `walls` false
 * without the polygons on the cell's walls. */
EBPO_MUST_USE ebpo_status ebpo_polyhedra_add(ebpo_polyhedra *piece, const ebpo_polytope *p,
                                             const ebpo_box *box, ebpo_cell cell,
                                             ebpo_node_type type, bool walls, ebpo_error *error);

/* Joins `count` pieces, in order, to a mesh of double vertices; pieces are freed on the way.
 * EBPO_E_LIMIT beyond 2^32 - 2 vertices or faces. `nodes` may be NULL, else all pieces have kept
 * theirs; windings are left 0. */
EBPO_MUST_USE ebpo_status ebpo_polyhedra_join(ebpo_mesh *out, ebpo_lod_nodes *nodes,
                                              ebpo_polyhedra *const *pieces, uint64_t count,
                                              ebpo_error *error);

#endif
