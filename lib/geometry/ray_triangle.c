/* Intersects a ray with a triangle.
 *
 * There are several stages. The fastest stage is tried first. The first stage computes the side of
 * each edge on which the line passes, in floating-point arithmetic with error bounds. The second
 * stage computes t in double-double arithmetic (double_double_kernels.c), which gives nearly all
 * bits of t. Here t is the ray's parameter at the triangle's plane, a fraction. If the result is
 * not certain, expansions are used. If exponents are out of the range of expansions, rational
 * numbers are used (ray_exact.c).
 *
 * Let e_i = corner i - origin, and d the direction. The sign of d . (e_i x e_j) is the side of the
 * edge from corner i to corner j on which the line passes. If one edge has the sign 1 and another
 * edge the sign -1, the line misses the triangle. This is also true for triangles that have no area
 * or whose plane contains d, because the signs depend only on the projection of the triangle along
 * d. If the three signs are equal and not 0, the line passes through the interior. In all other
 * cases the line touches an edge or a corner, or a sign is not certain. */
#include "core/strict_fp.h"

#include <gmp.h>
#include <limits.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "geometry/expansion.h"
#include "geometry/predicates.h"
#include "geometry/ray.h"
#include "geometry/double_double_kernels.h"

/* Stands for a sign that is not certain: of the determinant of direction, corner i and corner i + 1
 * (relative to the origin). */
enum { SIDE_OPEN = 2 };

/* Takes two rounded values. Returns true if the exact value of `a` is certainly less than the exact
 * value of `b`. */
static inline bool certainly_less(double a, double b)
{
    return b - a > 0x1p-50 * (__builtin_fabs(a) + __builtin_fabs(b));
}

static inline void set_miss(ebpo_ray_intersection *out)
{
    *out = (ebpo_ray_intersection){ .t = INFINITY };
}

/* --- expansions: t as a fraction, exact without allocation --- */

/* Ranges. A double x with 2^-172 <= |x| <= 2^225 is a multiple of 2^-225. Products of four such
 * numbers, the differences of these products, and all rounding errors are multiples of 2^-900 and
 * below 2^910. The comparison of two intersections needs products of six numbers. For this, the
 * numbers must be from 2^-97 to 2^150, so that they are multiples of 2^-150. Functions return false
 * or EBPO_SIGN_UNKNOWN for numbers outside of these ranges. */

/* The value numerator / denominator, of two expansions with n and m components. The denominator is
 * not 0. */
typedef struct fraction_of_expansions {
    int n, m;
    double numerator[192], denominator[96];
} fraction_of_expansions;

static bool in_range(const double *x, int n, double least, double largest)
{
    bool ok = true;
    for (int i = 0; i < n; i++)
        ok &= (x[i] == 0) | ((fabs(x[i]) >= least) & (fabs(x[i]) <= largest));
    return ok;
}

static bool all_in_range(const ebpo_segment *ray, const double triangle[3][3], double least,
                         double largest)
{
    return in_range(ray->origin, 3, least, largest) &&
           in_range(ray->direction, 3, least, largest) && in_range(triangle[0], 9, least, largest);
}

/* Returns true if every value is 0 or within the range in which products of four values can be
 * computed exactly. */
static bool ray_in_range(const ebpo_segment *ray, const double triangle[3][3])
{
    return all_in_range(ray, triangle, 0x1p-172, 0x1p225);
}

/* --- fractions --- */

static int fraction_sign(const fraction_of_expansions *f)
{
    return ebpo_expansion_sign(f->numerator, f->n) * ebpo_expansion_sign(f->denominator, f->m);
}

/* Returns the sign of the fraction f minus t, for t >= 0. */
static int fraction_beyond(const fraction_of_expansions *f, double t)
{
    double end[192], rest[384];
    if (t == INFINITY)
        return -1;
    if (!in_range(&t, 1, 0x1p-172, 0x1p225))
        return EBPO_SIGN_UNKNOWN;
    int n = t == 0 ? 0 : ebpo_expansion_scale(end, f->denominator, f->m, t);
    ebpo_expansion_negate(end, n);
    n = ebpo_expansion_sum(rest, f->numerator, f->n, end, n);
    return ebpo_expansion_sign(rest, n) * ebpo_expansion_sign(f->denominator, f->m);
}

/* Returns the two leading components of a compressed expansion. */
static ebpo_pair leading_pair(const double *e, int n)
{
    return (ebpo_pair){ e[n - 1], n > 1 ? e[n - 2] : 0 };
}

static void compress_fraction(fraction_of_expansions *f)
{
    f->n = ebpo_expansion_compress(f->numerator, f->n);
    f->m = ebpo_expansion_compress(f->denominator, f->m);
}

/* Returns the element of `neighbour` that is nearer to the fraction, or, if the fraction is in the
 * middle, the element whose last bit is 0. `neighbour`: two adjacent doubles around the fraction.
 */
static double nearest_neighbour(const fraction_of_expansions *f, const double neighbour[2])
{
    double low[192], high[192], middle[384], rest[576], half = (neighbour[1] - neighbour[0]) / 2;
    int n = ebpo_expansion_scale(low, f->denominator, f->m, neighbour[0]),
        m = ebpo_expansion_scale(high, f->denominator, f->m, half);
    n = ebpo_expansion_sum(middle, low, n, high, m);
    ebpo_expansion_negate(middle, n);
    n = ebpo_expansion_sum(rest, f->numerator, f->n, middle, n);
    int sign = ebpo_expansion_sign(rest, n) * ebpo_expansion_sign(f->denominator, f->m);
    uint64_t bits;
    memcpy(&bits, neighbour, sizeof bits);
    return sign > 0 || (sign == 0 && bits % 2) ? neighbour[1] : neighbour[0];
}

/* Sets *t to the fraction, correctly rounded. The fraction must be positive. Compresses *f, without
 * changing its value. Returns false if the value is out of range. */
static bool fraction_value(fraction_of_expansions *f, double *t)
{
    double out[2];
    compress_fraction(f);
    if (!ebpo_pair_quotient(leading_pair(f->numerator, f->n), leading_pair(f->denominator, f->m),
                            0x1p-102, out) ||
        !in_range(out, 2, 0x1p-172, 0x1p225))
        return false;
    *t = out[0] < out[1] ? nearest_neighbour(f, out) : out[0];
    return true;
}

/* Computes the t at which the line intersects the triangle's plane: normal . (corner - origin) over
 * normal . direction, for input that ray_in_range accepts. Returns false if the line is parallel to
 * the plane. */
static bool plane_fraction(const ebpo_segment *ray, const double triangle[3][3],
                           fraction_of_expansions *out)
{
    ebpo_difference f[3], g[3], e[3];
    double normal[16], up[3][64], down[3][32], two[128];
    int up_n[3], down_n[3];
    for (int k = 0; k < 3; k++) {
        f[k] = ebpo_difference_of(ebpo_two_difference(triangle[1][k], triangle[0][k]));
        g[k] = ebpo_difference_of(ebpo_two_difference(triangle[2][k], triangle[0][k]));
        e[k] = ebpo_difference_of(ebpo_two_difference(triangle[0][k], ray->origin[k]));
    }
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        int n = ebpo_expansion_minor(normal, f[u], g[v], f[v], g[u]);
        double d = ray->direction[k];
        up_n[k] = ebpo_expansion_times(up[k], normal, n, e[k].x, e[k].n);
        down_n[k] = d == 0 ? 0 : ebpo_expansion_scale(down[k], normal, n, d);
    }
    int n = ebpo_expansion_sum(two, up[0], up_n[0], up[1], up_n[1]);
    out->n = ebpo_expansion_sum(out->numerator, two, n, up[2], up_n[2]);
    n = ebpo_expansion_sum(two, down[0], down_n[0], down[1], down_n[1]);
    out->m = ebpo_expansion_sum(out->denominator, two, n, down[2], down_n[2]);
    return out->m > 0;
}

/* --- line and triangle in one plane --- */

/* The positions at which the line enters or leaves the triangle: corners on the line, and crossings
 * with edges. */
typedef struct crossings {
    int count;
    fraction_of_expansions at[3];
} crossings;

typedef struct scene {
    ebpo_difference corner[3][3]; /* relative to the origin */
    const double *direction;
    int axis; /* axis of the direction's largest component */
} scene;

static void make_scene(scene *s, const ebpo_segment *ray, const double triangle[3][3])
{
    s->direction = ray->direction;
    s->axis = 0;
    for (int k = 0; k < 3; k++) {
        if (fabs(ray->direction[k]) > fabs(ray->direction[s->axis]))
            s->axis = k;
        for (int i = 0; i < 3; i++)
            s->corner[i][k] =
                ebpo_difference_of(ebpo_two_difference(triangle[i][k], ray->origin[k]));
    }
}

/* Returns a double as an expansion. */
static ebpo_difference difference_of_double(double x)
{
    return ebpo_difference_of((ebpo_pair){ x, 0 });
}

/* Computes out[i]: coordinate k of the cross product of corner i and the direction, as an expansion
 * of n[i] components. Returns false when all three values are 0. */
static bool offsets_along(const scene *s, int k, double out[3][16], int n[3])
{
    int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
    ebpo_difference du = difference_of_double(s->direction[u]),
                    dv = difference_of_double(s->direction[v]);
    for (int i = 0; i < 3; i++)
        n[i] = ebpo_expansion_minor(out[i], s->corner[i][u], dv, s->corner[i][v], du);
    return n[0] || n[1] || n[2];
}

static void add_corner(crossings *c, const scene *s, int i)
{
    fraction_of_expansions *f = &c->at[c->count++];
    const ebpo_difference *e = &s->corner[i][s->axis];
    f->n = e->n;
    memcpy(f->numerator, e->x, sizeof e->x);
    f->m = 1;
    f->denominator[0] = s->direction[s->axis];
}

/* Adds the crossing of the line with the edge from corner i to corner j. The crossing is at t d =
 * (e_i w_j - e_j w_i) / (w_j - w_i), where e are the corners relative to the origin, and w are the
 * corners' offsets from the line. */
static void add_crossing(crossings *c, const scene *s, double w[3][16], const int *n, int i, int j)
{
    fraction_of_expansions *f = &c->at[c->count++];
    const ebpo_difference *p = &s->corner[i][s->axis], *q = &s->corner[j][s->axis];
    double left[64], right[64], negative[16];
    int left_n = ebpo_expansion_times(left, w[j], n[j], p->x, p->n),
        right_n = ebpo_expansion_times(right, w[i], n[i], q->x, q->n);
    ebpo_expansion_negate(right, right_n);
    f->n = ebpo_expansion_sum(f->numerator, left, left_n, right, right_n);
    memcpy(negative, w[i], sizeof negative);
    ebpo_expansion_negate(negative, n[i]);
    int m = ebpo_expansion_sum(left, w[j], n[j], negative, n[i]);
    f->m = ebpo_expansion_scale(f->denominator, left, m, s->direction[s->axis]);
}

static void find_crossings(crossings *c, const ebpo_segment *ray, const double triangle[3][3])
{
    scene s;
    double w[3][16];
    int n[3], sign[3];
    c->count = 0;
    make_scene(&s, ray, triangle);
    for (int k = 0; k < 3 && !offsets_along(&s, k, w, n); k++)
        ;
    for (int i = 0; i < 3; i++)
        sign[i] = ebpo_expansion_sign(w[i], n[i]);
    for (int i = 0; i < 3; i++) {
        int j = i == 2 ? 0 : i + 1;
        if (sign[i] == 0)
            add_corner(c, &s, i);
        else if (sign[i] * sign[j] < 0)
            add_crossing(c, &s, w, n, i, j);
    }
}

/* Intersects a ray whose line is in one plane with the triangle. The triangle may have no area. The
 * input must satisfy ray_in_range. Returns false if expansions cannot decide. */
static bool intersect_within_plane(const ebpo_segment *ray, const double triangle[3][3],
                                   ebpo_ray_intersection *out)
{
    crossings c;
    bool before_end = false, after_begin = false, before_begin = false;
    double least = INFINITY, t = 0;
    find_crossings(&c, ray, triangle);
    for (int i = 0; i < c.count; i++) {
        int sign = fraction_sign(&c.at[i]), end = fraction_beyond(&c.at[i], ray->t_max);
        if (end == EBPO_SIGN_UNKNOWN || (sign > 0 && !fraction_value(&c.at[i], &t)))
            return false;
        after_begin |= sign >= 0;
        before_begin |= sign <= 0;
        before_end |= end <= 0;
        least = sign > 0 ? fmin(least, t) : least;
    }
    *out = (ebpo_ray_intersection){ .intersects = after_begin && before_end, .t = INFINITY };
    if (out->intersects)
        out->t = before_begin ? 0 : least;
    return true;
}

/* --- comparing --- */

enum { PRODUCT_SPACE = 512 };

/* Computes out = e * f, which has space for PRODUCT_SPACE components; returns false when that is
 * too small. work: space for twice as many, so that the stack need not hold it again. */
static bool multiply_expansions(double *out, int *length, const double *e, int n, const double *f,
                                int m, double *work)
{
    double *sum[2] = { work, work + PRODUCT_SPACE }, term[256];
    int count = 0, now = 0;
    if (2 * n * m > PRODUCT_SPACE || 2 * n > 256)
        return false;
    for (int i = 0; i < m; i++) {
        int term_n = ebpo_expansion_scale(term, e, n, f[i]);
        count = ebpo_expansion_sum(sum[!now], sum[now], count, term, term_n);
        now = !now;
    }
    memcpy(out, sum[now], (size_t)count * sizeof *out);
    *length = count;
    return true;
}

static int compare_fractions(fraction_of_expansions *a, fraction_of_expansions *b)
{
    double left[PRODUCT_SPACE], right[PRODUCT_SPACE], work[2 * PRODUCT_SPACE];
    int left_n, right_n;
    compress_fraction(a);
    compress_fraction(b);
    if (!multiply_expansions(left, &left_n, a->numerator, a->n, b->denominator, b->m, work) ||
        !multiply_expansions(right, &right_n, b->numerator, b->n, a->denominator, a->m, work))
        return EBPO_SIGN_UNKNOWN;
    ebpo_expansion_negate(right, right_n);
    int n = ebpo_expansion_sum(work, left, left_n, right, right_n);
    return ebpo_expansion_sign(work, n) * ebpo_expansion_sign(a->denominator, a->m) *
           ebpo_expansion_sign(b->denominator, b->m);
}

/* Computes the t of the first common point. Returns false if expansions cannot decide. */
static bool first_fraction(const ebpo_segment *ray, const double triangle[3][3],
                           fraction_of_expansions *out)
{
    if (plane_fraction(ray, triangle, out))
        return true;
    crossings c;
    find_crossings(&c, ray, triangle);
    *out = c.at[0];
    for (int i = 1; i < c.count; i++) {
        int sign = compare_fractions(&c.at[i], out);
        if (sign == EBPO_SIGN_UNKNOWN)
            return false;
        if (sign < 0)
            *out = c.at[i];
    }
    if (fraction_sign(out) < 0) /* the ray begins within the triangle */
        out->n = 0;
    return c.count > 0;
}

/* Returns the sign of t(a) - t(b), as ebpo_ray_compare does, or EBPO_SIGN_UNKNOWN. */
static int compare_by_expansions(const ebpo_segment *ray, const double a[3][3],
                                 const double b[3][3])
{
    fraction_of_expansions first, second;
    if (!all_in_range(ray, a, 0x1p-97, 0x1p150) || !in_range(b[0], 9, 0x1p-97, 0x1p150) ||
        !first_fraction(ray, a, &first) || !first_fraction(ray, b, &second))
        return EBPO_SIGN_UNKNOWN;
    return compare_fractions(&first, &second);
}

/* --- the parameter t: double-double arithmetic, then expansions --- */

static inline int bounded_sign(const ebpo_bounded *b)
{
    /* without a branch on the sign, which would often be mispredicted */
    int sign = (b->x.head > b->error) - (b->x.head < -b->error);
    return sign ? sign : SIDE_OPEN;
}

/* t as a fraction, first in double-double arithmetic. Expansions are computed when they are needed.
 */
typedef struct parameter {
    const ebpo_segment *ray;
    const double (*triangle)[3];
    ebpo_plane_pairs at;
    bool made; /* `fraction` is set */
    fraction_of_expansions fraction;
} parameter;

static inline void parameter_begin(parameter *p, const ebpo_segment *ray,
                                   const double triangle[3][3])
{
    p->ray = ray;
    p->triangle = triangle;
    ebpo_ray_pairs_best()->plane(ray, triangle, &p->at);
    p->made = false;
}

static bool make_fraction(parameter *p)
{
    if (!p->made)
        p->made =
            ray_in_range(p->ray, p->triangle) && plane_fraction(p->ray, p->triangle, &p->fraction);
    return p->made;
}

/* Returns the sign of t. `denominator`: sign of the denominator of t. */
static int sign_of_t(parameter *p, int denominator)
{
    int sign = bounded_sign(&p->at.numerator);
    if (sign == SIDE_OPEN)
        sign = -ebpo_orient3d(p->triangle[0], p->triangle[1], p->triangle[2], p->ray->origin);
    return sign * denominator;
}

/* Computes t > 0, correctly rounded. */
static bool value_of_t(parameter *p, double *t)
{
    const double *out = p->at.quotient;
    *t = 0;
    if (p->at.has_quotient && !(out[0] < out[1])) {
        *t = out[0];
        return true;
    }
    return make_fraction(p) && fraction_value(&p->fraction, t);
}

/* Returns the sign of t - t_max, for t and t_max that are close to each other. `denominator`: sign
 * of the denominator of t. */
static int beyond_end(parameter *p, int denominator)
{
    double end = p->ray->t_max;
    const ebpo_bounded *a = &p->at.numerator, *b = &p->at.denominator;
    ebpo_pair at_end = ebpo_pair_multiply(b->x, ebpo_pair_of(end));
    ebpo_bounded rest = { ebpo_pair_subtract(a->x, at_end), 0 };
    rest.error = a->error + end * b->error + 0x1p-97 * (fabs(a->x.head) + fabs(at_end.head)) +
                 EBPO_RAY_SLACK;
    int sign = bounded_sign(&rest);
    if (sign != SIDE_OPEN)
        return sign * denominator;
    return make_fraction(p) ? fraction_beyond(&p->fraction, end) : EBPO_SIGN_UNKNOWN;
}

/* Intersects the ray with a triangle that the ray's line intersects. `side` has the meaning of the
 * member in ebpo_ray_intersection; `sign` is the sign of normal . direction. Returns false if the
 * result is not certain. */
static bool intersect_plane(const ebpo_segment *ray, const double triangle[3][3], int sign,
                            int side, ebpo_ray_intersection *out)
{
    parameter p;
    double t = 0;
    parameter_begin(&p, ray, triangle);
    int from_begin = sign_of_t(&p, sign);
    set_miss(out);
    if (from_begin < 0)
        return true;
    if (from_begin > 0 && !value_of_t(&p, &t))
        return false;
    if (certainly_less(ray->t_max, t))
        return true;
    if (t > 0 && ray->t_max < INFINITY && !certainly_less(t, ray->t_max)) {
        int from_end = beyond_end(&p, sign);
        if (from_end == EBPO_SIGN_UNKNOWN || from_end > 0)
            return from_end != EBPO_SIGN_UNKNOWN;
    }
    *out = (ebpo_ray_intersection){ true, side, -sign, t, 0 };
    return true;
}

/* --- rays close to an edge or a corner --- */

/* Frequent cases are recognised first: a corner at the origin (t = 0), a corner on the line, and an
 * edge through the origin. */

/* Returns true if a x b is exactly 0. The numbers must be in the range of ray_in_range. */
static bool are_parallel(const double a[3], const double b[3])
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
    const double *at; /* position in the model */
    ebpo_pair x[3];
    double head[3];
    bool exact; /* true: the tails of `x` are 0, so `head` is exact */
} corner;

/* Sets a corner in place. (A corner that is returned by value is copied in larger parts than it was
 * stored in, for which processors wait.) */
static inline void set_corner(corner *c, const ebpo_segment *ray, const double p[3])
{
    bool exact = true;
    c->at = p;
    for (int k = 0; k < 3; k++) {
        ebpo_pair x = ebpo_two_difference(p[k], ray->origin[k]);
        c->x[k] = x;
        c->head[k] = x.head;
        exact &= x.tail == 0;
    }
    c->exact = exact;
}

static inline bool is_origin(const corner *c)
{
    return c->head[0] == 0 && c->head[1] == 0 && c->head[2] == 0;
}

/* Returns the exact sign of d . (a x b). The kernel computes d . (a x (b - a)), which has the same
 * value, because fewer digits are lost if the edge is short compared with its distance from the
 * origin. */
static int close_edge_side(const double d[3], const corner *a, const corner *b)
{
    ebpo_pair m[3][3];
    if (a->exact && b->exact && are_parallel(a->head, b->head))
        return 0;
    ebpo_bounded value;
    ebpo_ray_pairs_best()->edge(d, a->x, a->at, b->at, &value);
    int sign = bounded_sign(&value);
    if (sign != SIDE_OPEN)
        return sign;
    for (int k = 0; k < 3; k++) {
        m[k][0] = a->x[k];
        m[k][1] = b->x[k];
        m[k][2] = ebpo_pair_of(d[k]);
    }
    return ebpo_determinant_expansion(m);
}

/* Returns true if the line passes through the corner, exactly. */
static inline bool on_line(const double d[3], const corner *c)
{
    return c->exact && are_parallel(d, c->head);
}

/* Replaces each sign that is SIDE_OPEN by the exact sign. sign[i]: side of the edge from e[i] to
 * the next corner. */
static void close_sides(const double d[3], const corner e[3], int sign[3])
{
    for (int i = 0; i < 3; i++) {
        int before = i == 0 ? 2 : i - 1;
        if (sign[i] == SIDE_OPEN && sign[before] == SIDE_OPEN && on_line(d, &e[i]))
            sign[i] = sign[before] = 0;
    }
    for (int i = 0; i < 3; i++)
        if (sign[i] == SIDE_OPEN)
            sign[i] = close_edge_side(d, &e[i], &e[i == 2 ? 0 : i + 1]);
}

/* Returns ebpo_ray_intersection.part for the exact signs of the three edges: a corner is in two
 * edges. */
static unsigned part_of(const int sign[3])
{
    static const unsigned ends[3] = { 3, 6, 5 };
    unsigned part = 7;
    for (int i = 0; i < 3; i++)
        part &= sign[i] == 0 ? ends[i] : 7;
    return part == 7 ? 0 : part;
}

/* Intersects a ray that passes close to an edge or corner. The known signs must be equal or 0.
 * Returns false if the result is not certain, because numbers are too large or too small. */
static bool intersect_closely(const ebpo_segment *ray, const double triangle[3][3], int sign[3],
                              ebpo_ray_intersection *out)
{
    corner e[3];
    bool begins = false;
    if (!ray_in_range(ray, triangle))
        return false;
    for (int i = 0; i < 3; i++) {
        set_corner(&e[i], ray, triangle[i]);
        begins |= is_origin(&e[i]);
    }
    close_sides(ray->direction, e, sign);
    bool left = sign[0] > 0 || sign[1] > 0 || sign[2] > 0,
         right = sign[0] < 0 || sign[1] < 0 || sign[2] < 0, inner = sign[0] && sign[1] && sign[2];
    int normal = left ? 1 : right ? -1 : 0;
    if (left && right)
        set_miss(out);
    else if (begins)
        *out = (ebpo_ray_intersection){ true, 0, -normal, 0, 0 };
    else if (normal == 0)
        return intersect_within_plane(ray, triangle, out);
    else if (!intersect_plane(ray, triangle, normal, inner ? -normal : 0, out))
        return false;
    if (out->intersects && normal != 0)
        out->part = part_of(sign);
    return true;
}

/* --- shared corners and edges of two triangles --- */

static inline bool is_same(const double p[3], const double q[3])
{
    return p[0] == q[0] && p[1] == q[1] && p[2] == q[2];
}

static bool has_corner(const double triangle[3][3], const double p[3])
{
    bool has = false;
    for (int i = 0; i < 3; i++)
        has |= is_same(triangle[i], p);
    return has;
}

/* Takes two triangles that the ray intersects. Returns true when the ray certainly intersects both
 * in a shared corner or edge, and therefore at the same t. `across`: true if the ray is in neither
 * triangle's plane. */
static bool intersects_shared(const ebpo_segment *ray, const double a[3][3], const double b[3][3],
                              bool across)
{
    corner shared[3];
    int count = 0;
    for (int i = 0; i < 3; i++)
        if (has_corner(b, a[i]))
            set_corner(&shared[count++], ray, a[i]);
    if (count == 0 || !ray_in_range(ray, a))
        return false;
    if (count == 3 && has_corner(a, b[0]) && has_corner(a, b[1]) && has_corner(a, b[2]))
        return true;
    for (int i = 0; i < count; i++)
        if (is_origin(&shared[i]) || (across && on_line(ray->direction, &shared[i])))
            return true;
    return across && count == 2 && close_edge_side(ray->direction, &shared[0], &shared[1]) == 0;
}

/* --- the filter --- */

/* An error bound is a factor times eps times the computed permanent (the sum of the absolute values
 * of all products), plus a term with `slack`, which covers underflow. An overflow makes the bound
 * infinite or NaN; then no comparison with this bound succeeds. */
static const double eps = 0x1p-53;
/* This number is much larger than the sum of all underflow errors (2^-1075 each). It is not a
 * denormal, because arithmetic on denormals is slow. */
static const double slack = 0x1p-960;

/* Returns the sign of d . (a x b), or SIDE_OPEN if the sign is not certain. `a`, `b`: corners minus
 * origin, rounded. `weight`: 1 + |d[0]| + |d[1]| + |d[2]|. */
static inline int filtered_edge_side(const double d[3], double weight, const double a[3],
                                     const double b[3])
{
    double p0 = a[1] * b[2], q0 = a[2] * b[1];
    double p1 = a[2] * b[0], q1 = a[0] * b[2];
    double p2 = a[0] * b[1], q2 = a[1] * b[0];
    double det = d[0] * (p0 - q0) + d[1] * (p1 - q1) + d[2] * (p2 - q2);
    double permanent = fabs(d[0]) * (fabs(p0) + fabs(q0)) + fabs(d[1]) * (fabs(p1) + fabs(q1)) +
                       fabs(d[2]) * (fabs(p2) + fabs(q2));
    double bound = 8 * eps * permanent + slack * weight;
    return det > bound ? 1 : det < -bound ? -1 : SIDE_OPEN;
}

/* Returns true when the coordinates on one axis show that ray and triangle are disjoint. `e`:
 * corners minus origin, rounded; their signs are always correct. */
static bool apart_on_an_axis(const ebpo_segment *ray, double e[3][3])
{
    for (int k = 0; k < 3; k++) {
        bool all_above = e[0][k] > 0 && e[1][k] > 0 && e[2][k] > 0,
             all_below = e[0][k] < 0 && e[1][k] < 0 && e[2][k] < 0;
        if ((all_above && ray->direction[k] <= 0) || (all_below && ray->direction[k] >= 0))
            return true;
    }
    return false;
}

void ebpo_ray_triangle(const ebpo_segment *ray, const double triangle[3][3],
                       ebpo_ray_intersection *out)
{
    const double *d = ray->direction;
    double e[3][3], weight = 1 + fabs(d[0]) + fabs(d[1]) + fabs(d[2]);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            e[i][k] = triangle[i][k] - ray->origin[k];
    int sign[3] = { filtered_edge_side(d, weight, e[0], e[1]),
                    filtered_edge_side(d, weight, e[1], e[2]),
                    filtered_edge_side(d, weight, e[2], e[0]) };
    bool done;
    if (sign[0] + sign[1] == 0 || sign[1] + sign[2] == 0 || sign[2] + sign[0] == 0) {
        set_miss(out);
        return;
    }
    if (sign[0] == sign[1] && sign[1] == sign[2] && sign[0] != SIDE_OPEN) {
        done = intersect_plane(ray, triangle, sign[0], -sign[0], out);
    } else if (apart_on_an_axis(ray, e)) {
        set_miss(out);
        return;
    } else {
        done = intersect_closely(ray, triangle, sign, out);
    }
    if (!done)
        ebpo_ray_triangle_exact(ray, triangle, out);
}

void ebpo_ray_share(const double triangle[3][3], const ebpo_ray_intersection *at,
                    ebpo_ray_shared *out)
{
    out->count = 0;
    for (int i = 0; i < 3; i++)
        if (at->part >> i & 1)
            memcpy(out->corner[out->count++], triangle[i], sizeof triangle[i]);
    out->t = at->t;
}

/* Returns a bit (1 << i) for each corner of the triangle that is a corner of the shared part; 0 if
 * the triangle does not have all corners of this part. */
static unsigned shared_corners(const ebpo_ray_shared *shared, const double triangle[3][3])
{
    unsigned corners = 0;
    for (unsigned n = 0; n < shared->count; n++) {
        unsigned same = 0;
        for (int i = 0; i < 3; i++)
            same |= (unsigned)is_same(triangle[i], shared->corner[n]) << i;
        if (!same)
            return 0;
        corners |= same;
    }
    return corners;
}

bool ebpo_ray_shares(const ebpo_segment *ray, const ebpo_ray_shared *shared,
                     const double triangle[3][3], ebpo_ray_intersection *out)
{
    const double *d = ray->direction;
    double e[3][3], weight = 1 + fabs(d[0]) + fabs(d[1]) + fabs(d[2]);
    unsigned part = shared_corners(shared, triangle);
    int facing = 0;
    if (!part)
        return false;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            e[i][k] = triangle[i][k] - ray->origin[k];
    for (int i = 0; i < 3; i++) {
        int next = i == 2 ? 0 : i + 1;
        unsigned ends = 1u << i | 1u << next;
        /* The line intersects edges that contain the shared part, so the sign of their side is 0.
         * The other edges have one sign, as the line intersects the triangle. */
        if (shared->count == 1 ? ends & part : ends == part)
            continue;
        int sign = filtered_edge_side(d, weight, e[i], e[next]);
        if (sign == SIDE_OPEN)
            return false;
        facing = -sign;
    }
    *out = (ebpo_ray_intersection){ true, 0, facing, shared->t, part };
    return facing != 0;
}

void ebpo_ray_interior(const ebpo_segment *ray, const double triangle[3][3], int facing,
                       ebpo_ray_intersection *out)
{
    if (!intersect_plane(ray, triangle, -facing, facing, out))
        ebpo_ray_triangle_exact(ray, triangle, out);
}

unsigned ebpo_ray_interior_four(const ebpo_ray_four *four, double t[4])
{
    ebpo_plane_four at;
    unsigned done = 0;
    ebpo_ray_pairs_best()->four_planes(four, &at);
    for (int i = 0; i < 4; i++) {
        double numerator = -four->facing[i] * at.numerator[i], t_max = four->t_max[i];
        t[i] = at.least[i];
        if (numerator > at.numerator_error[i] &&
            ebpo_pair_quotient_in_range(at.rounded[i], at.error[i]) &&
            at.least[i] == at.greatest[i] && (t_max == INFINITY || certainly_less(t[i], t_max)))
            done |= 1u << i;
    }
    return done;
}

int ebpo_ray_compare(const ebpo_segment *ray, const double a[3][3],
                     const ebpo_ray_intersection *at_a, const double b[3][3],
                     const ebpo_ray_intersection *at_b)
{
    if (certainly_less(at_a->t, at_b->t))
        return -1;
    if (certainly_less(at_b->t, at_a->t))
        return 1;
    if (intersects_shared(ray, a, b, at_a->facing && at_b->facing))
        return 0;
    int order = compare_by_expansions(ray, a, b);
    return order != EBPO_SIGN_UNKNOWN ? order : ebpo_ray_compare_exact(ray, a, b);
}
