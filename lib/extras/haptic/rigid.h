/* Inside lib/extras/haptic: rigid motions, of which a tool's turning is measured in lengths: angles
 * times the tool's arm. */
#ifndef EBPO_HAPTIC_RIGID_H
#define EBPO_HAPTIC_RIGID_H

#include <math.h>
#include <stdbool.h>

#include "extras/haptic/vectors.h"

typedef struct ebpo_rigid {
    double place[3], turn[4]; /* a unit quaternion x, y, z, w */
} ebpo_rigid;

enum { EBPO_SCREW = 6 }; /* a way, and a rotation vector times the arm */

/* False: not finite, or no quaternion at all. */
bool ebpo_rigid_read(const double place[3], const double turn[4], ebpo_rigid *out);

/* The way from a to b, in the axes of the world, by the shorter turn. */
void ebpo_rigid_between(const ebpo_rigid *a, const ebpo_rigid *b, double arm,
                        double out[EBPO_SCREW]);

/* A part of the way further. */
void ebpo_rigid_go(const ebpo_rigid *from, const double way[EBPO_SCREW], double part, double arm,
                   ebpo_rigid *out);

void ebpo_rigid_matrix(const ebpo_rigid *r, double out[3][3]);

static inline void ebpo_rigid_lever(const double matrix[3][3], const double p[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = dot(matrix[i], p);
}

static inline double screw_dot(const double a[EBPO_SCREW], const double b[EBPO_SCREW])
{
    return dot(a, b) + dot(a + 3, b + 3);
}

static inline double screw_length(const double a[EBPO_SCREW]) { return sqrt(screw_dot(a, a)); }

#endif
