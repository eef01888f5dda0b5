/* Converts rotations from quaternions (x, y, z, w; w is the real part), and applies poses to
 * coordinates. All functions are thread-safe. */
#ifndef EBPO_GEOMETRY_POSE_H
#define EBPO_GEOMETRY_POSE_H

#include <stdbool.h>

#include <ebpo/pose.h>

double ebpo_quaternion_length(const double q[4]);

/* Scales a quaternion to length 1, up to rounding. Returns false if the greatest absolute value of
 * a component is not within 2^-500 .. 2^500. */
bool ebpo_quaternion_normalise(double q[4]);

/* Converts a quaternion, whose length is 1 up to rounding, to a matrix. */
void ebpo_quaternion_matrix(const double q[4], double (*m)[3]);

/* The pose of a model in the world, and the posed coordinates of its vertices. Posed coordinates
 * are doubles, and each operation is rounded once. All decisions about two models are exact for
 * these doubles (docs/develop/collision.md). All functions are pure and may be called by any
 * thread. */

/* A pose that has been checked. */
typedef struct ebpo_posing {
    double matrix[3][3]; /* rotation times scale; each component is rounded once */
    double translation[3];
    double scale;
    double error_bound; /* greatest absolute component of R^T R minus the unit matrix, where R is
                           the pose's rotation, plus a bound of the rounding */
} ebpo_posing;

/* Checks a pose, for vertices whose coordinates have absolute values of at most largest[axis].
 *
 * Returns EBPO_E_ARGUMENT if a number is not finite, or if the matrix is a mirror or no rotation
 * (the message gives the difference). Also returns EBPO_E_ARGUMENT if the scale or a posed
 * coordinate is out of range. */
EBPO_MUST_USE ebpo_status ebpo_posing_make(ebpo_posing *out, const ebpo_pose *pose,
                                           const double largest[3], ebpo_error *error);

/* Applies the pose. The result is finite and within 2^1000. Files that use this function must
 * include core/strict_fp.h first, so that its operations are never contracted. */
static inline void ebpo_posing_apply(const ebpo_posing *p, const double x[3], double out[3])
{
    for (int i = 0; i < 3; i++) {
        const double *m = p->matrix[i];
        out[i] = ((m[0] * x[0] + m[1] * x[1]) + m[2] * x[2]) + p->translation[i];
    }
}

/* Returns the rows of the rotation, in doubles. */
void ebpo_posing_rotation(const ebpo_posing *p, double out[3][3]);

/* Returns a bound of the error of each posed coordinate. `length`: greatest distance of a vertex
 * from the model's origin. The error is the difference from the position that the nearest exact
 * rotation would give without rounding. */
double ebpo_posing_error(const ebpo_posing *p, double length);

#endif
