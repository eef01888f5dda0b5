/* Loops over 24 vertices, which compilers turn into vectors: the operations are the same ones. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "extras/collide/posed_block.h"

enum { MOST = EBPO_POSED_VERTICES };

static float posed_block_greater(float a, float b) { return a > b ? a : b; }

double ebpo_block_unit(double reach)
{
    int exponent;
    frexp(reach > 0x1p-900 ? reach : 0x1p-900, &exponent);
    return ldexp(1, 30 - exponent);
}

void ebpo_block_posing_make(ebpo_block_posing *out, const ebpo_posing *posing, double reach)
{
    out->posing = *posing;
    out->unit = ebpo_block_unit(reach);
    double size = posing->scale * out->unit * (1 + 0x1p-18);
    out->size = (float)(size * (1 + 0x1p-20));
    out->doubt = (float)(0x1p-49 * reach * out->unit);
    out->fits = size > 0x1p-60 && size < 0x1p60;
    for (int i = 0; i < 9; i++)
        out->matrix[i / 3][i % 3] = (float)(posing->matrix[i / 3][i % 3] * out->unit);
}

void ebpo_posed_block_make(ebpo_posed_block *out, const ebpo_block_posing *p, const float *vertex,
                           unsigned vertices)
{
    const float base[3] = { vertex[0], vertex[vertices], vertex[2 * vertices] };
    ebpo_posing_apply(&p->posing, (const double[3]){ base[0], base[1], base[2] }, out->base);
    float most = 0, d[3][MOST] = { { 0 } };
    for (unsigned k = 0; k < 3; k++)
        for (unsigned i = 0; i < vertices; i++)
            d[k][i] = vertex[k * vertices + i] - base[k];
    for (int i = 0; i < MOST; i++)
        most = posed_block_greater(most, fabsf(d[0][i]) + fabsf(d[1][i]) + fabsf(d[2][i]));
    for (int k = 0; k < 3; k++) {
        const float *m = p->matrix[k];
        for (int i = 0; i < MOST; i++)
            out->x[k][i] = (m[0] * d[0][i] + m[1] * d[1][i]) + m[2] * d[2][i];
    }
    out->vertices = vertices;
    out->reach = ebpo_posed_block_reach(p, most);
    out->error = ebpo_posed_block_error(p, out->reach);
}

void ebpo_posed_block_make_wide(ebpo_posed_block *out, const ebpo_block_posing *p,
                                const double *vertex, unsigned vertices)
{
    const double base[3] = { vertex[0], vertex[vertices], vertex[2 * vertices] };
    ebpo_posing_apply(&p->posing, base, out->base);
    memset(out->x, 0, sizeof out->x);
    out->reach = 0;
    for (unsigned i = 0; i < vertices; i++) {
        double v[3] = { vertex[i], vertex[vertices + i], vertex[2 * vertices + i] }, posed[3];
        ebpo_posing_apply(&p->posing, v, posed);
        for (int k = 0; k < 3; k++) {
            out->x[k][i] = (float)((posed[k] - out->base[k]) * p->unit);
            out->reach = posed_block_greater(out->reach, fabsf(out->x[k][i]));
        }
    }
    out->vertices = vertices;
    out->error = 2 * 0x1p-24f * out->reach + p->doubt;
}

float ebpo_posed_block_place(const ebpo_posed_block *b, double unit, const double origin[3],
                             float out[3][EBPO_POSED_VERTICES])
{
    float most = 0;
    for (int k = 0; k < 3; k++) {
        float shift = (float)((b->base[k] - origin[k]) * unit);
        most = posed_block_greater(most, fabsf(shift));
        for (int i = 0; i < MOST; i++)
            out[k][i] = b->x[k][i] + shift;
    }
    return b->error + 0x1.2p-24f * b->reach + 2.5f * 0x1p-24f * most;
}

static double two_frames_greatest(const double x[3])
{
    return fmax(fabs(x[0]), fmax(fabs(x[1]), fabs(x[2])));
}

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
               far = two_frames_greatest(accel[s]->centre) + length;
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
    double all = size + 1.7321 * two_frames_greatest(offset[0]);
    for (int s = 0; s < 2; s++)
        turn_into(&out->frame[s], rotation[s], rotation[1 - s], offset[s]);
    out->slack = (float)((0x1p-19 * all + 2 * deviation * all + 2 * lost) * (1 + 0x1p-20));
}
