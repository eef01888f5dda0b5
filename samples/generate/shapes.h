/* Makes base meshes and refines them. Functions return false if there is not enough memory, or if
 * there would be more than 2^32 - 2 faces. Coordinates are floats. */
#ifndef EBPO_SAMPLES_SHAPES_H
#define EBPO_SAMPLES_SHAPES_H

#include <ebpo/mesh.h>

/* Makes an icosahedron of radius 1. */
bool ebpo_make_icosahedron(ebpo_mesh *out);
/* Makes a torus of radius 1 and tube 0.4 around z, with n squares around the axis and m around the
 * tube, two faces each. */
bool ebpo_make_torus(ebpo_mesh *out, uint32_t n, uint32_t m);
/* Splits every face into four at the midpoints of its edges. The first vertices stay. Precondition:
 * the mesh is balanced and no face uses a vertex twice, so that there are at most 3/2 edges per
 * face. */
bool ebpo_subdivide(ebpo_mesh *mesh);
/* Moves every vertex to distance 1 from the origin. */
void ebpo_to_unit_sphere(ebpo_mesh *mesh);
/* Moves each vertex along the mean normal of its faces. `relief` is the height of broad hills in
 * the model's unit (0 for a shape without known space for them), `roughness` the height of fine
 * hills in mean lengths of the vertex's edges. */
bool ebpo_displace(ebpo_mesh *mesh, double relief, double roughness, uint64_t seed);

#endif
