/* SPDX-License-Identifier: MIT
 * Pose of a model in the world.
 *
 * A pose transforms each vertex to the world in doubles, with one rounding per operation in a
 * defined order (docs/develop/collision.md, "Posed coordinates"). The results are the *posed
 * coordinates*. Decisions of queries are exact for posed coordinates: a decision is the one that a
 * computation without rounding gives for these coordinates. Lengths are in the unit of the world:
 * the model's unit times the scale.
 */
#ifndef EBPO_POSE_H
#define EBPO_POSE_H

#include <ebpo/query.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * Transforms a point x of the model to a point y of the world. y[i] is translation[i] plus the sum
 * of rotation[i][k] * scale * x[k] for k = 0, 1, 2. So the rows of `rotation` are the axes of the
 * world in model coordinates. All values are finite; `scale` is from 2^-300 to 2^300.
 */
typedef struct ebpo_pose {
    double rotation[3][3];
    double translation[3];
    double scale;
} ebpo_pose;

/* The identity: posed coordinates equal the coordinates in the file. */
#define EBPO_POSE_INIT                                            \
    {                                                             \
        { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } }, { 0, 0, 0 }, 1 \
    }

/*
 * Sets pose->rotation from a quaternion x, y, z, w of any length; w is the real part. The result is
 * bitwise equal to the rotation of an instance with this quaternion in a scene file.
 *
 * EBPO_E_ARGUMENT: the greatest absolute value of a component is not within 2^-500 .. 2^500. In
 * this case the pose is unchanged.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_pose_turn(ebpo_pose *pose, const double quaternion[4],
                                                  ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
