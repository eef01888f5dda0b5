/* The faces at one edge: by their patches, or in their order around it. */
#ifndef EBPO_MESH_EDGE_FACES_H
#define EBPO_MESH_EDGE_FACES_H

#include "mesh/mesh_parts.h"

typedef struct ebpo_edge_face {
    uint64_t patch; /* shifted by 1; the lowest bit is the caller's */
    uint32_t face;
    uint8_t out; /* 1: the face runs from the edge's first vertex to the other one */

    /* set while faces are put in order: the third corner, and the quarter of the turn from the
     * first face: 0 beside it, 1 before the half, 2 at the half, 3 beyond */
    uint8_t quarter;
    bool layered;    /* it is in one plane with the face before it */
    bool reversed;   /* of faces in one plane, those of greater numbers come first */
    uint64_t source; /* its number in the source */
    double at[3];
} ebpo_edge_face;

/* Zero it to begin with; `face` is freed by free(). */
typedef struct ebpo_edge_faces {
    ebpo_edge_face *face;
    uint64_t count, capacity;
} ebpo_edge_faces;

/* False when memory is short. */
bool ebpo_edge_faces_add(ebpo_edge_faces *e, uint32_t face, uint8_t out, uint64_t patch);

/* Puts faces of one patch together. */
void ebpo_edge_faces_sort(ebpo_edge_faces *e);

/* Puts the faces in their order around the edge from vertex v to w, exactly, beginning anywhere.
 * Faces in one plane are taken for layers above each other, by their numbers in the source: in the
 * same order at every edge that they have in common. False where a face has no area. */
bool ebpo_edge_faces_turn(ebpo_edge_faces *e, const ebpo_mesh *mesh, uint32_t v, uint32_t w);

/* Returns whether the faces, put in that order, run along the edge and against it by turns, with
 * those in one plane in any order. */
bool ebpo_edge_faces_alternate(const ebpo_edge_faces *e);

#endif
