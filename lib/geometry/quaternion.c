#include "core/strict_fp.h"

#include "geometry/quaternion.h"

#include <math.h>
#include <string.h>

#include <ebpo/pose.h>

#include "core/error.h"
#include "core/fp_env.h"

double ebpo_quaternion_length(const double q[4])
{
    return sqrt((q[0] * q[0] + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3]));
}

bool ebpo_quaternion_normalise(double q[4])
{
    double most = 0;
    for (int k = 0; k < 4; k++) {
        if (!(fabs(q[k]) <= 0x1p500))
            return false;
        most = fmax(most, fabs(q[k]));
    }
    if (most < 0x1p-500)
        return false;
    for (int k = 0; k < 4; k++)
        q[k] /= most;
    double length = ebpo_quaternion_length(q);
    for (int k = 0; k < 4; k++)
        q[k] /= length;
    return true;
}

void ebpo_quaternion_matrix(const double q[4], double (*m)[3])
{
    double x = q[0], y = q[1], z = q[2], w = q[3];
    m[0][0] = 1 - 2 * (y * y + z * z);
    m[0][1] = 2 * (x * y - z * w);
    m[0][2] = 2 * (x * z + y * w);
    m[1][0] = 2 * (x * y + z * w);
    m[1][1] = 1 - 2 * (x * x + z * z);
    m[1][2] = 2 * (y * z - x * w);
    m[2][0] = 2 * (x * z - y * w);
    m[2][1] = 2 * (y * z + x * w);
    m[2][2] = 1 - 2 * (x * x + y * y);
}

ebpo_status ebpo_pose_turn(ebpo_pose *pose, const double quaternion[4], ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    double q[4];
    memcpy(q, quaternion, sizeof q);
    if (!ebpo_quaternion_normalise(q))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the quaternion's greatest part is not from 2^-500 to 2^500: %g %g %g %g",
                         q[0], q[1], q[2], q[3]);
    ebpo_quaternion_matrix(q, pose->rotation);
    return EBPO_OK;
}
