/* Proof, for each surface that is made, that it does not meet itself. */
#ifndef EBPO_SAMPLES_EMBEDDED_H
#define EBPO_SAMPLES_EMBEDDED_H

#include <ebpo/mesh.h>

/* True: a closed mesh that certainly meets itself nowhere. False: it does, or is too steep for this
 * proof. Floats up to 4.
 *
 * Let a projection take all points of space but a few onto a smooth surface S, each along the ray
 * on which it lies: onto the sphere from its centre, or onto the torus from the nearest point of
 * the circle in its middle. If every ray that meets a face goes through it from below, the
 * projection, restricted to the mesh, is one to one on each face and goes on without a fold across
 * edges; round a vertex the faces follow each other in one sense. So it covers S evenly: every ray
 * meets the mesh equally often. Looking at one ray tells how often; if that is once, no two faces
 * have a point in common, but at their shared edges and corners. */
bool ebpo_embedded_sphere(const ebpo_mesh *mesh); /* centre: the origin */
bool ebpo_embedded_torus(const ebpo_mesh *mesh);  /* circle of radius 1 around z */

#endif
