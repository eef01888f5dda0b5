/* What happens often is recognised: a corner at the origin (t = 0), a corner on the line, an edge
 * through the origin, a shared corner or edge. The rest goes through double-double arithmetic, then
 * expansions.
 *
 * Error bounds: as in predicates.c; each holds for the computed permanent (the sum of absolute
 * values), the slack covers underflow, and an overflow makes the bound infinite or not a number, so
 * that no comparison succeeds. */
#include "geom/strict_fp.h"

#include "geom/ray_close.h"

#include <string.h>

#include "geom/double_double.h"
#include "geom/predicates.h"
#include "geom/predicates_expansion.h"
#include "geom/ray_expansion.h"

/* Far above every underflow error (2^-1075 each), and normal: arithmetic on denormals is slow. */
static const double slack = 0x1p-960;

/* --- the parameter --- */

/* A normal and the sum of absolute values behind each component. */
typedef struct plane_normal {
    ebpo_pair x[3];
    double permanent[3];
} plane_normal;

static inline plane_normal cross(const ebpo_pair f[3], const ebpo_pair g[3])
{
    plane_normal n;
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        ebpo_pair p = ebpo_pair_multiply(f[u], g[v]), q = ebpo_pair_multiply(f[v], g[u]);
        n.x[k] = ebpo_pair_subtract(p, q);
        n.permanent[k] = fabs(p.head) + fabs(q.head);
    }
    return n;
}

/* A value, at most `error` off. */
typedef struct bounded {
    ebpo_pair x;
    double error;
} bounded;

/* n . y. Errors: some 12 * 2^-106 of the permanent in n, 12 more in products and sums; 2^-97 leaves
 * a margin. */
static inline bounded dot(const plane_normal *n, const ebpo_pair y[3])
{
    ebpo_pair first = ebpo_pair_multiply(n->x[0], y[0]), second = ebpo_pair_multiply(n->x[1], y[1]);
    bounded out = { ebpo_pair_add(ebpo_pair_add(first, second), ebpo_pair_multiply(n->x[2], y[2])),
                    0 };
    double a = fabs(y[0].head), b = fabs(y[1].head), c = fabs(y[2].head);
    double permanent = n->permanent[0] * a + n->permanent[1] * b + n->permanent[2] * c;
    out.error = 0x1p-97 * permanent + slack * (1 + a + b + c);
    return out;
}

static inline int sign_of(const bounded *b)
{
    return b->x.head > b->error ? 1 : b->x.head < -b->error ? -1 : EBPO_SIDE_OPEN;
}

/* t as a fraction, at first in double-double arithmetic, and as expansions when these are needed.
 */
typedef struct parameter {
    const ebpo_segment *ray;
    const double (*triangle)[3];
    bounded numerator, denominator;
    bool made; /* the fraction is there */
    ebpo_fraction fraction;
} parameter;

static inline void begin(parameter *p, const ebpo_segment *ray, const double triangle[3][3])
{
    ebpo_pair f[3], g[3], to_plane[3], d[3];
    for (int k = 0; k < 3; k++) {
        f[k] = ebpo_two_difference(triangle[1][k], triangle[0][k]);
        g[k] = ebpo_two_difference(triangle[2][k], triangle[0][k]);
        to_plane[k] = ebpo_two_difference(triangle[0][k], ray->origin[k]);
        d[k] = ebpo_pair_of(ray->direction[k]);
    }
    plane_normal n = cross(f, g);
    p->ray = ray;
    p->triangle = triangle;
    p->numerator = dot(&n, to_plane);
    p->denominator = dot(&n, d);
    p->made = false;
}

static bool make_fraction(parameter *p)
{
    if (!p->made)
        p->made = ebpo_ray_in_range(p->ray, p->triangle) &&
                  ebpo_plane_fraction(p->ray, p->triangle, &p->fraction);
    return p->made;
}

/* Sign of t; that of the denominator is known. */
static int sign_of_t(parameter *p, int denominator)
{
    int sign = sign_of(&p->numerator);
    if (sign == EBPO_SIDE_OPEN)
        sign = -ebpo_orient3d(p->triangle[0], p->triangle[1], p->triangle[2], p->ray->origin);
    return sign * denominator;
}

/* t > 0, correctly rounded. */
static bool value_of_t(parameter *p, double *t)
{
    const bounded *a = &p->numerator, *b = &p->denominator;
    double out[2], error = a->error / fabs(a->x.head) + b->error / fabs(b->x.head);
    *t = 0;
    if (ebpo_pair_quotient(a->x, b->x, error, out) && !(out[0] < out[1])) {
        *t = out[0];
        return true;
    }
    return make_fraction(p) && ebpo_fraction_value(&p->fraction, t);
}

/* Sign of t - t_max, which are close; that of the denominator is known. */
static int beyond_end(parameter *p, int denominator)
{
    double end = p->ray->t_max;
    ebpo_pair at_end = ebpo_pair_multiply(p->denominator.x, ebpo_pair_of(end));
    bounded rest = { ebpo_pair_subtract(p->numerator.x, at_end), 0 };
    rest.error = p->numerator.error + end * p->denominator.error +
                 0x1p-97 * (fabs(p->numerator.x.head) + fabs(at_end.head)) + slack;
    int sign = sign_of(&rest);
    if (sign != EBPO_SIDE_OPEN)
        return sign * denominator;
    return make_fraction(p) ? ebpo_fraction_beyond(&p->fraction, end) : EBPO_SIGN_UNKNOWN;
}

static inline void set_miss(ebpo_ray_meeting *out)
{
    *out = (ebpo_ray_meeting){ false, 0, 0, INFINITY };
}

bool ebpo_ray_meet_plane(const ebpo_segment *ray, const double triangle[3][3], int sign, int side,
                         ebpo_ray_meeting *out)
{
    parameter p;
    double t = 0;
    begin(&p, ray, triangle);
    int from_begin = sign_of_t(&p, sign);
    set_miss(out);
    if (from_begin < 0)
        return true;
    if (from_begin > 0 && !value_of_t(&p, &t))
        return false;
    if (ebpo_certainly_less(ray->t_max, t))
        return true;
    if (t > 0 && ray->t_max < INFINITY && !ebpo_certainly_less(t, ray->t_max)) {
        int from_end = beyond_end(&p, sign);
        if (from_end == EBPO_SIGN_UNKNOWN || from_end > 0)
            return from_end != EBPO_SIGN_UNKNOWN;
    }
    *out = (ebpo_ray_meeting){ true, side, -sign, t };
    return true;
}

/* --- the sides of edges --- */

/* a x b = 0, exact, for numbers in range. */
static bool parallel(const double a[3], const double b[3])
{
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        ebpo_pair p = ebpo_two_product(a[u], b[v]), q = ebpo_two_product(a[v], b[u]);
        if (p.head != q.head || p.tail != q.tail)
            return false;
    }
    return true;
}

/* A corner relative to the ray's origin. */
typedef struct corner {
    ebpo_pair x[3];
    double head[3];
    bool exact; /* no tails */
} corner;

static corner corner_at(const ebpo_segment *ray, const double p[3])
{
    corner c = { .exact = true };
    for (int k = 0; k < 3; k++) {
        c.x[k] = ebpo_two_difference(p[k], ray->origin[k]);
        c.head[k] = c.x[k].head;
        c.exact &= c.x[k].tail == 0;
    }
    return c;
}

static inline bool is_origin(const corner *c)
{
    return c->head[0] == 0 && c->head[1] == 0 && c->head[2] == 0;
}

/* Sign of d . (a x b), exact. */
static int edge_side(const double d[3], const corner *a, const corner *b)
{
    ebpo_pair direction[3], m[3][3];
    if (a->exact && b->exact && parallel(a->head, b->head))
        return 0;
    for (int k = 0; k < 3; k++)
        direction[k] = ebpo_pair_of(d[k]);
    plane_normal n = cross(a->x, b->x);
    bounded value = dot(&n, direction);
    int sign = sign_of(&value);
    if (sign != EBPO_SIDE_OPEN)
        return sign;
    for (int k = 0; k < 3; k++) {
        m[k][0] = a->x[k];
        m[k][1] = b->x[k];
        m[k][2] = direction[k];
    }
    return ebpo_determinant_expansion(m);
}

/* The line goes through the corner, exact. */
static inline bool on_line(const double d[3], const corner *c)
{
    return c->exact && parallel(d, c->head);
}

static void close_sides(const double d[3], const corner e[3], int sign[3])
{
    for (int i = 0; i < 3; i++) {
        int before = i == 0 ? 2 : i - 1;
        if (sign[i] == EBPO_SIDE_OPEN && sign[before] == EBPO_SIDE_OPEN && on_line(d, &e[i]))
            sign[i] = sign[before] = 0;
    }
    for (int i = 0; i < 3; i++)
        if (sign[i] == EBPO_SIDE_OPEN)
            sign[i] = edge_side(d, &e[i], &e[i == 2 ? 0 : i + 1]);
}

bool ebpo_ray_close(const ebpo_segment *ray, const double triangle[3][3], int sign[3],
                    ebpo_ray_meeting *out)
{
    corner e[3];
    bool begins = false;
    if (!ebpo_ray_in_range(ray, triangle))
        return false;
    for (int i = 0; i < 3; i++) {
        e[i] = corner_at(ray, triangle[i]);
        begins |= is_origin(&e[i]);
    }
    close_sides(ray->direction, e, sign);
    bool left = sign[0] > 0 || sign[1] > 0 || sign[2] > 0,
         right = sign[0] < 0 || sign[1] < 0 || sign[2] < 0, inner = sign[0] && sign[1] && sign[2];
    int normal = left ? 1 : right ? -1 : 0;
    if (left && right)
        set_miss(out);
    else if (begins)
        *out = (ebpo_ray_meeting){ true, 0, -normal, 0 };
    else if (normal == 0)
        return ebpo_ray_within_plane(ray, triangle, out);
    else
        return ebpo_ray_meet_plane(ray, triangle, normal, inner ? -normal : 0, out);
    return true;
}

/* --- what two triangles share --- */

static bool has_corner(const double triangle[3][3], const double p[3])
{
    bool has = false;
    for (int i = 0; i < 3; i++)
        has |= triangle[i][0] == p[0] && triangle[i][1] == p[1] && triangle[i][2] == p[2];
    return has;
}

bool ebpo_ray_meets_shared(const ebpo_segment *ray, const double a[3][3], const double b[3][3],
                           bool across)
{
    corner shared[3];
    int count = 0;
    for (int i = 0; i < 3; i++)
        if (has_corner(b, a[i]))
            shared[count++] = corner_at(ray, a[i]);
    if (count == 0 || !ebpo_ray_in_range(ray, a))
        return false;
    if (count == 3 && has_corner(a, b[0]) && has_corner(a, b[1]) && has_corner(a, b[2]))
        return true;
    for (int i = 0; i < count; i++)
        if (is_origin(&shared[i]) || (across && on_line(ray->direction, &shared[i])))
            return true;
    return across && count == 2 && edge_side(ray->direction, &shared[0], &shared[1]) == 0;
}
