/* Draws triangle meshes without a display: perspective, z-buffer, supersampling, ambient occlusion
 * from the depths. */
#ifndef EBPO_TOOLS_RASTER_H
#define EBPO_TOOLS_RASTER_H

#include <ebpo/mesh.h>

#include "cli/render/picture.h"

typedef struct camera {
    double right[3], up[3], back[3]; /* orthonormal; back points from the model to the eye */
    double target[3], distance;      /* the eye is target + distance * back */
    double tangent;                  /* tangent of half the vertical angle of view */
} camera;

/* Sets the camera to the direction given by azimuth and elevation (degrees), with `up_axis` (0 x, 1
 * y, 2 z) upwards. The distance is the least one at which all vertices of the mesh are in a picture
 * of width * height pixels. The mesh must have at least one face. */
void camera_fit(camera *out, const ebpo_mesh *mesh, double azimuth, double elevation, int up_axis,
                int width, int height);

/* Values of raster_style.paint: the colour of a face, and the bit RASTER_HOLLOW. A face with this
 * bit is drawn only if its back is visible. RASTER_PLAIN: raster_style.colour. RASTER_OTHER: blue,
 * for a second model. */
enum { RASTER_PLAIN = 0, RASTER_OTHER = 1, RASTER_RED = 2, RASTER_HOLLOW = 4 };

typedef struct raster_style {
    double colour[3];     /* linear, 0 .. 1 */
    bool closed;          /* back faces are never visible, so they are not drawn */
    bool edges;           /* draw the outlines of polygons */
    const uint8_t *paint; /* [face_count] RASTER_...; NULL: RASTER_PLAIN for all faces */
    /* [face_count][4] and [vertex_count][4] colours that replace `colour`: sRGB, and a fourth byte
     * that is ignored. Colours of vertices are interpolated on faces. NULL: none. */
    const uint8_t *face_colours, *vertex_colours;
    /* [face_count][3] unit normals for lighting; 0, 0, 0: the geometric normal is used. NULL: the
     * geometric normals of all faces are used. */
    const float *normals;
    /* [vertex_count][3] unit normals for lighting, interpolated on faces; NULL: none */
    const float *vertex_normals;
} raster_style;

/* Draws the mesh over the rectangle (x, y, width, height) of the picture. threads: 1 to 64; the
 * picture does not depend on this number. */
EBPO_MUST_USE ebpo_status raster_draw(picture *out, int x, int y, int width, int height,
                                      const camera *view, const ebpo_mesh *mesh,
                                      const raster_style *style, unsigned threads,
                                      ebpo_error *error);

#endif
