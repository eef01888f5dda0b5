#include "core/strict_fp.h"

#include "extras/haptic/passive.h"

#include <math.h>

static double product(const double *a, const double *b, int n)
{
    double sum = 0;
    for (int i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

void ebpo_passive_moved(ebpo_passive *p, const double *force, const double *moved, int n)
{
    p->given += product(force, moved, n);
    p->step_most = fmax(p->step_most, sqrt(product(moved, moved, n)));
}

/* So that what is given in sum, `given`, never exceeds A = stiffness s^2, s being the longest step
 * that the hand ever made in a tick. With g = -given, a step of s' gives at most F s', and F s' - g
 * must not exceed stiffness max(s, s')^2. That is so for all s' where F^2 <= 4 stiffness g; and
 * where F <= 2 stiffness s and F s - g <= A, as from s on the right side then grows faster than the
 * left one. A spring that was pressed steadily to the depth d has F = stiffness d and g at least
 * stiffness d^2 / 2: there the one or the other holds, and nothing is taken off. */
static double most_force(const ebpo_passive *p)
{
    double k = p->stiffness, g = -p->given, s = p->step_most;
    double by_step = s > 0 ? fmin(2 * k * s, k * s + g / s) : 0;
    double by_store = g > 0 ? 2 * sqrt(k * g) : 0;
    return fmax(fmax(by_step, by_store) * (1 - 0x1p-40), 0);
}

void ebpo_passive_push(const ebpo_passive *p, double damping, const double *depth,
                       const double *moved, int n, double *force)
{
    for (int i = 0; i < n; i++)
        force[i] = p->stiffness * depth[i] - damping * moved[i];
    double into = product(force, depth, n), square = product(depth, depth, n);
    if (into < 0 && square > 0) /* what pulls towards the faces is taken out */
        for (int i = 0; i < n; i++)
            force[i] -= into / square * depth[i];
    double length = sqrt(product(force, force, n)), most = most_force(p);
    if (length > most)
        for (int i = 0; i < n; i++)
            force[i] *= most / length;
}
