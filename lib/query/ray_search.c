#include "geom/strict_fp.h"

#include "query/ray_search.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "geom/double_double.h"

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

typedef struct framed {
    double origin[3], direction[3];
    double inverse[3]; /* of the direction, small coordinates replaced */
    double most;       /* no coordinate of the origin is greater */
} framed;

/* Not fmax, which is a call. */
static inline double greater(double a, double b) { return a > b ? a : b; }

/* x times 2^-exponent is from .5 to 1; x > 0. What frexp and ldexp do, without calls where that is
 * a product by a normal number: *factor, or 0. */
static inline int exponent_of(double x, double *factor)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    int exponent = (int)(bits >> 52);
    *factor = 0;
    if (exponent == 0 || exponent > 2040) {
        frexp(x, &exponent);
        return exponent;
    }
    bits = (uint64_t)(2045 - exponent) << 52;
    memcpy(factor, &bits, sizeof bits);
    return exponent - 1022;
}

/* The direction is scaled by a power of two to a longest coordinate of .5 to 1. */
static framed to_frame(ebpo_ray_search *r)
{
    const ebpo_accel *s = r->s;
    framed f;
    double longest = 0;
    f.most = 0;
    for (int k = 0; k < 3; k++)
        longest = greater(longest, fabs(r->ray->direction[k]));
    double factor;
    int exponent = exponent_of(longest, &factor);
    for (int k = 0; k < 3; k++) {
        r->from[k] = r->ray->origin[k];
        f.origin[k] = (r->ray->origin[k] - s->centre[k]) * s->scale;
        f.direction[k] =
            factor > 0 ? r->ray->direction[k] * factor : ldexp(r->ray->direction[k], -exponent);
        f.most = greater(f.most, fabs(f.origin[k]));
    }
    r->limit_scale = factor > 0 ? s->scale / factor : ldexp(s->scale, exponent);
    r->moved = 0;
    return f;
}

/* Where the ray comes to the cube of `reach` around all faces, somewhat before; false: nowhere.
 * Rounding is far below what the cube is widened by as long as the origin is not so far away that
 * the ray is blurred to the cube's size; then it stays where it is. */
static bool entry(const framed *f, double reach, double *t)
{
    double from = 0, to = INFINITY;
    for (int k = 0; k < 3; k++) {
        double wall = 2 * reach * (f->direction[k] < 0 ? -1 : 1);
        if (f->direction[k] == 0) {
            if (fabs(f->origin[k]) > 2 * reach)
                return false;
            continue;
        }
        from = fmax(from, (-wall - f->origin[k]) / f->direction[k]);
        to = fmin(to, (wall - f->origin[k]) / f->direction[k]);
    }
    *t = from;
    return from <= to;
}

/* The origin goes along in double-double arithmetic: where the ray comes from hardly matters. */
static bool move_origin(ebpo_ray_search *r, framed *f)
{
    const ebpo_accel *s = r->s;
    double t;
    if (f->most <= near_enough * s->reach || !(f->most < 0x1p46 * s->reach))
        return true;
    if (!entry(f, s->reach, &t))
        return false;
    r->moved = t;
    f->most = 0;
    for (int k = 0; k < 3; k++) {
        ebpo_pair from = ebpo_two_difference(r->ray->origin[k], s->centre[k]),
                  step = ebpo_two_product(t, f->direction[k]);
        from = (ebpo_pair){ from.head * s->scale, from.tail * s->scale };
        f->origin[k] = ebpo_pair_add(from, step).head;
        f->most = greater(f->most, fabs(f->origin[k]));
        r->from[k] = s->centre[k] + f->origin[k] / s->scale;
    }
    return true;
}

/* How far off the origin may be, in the frame: moved, brought into the frame, back into the model's
 * unit, and split into floats there; and what replacing a small direction does. */
static double origin_error(const ebpo_ray_search *r, const framed *f)
{
    double unit = 0;
    for (int k = 0; k < 3; k++)
        unit = greater(unit, fabs(r->from[k]) + fabs(r->s->centre[k]));
    return 0x1p-50 * f->most + 0x1p-98 * r->moved + 0x1p-46 * (unit * r->s->scale) +
           0x1p-57 * (f->most + r->s->reach) + 0x1p-53;
}

static void set_boxes(ebpo_ray_search *r, framed *f, double error)
{
    bool blind = !(f->most < 0x1p80);
    for (int k = 0; k < 3; k++) {
        double d = f->direction[k], origin = blind ? 0 : f->origin[k],
               slack = blind ? (double)BEYOND : fabs(origin) * 0x1p-21 + error;
        double ahead = copysign(slack, d);
        f->inverse[k] = 1 / copysign(greater(fabs(d), 0x1p-60), d);
        r->inverse[k] = (float)f->inverse[k];
        r->step_inverse[k + 1] = r->inverse[k];
        r->near_from[k] = (float)(origin + ahead);
        r->far_from[k] = (float)(origin - ahead);
        /* No branch: half of them would be mispredicted. */
        unsigned low = (unsigned)(offsetof(ebpo_bound, low) + (size_t)k * 8),
                 high = (unsigned)(offsetof(ebpo_bound, high) + (size_t)k * 8),
                 turn = (low ^ high) & (0 - (unsigned)(signbit(d) != 0));
        r->near_at[k] = low ^ turn;
        r->far_at[k] = high ^ turn;
    }
    r->near_from[3] = r->far_from[3] = r->inverse[3] = r->step_inverse[0] = 0;
}

static void set_faces(ebpo_ray_search *r, const framed *f, double error)
{
    const double *d = f->direction;
    int z = fabs(d[1]) > fabs(d[0]);
    z = fabs(d[2]) > greater(fabs(d[0]), fabs(d[1])) ? 2 : z;
    r->axis[2] = z;
    r->axis[0] = z == 2 ? 0 : z + 1;
    r->axis[1] = z == 0 ? 2 : z - 1;
    for (int i = 0; i < 2; i++)
        r->shear[i] = (float)(d[r->axis[i]] * f->inverse[z]);
    r->shear[2] = (float)f->inverse[z];
    for (int k = 0; k < 3; k++) {
        r->from_high[k] = (float)r->from[k];
        r->from_low[k] = (float)(r->from[k] - (double)r->from_high[k]);
    }
    r->blur = f->most < 0x1p30 ? (float)(error * 0x1p23 + 0x1p-30) : INFINITY;
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
    framed f = to_frame(r);
    if (!move_origin(r, &f))
        return;
    double error = origin_error(r, &f);
    set_boxes(r, &f, error);
    set_faces(r, &f, error);
    r->surely = frame_t(r, r->ray->t_max, -1);
    r->bound = BEYOND;
    lower_bound(r);
    kernels->ray(r);
    judge(r);
}
