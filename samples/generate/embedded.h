/* Proves for each generated surface that it does not intersect itself. */
#ifndef EBPO_SAMPLES_EMBEDDED_H
#define EBPO_SAMPLES_EMBEDDED_H

#include <ebpo/mesh.h>

/* Returns true for a closed mesh that certainly does not intersect itself. Returns false if it
 * does, or is too steep for this proof. Coordinates must be floats of at most 4.
 *
 * Proof: let a projection map all points of space except a few onto a smooth surface S, each along
 * its ray: onto the sphere from its centre, or onto the torus from the nearest point of its central
 * circle. Let every ray that intersects a face pass through it from below. Then the projection,
 * restricted to the mesh, is one to one on each face and continues without a fold across edges;
 * around a vertex the faces follow each other in one sense. So it covers S evenly: every ray
 * intersects the mesh equally often. One ray gives the number. If it is one, no two faces have a
 * common point except at shared edges and corners. */
bool ebpo_embedded_sphere(const ebpo_mesh *mesh); /* centre: the origin */
bool ebpo_embedded_torus(const ebpo_mesh *mesh);  /* circle of radius 1 around z */

#endif
