#include "core/strict_fp.h"

#include "extras/haptic/rigid.h"

bool ebpo_rigid_read(const double place[3], const double turn[4], ebpo_rigid *out)
{
    double most = 0, square = 0, unit[4];
    bool fine = true;
    for (int i = 0; i < 3; i++)
        fine &= fabs(place[i]) <= 0x1p200;
    for (int i = 0; i < 4; i++) {
        fine &= isfinite(turn[i]) != 0;
        most = fmax(most, fabs(turn[i]));
    }
    if (!fine || !(most >= 0x1p-500))
        return false;
    for (int i = 0; i < 4; i++) {
        unit[i] = turn[i] / most;
        square += unit[i] * unit[i];
    }
    copy(place, out->place);
    for (int i = 0; i < 4; i++)
        out->turn[i] = unit[i] / sqrt(square);
    return true;
}

static void multiply(const double a[4], const double b[4], double out[4])
{
    double c[3];
    cross(a, b, c);
    for (int i = 0; i < 3; i++)
        out[i] = a[3] * b[i] + b[3] * a[i] + c[i];
    out[3] = a[3] * b[3] - dot(a, b);
}

void ebpo_rigid_between(const ebpo_rigid *a, const ebpo_rigid *b, double arm,
                        double out[EBPO_SCREW])
{
    const double back[4] = { -a->turn[0], -a->turn[1], -a->turn[2], a->turn[3] };
    double q[4];
    difference(b->place, a->place, out);
    multiply(b->turn, back, q);
    double sine = sqrt(dot(q, q)), side = q[3] < 0 ? -1 : 1;
    double angle = 2 * atan2(sine, side * q[3]);
    for (int i = 0; i < 3; i++)
        out[3 + i] = sine > 0 ? arm * (side * angle / sine) * q[i] : 0;
}

void ebpo_rigid_go(const ebpo_rigid *from, const double way[EBPO_SCREW], double part, double arm,
                   ebpo_rigid *out)
{
    double by[4], q[4], place[3];
    double angle = part * sqrt(dot(way + 3, way + 3)) / arm;
    for (int i = 0; i < 3; i++) {
        place[i] = from->place[i] + part * way[i];
        by[i] = angle > 0 ? sin(angle / 2) / angle * (part * way[3 + i] / arm) : 0;
    }
    by[3] = cos(angle / 2);
    multiply(by, from->turn, q);
    *out = *from;
    (void)ebpo_rigid_read(place, q, out);
}

void ebpo_rigid_matrix(const ebpo_rigid *r, double out[3][3])
{
    const double *q = r->turn;
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        out[i][i] = 1 - 2 * (q[j] * q[j] + q[k] * q[k]);
        out[i][j] = 2 * (q[i] * q[j] - q[3] * q[k]);
        out[i][k] = 2 * (q[i] * q[k] + q[3] * q[j]);
    }
}
