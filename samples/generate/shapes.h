/* Makes base meshes and refines them. Functions return false if there is not enough memory, or if
 * there would be more than 2^32 - 2 faces. Coordinates are floats. */
#ifndef EBPO_SAMPLES_SHAPES_H
#define EBPO_SAMPLES_SHAPES_H

#include <ebpo/mesh.h>

/* Makes an icosahedron of radius 1. */
bool ebpo_make_icosahedron(ebpo_mesh *out);
/* Makes a torus around the z axis. Its central circle has the radius 1, and its tube has the radius
 * 0.4. It has n squares around the axis and m squares around the tube; each square is two faces. */
bool ebpo_make_torus(ebpo_mesh *out, uint32_t n, uint32_t m);
/* Splits every face into four at the midpoints of its edges. New vertices are appended after the
 * old ones. Precondition: the mesh is closed and no face uses a vertex twice, so that there are at
 * most 3/2 edges for each face. */
bool ebpo_subdivide(ebpo_mesh *mesh);
/* Moves every vertex to distance 1 from the origin. */
void ebpo_to_unit_sphere(ebpo_mesh *mesh);
/* Moves each vertex along the mean normal of its faces. `relief`: height of broad hills in the
 * model's unit; 0 if the shape may be too thin for them. `roughness`: height of fine hills, divided
 * by the mean length of the vertex's edges. */
bool ebpo_displace(ebpo_mesh *mesh, double relief, double roughness, uint64_t seed);

#endif
