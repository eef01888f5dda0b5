/* Bounds from a nearest pair of points that need not be the nearest: proof in
 * docs/develop/collision.md. All is seen from A's first corner, so that where the faces lie does
 * not matter. */
#include "geom/strict_fp.h"

#include "pair/pair_distance.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

static const double most_reach = 0x1p200, least_reach = 0x1p-200;

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void subtract(const double a[3], const double b[3], double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = a[k] - b[k];
}

static void cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static double within_unit(double t) { return t > 0 ? (t < 1 ? t : 1) : 0; }

/* The best pair of points so far, of the two faces as seen from A's first corner. */
typedef struct search {
    double face[2][3][3];
    double reach; /* 1-norms of corners are at most that */
    double square, point[2][3];
} search;

static void offer(search *s, int first, const double p[3], const double q[3])
{
    double d[3];
    subtract(p, q, d);
    double square = dot(d, d);
    if (!(square < s->square))
        return;
    s->square = square;
    memcpy(s->point[first], p, sizeof s->point[0]);
    memcpy(s->point[!first], q, sizeof s->point[0]);
}

/* --- edges with edges --- */

static void along(const double from[3], const double edge[3], double t, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = from[k] + t * edge[k];
}

static void offer_edges(search *s, int i, int j)
{
    const double *p = s->face[0][i], *q = s->face[1][j];
    double e[3], f[3], w[3], x[3], y[3];
    subtract(s->face[0][i == 2 ? 0 : i + 1], p, e);
    subtract(s->face[1][j == 2 ? 0 : j + 1], q, f);
    subtract(p, q, w);
    double ee = dot(e, e), ff = dot(f, f), ef = dot(e, f), ew = dot(e, w), fw = dot(f, w);
    double area = ee * ff - ef * ef;
    double on_e = area > 0 ? within_unit((ef * fw - ff * ew) / area) : 0;
    double on_f = ff > 0 ? within_unit((on_e * ef + fw) / ff) : 0;
    on_e = ee > 0 ? within_unit((on_f * ef - ew) / ee) : 0;
    along(p, e, on_e, x);
    along(q, f, on_f, y);
    offer(s, 0, x, y);
}

/* --- corners with planes --- */

/* Only corners that lie over the inner part matter: the rest is the edges'. */
static void offer_corner(search *s, int of, int i)
{
    double(*plane)[3] = s->face[!of];
    const double *corner = s->face[of][i];
    double e[3], f[3], n[3], d[3], c[3], foot[3];
    subtract(plane[1], plane[0], e);
    subtract(plane[2], plane[0], f);
    subtract(corner, plane[0], d);
    cross(e, f, n);
    double nn = dot(n, n);
    cross(d, f, c);
    double on_e = dot(c, n) / nn;
    cross(e, d, c);
    double on_f = dot(c, n) / nn;
    if (!(on_e >= 0 && on_f >= 0 && on_e + on_f <= 1))
        return;
    for (int k = 0; k < 3; k++)
        foot[k] = plane[0][k] + (on_e * e[k] + on_f * f[k]);
    offer(s, of, corner, foot);
}

/* --- bounds --- */

static bool see_from_corner(const double a[3][3], const double b[3][3], search *s)
{
    s->reach = 0;
    s->square = INFINITY;
    memset(s->point, 0, sizeof s->point);
    for (int i = 0; i < 3; i++) {
        subtract(a[i], a[0], s->face[0][i]);
        subtract(b[i], a[0], s->face[1][i]);
        for (int of = 0; of < 2; of++) {
            const double *x = s->face[of][i];
            s->reach = fmax(s->reach, fabs(x[0]) + fabs(x[1]) + fabs(x[2]));
        }
    }
    return s->reach < most_reach && s->reach > least_reach;
}

/* The gap between the faces along n, which is not 0, less what rounding may have added. */
static double gap_along(const search *s, const double n[3])
{
    double least = INFINITY, most = -INFINITY, d[3];
    for (int i = 0; i < 3; i++) {
        subtract(s->face[1][i], s->point[0], d);
        least = fmin(least, dot(n, d));
        subtract(s->face[0][i], s->point[0], d);
        most = fmax(most, dot(n, d));
    }
    double size = fabs(n[0]) + fabs(n[1]) + fabs(n[2]);
    return (least - most - 0x1p-48 * size * s->reach) / sqrt(dot(n, n));
}

void ebpo_triangles_distance_bounds(const double a[3][3], const double b[3][3],
                                    ebpo_pair_distance_bounds *out)
{
    search s;
    *out = (ebpo_pair_distance_bounds){ .hi = INFINITY };
    memcpy(out->point[0], a[0], sizeof out->point[0]);
    memcpy(out->point[1], b[0], sizeof out->point[1]);
    if (!see_from_corner(a, b, &s))
        return;
    for (int i = 0; i < 9; i++)
        offer_edges(&s, i / 3, i % 3);
    for (int i = 0; i < 6; i++)
        offer_corner(&s, i / 3, i % 3);
    double n[3], margin = 0x1p-47 * s.reach;
    subtract(s.point[1], s.point[0], n);
    double distance = sqrt(s.square);
    out->hi = distance + margin;
    if (distance > margin) {
        double gap = gap_along(&s, n);
        out->lo = gap > 0 ? gap * (1 - 0x1p-50) : 0;
    }
    for (int of = 0; of < 2; of++)
        for (int k = 0; k < 3; k++)
            out->point[of][k] = a[0][k] + s.point[of][k];
}
