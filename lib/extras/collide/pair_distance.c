/* Computes the distance of two triangles: bounds in doubles, and exact comparisons.
 *
 * To compute bounds, one point of each face is found. These two points are the nearest points
 * except for rounding. Their distance is an upper bound. The gap of the faces along the line
 * through both points is a lower bound. All coordinates are relative to A's first corner, so that
 * rounding does not depend on the position of the faces. If bounds do not decide a comparison, the
 * squared distance is computed as a fraction of integers. The squared distance of two faces is the
 * least of the squared distances of a corner from the other face, and of two edges whose nearest
 * points are not ends. See docs/develop/collision.md, "Distance of two faces". All functions are
 * pure and can be called from any thread; results do not depend on compilers and their flags. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "extras/collide/face_pairs.h"
#include "geometry/distance.h"
#include "geometry/integer_vectors.h"
#include "geometry/triangle_pair.h"
#include "geometry/vec3.h"

/* The range of 1-norms for which squares neither overflow nor underflow. */
static const double max_norm = 0x1p200, least_norm = 0x1p-200;

/* Limits t to 0 .. 1; NaN becomes 0. */
static double within_unit(double t) { return t > 0 ? (t < 1 ? t : 1) : 0; }

/* The nearest pair of points so far. Coordinates are relative to A's first corner. */
typedef struct search {
    double face[2][3][3];       /* corners of A and B */
    double norm;                /* upper bound of the corners' 1-norms */
    double square, point[2][3]; /* the points of A and B, and their squared distance */
    int feature[2];             /* features of the points, as in ebpo_pair_distance_bounds */
    double space; /* least distance of the points from the borders of their features: the ends of an
                   * edge or the edges of a face; INFINITY for corners, which are exact; 0 if it is
                   * not known */
} search;

/* Keeps the points p and q if they are nearer than the pair so far. first: face of p, 0 for A or 1
 * for B; q is a point of the other face. on_p, on_q: features of p and q. space: as in `search`. */
static void offer_points(search *s, int first, const double p[3], const double q[3], int on_p,
                         int on_q, double space)
{
    double d[3];
    ebpo_vec3_subtract(p, q, d);
    double square = ebpo_vec3_dot(d, d);
    if (!(square < s->square))
        return;
    s->square = square;
    memcpy(s->point[first], p, sizeof s->point[0]);
    memcpy(s->point[!first], q, sizeof s->point[0]);
    s->feature[first] = on_p;
    s->feature[!first] = on_q;
    s->space = space;
}

/* --- edges with edges --- */

/* Computes the point at the fraction t of an edge, which begins at `from`. */
static void point_along(const double from[3], const double edge[3], double t, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = from[k] + t * edge[k];
}

/* Returns the feature of the point at the fraction t of edge i. */
static int on_edge(int i, double t) { return t == 0 ? i : t == 1 ? (i + 1) % 3 : 3 + i; }

/* Returns the distance of the point at the fraction t of an edge from the nearer end of the edge.
 * At an end, returns INFINITY, because ends are exact. square: the edge's squared length. */
static double space_on_edge(double t, double square)
{
    return t == 0 || t == 1 ? INFINITY : fmin(t, 1 - t) * sqrt(square);
}

/* Offers the nearest points of edge i of A and edge j of B. */
static void offer_edges(search *s, int i, int j)
{
    const double *p = s->face[0][i], *q = s->face[1][j];
    double e[3], f[3], w[3], x[3], y[3];
    ebpo_vec3_subtract(s->face[0][i == 2 ? 0 : i + 1], p, e);
    ebpo_vec3_subtract(s->face[1][j == 2 ? 0 : j + 1], q, f);
    ebpo_vec3_subtract(p, q, w);
    double ee = ebpo_vec3_dot(e, e), ff = ebpo_vec3_dot(f, f), ef = ebpo_vec3_dot(e, f),
           ew = ebpo_vec3_dot(e, w), fw = ebpo_vec3_dot(f, w);
    double area = ee * ff - ef * ef;
    double on_e = area > 0 ? within_unit((ef * fw - ff * ew) / area) : 0;
    double on_f = ff > 0 ? within_unit((on_e * ef + fw) / ff) : 0;
    on_e = ee > 0 ? within_unit((on_f * ef - ew) / ee) : 0;
    point_along(p, e, on_e, x);
    point_along(q, f, on_f, y);
    bool no_ends = on_e > 0 && on_e < 1 && on_f > 0 && on_f < 1;
    double space = fmin(space_on_edge(on_e, ee), space_on_edge(on_f, ff));
    if (no_ends && !(area > 0x1p-20 * ee * ff)) /* the edges are almost parallel */
        space = 0;
    offer_points(s, 0, x, y, on_edge(i, on_e), on_edge(j, on_f), space);
}

/* --- corners with planes --- */

/* Offers corner i of face `which` and its nearest point on the other face, if this nearest point is
 * in the other face's interior. If the nearest point is on an edge, the pairs of edges include this
 * pair of points. */
static void offer_corner(search *s, int which, int i)
{
    double(*plane)[3] = s->face[!which];
    const double *corner = s->face[which][i];
    double e[3], f[3], n[3], d[3], c[3], foot[3];
    ebpo_vec3_subtract(plane[1], plane[0], e);
    ebpo_vec3_subtract(plane[2], plane[0], f);
    ebpo_vec3_subtract(corner, plane[0], d);
    ebpo_vec3_cross(e, f, n);
    double nn = ebpo_vec3_dot(n, n);
    ebpo_vec3_cross(d, f, c);
    double on_e = ebpo_vec3_dot(c, n) / nn;
    ebpo_vec3_cross(e, d, c);
    double on_f = ebpo_vec3_dot(c, n) / nn;
    if (!(on_e >= 0 && on_f >= 0 && on_e + on_f <= 1))
        return;
    for (int k = 0; k < 3; k++)
        foot[k] = plane[0][k] + (on_e * e[k] + on_f * f[k]);
    double least = fmin(fmin(on_e, on_f), 1 - on_e - on_f), ee = ebpo_vec3_dot(e, e),
           ff = ebpo_vec3_dot(f, f);
    offer_points(s, which, corner, foot, i, 6,
                 nn > 0x1p-20 * ee * ff ? least * sqrt(nn / fmax(ee, ff)) : 0);
}

/* --- bounds --- */

/* Begins a search: computes the coordinates relative to A's first corner. Returns false if these
 * relative coordinates are too large or too small. */
static bool make_relative(const double a[3][3], const double b[3][3], search *s)
{
    s->norm = 0;
    s->square = INFINITY;
    s->space = 0;
    memset(s->point, 0, sizeof s->point);
    memset(s->feature, 0, sizeof s->feature);
    for (int i = 0; i < 3; i++) {
        ebpo_vec3_subtract(a[i], a[0], s->face[0][i]);
        ebpo_vec3_subtract(b[i], a[0], s->face[1][i]);
        for (int which = 0; which < 2; which++) {
            const double *x = s->face[which][i];
            s->norm = fmax(s->norm, fabs(x[0]) + fabs(x[1]) + fabs(x[2]));
        }
    }
    return s->norm < max_norm && s->norm > least_norm;
}

/* Returns a lower bound of the gap of the faces along n, which is not 0. */
static double gap_along(const search *s, const double n[3])
{
    double least = INFINITY, most = -INFINITY, d[3];
    for (int i = 0; i < 3; i++) {
        ebpo_vec3_subtract(s->face[1][i], s->point[0], d);
        least = fmin(least, ebpo_vec3_dot(n, d));
        ebpo_vec3_subtract(s->face[0][i], s->point[0], d);
        most = fmax(most, ebpo_vec3_dot(n, d));
    }
    double size = fabs(n[0]) + fabs(n[1]) + fabs(n[2]);
    return (least - most - 0x1p-48 * size * s->norm) / sqrt(ebpo_vec3_dot(n, n));
}

/* --- features --- */

/* Returns true if a corner belongs to a feature. */
static bool is_on(int corner, int feature)
{
    return feature == 6 || corner == feature ||
           (feature >= 3 && (corner == feature - 3 || corner == (feature - 2) % 3));
}

/* Returns true if the features of the points certainly contain the nearest points. n: vector from
 * A's point to B's point. In the direction of n, the corners of A that are not on A's feature must
 * be behind A's point, and the corners of B that are not on B's feature must be ahead of B's point.
 * The distances of these corners behind and ahead must be greater than the errors of n and of the
 * points. Proof: docs/develop/collision.md, "Which features are nearest". */
static bool features_certain(const search *s, const double n[3])
{
    const double margin = 0x1p-24; /* more than the relative errors */
    if (!(s->space > margin * s->norm))
        return false;
    for (int which = 0; which < 2; which++)
        for (int i = 0; i < 3; i++) {
            double d[3];
            ebpo_vec3_subtract(s->face[which][i], s->point[which], d);
            double ahead = which ? ebpo_vec3_dot(n, d) : -ebpo_vec3_dot(n, d);
            if (!is_on(i, s->feature[which]) && !(ahead > margin * s->norm * s->norm))
                return false;
        }
    return true;
}

/* Returns true if two features have the same corners, in any order. */
static bool same_feature(const double a[3][3], int on_a, const double b[3][3], int on_b)
{
    int corners_a = on_a < 3 ? 1 : on_a < 6 ? 2 : 3, corners_b = on_b < 3 ? 1 : on_b < 6 ? 2 : 3;
    if (corners_a != corners_b)
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

/* Returns true if both faces are perpendicular to the same axis, and their projections along this
 * axis intersect. The distance of the faces is then the distance of their planes, whose coordinates
 * are level[0] and level[1]. */
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

/* Returns true if the pairs a, b and c, d are pairs of level faces whose planes have the same two
 * coordinates. */
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
    if (!make_relative(a, b, &s))
        return;
    for (int i = 0; i < 9; i++)
        offer_edges(&s, i / 3, i % 3);
    for (int i = 0; i < 6; i++)
        offer_corner(&s, i / 3, i % 3);
    double n[3], margin = 0x1p-47 * s.norm;
    ebpo_vec3_subtract(s.point[1], s.point[0], n);
    double distance = sqrt(s.square);
    out->hi = distance + margin;
    if (distance > margin) {
        double gap = gap_along(&s, n);
        out->lo = gap > 0 ? gap * (1 - 0x1p-50) : 0;
        out->certain = out->lo > 0 && features_certain(&s, n);
    }
    memcpy(out->feature, s.feature, sizeof out->feature);
    for (int which = 0; which < 2; which++)
        for (int k = 0; k < 3; k++)
            out->point[which][k] = a[0][k] + s.point[which][k];
}

/* --- exact distances: fractions of integers --- */

/* A squared distance: square / denominator, in the unit 2^(2 unit), where the coordinates are
 * integers in the unit 2^unit. */
typedef struct fraction {
    mpz_t square, denominator;
} fraction;

static void fraction_init(fraction *f) { mpz_inits(f->square, f->denominator, NULL); }

static void fraction_clear(fraction *f) { mpz_clears(f->square, f->denominator, NULL); }

/* Compares two fractions; returns a negative number, 0 or a positive number. */
static int fraction_compare(const fraction *f, const fraction *g)
{
    mpz_t left, right;
    mpz_inits(left, right, NULL);
    mpz_mul(left, f->square, g->denominator);
    mpz_mul(right, g->square, f->denominator);
    int order = mpz_cmp(left, right);
    mpz_clears(left, right, NULL);
    return order;
}

/* Sets *best to `other` if `other` is less, or if best->denominator is 0 (no fraction so far). */
static void keep_lesser(fraction *best, const fraction *other)
{
    if (mpz_sgn(best->denominator) != 0 && fraction_compare(other, best) >= 0)
        return;
    mpz_set(best->square, other->square);
    mpz_set(best->denominator, other->denominator);
}

/* --- edges --- */

/* Two edges, in integers. */
typedef struct edges {
    ebpo_vectorz from[2], along[2]; /* first end, and vector to the other end, of each edge */
    ebpo_vectorz between;           /* vector from the first end of edge 0 to the first end of
                                     * edge 1 */
    ebpo_vectorz normal;            /* vector product of both edges */
    mpz_t length2;                  /* squared length of `normal` */
    ebpo_vectorz part;              /* temporary values */
    mpz_t share;
} edges;

static void edges_init(edges *e)
{
    ebpo_vectorz *all[] = { &e->from[0], &e->from[1], &e->along[0], &e->along[1],
                            &e->between, &e->normal,  &e->part };
    for (int i = 0; i < 7; i++)
        ebpo_vectorz_init(all[i]);
    mpz_inits(e->length2, e->share, NULL);
}

static void edges_clear(edges *e)
{
    ebpo_vectorz *all[] = { &e->from[0], &e->from[1], &e->along[0], &e->along[1],
                            &e->between, &e->normal,  &e->part };
    for (int i = 0; i < 7; i++)
        ebpo_vectorz_clear(all[i]);
    mpz_clears(e->length2, e->share, NULL);
}

/* Sets an edge to the integers of its ends. */
static void set_edge(edges *e, int which, const double from[3], const double to[3], int unit)
{
    for (int k = 0; k < 3; k++) {
        ebpo_set_integer(e->from[which].x[k], from[k], unit);
        ebpo_set_integer(e->along[which].x[k], to[k], unit);
    }
    ebpo_vectorz_subtract(&e->along[which], &e->along[which], &e->from[which]);
}

/* Returns true if, of the nearest points of both edges' lines, the point on the line of edge
 * `which` is on the edge. */
static bool within_edge(edges *e, int which)
{
    ebpo_vectorz_cross(&e->part, &e->between, &e->along[!which]);
    ebpo_vectorz_dot(e->share, &e->part, &e->normal);
    return mpz_sgn(e->share) >= 0 && mpz_cmp(e->share, e->length2) <= 0;
}

/* Computes the squared distance of two edges. Returns false if the edges are parallel, or if a
 * nearest point of their lines is not on its edge. In both cases, an end of an edge is a nearest
 * point, and update_by_corners finds the distance. */
static bool edges_square(edges *e, fraction *out)
{
    ebpo_vectorz_subtract(&e->between, &e->from[1], &e->from[0]);
    ebpo_vectorz_cross(&e->normal, &e->along[0], &e->along[1]);
    ebpo_vectorz_dot(e->length2, &e->normal, &e->normal);
    if (mpz_sgn(e->length2) == 0 || !within_edge(e, 0) || !within_edge(e, 1))
        return false;
    ebpo_vectorz_dot(e->share, &e->between, &e->normal);
    mpz_mul(out->square, e->share, e->share);
    mpz_set(out->denominator, e->length2);
    return true;
}

/* Returns true if the distance of edge i of a and edge j of b is certainly greater than `hi`. The
 * bounds are computed for edges in the form of faces with two equal corners. */
static bool edges_far(const double a[3][3], int i, const double b[3][3], int j, double hi)
{
    double p[3][3], q[3][3];
    ebpo_pair_distance_bounds bounds;
    for (int k = 0; k < 3; k++) {
        memcpy(p[k], a[(i + (k > 0)) % 3], sizeof p[k]);
        memcpy(q[k], b[(j + (k > 0)) % 3], sizeof q[k]);
    }
    ebpo_triangles_distance_bounds((const double(*)[3])p, (const double(*)[3])q, &bounds);
    return bounds.lo > hi;
}

/* Updates *best by all pairs of edges that may be nearer than `hi`. */
static void update_by_edges(fraction *best, const double a[3][3], const double b[3][3], double hi,
                            int unit)
{
    edges e;
    fraction f;
    edges_init(&e);
    fraction_init(&f);
    for (int i = 0; i < 3; i++) {
        set_edge(&e, 0, a[i], a[i == 2 ? 0 : i + 1], unit);
        for (int j = 0; j < 3; j++) {
            if (edges_far(a, i, b, j, hi))
                continue;
            set_edge(&e, 1, b[j], b[j == 2 ? 0 : j + 1], unit);
            if (edges_square(&e, &f))
                keep_lesser(best, &f);
        }
    }
    fraction_clear(&f);
    edges_clear(&e);
}

/* --- faces --- */

/* Updates *best by the distances of the corners of one face from the other face. Skips corners
 * whose distance is certainly greater than `hi`. */
static void update_by_corners(fraction *best, const double corner[3][3], const double face[3][3],
                              double hi, int unit)
{
    fraction f;
    fraction_init(&f);
    for (int i = 0; i < 3; i++) {
        ebpo_distance_bounds bounds;
        ebpo_triangle_distance_bounds(corner[i], face, &bounds);
        if (bounds.lo > hi)
            continue;
        ebpo_triangle_square_gmp(corner[i], face, unit, f.square, f.denominator);
        keep_lesser(best, &f);
    }
    fraction_clear(&f);
}

/* Returns the exponent of a unit of which all coordinates are multiples, at most `unit`. */
static int unit_of(const double a[3][3], const double b[3][3], int unit)
{
    return ebpo_common_unit(&b[0][0], 9, ebpo_common_unit(&a[0][0], 9, unit));
}

/* Computes the exact squared distance of two faces. */
static void squared_distance(const double a[3][3], const double b[3][3], int unit, fraction *out)
{
    if (ebpo_triangle_pair(a, b) != EBPO_PAIR_APART) {
        mpz_set_ui(out->square, 0);
        mpz_set_ui(out->denominator, 1);
        return;
    }
    ebpo_pair_distance_bounds bounds;
    ebpo_triangles_distance_bounds(a, b, &bounds);
    mpz_set_ui(out->denominator, 0);
    update_by_corners(out, a, b, bounds.hi, unit);
    update_by_corners(out, b, a, bounds.hi, unit);
    update_by_edges(out, a, b, bounds.hi, unit);
}

double ebpo_triangles_distance(const double a[3][3], const double b[3][3])
{
    fraction f;
    fraction_init(&f);
    int unit = unit_of(a, b, EBPO_UNIT_OF_ZEROS);
    squared_distance(a, b, unit, &f);
    double out = ebpo_round_root(f.square, f.denominator, unit);
    fraction_clear(&f);
    return out;
}

/* --- comparisons --- */

/* Compares the distances of a, b and of c, d exactly. */
static int compare_exact(const double a[3][3], const double b[3][3], const double c[3][3],
                         const double d[3][3])
{
    fraction f, g;
    fraction_init(&f);
    fraction_init(&g);
    int unit = unit_of(c, d, unit_of(a, b, EBPO_UNIT_OF_ZEROS));
    squared_distance(a, b, unit, &f);
    squared_distance(c, d, unit, &g);
    int order = fraction_compare(&f, &g);
    fraction_clear(&f);
    fraction_clear(&g);
    return (order > 0) - (order < 0);
}

int ebpo_triangles_distance_compare(const double a[3][3], const double b[3][3],
                                    const double c[3][3], const double d[3][3])
{
    ebpo_pair_distance_bounds x, y;
    ebpo_triangles_distance_bounds(a, b, &x);
    ebpo_triangles_distance_bounds(c, d, &y);
    return x.hi < y.lo ? -1 : x.lo > y.hi ? 1 : compare_exact(a, b, c, d);
}

/* Compares the distance of a, b with a finite distance exactly. */
static int compare_to_exact(const double a[3][3], const double b[3][3], double distance)
{
    fraction f, g;
    fraction_init(&f);
    fraction_init(&g);
    int unit = unit_of(a, b, ebpo_common_unit(&distance, 1, EBPO_UNIT_OF_ZEROS));
    squared_distance(a, b, unit, &f);
    ebpo_set_integer(g.square, distance, unit);
    mpz_mul(g.square, g.square, g.square);
    mpz_set_ui(g.denominator, 1);
    int order = fraction_compare(&f, &g);
    fraction_clear(&f);
    fraction_clear(&g);
    return (order > 0) - (order < 0);
}

int ebpo_triangles_distance_compare_to(const double a[3][3], const double b[3][3], double distance)
{
    ebpo_pair_distance_bounds x;
    if (isinf(distance))
        return -1;
    ebpo_triangles_distance_bounds(a, b, &x);
    return x.hi < distance ? -1 : x.lo > distance ? 1 : compare_to_exact(a, b, distance);
}
