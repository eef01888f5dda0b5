/* Loops over eight lanes, which compilers turn into vectors: the operations are the same ones. */
#include "geom/strict_fp.h"

#include "pair/posed_block.h"

#include <float.h>
#include <math.h>

enum { LANES = 8 };

static float greater(float a, float b) { return a > b ? a : b; }

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

/* One corner of eight faces less the first one's; returns the greatest 1-norm. */
static float corner_less(const float *x, const float base[3], float d[3][LANES])
{
    float most = 0;
    for (int k = 0; k < 3; k++)
        for (int lane = 0; lane < LANES; lane++) {
            float v = x[k * LANES + lane];
            d[k][lane] = v < FLT_MAX ? v - base[k] : 0;
        }
    for (int lane = 0; lane < LANES; lane++)
        most = greater(most, fabsf(d[0][lane]) + fabsf(d[1][lane]) + fabsf(d[2][lane]));
    return most;
}

void ebpo_posed_block_make(ebpo_posed_block *out, const ebpo_block_posing *p, const float *block)
{
    const float base[3] = { block[0], block[LANES], block[2 * LANES] };
    ebpo_posing_apply(&p->posing, (const double[3]){ base[0], base[1], base[2] }, out->base);
    float most = 0, d[3][LANES];
    for (int c = 0; c < 3; c++) {
        most = greater(most, corner_less(block + 3 * c * LANES, base, d));
        for (int i = 0; i < 3; i++) {
            const float *m = p->matrix[i];
            for (int lane = 0; lane < LANES; lane++)
                out->x[(3 * c + i) * LANES + lane] =
                    (m[0] * d[0][lane] + m[1] * d[1][lane]) + m[2] * d[2][lane];
        }
    }
    out->reach = p->size * most * (1 + 0x1p-20f);
    out->error = 6 * 0x1p-24f * out->reach + p->doubt;
}

void ebpo_posed_block_make_wide(ebpo_posed_block *out, const ebpo_block_posing *p,
                                const double *block)
{
    const double base[3] = { block[0], block[LANES], block[2 * LANES] };
    ebpo_posing_apply(&p->posing, base, out->base);
    out->reach = 0;
    for (int at = 0; at < 3 * LANES; at++) {
        int c = at / LANES, lane = at % LANES;
        const double *x = block + 3 * c * LANES + lane, v[3] = { x[0], x[LANES], x[2 * LANES] };
        double posed[3] = { out->base[0], out->base[1], out->base[2] };
        if (v[0] < DBL_MAX)
            ebpo_posing_apply(&p->posing, v, posed);
        for (int i = 0; i < 3; i++) {
            float f = (float)((posed[i] - out->base[i]) * p->unit);
            out->x[(3 * c + i) * LANES + lane] = f;
            out->reach = greater(out->reach, fabsf(f));
        }
    }
    out->error = 2 * 0x1p-24f * out->reach + p->doubt;
}

float ebpo_posed_block_place(const ebpo_posed_block *b, double unit, const double origin[3],
                             float out[72])
{
    float shift[3], most = 0;
    for (int k = 0; k < 3; k++) {
        shift[k] = (float)((b->base[k] - origin[k]) * unit);
        most = greater(most, fabsf(shift[k]));
    }
    for (int i = 0; i < 9; i++)
        for (int lane = 0; lane < LANES; lane++)
            out[i * LANES + lane] = b->x[i * LANES + lane] + shift[i % 3];
    return b->error + 0x1.2p-24f * b->reach + 2.5f * 0x1p-24f * most;
}
