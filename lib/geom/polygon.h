/* Cutting polygons in space into triangles over their own corners.
 *
 * The polygon is projected along the axis on which its normal (Newell's sum) is largest. There a
 * convex polygon becomes a fan from its first corner; any other is cut ear by ear, every turn and
 * every point-in-ear test by the exact ebpo_orient2d. Polygons for which this has no answer (no
 * area, crossing themselves, coordinates that are not finite) become a fan, whatever it looks like:
 * the outline stays the source's. The result depends on nothing but the corners. Source of the
 * method: Meisters, "Polygons have ears", 1975.
 */
#ifndef EBPO_GEOM_POLYGON_H
#define EBPO_GEOM_POLYGON_H

#include <ebpo/base.h>

typedef enum ebpo_polygon_kind {
    EBPO_POLYGON_CONVEX, /* a fan; also every triangle */
    /* no reflex corner but straight ones: cut by ears, so that no triangle lies on a straight side
     */
    EBPO_POLYGON_FLAT,
    EBPO_POLYGON_CONCAVE,    /* cut by ears */
    EBPO_POLYGON_DEGENERATE, /* a fan, for want of better */
    /* concave, and more than EBPO_POLYGON_WORK steps were not enough; `triangle` is not usable */
    EBPO_POLYGON_TOO_LARGE
} ebpo_polygon_kind;

/* Limit of point-in-ear tests for one polygon. Never reached below 1,000 corners; real outlines of
 * 10,000 stay well below it too. */
#define EBPO_POLYGON_WORK (UINT64_C(1) << 30)

/* Bytes of scratch for n corners, at any alignment that malloc gives; 0 when that does not fit 64
 * bits. */
uint64_t ebpo_polygon_scratch_bytes(uint64_t n);

/* Writes n - 2 triangles of corner numbers (0 .. n - 1) with the polygon's orientation. n >= 3.
 * Pure, any thread. */
ebpo_polygon_kind ebpo_polygon_triangulate(uint32_t (*triangle)[3], const double (*corner)[3],
                                           uint32_t n, void *scratch);

#endif
