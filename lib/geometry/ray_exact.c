/* Intersects rays with triangles in rational numbers. This is exact for all finite doubles, and
 * slow. It is the last stage of ray_triangle.c.
 *
 * Corners relative to the origin are converted to integers e_i in one unit, and the direction to
 * integers d in another unit. For the edge from corner j to corner k, opposite corner i, let s_i =
 * d . (e_j x e_k). The line intersects the plane at t = e_0 . (e_1 x e_2) / (s_0 + s_1 + s_2). The
 * line intersects the triangle if no s_i is positive or no s_i is negative. If the denominator is
 * 0, the line is parallel to the triangle, or the triangle has no area. In both cases, the line and
 * the triangle can have common points only if all s_i are 0. If all s_i are 0, the line and the
 * triangle are in one plane. */
#include "core/strict_fp.h"

#include <float.h>
#include <gmp.h>
#include <limits.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "geometry/ray.h"

typedef struct integer_scene {
    mpz_t corner[3][3]; /* e_i */
    mpz_t direction[3];
    int shift; /* t is 2^shift times the parameter that is computed from the integers */
} integer_scene;

/* The intersection of the line and the triangle: an interval of the parameter. The ends are
 * computed from the integers of integer_scene, and clip_stretch converts them to the unit of t. */
typedef struct stretch {
    bool any; /* false: no common point, and the other members are unused */
    int side, facing;
    mpq_t low, high; /* ends of the interval */
} stretch;

/* --- integers --- */

/* Lowers *unit so that each of the n numbers x is an integer times 2^unit. */
static void lower_unit(int *unit, const double *x, int n)
{
    for (int i = 0; i < n; i++) {
        int e;
        frexp(x[i], &e);
        if (x[i] != 0 && e - DBL_MANT_DIG < *unit)
            *unit = e - DBL_MANT_DIG;
    }
}

/* Computes out = x / 2^unit. */
static void set_integer(mpz_t out, double x, int unit)
{
    int e;
    mpz_set_d(out, ldexp(frexp(x, &e), DBL_MANT_DIG));
    if (x != 0)
        mpz_mul_2exp(out, out, (mp_bitcnt_t)(e - DBL_MANT_DIG - unit));
}

static void scene_init(integer_scene *s, const ebpo_segment *ray, const double triangle[3][3])
{
    int length_unit = INT_MAX, direction_unit = INT_MAX;
    mpz_t origin;
    mpz_init(origin);
    lower_unit(&length_unit, ray->origin, 3);
    lower_unit(&direction_unit, ray->direction, 3);
    for (int i = 0; i < 3; i++)
        lower_unit(&length_unit, triangle[i], 3);
    if (length_unit == INT_MAX)
        length_unit = 0;
    for (int k = 0; k < 3; k++) {
        mpz_init(s->direction[k]);
        set_integer(s->direction[k], ray->direction[k], direction_unit);
        set_integer(origin, ray->origin[k], length_unit);
        for (int i = 0; i < 3; i++) {
            mpz_init(s->corner[i][k]);
            set_integer(s->corner[i][k], triangle[i][k], length_unit);
            mpz_sub(s->corner[i][k], s->corner[i][k], origin);
        }
    }
    s->shift = length_unit - direction_unit;
    mpz_clear(origin);
}

static void scene_clear(integer_scene *s)
{
    for (int k = 0; k < 3; k++) {
        mpz_clear(s->direction[k]);
        for (int i = 0; i < 3; i++)
            mpz_clear(s->corner[i][k]);
    }
}

/* Computes out = component k of a x b. */
static void cross_component(mpz_t out, const mpz_t a[3], const mpz_t b[3], int k)
{
    int u = (k + 1) % 3, v = (k + 2) % 3;
    mpz_mul(out, a[u], b[v]);
    mpz_submul(out, a[v], b[u]);
}

/* Computes out = a . (b x c). */
static void integer_determinant(mpz_t out, const mpz_t a[3], const mpz_t b[3], const mpz_t c[3])
{
    mpz_t component;
    mpz_init(component);
    mpz_set_ui(out, 0);
    for (int k = 0; k < 3; k++) {
        cross_component(component, b, c, k);
        mpz_addmul(out, a[k], component);
    }
    mpz_clear(component);
}

static void set_fraction(mpq_t out, const mpz_t numerator, const mpz_t denominator)
{
    mpz_set(mpq_numref(out), numerator);
    mpz_set(mpq_denref(out), denominator);
    mpq_canonicalize(out);
}

/* --- the line and the triangle --- */

/* Returns the axis with the direction's largest component. The parameter of a point on the line is
 * computed from its coordinate on this axis. */
static int main_axis(const integer_scene *s)
{
    int axis = 0;
    for (int k = 1; k < 3; k++)
        if (mpz_cmpabs(s->direction[k], s->direction[axis]) > 0)
            axis = k;
    return axis;
}

/* Extends the interval by a value of the parameter. */
static void stretch_add(stretch *st, const mpz_t numerator, const mpz_t denominator)
{
    mpq_t t;
    mpq_init(t);
    set_fraction(t, numerator, denominator);
    if (!st->any || mpq_cmp(t, st->low) < 0)
        mpq_set(st->low, t);
    if (!st->any || mpq_cmp(t, st->high) > 0)
        mpq_set(st->high, t);
    st->any = true;
    mpq_clear(t);
}

/* Computes out[i]: the signed distance of corner i from the line, times a factor that is the same
 * for all corners. The line and the triangle must be in one plane. */
static void offsets_from_line(const integer_scene *s, mpz_t out[3])
{
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 3; i++)
            cross_component(out[i], s->corner[i], s->direction, k);
        if (mpz_sgn(out[0]) || mpz_sgn(out[1]) || mpz_sgn(out[2]))
            return;
    }
}

/* Adds the crossing of the line with the edge from corner i to corner j. The crossing is at t d =
 * (e_i w_j - e_j w_i) / (w_j - w_i), where w are the corners' offsets from the line. */
static void add_edge_crossing(stretch *st, const integer_scene *s, int axis, mpz_t w[3], int i,
                              int j)
{
    mpz_t numerator, denominator;
    mpz_inits(numerator, denominator, NULL);
    mpz_mul(numerator, s->corner[i][axis], w[j]);
    mpz_submul(numerator, s->corner[j][axis], w[i]);
    mpz_sub(denominator, w[j], w[i]);
    mpz_mul(denominator, denominator, s->direction[axis]);
    stretch_add(st, numerator, denominator);
    mpz_clears(numerator, denominator, NULL);
}

/* Intersects a line and a triangle in one plane. */
static void intersect_in_plane(stretch *st, const integer_scene *s)
{
    int axis = main_axis(s);
    mpz_t w[3];
    mpz_inits(w[0], w[1], w[2], NULL);
    offsets_from_line(s, w);
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3;
        if (mpz_sgn(w[i]) == 0)
            stretch_add(st, s->corner[i][axis], s->direction[axis]);
        else if (mpz_sgn(w[i]) * mpz_sgn(w[j]) < 0)
            add_edge_crossing(st, s, axis, w, i, j);
    }
    mpz_clears(w[0], w[1], w[2], NULL);
}

static void intersect_line(stretch *st, const integer_scene *s)
{
    mpz_t edge[3], denominator, numerator;
    int sign[3], negative = 0, positive = 0;
    mpz_inits(denominator, numerator, NULL);
    for (int i = 0; i < 3; i++) {
        mpz_init(edge[i]);
        integer_determinant(edge[i], s->direction, s->corner[(i + 1) % 3], s->corner[(i + 2) % 3]);
        mpz_add(denominator, denominator, edge[i]);
        sign[i] = mpz_sgn(edge[i]);
        negative += sign[i] < 0;
        positive += sign[i] > 0;
    }
    if (negative + positive == 0)
        intersect_in_plane(st, s);
    else if (negative == 0 || positive == 0) {
        integer_determinant(numerator, s->corner[0], s->corner[1], s->corner[2]);
        stretch_add(st, numerator, denominator);
        st->facing = negative ? 1 : -1;
        st->side = negative == 3 || positive == 3 ? st->facing : 0;
    }
    mpz_clears(edge[0], edge[1], edge[2], denominator, numerator, NULL);
}

/* --- the parameter --- */

static void scale_parameter(mpq_t t, int shift)
{
    if (shift >= 0)
        mpq_mul_2exp(t, t, (mp_bitcnt_t)shift);
    else
        mpq_div_2exp(t, t, (mp_bitcnt_t)-shift);
}

/* Converts the interval to the unit of t, and restricts it to 0 <= t <= t_max. */
static void clip_stretch(stretch *st, int shift, double t_max)
{
    if (!st->any)
        return;
    scale_parameter(st->low, shift);
    scale_parameter(st->high, shift);
    st->any = mpq_sgn(st->high) >= 0;
    if (mpq_sgn(st->low) < 0)
        mpq_set_ui(st->low, 0, 1);
    if (st->any && t_max < INFINITY) {
        mpq_t end;
        mpq_init(end);
        mpq_set_d(end, t_max);
        st->any = mpq_cmp(st->low, end) <= 0;
        mpq_clear(end);
    }
}

static void intersect_ray(stretch *st, const ebpo_segment *ray, const double triangle[3][3])
{
    integer_scene s;
    st->any = false;
    st->side = st->facing = 0;
    mpq_inits(st->low, st->high, NULL);
    scene_init(&s, ray, triangle);
    intersect_line(st, &s);
    clip_stretch(st, s.shift, ray->t_max);
    scene_clear(&s);
}

static void stretch_clear(stretch *st) { mpq_clears(st->low, st->high, NULL); }

/* Rounds t >= 0 to the nearest double. (mpq_get_d truncates.) */
static double round_fraction(const mpq_t t)
{
    double low = mpq_get_d(t), high = nextafter(low, INFINITY);
    if (low == INFINITY)
        return low;
    mpq_t middle, half;
    mpq_inits(middle, half, NULL);
    mpq_set_d(middle, low);
    mpq_set_d(half, high < INFINITY ? high - low : low - nextafter(low, 0));
    mpq_div_2exp(half, half, 1);
    mpq_add(middle, middle, half);
    int sign = mpq_cmp(t, middle);
    uint64_t bits;
    memcpy(&bits, &low, sizeof bits);
    mpq_clears(middle, half, NULL);
    return sign > 0 || (sign == 0 && bits % 2) ? high : low;
}

void ebpo_ray_triangle_exact(const ebpo_segment *ray, const double triangle[3][3],
                             ebpo_ray_intersection *out)
{
    stretch st;
    intersect_ray(&st, ray, triangle);
    out->intersects = st.any;
    out->side = st.any ? st.side : 0;
    out->facing = st.any ? st.facing : 0;
    out->t = st.any ? round_fraction(st.low) : INFINITY;
    out->part = 0;
    stretch_clear(&st);
}

int ebpo_ray_compare_exact(const ebpo_segment *ray, const double a[3][3], const double b[3][3])
{
    stretch first, second;
    intersect_ray(&first, ray, a);
    intersect_ray(&second, ray, b);
    int order = mpq_cmp(first.low, second.low);
    stretch_clear(&first);
    stretch_clear(&second);
    return (order > 0) - (order < 0);
}
