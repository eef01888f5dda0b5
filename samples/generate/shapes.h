/* Meshes to begin with, and their refinement. Functions return false when memory is short or 2^32 -
 * 2 faces are exceeded. Coordinates are floats. */
#ifndef EBPO_SAMPLES_SHAPES_H
#define EBPO_SAMPLES_SHAPES_H

#include <ebpo/mesh.h>

/* An icosahedron of radius 1. */
bool ebpo_make_icosahedron(ebpo_mesh *out);
/* Radius 1, tube 0.4, around z; n squares around the axis, m around the tube, two faces each. */
bool ebpo_make_torus(ebpo_mesh *out, uint32_t n, uint32_t m);
/* Cuts every face into four at the middles of its edges. The first vertices stay. Precondition: the
 * mesh balances and no face names a vertex twice, so that there are at most 3/2 edges a face. */
bool ebpo_subdivide(ebpo_mesh *mesh);
/* Moves every vertex to distance 1 from the origin. */
void ebpo_to_unit_sphere(ebpo_mesh *mesh);
/* Moves each vertex along the mean normal of its faces. Two parts: `relief` is the height of broad
 * hills in the model's unit (0 for a shape that is not known to have room for them), `roughness`
 * that of fine ones in mean lengths of the vertex' own edges. */
bool ebpo_displace(ebpo_mesh *mesh, double relief, double roughness, uint64_t seed);

#endif
