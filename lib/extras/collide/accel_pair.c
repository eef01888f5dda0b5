#include "core/strict_fp.h"

#include "extras/collide/accel_pair.h"

#include <math.h>

/* 3x3 matrices in doubles, near rotations. */
static void inverse(const double m[3][3], double out[3][3])
{
    double det = 0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            int r1 = (k + 1) % 3, r2 = (k + 2) % 3, c1 = (i + 1) % 3, c2 = (i + 2) % 3;
            out[i][k] = m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1];
        }
    for (int k = 0; k < 3; k++)
        det += m[0][k] * out[k][0];
    for (int i = 0; i < 9; i++)
        out[i / 3][i % 3] /= det;
}

static void turn(const double m[3][3], const double x[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = m[i][0] * x[0] + m[i][1] * x[1] + m[i][2] * x[2];
}

static void to_floats(const double m[3][3], float out[3][3], float size[3][3])
{
    for (int i = 0; i < 9; i++) {
        out[i / 3][i % 3] = (float)m[i / 3][i % 3];
        size[i / 3][i % 3] = fabsf(out[i / 3][i % 3]) * (1 + 0x1p-22f);
    }
}

/* Frames too different or too strange for floats: every pair of nodes is looked at. */
static void look_at_all(ebpo_accel_pair *out)
{
    out->unit[0] = out->unit[1] = 1;
    for (int i = 0; i < 9; i++)
        out->turn[i / 3][i % 3] = i % 4 == 0;
    out->place[0] = out->place[1] = out->place[2] = 0;
    to_floats((const double(*)[3])out->turn, out->into[0], out->size[0]);
    to_floats((const double(*)[3])out->turn, out->into[1], out->size[1]);
    out->doubt = INFINITY;
    out->slabs = out->apart = false;
}

/* By the axes of the first's frame; spheres would not do better. */
static bool boxes_apart(const ebpo_accel_pair *p)
{
    double first = p->accel[0]->reach * (double)p->unit[0],
           second = p->accel[1]->reach * (double)p->unit[1];
    for (int i = 0; i < 3; i++) {
        double size = first + (double)p->doubt;
        for (int k = 0; k < 3; k++)
            size += fabs(p->turn[i][k]) * second;
        if (fabs(p->place[i]) > size * (1 + 0x1p-40))
            return true;
    }
    return false;
}

/* per_world: lengths of each frame for one of the world. */
static void choose_units(ebpo_accel_pair *out, const double per_world[2])
{
    double ratio = per_world[0] / per_world[1];
    out->slabs = ratio > 0x1p-60 && ratio < 0x1p60;
    out->unit[0] = ratio > 1 ? (float)fmax(1 / ratio, 0x1p-60) : 1;
    out->unit[1] = ratio > 1 ? 1 : (float)fmax(ratio, 0x1p-60);
}

void ebpo_accel_pair_make(ebpo_accel_pair *out, const ebpo_accel *const accel[2],
                          const ebpo_block_posing *const posing[2], double reach)
{
    double per_world[2], rotation[2][3][3], back[3][3], middle[3], seen[3];
    for (int i = 0; i < 2; i++) {
        out->accel[i] = accel[i];
        out->posing[i] = posing[i];
        per_world[i] = accel[i]->scale / posing[i]->posing.scale;
        ebpo_posing_rotation(&posing[i]->posing, rotation[i]);
    }
    choose_units(out, per_world);
    double unit = (double)out->unit[0] * per_world[0],
           ratio = unit / ((double)out->unit[1] * per_world[1]);
    if (!(unit > 0x1p-900 && unit < 0x1p900 && ratio > 0x1p-900 && ratio < 0x1p900 &&
          reach * unit < 0x1p100)) {
        look_at_all(out);
        return;
    }
    inverse((const double(*)[3])rotation[0], back);
    for (int k = 0; k < 3; k++) {
        double column[3] = { rotation[1][0][k], rotation[1][1][k], rotation[1][2][k] };
        turn((const double(*)[3])back, column, seen);
        for (int i = 0; i < 3; i++)
            out->turn[i][k] = seen[i] * ratio;
    }
    ebpo_posing_apply(&posing[1]->posing, accel[1]->centre, middle);
    for (int i = 0; i < 3; i++)
        middle[i] -= posing[0]->posing.translation[i];
    turn((const double(*)[3])back, middle, seen);
    for (int i = 0; i < 3; i++)
        out->place[i] = seen[i] * unit - accel[0]->centre[i] * (posing[0]->posing.scale * unit);
    to_floats((const double(*)[3])out->turn, out->into[0], out->size[0]);
    inverse((const double(*)[3])out->turn, back);
    to_floats((const double(*)[3])back, out->into[1], out->size[1]);
    double deviation = posing[0]->posing.deviation + posing[1]->posing.deviation;
    out->doubt = (float)(0x1p-44 * reach * unit) + 0x1p-100f;
    out->slab_share = (float)(0x1p-17 + 8 * deviation);
    out->sine_room = (float)(0x1p-17 + 16 * deviation);
    out->apart = boxes_apart(out);
}
