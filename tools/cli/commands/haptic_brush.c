#include "cli/commands/haptic_brush.h"

void haptic_rotate(const double q[4], const double v[3], double out[3])
{
    const double t[3] = { 2 * (q[1] * v[2] - q[2] * v[1]), 2 * (q[2] * v[0] - q[0] * v[2]),
                          2 * (q[0] * v[1] - q[1] * v[0]) };
    out[0] = v[0] + q[3] * t[0] + q[1] * t[2] - q[2] * t[1];
    out[1] = v[1] + q[3] * t[1] + q[2] * t[0] - q[0] * t[2];
    out[2] = v[2] + q[3] * t[2] + q[0] * t[1] - q[1] * t[0];
}

/* Sets `out` to the position of a point of the tool. Returns its height above the plane of the
 * contact. */
static double place_point(const haptic_sample *s, const double point[3], double out[3])
{
    double height = 0;
    haptic_rotate(s->rotation, point, out);
    for (int k = 0; k < 3; k++) {
        out[k] += s->proxy[k];
        height += (out[k] - s->touch[k]) * s->normal[k];
    }
    return height;
}

int haptic_brush_pressed(const double (*points)[3], uint64_t count, const haptic_sample *sample,
                         double near, double out[HAPTIC_BRUSH_MAX][3])
{
    double at[3], limit = sample->depth + near;
    uint64_t pressed = 0, seen = 0;
    int n = 0;
    for (uint64_t i = 0; i < count; i++)
        pressed += place_point(sample, points[i], at) <= limit;
    for (uint64_t i = 0; i < count && n < HAPTIC_BRUSH_MAX; i++)
        if (place_point(sample, points[i], out[n]) <= limit &&
            seen++ * HAPTIC_BRUSH_MAX >= (uint64_t)n * pressed)
            n++;
    return n;
}
