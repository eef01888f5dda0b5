/* Do faces of a mesh meet? Shares no code with the library, whose predicates and readers are among
 * what the answers test. */
#ifndef EBPO_TESTS_CROSSING_FACES_H
#define EBPO_TESTS_CROSSING_FACES_H

#include <stdbool.h>
#include <stdint.h>

/* Lent. Coordinates are finite, corners below `vertices`. */
typedef struct face_model {
    const float (*xyz)[3];
    const uint32_t (*corners)[3];
    uint64_t vertices, faces;
} face_model;

/* Every edge is used once in each direction, and the faces around each vertex are one ring. */
bool crossing_closed_manifold(const face_model *m);
/* Faces whose corners are on one line, exactly. */
uint64_t crossing_flat_faces(const face_model *m);
/* Pairs of faces that have a point in common besides the corner or edge that they share, exactly;
 * one of them in `first`. Precondition: no face is flat. */
uint64_t crossing_faces(const face_model *m, uint64_t first[2]);

#endif
