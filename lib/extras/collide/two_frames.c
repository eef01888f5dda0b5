#include "core/strict_fp.h"

#include "extras/collide/two_frames.h"

#include <math.h>

static double greatest(const double x[3]) { return fmax(fabs(x[0]), fmax(fabs(x[1]), fabs(x[2]))); }

/* Frame `from` seen from frame `to`; offset: from's centre less to's, in the world. */
static void turn_into(ebpo_turned_frame *out, double from[3][3], double to[3][3],
                      const double offset[3])
{
    for (int i = 0; i < 3; i++) {
        double shift = 0;
        for (int j = 0; j < 3; j++) {
            double turn = 0;
            for (int k = 0; k < 3; k++)
                turn += to[k][i] * from[k][j];
            out->turn[i][j] = (float)turn;
            out->turn_size[i][j] = fabsf(out->turn[i][j]);
            out->in_world[i][j] = (float)from[i][j];
            shift += to[j][i] * offset[j];
        }
        out->shift[i] = (float)shift;
    }
}

void ebpo_two_frames_make(ebpo_two_frames *out, const ebpo_accel *const accel[2],
                          const ebpo_block_posing posing[2])
{
    double rotation[2][3][3], centre[2][3], offset[2][3], size = 0, lost = 0, deviation = 0;
    double unit = posing[0].unit;
    for (int s = 0; s < 2; s++) {
        const ebpo_posing *p = &posing[s].posing;
        double length = accel[s]->reach / accel[s]->scale,
               far = greatest(accel[s]->centre) + length;
        ebpo_posing_rotation(p, rotation[s]);
        ebpo_posing_apply(p, accel[s]->centre, centre[s]);
        out->frame[s].unit = (float)(p->scale / accel[s]->scale * unit);
        size += length * p->scale * unit;
        lost += 2 * ebpo_posing_error(p, 1.7321 * far) * unit;
        deviation += 2 * p->deviation + 0x1p-50;
    }
    for (int k = 0; k < 3; k++) {
        offset[0][k] = (centre[0][k] - centre[1][k]) * unit;
        offset[1][k] = -offset[0][k];
    }
    double all = size + 1.7321 * greatest(offset[0]);
    for (int s = 0; s < 2; s++)
        turn_into(&out->frame[s], rotation[s], rotation[1 - s], offset[s]);
    out->slack = (float)((0x1p-19 * all + 2 * deviation * all + 2 * lost) * (1 + 0x1p-20));
}
