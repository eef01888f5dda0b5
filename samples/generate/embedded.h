/* Proves for each generated surface that it does not intersect itself. */
#ifndef EBPO_SAMPLES_EMBEDDED_H
#define EBPO_SAMPLES_EMBEDDED_H

#include <ebpo/mesh.h>

/* Returns true if a closed mesh certainly does not intersect itself. Returns false if the mesh
 * intersects itself, or is too steep for this proof. Coordinates must be floats, at most 4.
 *
 * Proof: let S be a sphere or a torus. A projection maps almost every point of space onto S along a
 * ray: from the centre of the sphere, or from the nearest point of the torus's central circle.
 * Assume that every ray that intersects a face crosses the face from inside to outside. Then the
 * projection is one to one on each face, and does not fold at edges; around a vertex, the faces
 * follow each other in one direction. So the projected mesh covers S evenly: every ray intersects
 * the mesh equally often. It is sufficient to count the intersections of one ray. If this number is
 * one, two faces have no common point except at shared edges and corners. */
bool ebpo_embedded_sphere(const ebpo_mesh *mesh); /* centre: the origin */
bool ebpo_embedded_torus(const ebpo_mesh *mesh);  /* circle of radius 1 around z */

#endif
