/* Finds intersecting faces of a mesh. Shares no code with the library, as the results test the
 * library's predicates and readers. */
#ifndef EBPO_TESTS_CROSSING_FACES_H
#define EBPO_TESTS_CROSSING_FACES_H

#include <stdbool.h>
#include <stdint.h>

/* A mesh; its arrays belong to the caller. Coordinates are finite, corners below `vertices`. */
typedef struct face_model {
    const float (*xyz)[3];
    const uint32_t (*corners)[3];
    uint64_t vertices, faces;
} face_model;

/* Returns true if every edge is used once in each direction, and the faces around each vertex form
 * one ring. */
bool crossing_closed_manifold(const face_model *m);
/* Counts faces whose corners are exactly collinear. */
uint64_t crossing_flat_faces(const face_model *m);
/* Counts pairs of faces that have a common point besides the corner or edge that they share,
 * exactly; stores one pair in `first`. Precondition: no face is flat. */
uint64_t crossing_faces(const face_model *m, uint64_t first[2]);

#endif
