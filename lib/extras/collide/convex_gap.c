#include "core/strict_fp.h"

#include "extras/collide/convex_gap.h"

#include <math.h>

#include "geometry/length.h"

static double dot(const double x[3], const double y[3])
{
    return (x[0] * y[0] + x[1] * y[1]) + x[2] * y[2];
}

static void middle_of(const ebpo_convex *c, double out[3])
{
    for (int k = 0; k < 3; k++) {
        double sum = 0;
        for (int i = 0; i < c->count; i++)
            sum += c->point[i][k];
        out[k] = sum / c->count;
    }
}

/* The point that is farthest along a direction, or (sign -1) against it. */
static const double *farthest(const ebpo_convex *c, const double n[3], double sign)
{
    int best = 0;
    double most = -INFINITY;
    for (int i = 0; i < c->count; i++) {
        double at = sign * dot(c->point[i], n);
        if (at > most) {
            most = at;
            best = i;
        }
    }
    return c->point[best];
}

/* So many directions are tried; those that are nearly in contact would take more. */
enum { DIRECTIONS = 32 };

/* Of all differences of points of B and of A, `v` is one near the origin: the line from there to
 * the difference that is farthest back along v comes nearer (Gilbert 1966). Any v bounds the
 * distance: all differences are at least as far along it as that one. */
double ebpo_convex_gap(const ebpo_convex *a, const ebpo_convex *b, double enough)
{
    double v[3], w[3], from[3], best = 0;
    middle_of(a, from);
    middle_of(b, v);
    for (int k = 0; k < 3; k++)
        v[k] -= from[k];
    for (int turn = 0; turn < DIRECTIONS; turn++) {
        double length2 = dot(v, v), along, step2 = 0, back = 0;
        if (!(length2 > 0x1p-900 && length2 < 0x1p900)) /* squares are not what they should be */
            break;
        const double *p = farthest(a, v, 1), *q = farthest(b, v, -1);
        for (int k = 0; k < 3; k++)
            w[k] = q[k] - p[k];
        along = dot(v, w) / sqrt(length2);
        best = along > best ? along : best;
        if (best > enough)
            break;
        for (int k = 0; k < 3; k++) {
            back += v[k] * (v[k] - w[k]);
            step2 += (v[k] - w[k]) * (v[k] - w[k]);
        }
        if (!(back > 0x1p-40 * length2))
            break;
        double share = back < step2 ? back / step2 : 1;
        for (int k = 0; k < 3; k++)
            v[k] += share * (w[k] - v[k]);
    }
    return best;
}

double ebpo_convex_span(const ebpo_convex *a, const ebpo_convex *b)
{
    double most = 0;
    for (int i = 0; i < a->count; i++)
        for (int j = 0; j < b->count; j++)
            most = fmax(most, ebpo_length_between(a->point[i], b->point[j]));
    return most * (1 + 0x1p-40);
}
