/* Triangulates closed chains in space, which closes holes, and polygons in space. No vertices are
 * added. */
#ifndef EBPO_GEOMETRY_POLYGON_H
#define EBPO_GEOMETRY_POLYGON_H

#include <ebpo/base.h>
#include <ebpo/workspace.h>

/* Computes (b - a) x (c - a), rounded. */
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
    /* up to this length, the triangulation of least area is found in O(n^3); longer chains are cut
     * ear by ear in O(n log n) */
    uint32_t optimal;
    const double (*point)[3];
    /* NULL, or [n][n]: 1 where the mesh has an edge between two points already (a triangle there
     * would make the edge non-manifold). Such edges are avoided where possible. Used only for n <=
     * optimal */
    const uint8_t *taken;
    ebpo_workspace *workspace; /* for long chains, or NULL */
} ebpo_chain;

/* Writes n - 2 triangles, as indices of points, that run along the chain (point i to i + 1). The
 * result depends only on the points. Returns false when memory is short. Source for the chain of
 * least area: Barequet and Sharir, "Filling gaps in the boundary of a polyhedron", 1995. */
bool ebpo_triangulate_chain(const ebpo_chain *chain, uint32_t (*triangles)[3]);

/* Cuts polygons in space into triangles over their own corners.
 *
 * The polygon is projected along the axis on which its normal (Newell's sum) is largest. There a
 * convex polygon becomes a fan from its first corner; any other is cut ear by ear, every turn and
 * every point-in-ear test by the exact ebpo_orient2d: first as if the outline did not touch itself,
 * then, where that fails, with the rule for outlines that do. All triangles then turn the polygon's
 * way or have no area, so each point is covered as often as the outline winds around it: once in a
 * polygon with slits, with bridges to holes, or pinched at corners.
 *
 * Outlines whose projection crosses itself (including folded quads) have no such triangles. They
 * get triangles that are a guess, which callers count: up to EBPO_POLYGON_OPTIMAL corners the
 * triangles of least area in space, with more corners the triangles that result from cutting the
 * smallest ears first. The result depends only on the corners. Sources: Meisters, "Polygons have
 * ears", 1975; Barequet and Sharir, "Filling gaps in the boundary of a polyhedron", 1995, for the
 * least area. */

typedef enum ebpo_polygon_kind {
    EBPO_POLYGON_CONVEX, /* a fan; also every triangle */
    /* no reflex corner, but straight ones: cut by ears, so that no triangle is on a straight side
     */
    EBPO_POLYGON_FLAT,
    EBPO_POLYGON_CONCAVE, /* cut by ears; also where the outline touches itself */
    EBPO_POLYGON_GUESSED, /* it crosses itself: triangles of least area */
    /* a fan, because all corners are on a line or a coordinate is not finite */
    EBPO_POLYGON_DEGENERATE,
    /* more than EBPO_POLYGON_WORK steps were not enough; `triangle` is not usable */
    EBPO_POLYGON_TOO_LARGE,
    EBPO_POLYGON_NO_MEMORY
} ebpo_polygon_kind;

/* Limit of steps for one polygon, each a few tests of coordinates. Outlines of 100,000 corners stay
 * well below it, unless tens of thousands of them are on one line or at one position. */
#define EBPO_POLYGON_WORK (UINT64_C(1) << 31)

enum { EBPO_POLYGON_OPTIMAL = 64 };

/* Returns the bytes of scratch for n corners, at any alignment that malloc gives; 0 when that does
 * not fit 64 bits. */
uint64_t ebpo_polygon_scratch_bytes(uint64_t n);

/* Writes n - 2 triangles of corner indices (0 .. n - 1) with the polygon's orientation. n >= 3.
 * Pure, any thread. */
ebpo_polygon_kind ebpo_polygon_triangulate(uint32_t (*triangle)[3], const double (*corner)[3],
                                           uint32_t n, void *scratch);

#endif
