/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: where a model is in the world.
 *
 * Each vertex is brought to the world by its model's pose, in doubles, with one rounding for each
 * operation in a stated order (docs/develop/collision.md, "Posed coordinates"). Decisions about
 * models at poses are those of arithmetic without rounding on these coordinates, as if files had
 * been written with them. Lengths are in the unit of the world: the model's, times the scale.
 */
#ifndef EBPO_POSE_H
#define EBPO_POSE_H

#include <ebpo/query.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * x of the model becomes rotation (scale x) + translation. All finite; scale from 2^-300 to 2^300.
 * Rows of `rotation` are the axes of the world in the model: rotation[i][k] multiplies x_k.
 */
typedef struct ebpo_pose {
    double rotation[3][3];
    double translation[3];
    double scale;
} ebpo_pose;

/* The model stays where it is. */
#define EBPO_POSE_INIT                                            \
    {                                                             \
        { { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } }, { 0, 0, 0 }, 1 \
    }

/*
 * Sets pose->rotation to that of a quaternion x, y, z, w, w its real part, of any length: the same
 * bits as scene files give.
 *
 * EBPO_E_ARGUMENT: its greatest part is not from 2^-500 to 2^500; the pose is as it was.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_pose_turn(ebpo_pose *pose, const double quaternion[4],
                                                  ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
