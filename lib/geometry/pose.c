/* Evaluates poses: rotations as quaternions and matrices, and the coordinates of posed vertices.
 *
 * A pose is checked once. Its matrix may differ from a rotation only by rounding. Posed coordinates
 * are the coordinates of a vertex after the pose was applied. They are doubles, and each operation
 * is rounded once. All decisions about two models are exact for these doubles. Bounds:
 * docs/develop/collision.md, "Posed coordinates". */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include <ebpo/pose.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "geometry/pose.h"

/* --- quaternions --- */

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
        return ebpo_fail(
            error, EBPO_E_ARGUMENT,
            "the greatest component of the quaternion is not from 2^-500 to 2^500: %g %g %g %g",
            q[0], q[1], q[2], q[3]);
    ebpo_quaternion_matrix(q, pose->rotation);
    return EBPO_OK;
}

/* --- poses --- */

static const double max_error_bound = 0x1p-20, least_scale = 0x1p-300, max_scale = 0x1p300,
                    max_coordinate = 0x1p1000;

static bool all_finite(const double *x, int n)
{
    bool finite = true;
    for (int i = 0; i < n; i++)
        finite &= isfinite(x[i]) != 0;
    return finite;
}

/* Returns the greatest absolute component of R^T R minus the unit matrix, where R is the matrix
 * `r`, plus a bound of the rounding. Returns infinity on overflow. */
static double error_bound_of(const double r[3][3])
{
    double most = 0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            double product = (r[0][i] * r[0][k] + r[1][i] * r[1][k]) + r[2][i] * r[2][k];
            double off = fabs(product - (i == k));
            most = off <= most ? most : off < INFINITY ? off : INFINITY;
        }
    return most + 0x1p-50;
}

static double determinant_3x3(const double r[3][3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        sum += (r[0][u] * r[1][v] - r[0][v] * r[1][u]) * r[2][k];
    }
    return sum;
}

static ebpo_status check_rotation(const ebpo_pose *pose, double error_bound, ebpo_error *error)
{
    if (!all_finite(&pose->rotation[0][0], 9) || !all_finite(pose->translation, 3))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "pose: a number is not finite");
    if (!(error_bound <= max_error_bound))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "pose: the matrix is not a rotation: its transpose times itself is off by "
                         "%.3g from the unit matrix, at most %.3g is allowed",
                         error_bound, max_error_bound);
    if (determinant_3x3(pose->rotation) < 0)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "pose: the matrix is a mirror, not a rotation: its determinant is -1");
    if (!(pose->scale >= least_scale && pose->scale <= max_scale))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "pose: the scale is %g, not from %.3g to %.3g",
                         pose->scale, least_scale, max_scale);
    return EBPO_OK;
}

ebpo_status ebpo_posing_make(ebpo_posing *out, const ebpo_pose *pose, const double largest[3],
                             ebpo_error *error)
{
    out->error_bound = error_bound_of(pose->rotation);
    ebpo_status status = check_rotation(pose, out->error_bound, error);
    if (status != EBPO_OK)
        return status;
    out->scale = pose->scale;
    for (int i = 0; i < 3; i++) {
        out->translation[i] = pose->translation[i];
        double size = fabs(pose->translation[i]);
        for (int k = 0; k < 3; k++) {
            out->matrix[i][k] = pose->scale * pose->rotation[i][k];
            size += fabs(out->matrix[i][k]) * largest[k];
        }
        if (!(size <= max_coordinate))
            return ebpo_fail(error, EBPO_E_ARGUMENT,
                             "pose: the model would extend to %.3g on axis %d; at most %.3g is "
                             "allowed",
                             size, i, max_coordinate);
    }
    return EBPO_OK;
}

void ebpo_posing_rotation(const ebpo_posing *p, double out[3][3])
{
    for (int i = 0; i < 9; i++)
        out[i / 3][i % 3] = p->matrix[i / 3][i % 3] / p->scale;
}

double ebpo_posing_error(const ebpo_posing *p, double length)
{
    double most = 0;
    for (int i = 0; i < 3; i++)
        most = fmax(most, fabs(p->translation[i]));
    double moved = p->scale * length * (2 * p->error_bound + 6 * 0x1p-53);
    return (moved + 1.01 * 0x1p-53 * most) * (1 + 0x1p-50) + 0x1p-1072;
}
