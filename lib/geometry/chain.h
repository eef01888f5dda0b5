/* Triangles over the vertices of a closed chain in space: closes a hole, or covers a polygon that
 * crosses itself. */
#ifndef EBPO_GEOMETRY_CHAIN_H
#define EBPO_GEOMETRY_CHAIN_H

#include <ebpo/workspace.h>

/* (b - a) x (c - a), rounded. */
static inline void ebpo_face_cross(const double a[3], const double b[3], const double c[3],
                                   double out[3])
{
    double p[3] = { b[0] - a[0], b[1] - a[1], b[2] - a[2] };
    double q[3] = { c[0] - a[0], c[1] - a[1], c[2] - a[2] };
    out[0] = p[1] * q[2] - p[2] * q[1];
    out[1] = p[2] * q[0] - p[0] * q[2];
    out[2] = p[0] * q[1] - p[1] * q[0];
}

/* Holes up to this length get the triangulation of least area. */
#define EBPO_OPTIMAL_CHAIN 256

/* A chain of n >= 3 points in order. */
typedef struct ebpo_chain {
    uint32_t n;
    /* up to this length the triangulation of least area is found, O(n^3); longer chains are cut ear
     * by ear, O(n log n) */
    uint32_t optimal;
    const double (*point)[3];
    /* NULL, or [n][n]: 1 where the mesh has an edge between two points already (a triangle there
     * would make it non-manifold); avoided where possible; only for n <= optimal */
    const uint8_t *taken;
    ebpo_workspace *workspace; /* for long ones, or NULL */
} ebpo_chain;

/* Writes n - 2 triangles, as numbers of points, that run along the chain (point i to i + 1). The
 * result depends on the points only. False when memory is short. Source for the chain of least
 * area: Barequet and Sharir, "Filling gaps in the boundary of a polyhedron", 1995. */
bool ebpo_triangulate_chain(const ebpo_chain *chain, uint32_t (*triangles)[3]);

#endif
