/* What happens often is recognised: a corner at the origin (t = 0), a corner on the line, an edge
 * through the origin, a shared corner or edge. The rest goes through double-double arithmetic
 * (ray_pairs.h), then expansions. */
#include "core/strict_fp.h"

#include "geometry/ray_close.h"

#include <string.h>

#include "geometry/double_double.h"
#include "geometry/predicates.h"
#include "geometry/predicates_expansion.h"
#include "geometry/ray_expansion.h"
#include "geometry/ray_pairs.h"

/* --- the parameter --- */

static inline int sign_of(const ebpo_bounded *b)
{
    return b->x.head > b->error ? 1 : b->x.head < -b->error ? -1 : EBPO_SIDE_OPEN;
}

/* t as a fraction, at first in double-double arithmetic, and as expansions when these are needed.
 */
typedef struct parameter {
    const ebpo_segment *ray;
    const double (*triangle)[3];
    ebpo_plane_pairs at;
    bool made; /* the fraction is there */
    ebpo_fraction fraction;
} parameter;

static inline void begin(parameter *p, const ebpo_segment *ray, const double triangle[3][3])
{
    p->ray = ray;
    p->triangle = triangle;
    ebpo_ray_pairs_best()->plane(ray, triangle, &p->at);
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
    int sign = sign_of(&p->at.numerator);
    if (sign == EBPO_SIDE_OPEN)
        sign = -ebpo_orient3d(p->triangle[0], p->triangle[1], p->triangle[2], p->ray->origin);
    return sign * denominator;
}

/* t > 0, correctly rounded. */
static bool value_of_t(parameter *p, double *t)
{
    const double *out = p->at.quotient;
    *t = 0;
    if (p->at.has_quotient && !(out[0] < out[1])) {
        *t = out[0];
        return true;
    }
    return make_fraction(p) && ebpo_fraction_value(&p->fraction, t);
}

/* Sign of t - t_max, which are close; that of the denominator is known. */
static int beyond_end(parameter *p, int denominator)
{
    double end = p->ray->t_max;
    const ebpo_bounded *a = &p->at.numerator, *b = &p->at.denominator;
    ebpo_pair at_end = ebpo_pair_multiply(b->x, ebpo_pair_of(end));
    ebpo_bounded rest = { ebpo_pair_subtract(a->x, at_end), 0 };
    rest.error = a->error + end * b->error + 0x1p-97 * (fabs(a->x.head) + fabs(at_end.head)) +
                 EBPO_RAY_SLACK;
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
    const double *at; /* in the model */
    ebpo_pair x[3];
    double head[3];
    bool exact; /* no tails */
} corner;

static corner corner_at(const ebpo_segment *ray, const double p[3])
{
    corner c = { .at = p, .exact = true };
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

/* Sign of d . (a x b), exact. The same with b - a in place of b, which loses less where the edge is
 * short beside its distance from the origin. */
static int edge_side(const double d[3], const corner *a, const corner *b)
{
    ebpo_pair m[3][3];
    if (a->exact && b->exact && parallel(a->head, b->head))
        return 0;
    ebpo_bounded value;
    ebpo_ray_pairs_best()->edge(d, a->x, a->at, b->at, &value);
    int sign = sign_of(&value);
    if (sign != EBPO_SIDE_OPEN)
        return sign;
    for (int k = 0; k < 3; k++) {
        m[k][0] = a->x[k];
        m[k][1] = b->x[k];
        m[k][2] = ebpo_pair_of(d[k]);
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
