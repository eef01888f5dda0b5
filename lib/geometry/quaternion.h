/* Rotations as quaternions: x, y, z, w (the real part). Any thread. */
#ifndef EBPO_GEOMETRY_QUATERNION_H
#define EBPO_GEOMETRY_QUATERNION_H

#include <stdbool.h>

double ebpo_quaternion_length(const double q[4]);

/* To length 1 but for rounding. False: its greatest part is not within 2^-500 .. 2^500. */
bool ebpo_quaternion_normalise(double q[4]);

/* Of length 1 but for rounding; m: [3][3]. */
void ebpo_quaternion_matrix(const double q[4], double (*m)[3]);

#endif
