#include "core/strict_fp.h"

#include "query/ray_search.h"

#include <math.h>
#include <string.h>

#include "geometry/double_double.h"

/* Origins farther from the box than this many times its reach are moved towards it. */
static const double near_enough = 4;
/* Stands for infinity: finite, so that products with 0 are numbers. */
#define BEYOND 0x1p100f

/* --- limits --- */

/* t in the frame, from the moved origin; `sign` 1: not less than the true one, -1: not greater. */
static float frame_t(const ebpo_ray_search *r, double t, int sign)
{
    double scaled = t * r->limit_scale;
    if (!(r->limit_scale > 0 && r->limit_scale < INFINITY && scaled < (double)BEYOND))
        return sign > 0 || t == INFINITY ? BEYOND : -1;
    double rest = scaled - r->moved + sign * (0x1p-50 * (scaled + r->moved) + 0x1p-90);
    return (float)(rest + sign * fabs(rest) * 0x1p-22);
}

static void lower_bound(ebpo_ray_search *r)
{
    float bound = frame_t(r, r->limit, 1);
    r->bound = bound < r->bound ? bound : r->bound;
}

/* --- the ray in the frame --- */

/* Not fmax, which is a call. */
static inline double greater(double a, double b) { return a > b ? a : b; }

/* A direction whose longest coordinate is out of the ordinary is scaled by a power of two. That
 * takes the processor a while before anything else can begin: most directions are left as they are.
 */
static void scale_direction(ebpo_ray_search *r, double longest)
{
    int exponent;
    frexp(longest, &exponent);
    for (int k = 0; k < 3; k++)
        r->direction[k] = ldexp(r->ray->direction[k], -exponent);
    r->limit_scale = ldexp(r->s->scale, exponent);
}

/* Returns the greatest size of a coordinate of the origin. */
static double to_frame(ebpo_ray_search *r)
{
    const ebpo_accel *s = r->s;
    double longest = 0, most = 0;
    for (int k = 0; k < 3; k++) {
        r->direction[k] = r->ray->direction[k];
        longest = greater(longest, fabs(r->direction[k]));
        r->from[k] = r->ray->origin[k];
        r->origin[k] = (r->ray->origin[k] - s->centre[k]) * s->scale;
        most = greater(most, fabs(r->origin[k]));
    }
    r->limit_scale = s->scale;
    if (!(longest >= 0x1p-12 && longest <= 0x1p12))
        scale_direction(r, longest);
    r->moved = 0;
    return most;
}

/* Where the ray comes to the cube of `reach` around all faces, somewhat before; false: nowhere.
 * Rounding is far below what the cube is widened by as long as the origin is not so far away that
 * the ray is blurred to the cube's size; then it stays where it is. */
static bool entry(const ebpo_ray_search *r, double reach, double *t)
{
    double from = 0, to = INFINITY;
    for (int k = 0; k < 3; k++) {
        double wall = 2 * reach * (r->direction[k] < 0 ? -1 : 1);
        if (r->direction[k] == 0) {
            if (fabs(r->origin[k]) > 2 * reach)
                return false;
            continue;
        }
        from = fmax(from, (-wall - r->origin[k]) / r->direction[k]);
        to = fmin(to, (wall - r->origin[k]) / r->direction[k]);
    }
    *t = from;
    return from <= to;
}

/* The origin goes along in double-double arithmetic: where the ray comes from hardly matters. */
static bool move_origin(ebpo_ray_search *r, double *most)
{
    const ebpo_accel *s = r->s;
    double t;
    if (!entry(r, s->reach, &t))
        return false;
    r->moved = t;
    *most = 0;
    for (int k = 0; k < 3; k++) {
        ebpo_pair from = ebpo_two_difference(r->ray->origin[k], s->centre[k]),
                  step = ebpo_two_product(t, r->direction[k]);
        from = (ebpo_pair){ from.head * s->scale, from.tail * s->scale };
        r->origin[k] = ebpo_pair_add(from, step).head;
        *most = greater(*most, fabs(r->origin[k]));
        r->from[k] = s->centre[k] + r->origin[k] / s->scale;
    }
    return true;
}

/* How far off the origin may be, in the frame: moved, brought into the frame, back into the model's
 * unit, and split into floats there; and what replacing a small direction does.
 * docs/develop/bounds.md, "A ray against boxes". */
static void set_error(ebpo_ray_search *r, double most)
{
    const double *c = r->s->centre;
    double unit = (fabs(c[0]) + fabs(c[1]) + fabs(c[2])) * r->s->scale;
    r->error = 0x1p-45 * (most + unit) + 0x1p-55 * r->s->reach + 0x1p-53;
    r->blur = most < 0x1p30 ? (float)(r->error * 0x1p23 + 0x1p-30) : INFINITY;
    if (most < 0x1p80)
        return;
    r->error = (double)BEYOND; /* all boxes are open */
    memset(r->origin, 0, sizeof r->origin);
}

/* --- candidates --- */

/* The nearest first, where that may spare others. */
static void judge(ebpo_ray_search *r)
{
    while (r->count && !r->done) {
        int first = 0;
        for (int i = 1; i < r->count && r->wants == EBPO_WANTS_FIRST; i++)
            first = r->waiting[i].low < r->waiting[first].low ? i : first;
        ebpo_ray_candidate c = r->waiting[first];
        r->waiting[first] = r->waiting[--r->count];
        if (c.low > r->bound)
            continue;
        double before = r->limit;
        r->decide(r, c.slot, c.facing);
        if (r->limit < before)
            lower_bound(r);
    }
    r->count = 0;
}

void ebpo_ray_search_accel(ebpo_ray_search *r, const ebpo_kernels *kernels, const ebpo_accel *s)
{
    r->s = s;
    r->judge = judge;
    r->count = 0;
    r->done = r->met = false;
    if (s->bound_count == 0)
        return;
    double most = to_frame(r);
    if (!(most <= near_enough * s->reach) && most < 0x1p46 * s->reach && !move_origin(r, &most))
        return;
    set_error(r, most);
    r->surely = frame_t(r, r->ray->t_max, -1);
    r->bound = BEYOND;
    lower_bound(r);
    kernels->ray(r);
    if (r->count)
        judge(r);
}
