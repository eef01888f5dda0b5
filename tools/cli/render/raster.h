/* Drawing triangle meshes without a display: perspective, z-buffer, supersampling, ambient
 * occlusion from the depths.
 */
#ifndef EBPO_TOOLS_RASTER_H
#define EBPO_TOOLS_RASTER_H

#include <ebpo/mesh.h>

#include "cli/render/picture.h"

typedef struct camera {
    double right[3], up[3], back[3]; /* orthonormal; back points from the model to the eye */
    double target[3], distance;      /* the eye is target + distance * back */
    double tangent;                  /* of half the vertical angle of view */
} camera;

/* Looks from azimuth and elevation (degrees) with `up_axis` (0 x, 1 y, 2 z) upwards, near enough
 * that the mesh's vertices just fit a picture of that size. The mesh has at least one face. */
void camera_fit(camera *out, const ebpo_mesh *mesh, double azimuth, double elevation, int up_axis,
                int width, int height);

/* How a face is painted; with RASTER_HOLLOW only where its back is seen. */
enum { RASTER_PLAIN = 0, RASTER_OTHER = 1, RASTER_RED = 2, RASTER_HOLLOW = 4 };

typedef struct raster_style {
    double colour[3];     /* linear, 0 .. 1 */
    bool closed;          /* back faces are never seen: leave them out */
    bool edges;           /* draw the outlines of polygons */
    const uint8_t *paint; /* of each face; NULL: RASTER_PLAIN, which is `colour` */
    /* Instead of `colour`, sRGB and a fourth byte each: of faces, or of vertices and interpolated
     * on faces; NULL: none. */
    const uint8_t *face_colours, *vertex_colours;
    /* [face_count][3] which way faces are lit, of length 1, or 0: as they lie; NULL: all of them */
    const float *normals;
} raster_style;

/* Draws the mesh into the rectangle (x, y, width, height) of the picture, over what is there.
 * `threads` 1 to 64; the picture does not depend on it. */
EBPO_MUST_USE ebpo_status raster_draw(picture *out, int x, int y, int width, int height,
                                      const camera *view, const ebpo_mesh *mesh,
                                      const raster_style *style, unsigned threads,
                                      ebpo_error *error);

#endif
