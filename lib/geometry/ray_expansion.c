/* Ranges. A double x with 2^-172 <= |x| <= 2^225 is a multiple of 2^-225; products of four such
 * numbers, their differences and rounding errors are multiples of 2^-900 and below 2^910. Comparing
 * two hits takes products of six, so numbers from 2^-97 to 2^150, which are multiples of 2^-150. */
#include "core/strict_fp.h"

#include "geometry/ray_expansion.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "geometry/double_double.h"
#include "geometry/predicates_expansion.h"

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

bool ebpo_ray_in_range(const ebpo_segment *ray, const double triangle[3][3])
{
    return all_in_range(ray, triangle, 0x1p-172, 0x1p225);
}

/* --- fractions --- */

int ebpo_fraction_sign(const ebpo_fraction *f)
{
    return ebpo_expansion_sign(f->numerator, f->n) * ebpo_expansion_sign(f->denominator, f->m);
}

int ebpo_fraction_beyond(const ebpo_fraction *f, double t)
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

/* The two leading components of what is compressed. */
static ebpo_pair leading(const double *e, int n)
{
    return (ebpo_pair){ e[n - 1], n > 1 ? e[n - 2] : 0 };
}

static void compress(ebpo_fraction *f)
{
    f->n = ebpo_expansion_compress(f->numerator, f->n);
    f->m = ebpo_expansion_compress(f->denominator, f->m);
}

/* Of two neighbours the one that the fraction is closer to, or the even one. */
static double nearest(const ebpo_fraction *f, const double neighbour[2])
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

bool ebpo_fraction_value(ebpo_fraction *f, double *t)
{
    double out[2];
    compress(f);
    if (!ebpo_pair_quotient(leading(f->numerator, f->n), leading(f->denominator, f->m), 0x1p-102,
                            out) ||
        !in_range(out, 2, 0x1p-172, 0x1p225))
        return false;
    *t = out[0] < out[1] ? nearest(f, out) : out[0];
    return true;
}

bool ebpo_plane_fraction(const ebpo_segment *ray, const double triangle[3][3], ebpo_fraction *out)
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

/* Places at which the line leaves or enters the triangle: at corners that it passes through, and
 * where it crosses edges. */
typedef struct crossings {
    int count;
    ebpo_fraction at[3];
} crossings;

typedef struct scene {
    ebpo_difference corner[3][3]; /* relative to the origin */
    const double *direction;
    int axis; /* of the direction's largest component */
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

/* A double as an expansion. */
static ebpo_difference alone(double x) { return ebpo_difference_of((ebpo_pair){ x, 0 }); }

/* out[i] = component k of corner i x direction, n[i] components; false when all are 0. */
static bool offsets_along(const scene *s, int k, double out[3][16], int n[3])
{
    int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
    ebpo_difference du = alone(s->direction[u]), dv = alone(s->direction[v]);
    for (int i = 0; i < 3; i++)
        n[i] = ebpo_expansion_minor(out[i], s->corner[i][u], dv, s->corner[i][v], du);
    return n[0] || n[1] || n[2];
}

static void add_corner(crossings *c, const scene *s, int i)
{
    ebpo_fraction *f = &c->at[c->count++];
    const ebpo_difference *e = &s->corner[i][s->axis];
    f->n = e->n;
    memcpy(f->numerator, e->x, sizeof e->x);
    f->m = 1;
    f->denominator[0] = s->direction[s->axis];
}

/* The edge from corner i to j crosses the line at (e_i w_j - e_j w_i) / (w_j - w_i) = t d, w being
 * the offsets. */
static void add_crossing(crossings *c, const scene *s, double w[3][16], const int *n, int i, int j)
{
    ebpo_fraction *f = &c->at[c->count++];
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

bool ebpo_ray_within_plane(const ebpo_segment *ray, const double triangle[3][3],
                           ebpo_ray_meeting *out)
{
    crossings c;
    bool before_end = false, after_begin = false, before_begin = false;
    double least = INFINITY, t = 0;
    find_crossings(&c, ray, triangle);
    for (int i = 0; i < c.count; i++) {
        int sign = ebpo_fraction_sign(&c.at[i]), end = ebpo_fraction_beyond(&c.at[i], ray->t_max);
        if (end == EBPO_SIGN_UNKNOWN || (sign > 0 && !ebpo_fraction_value(&c.at[i], &t)))
            return false;
        after_begin |= sign >= 0;
        before_begin |= sign <= 0;
        before_end |= end <= 0;
        least = sign > 0 ? fmin(least, t) : least;
    }
    *out = (ebpo_ray_meeting){ after_begin && before_end, 0, 0, INFINITY };
    if (out->meets)
        out->t = before_begin ? 0 : least;
    return true;
}

/* --- comparing --- */

/* out = e * f; false when there is no room for it. */
static bool multiply(double *out, int *length, const double *e, int n, const double *f, int m,
                     int room)
{
    double sum[2][512], term[256];
    int count = 0, now = 0;
    if (2 * n * m > room || room > 512 || 2 * n > 256)
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

static int compare_fractions(ebpo_fraction *a, ebpo_fraction *b)
{
    double left[512], right[512], rest[1024];
    int left_n, right_n;
    compress(a);
    compress(b);
    if (!multiply(left, &left_n, a->numerator, a->n, b->denominator, b->m, 512) ||
        !multiply(right, &right_n, b->numerator, b->n, a->denominator, a->m, 512))
        return EBPO_SIGN_UNKNOWN;
    ebpo_expansion_negate(right, right_n);
    int n = ebpo_expansion_sum(rest, left, left_n, right, right_n);
    return ebpo_expansion_sign(rest, n) * ebpo_expansion_sign(a->denominator, a->m) *
           ebpo_expansion_sign(b->denominator, b->m);
}

/* The t of the first common point; false: not known. */
static bool first_fraction(const ebpo_segment *ray, const double triangle[3][3], ebpo_fraction *out)
{
    if (ebpo_plane_fraction(ray, triangle, out))
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
    if (ebpo_fraction_sign(out) < 0) /* the ray begins within */
        out->n = 0;
    return c.count > 0;
}

int ebpo_ray_compare_expansion(const ebpo_segment *ray, const double a[3][3], const double b[3][3])
{
    ebpo_fraction first, second;
    if (!all_in_range(ray, a, 0x1p-97, 0x1p150) || !in_range(b[0], 9, 0x1p-97, 0x1p150) ||
        !first_fraction(ray, a, &first) || !first_fraction(ray, b, &second))
        return EBPO_SIGN_UNKNOWN;
    return compare_fractions(&first, &second);
}
