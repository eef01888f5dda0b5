/* Bounds from a nearest pair of points that need not be the nearest: proof in
 * docs/develop/collision.md. All is seen from A's first corner, so that where the faces lie does
 * not matter. */
#include "core/strict_fp.h"

#include "extras/collide/pair_distance.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "geometry/triangle_pair.h"

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
    int feature[2];
    double room; /* of the points: from where their features end, as a part of the reach */
} search;

static void offer(search *s, int first, const double p[3], const double q[3], int on_p, int on_q,
                  double room)
{
    double d[3];
    subtract(p, q, d);
    double square = dot(d, d);
    if (!(square < s->square))
        return;
    s->square = square;
    memcpy(s->point[first], p, sizeof s->point[0]);
    memcpy(s->point[!first], q, sizeof s->point[0]);
    s->feature[first] = on_p;
    s->feature[!first] = on_q;
    s->room = room;
}

/* --- edges with edges --- */

static void along(const double from[3], const double edge[3], double t, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = from[k] + t * edge[k];
}

static int on_edge(int i, double t) { return t == 0 ? i : t == 1 ? (i + 1) % 3 : 3 + i; }

/* From the nearer end, in length; ends are what they are. */
static double room_on_edge(double t, double square)
{
    return t == 0 || t == 1 ? INFINITY : fmin(t, 1 - t) * sqrt(square);
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
    bool edges = on_e > 0 && on_e < 1 && on_f > 0 && on_f < 1;
    double room = fmin(room_on_edge(on_e, ee), room_on_edge(on_f, ff));
    offer(s, 0, x, y, on_edge(i, on_e), on_edge(j, on_f),
          edges && !(area > 0x1p-20 * ee * ff) ? 0 : room);
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
    double least = fmin(fmin(on_e, on_f), 1 - on_e - on_f), ee = dot(e, e), ff = dot(f, f);
    offer(s, of, corner, foot, i, 6, nn > 0x1p-20 * ee * ff ? least * sqrt(nn / fmax(ee, ff)) : 0);
}

/* --- bounds --- */

static bool see_from_corner(const double a[3][3], const double b[3][3], search *s)
{
    s->reach = 0;
    s->square = INFINITY;
    s->room = 0;
    memset(s->point, 0, sizeof s->point);
    memset(s->feature, 0, sizeof s->feature);
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

/* --- features --- */

static bool is_on(int corner, int feature)
{
    return feature == 6 || corner == feature ||
           (feature >= 3 && (corner == feature - 3 || corner == (feature - 2) % 3));
}

/* Whether n from A's point to B's has all corners that the points' features do not have strictly
 * behind it, and ahead of it, by more than n and the points may be off: docs/develop/collision.md,
 * "Which features are nearest". */
static bool features_certain(const search *s, const double n[3])
{
    const double enough = 0x1p-24;
    if (!(s->room > enough * s->reach))
        return false;
    for (int of = 0; of < 2; of++)
        for (int i = 0; i < 3; i++) {
            double d[3];
            subtract(s->face[of][i], s->point[of], d);
            double ahead = of ? dot(n, d) : -dot(n, d);
            if (!is_on(i, s->feature[of]) && !(ahead > enough * s->reach * s->reach))
                return false;
        }
    return true;
}

/* Corners of the feature, in an order of their own. */
static bool same_feature(const double a[3][3], int on_a, const double b[3][3], int on_b)
{
    int count = on_a < 3 ? 1 : on_a < 6 ? 2 : 3, most = on_b < 3 ? 1 : on_b < 6 ? 2 : 3;
    if (count != most)
        return false;
    for (int i = 0; i < 3; i++) {
        bool found = !is_on(i, on_a);
        for (int j = 0; j < 3 && !found; j++)
            found =
                is_on(j, on_b) && a[i][0] == b[j][0] && a[i][1] == b[j][1] && a[i][2] == b[j][2];
        if (!found)
            return false;
    }
    return true;
}

/* Both lie across one axis, each all at one coordinate, and one is over the other: they are as far
 * apart as these two. */
static bool level_faces(const double a[3][3], const double b[3][3], double level[2])
{
    for (int k = 0; k < 3; k++) {
        double p[3][3], q[3][3];
        level[0] = a[0][k];
        level[1] = b[0][k];
        if (a[1][k] != level[0] || a[2][k] != level[0] || b[1][k] != level[1] ||
            b[2][k] != level[1])
            continue;
        memcpy(p, a, sizeof p);
        memcpy(q, b, sizeof q);
        for (int i = 0; i < 3; i++)
            p[i][k] = q[i][k] = 0;
        return ebpo_triangle_pair((const double(*)[3])p, (const double(*)[3])q) != EBPO_PAIR_APART;
    }
    return false;
}

static bool same_levels(const double a[3][3], const double b[3][3], const double c[3][3],
                        const double d[3][3])
{
    double ab[2], cd[2];
    return level_faces(a, b, ab) && level_faces(c, d, cd) &&
           ((ab[0] == cd[0] && ab[1] == cd[1]) || (ab[0] == cd[1] && ab[1] == cd[0]));
}

bool ebpo_same_distance(const double a[3][3], const double b[3][3],
                        const ebpo_pair_distance_bounds *ab, const double c[3][3],
                        const double d[3][3], const ebpo_pair_distance_bounds *cd)
{
    return (ab->certain && cd->certain && same_feature(a, ab->feature[0], c, cd->feature[0]) &&
            same_feature(b, ab->feature[1], d, cd->feature[1])) ||
           same_levels(a, b, c, d);
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
        out->certain = out->lo > 0 && features_certain(&s, n);
    }
    memcpy(out->feature, s.feature, sizeof out->feature);
    for (int of = 0; of < 2; of++)
        for (int k = 0; k < 3; k++)
            out->point[of][k] = a[0][k] + s.point[of][k];
}
