#include "core/strict_fp.h"

#include "geometry/plane_code.h"

#include <math.h>
#include <stdlib.h>

bool ebpo_plane_code_decode(uint32_t code, int32_t n[3], int32_t *d)
{
    int32_t u = (int32_t)(code & 1023) - EBPO_NORMAL_NORM,
            v = (int32_t)(code >> 10 & 1023) - EBPO_NORMAL_NORM;
    int32_t q = (int32_t)(code >> 20);
    if (u > EBPO_NORMAL_NORM || v > EBPO_NORMAL_NORM || q >= EBPO_OFFSET_STEPS - 1)
        return false;
    int32_t w = EBPO_NORMAL_NORM - abs(u) - abs(v);
    n[0] = w >= 0 ? u : (u < 0 ? -1 : 1) * (EBPO_NORMAL_NORM - abs(v));
    n[1] = w >= 0 ? v : (v < 0 ? -1 : 1) * (EBPO_NORMAL_NORM - abs(u));
    n[2] = w;
    int32_t least = 0;
    for (int i = 0; i < 3; i++)
        least += n[i] < 0 ? n[i] : 0;
    *d = EBPO_OFFSET_STEPS * least + EBPO_NORMAL_NORM * (q + 1);
    return true;
}

bool ebpo_plane_code_normal(const double direction[3], uint32_t *normal)
{
    double x = direction[0], y = direction[1], z = direction[2];
    double most = fmax(fabs(x), fmax(fabs(y), fabs(z)));
    if (!(most > 0) || !isfinite(most) || !isfinite(x + y + z))
        return false;
    x /= most, y /= most, z /= most; /* keeps the sum below from overflow and underflow */
    double scale = EBPO_NORMAL_NORM / (fabs(x) + fabs(y) + fabs(z));
    double u = x * scale, v = y * scale;
    if (z < 0) {
        double fu = (EBPO_NORMAL_NORM - fabs(v)) * (u < 0 ? -1 : 1);
        double fv = (EBPO_NORMAL_NORM - fabs(u)) * (v < 0 ? -1 : 1);
        u = fu, v = fv;
    }
    int32_t iu = (int32_t)floor(u + 0.5), iv = (int32_t)floor(v + 0.5);
    iu = iu < -EBPO_NORMAL_NORM ? -EBPO_NORMAL_NORM : iu > EBPO_NORMAL_NORM ? EBPO_NORMAL_NORM : iu;
    iv = iv < -EBPO_NORMAL_NORM ? -EBPO_NORMAL_NORM : iv > EBPO_NORMAL_NORM ? EBPO_NORMAL_NORM : iv;
    *normal = (uint32_t)(iu + EBPO_NORMAL_NORM) | (uint32_t)(iv + EBPO_NORMAL_NORM) << 10;
    return true;
}

int ebpo_plane_code_offset(const int32_t n[3], double support)
{
    double least = 0;
    for (int i = 0; i < 3; i++)
        least += n[i] < 0 ? n[i] : 0;
    /* A relative rounding of a few 2^-53 of values below 2^21: 1e-8 steps is far above it. */
    double q = ceil((support - least) * ((double)EBPO_OFFSET_STEPS / EBPO_NORMAL_NORM) + 1e-8) - 1;
    if (!(q < EBPO_OFFSET_STEPS - 1))
        return -1;
    return q < 0 ? 0 : (int)q;
}
