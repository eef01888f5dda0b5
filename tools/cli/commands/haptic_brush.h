/* A brush: a tool that paints with all of its points that are pressed against the surface. */
#ifndef EBPO_TOOLS_HAPTIC_BRUSH_H
#define EBPO_TOOLS_HAPTIC_BRUSH_H

#include <ebpo/pose.h>

#include "cli/commands/haptic_live.h"

/* Maximum number of points with which a brush paints at once. */
enum { HAPTIC_BRUSH_MAX = 64 };

typedef struct haptic_brush haptic_brush;

/* Computes q * v / q: the vector v, rotated by the unit quaternion q (x, y, z, w). */
void haptic_rotate(const double q[4], const double v[3], double out[3]);

/* Transforms a point from the world to the coordinates of a posed model, or back. pose NULL: the
 * coordinates are equal. `from` and `out` must not overlap. */
void haptic_to_model(const ebpo_pose *pose, const double from[3], double out[3]);
void haptic_to_world(const ebpo_pose *pose, const double from[3], double out[3]);

/* Makes a brush of points [count][3], which are copied; count is at least 1. Returns NULL without
 * memory. */
haptic_brush *haptic_brush_new(const double (*points)[3], uint64_t count);
void haptic_brush_free(haptic_brush *brush);

/* Computes the positions, on the proxy, of the pressed points of a brush in contact. A point is
 * pressed if it is not farther than `near` from the surface, or if the motion from proxy to device
 * would bring it so near to the surface or through it. The surface is here the plane through the
 * nearest point of the model, perpendicular to the line from there to the brush's point. If more
 * than HAPTIC_BRUSH_MAX points are pressed, takes about as many, spread over the pressed ones. Sets
 * *count to the number of positions. pose: of the model of `context`, or NULL; all other lengths
 * and positions are those of the world. Fails as ebpo_distance does. */
ebpo_status haptic_brush_press(haptic_brush *brush, ebpo_context *context, const ebpo_pose *pose,
                               const haptic_sample *sample, double near,
                               double out[HAPTIC_BRUSH_MAX][3], int *count, ebpo_error *error);

#endif
