/* A brush: a tool that paints with all of its points that are pressed against the surface. */
#ifndef EBPO_TOOLS_HAPTIC_BRUSH_H
#define EBPO_TOOLS_HAPTIC_BRUSH_H

#include "cli/commands/haptic_live.h"

/* Maximum number of points with which a brush paints at once. */
enum { HAPTIC_BRUSH_MAX = 64 };

/* Computes q * v / q: the vector v, rotated by the unit quaternion q (x, y, z, w). */
void haptic_rotate(const double q[4], const double v[3], double out[3]);

/* Computes the positions of the pressed points of a tool in contact, whose proxy is on the surface:
 * those that are at most depth and `near` above the plane of the contact. If there are more than
 * HAPTIC_BRUSH_MAX, takes every nth one. points: [count][3]. Returns the number of positions. */
int haptic_brush_pressed(const double (*points)[3], uint64_t count, const haptic_sample *sample,
                         double near, double out[HAPTIC_BRUSH_MAX][3]);

#endif
