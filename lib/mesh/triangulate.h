/* Triangles over the vertices of a closed chain in space: what closes a hole. */
#ifndef EBPO_MESH_TRIANGULATE_H
#define EBPO_MESH_TRIANGULATE_H

#include <ebpo/workspace.h>

/* Chains up to this length get the triangulation of least area, O(n^3); longer ones are cut ear by
 * ear, O(n log n). */
#define EBPO_OPTIMAL_CHAIN 256

/* A chain of n >= 3 points in order. */
typedef struct ebpo_chain {
    uint32_t n;
    const double (*point)[3];
    /* NULL, or [n][n]: 1 where the mesh has an edge between two points already (a triangle there
     * would make it non-manifold); avoided where possible; only for n <= EBPO_OPTIMAL_CHAIN */
    const uint8_t *taken;
    ebpo_workspace *workspace; /* for long ones, or NULL */
} ebpo_chain;

/* Writes n - 2 triangles, as numbers of points, that run along the chain (point i to i + 1). The
 * result depends on the points only. False when memory is short. Source for the chain of least
 * area: Barequet and Sharir, "Filling gaps in the boundary of a polyhedron", 1995. */
bool ebpo_triangulate_chain(const ebpo_chain *chain, uint32_t (*triangles)[3]);

#endif
