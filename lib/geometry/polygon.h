/* Triangulates polygons and closed chains in space. Chains are the boundaries of holes. No vertices
 * are added. */
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
    /* greatest n for the triangulation of least area, which takes O(n^3) steps; longer chains are
     * cut ear by ear in O(n log n) steps */
    uint32_t optimal;
    const double (*point)[3];
    /* NULL, or [n][n]: 1 if the mesh already has an edge between the two points. A new triangle
     * could make this edge non-manifold, so the triangulation avoids such edges where possible.
     * Used only if n <= optimal */
    const uint8_t *taken;
    ebpo_workspace *workspace; /* for long chains, or NULL */
} ebpo_chain;

/* Writes n - 2 triangles, as indices of points. The triangles have the direction of the chain (from
 * point i to i + 1). The result depends only on the points. Returns false when memory is short.
 * Source for the chain of least area: Barequet and Sharir, "Filling gaps in the boundary of a
 * polyhedron", 1995. */
bool ebpo_triangulate_chain(const ebpo_chain *chain, uint32_t (*triangles)[3]);

/* Cuts polygons in space into triangles between their own corners.
 *
 * The polygon is projected along the axis on which its normal (Newell's sum) is largest. A convex
 * polygon becomes a fan from its first corner. Every other polygon is cut ear by ear. Turns and
 * point-in-ear tests use the exact ebpo_orient2d. Ears are first cut by the rule for outlines that
 * do not touch themselves. If this fails, ears are cut by the rule for outlines that touch
 * themselves. Then all triangles turn as the polygon does or have no area. So each point is covered
 * as often as the outline winds around it: once in a polygon with slits, with bridges to holes, or
 * pinched at corners.
 *
 * Outlines whose projection crosses itself (including folded quads) have no such triangles. Their
 * triangles are a guess, and callers count such polygons. Polygons of up to EBPO_POLYGON_OPTIMAL
 * corners get the triangles of least area in space; for polygons of more corners, the smallest ears
 * are cut first. The result depends only on the corners. Sources: Meisters, "Polygons have ears",
 * 1975; for the least area: Barequet and Sharir, "Filling gaps in the boundary of a polyhedron",
 * 1995. */

typedef enum ebpo_polygon_kind {
    EBPO_POLYGON_CONVEX, /* cut as a fan; every polygon of three corners is of this kind */
    /* no reflex corners, but some corners are within straight sides; cut ear by ear, so that no
     * triangle has all its corners on one side of the polygon */
    EBPO_POLYGON_FLAT,
    EBPO_POLYGON_CONCAVE, /* cut ear by ear; the outline may touch itself */
    EBPO_POLYGON_GUESSED, /* the outline crosses itself: triangles of least area */
    /* a fan, because all corners are on a line or a coordinate is not finite */
    EBPO_POLYGON_DEGENERATE,
    /* more than EBPO_POLYGON_WORK steps were not enough; `triangle` is not usable */
    EBPO_POLYGON_TOO_LARGE,
    EBPO_POLYGON_NO_MEMORY
} ebpo_polygon_kind;

/* Maximum number of steps for one polygon, each of a few tests of coordinates. Outlines of 100,000
 * corners need far fewer steps, except if tens of thousands of corners are on one line or at one
 * position. */
#define EBPO_POLYGON_WORK (UINT64_C(1) << 31)

/* Greatest number of corners for the triangles of least area. */
enum { EBPO_POLYGON_OPTIMAL = 64 };

/* Returns the bytes of scratch memory for n corners. The memory needs the alignment of malloc.
 * Returns 0 when the number does not fit into 64 bits. */
uint64_t ebpo_polygon_scratch_bytes(uint64_t n);

/* Writes n - 2 triangles of corner indices (0 .. n - 1) with the polygon's orientation. n >= 3.
 * `scratch`: memory of ebpo_polygon_scratch_bytes(n) bytes. Any thread may call this function. */
ebpo_polygon_kind ebpo_polygon_triangulate(uint32_t (*triangle)[3], const double (*corner)[3],
                                           uint32_t n, void *scratch);

#endif
