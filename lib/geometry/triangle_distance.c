/* Computes the distance of a point from a triangle: bounds, correctly rounded values, and exact
 * comparisons.
 *
 * There are four stages. The fastest stage is tried first:
 *
 * 1. Bounds in doubles.
 *
 * 2. Signs of products with error bounds, for points that are far from the triangle compared with
 * its size.
 *
 * 3. Double-double arithmetic (double_double_kernels.c), if its error bound decides the rounding
 * (Ziv, "Fast evaluation of elementary mathematical functions with correctly rounded last bit",
 * 1991).
 *
 * 4. Integers of any size.
 *
 * In all stages the nearest feature (corner, edge or interior) follows from the signs of the same
 * products. The corners in these products are relative to the point p. A corner is nearest when p
 * is behind this corner along both of its edges. An edge is nearest when p, projected to the plane,
 * is between the edge's ends and outside of the edge. The interior is nearest when the projection
 * of p is inside of all edges. See docs/develop/bounds.md. */
#include "core/strict_fp.h"

#include <gmp.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "geometry/distance.h"
#include "geometry/double_double_kernels.h"
#include "geometry/integer_vectors.h"
#include "geometry/vec3.h"

/* --- points that are far from the triangle compared with its size --- */

/* A number with an error bound. A number 0 with the bound 0 is exactly 0. */
typedef struct bounded_number {
    double x, error;
} bounded_number;

/* `more`: factor that covers the rounding of the bounds themselves. `rounding`: bound of the
 * relative error of an operation. `lost`: bound of the error when a result is a denormal. */
static const double more = 1 + 0x1p-40, rounding = 0x1p-52, lost = 0x1p-1060;

static bounded_number bounded_multiply(bounded_number a, bounded_number b)
{
    bounded_number out = { a.x * b.x, 0 };
    if ((a.x == 0 && a.error == 0) || (b.x == 0 && b.error == 0))
        return (bounded_number){ 0, 0 };
    out.error =
        (fabs(a.x) * b.error + fabs(b.x) * a.error + a.error * b.error + fabs(out.x) * rounding) *
            more +
        lost;
    return out;
}
static bounded_number bounded_add(bounded_number a, bounded_number b)
{
    bounded_number out = { a.x + b.x, (a.error + b.error) * more };
    out.error += fabs(out.x) * rounding;
    return out;
}
static bounded_number bounded_negate(bounded_number a) { return (bounded_number){ -a.x, a.error }; }

static bounded_number bounded_dot(const bounded_number a[3], const bounded_number b[3])
{
    return bounded_add(bounded_add(bounded_multiply(a[0], b[0]), bounded_multiply(a[1], b[1])),
                       bounded_multiply(a[2], b[2]));
}
static void bounded_cross(const bounded_number a[3], const bounded_number b[3],
                          bounded_number out[3])
{
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        out[k] =
            bounded_add(bounded_multiply(a[u], b[v]), bounded_negate(bounded_multiply(a[v], b[u])));
    }
}
static int bounded_sign(bounded_number a) { return a.x > a.error ? 1 : a.x < -a.error ? -1 : 0; }
static bool bounded_is_zero(bounded_number a) { return a.x == 0 && a.error == 0; }

/* Returns (to - from) * 2^-exponent. */
static bounded_number bounded_difference(double to, double from, int exponent)
{
    double d = to - from;
    bounded_number out = { isfinite(d) ? ldexp(d, -exponent)
                                       : ldexp(to, -exponent) - ldexp(from, -exponent),
                           0 };
    if (d != 0)
        out.error = fabs(out.x) * rounding + lost;
    return out;
}

/* Returns an exponent such that no scaled coordinate difference is above 2. */
static int exponent_of(const double (*a)[3], int count, const double b[3])
{
    double most = 0;
    int exponent;
    for (int i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) {
            double d = fabs(a[i][k] - b[k]);
            most = fmax(most, isfinite(d) ? d : 0x1p1023);
        }
    frexp(most, &exponent);
    return exponent;
}

typedef struct far_triangle {
    bounded_number corner[3][3];      /* relative to p, in units of 2^exponent */
    bounded_number edge[3][3];        /* in units of 2^edge_exponent */
    bounded_number along[3], back[3]; /* along: corner k . edge k; back: corner k + 1 . edge k */
    int exponent, edge_exponent;
} far_triangle;

/* Computes the members of *t. Returns false if two corners are equal, because then this stage
 * cannot decide which of these corners is nearest. */
static bool relate_far(const double p[3], const double triangle[3][3], far_triangle *t)
{
    bool apart = true;
    t->exponent = exponent_of(triangle, 3, p);
    t->edge_exponent = exponent_of(triangle, 3, triangle[0]);
    for (int i = 0; i < 3; i++) {
        bool any = false;
        for (int k = 0; k < 3; k++) {
            t->corner[i][k] = bounded_difference(triangle[i][k], p[k], t->exponent);
            t->edge[i][k] =
                bounded_difference(triangle[(i + 1) % 3][k], triangle[i][k], t->edge_exponent);
            any = any || !bounded_is_zero(t->edge[i][k]);
        }
        apart = apart && any;
    }
    for (int i = 0; i < 3; i++) {
        t->along[i] = bounded_dot(t->corner[i], t->edge[i]);
        t->back[i] = bounded_dot(t->corner[(i + 1) % 3], t->edge[i]);
    }
    return apart;
}

static ebpo_feature far_feature_of(const far_triangle *t)
{
    bounded_number normal[3], outward[3];
    bool inside = true;
    bounded_cross(t->edge[0], t->edge[1], normal);
    for (int i = 0; i < 3; i++) {
        const bounded_number *along = &t->along[i], *before = &t->back[(i + 2) % 3];
        /* p is behind the corner along both of its edges, or exactly beside the corner */
        if ((bounded_sign(*along) > 0 || bounded_is_zero(*along)) &&
            (bounded_sign(*before) < 0 || bounded_is_zero(*before)))
            return (ebpo_feature)(EBPO_NEAR_CORNER0 + i);
        bounded_cross(t->edge[i], normal, outward);
        int side = bounded_sign(bounded_dot(outward, t->corner[i]));
        if (side < 0 && bounded_sign(*along) < 0 && bounded_sign(t->back[i]) > 0)
            return (ebpo_feature)(EBPO_NEAR_EDGE0 + i);
        inside = inside && side > 0;
    }
    return inside ? EBPO_NEAR_INTERIOR : EBPO_NEAR_UNKNOWN;
}

static double bounded_length(const bounded_number a[3])
{
    return sqrt(a[0].x * a[0].x + a[1].x * a[1].x + a[2].x * a[2].x);
}

/* Bounds the distance of p from the triangle. The distance of the nearest corner is an upper bound,
 * and exceeds the distance of the nearest point by at most the triangle's size. */
static void bound_far(const far_triangle *t, ebpo_feature feature, ebpo_distance_bounds *out)
{
    double least = INFINITY, size = 0;
    for (int i = 0; i < 3; i++) {
        least = fmin(least, bounded_length(t->corner[i]));
        size = fmax(size, bounded_length(t->edge[i]));
    }
    if (feature <= EBPO_NEAR_CORNER2) {
        least = bounded_length(t->corner[feature]);
        size = 0;
    }
    double low = least * (1 - 0x1p-48) -
                 ldexp(size, t->edge_exponent - t->exponent) * (1 + 0x1p-40) - 0x1p-1000,
           high = least * (1 + 0x1p-48) + 0x1p-1000;
    out->feature = feature;
    out->lo = low > 0 ? fmax(nextafter(ldexp(low, t->exponent), -INFINITY), 0) : 0;
    out->hi = nextafter(ldexp(high, t->exponent), INFINITY);
    /* lo may have overflowed although the distance is finite */
    out->lo = fmin(out->lo, 0x1.fffffffffffffp1023);
}

/* Returns the nearest feature, or EBPO_NEAR_UNKNOWN. If `out` is not NULL and p is far from the
 * triangle, sets *out to bounds of the distance that differ by about the triangle's size. */
static ebpo_feature find_far_feature(const double p[3], const double triangle[3][3],
                                     ebpo_distance_bounds *out)
{
    far_triangle t;
    ebpo_feature feature = EBPO_NEAR_UNKNOWN;
    if (relate_far(p, triangle, &t))
        feature = far_feature_of(&t);
    if (out && t.exponent - t.edge_exponent > 20)
        bound_far(&t, feature, out);
    return feature;
}

/* Compares the distances of two corners a and b from p: *sign is the sign of |p - a|^2 - |p - b|^2
 * = (a - b) . ((a - p) + (b - p)). Returns false if the sign is not certain. */
static bool compare_far_corners(const double p[3], const double a[3], const double b[3], int *sign)
{
    const double both[2][3] = { { a[0], a[1], a[2] }, { b[0], b[1], b[2] } };
    int apart = exponent_of((const double(*)[3])both, 1, b),
        away = exponent_of((const double(*)[3])both, 2, p);
    bounded_number step[3], middle[3];
    for (int k = 0; k < 3; k++) {
        step[k] = bounded_difference(a[k], b[k], apart);
        middle[k] =
            bounded_add(bounded_difference(a[k], p[k], away), bounded_difference(b[k], p[k], away));
    }
    bounded_number d = bounded_dot(step, middle);
    *sign = bounded_sign(d);
    return *sign || bounded_is_zero(d);
}

/* Reduces the triangle t to a feature: replaces the corners outside the feature by copies of a
 * corner of the feature. */
static void keep_feature(double t[3][3], ebpo_feature feature)
{
    double from[3], to[3];
    if (feature > EBPO_NEAR_EDGE2)
        return;
    int first = feature <= EBPO_NEAR_CORNER2 ? (int)feature : (int)(feature - EBPO_NEAR_EDGE0),
        last = feature <= EBPO_NEAR_CORNER2 ? first : (first + 1) % 3;
    memcpy(from, t[first], sizeof from);
    memcpy(to, t[last], sizeof to);
    memcpy(t[0], from, sizeof from);
    memcpy(t[1], to, sizeof to);
    memcpy(t[2], to, sizeof to);
}

/* Reduces the triangles a and b to their nearest features. If both features are in one plane
 * perpendicular to an axis, replaces p by its projection to this plane, and returns true. The
 * projection does not change which of the two features is nearer. */
static bool flatten_far(double p[3], double a[3][3], ebpo_feature of_a, double b[3][3],
                        ebpo_feature of_b)
{
    bool moved = false;
    keep_feature(a, of_a);
    keep_feature(b, of_b);
    for (int k = 0; k < 3; k++) {
        bool flat = a[0][k] != p[k];
        for (int i = 0; i < 3; i++)
            flat = flat && a[i][k] == a[0][k] && b[i][k] == a[0][k];
        if (flat) {
            p[k] = a[0][k];
            moved = true;
        }
    }
    return moved;
}

/* --- bounds in doubles --- */

/* Bounds of rounding errors. u is 2^-53. r bounds the 1-norms (sums of absolute coordinates) of the
 * corners relative to p. l bounds the 1-norms of the edges, so l^2 bounds the length of the normal
 * n.
 * - Relative corners and edges have relative errors of u.
 * - Products of a corner and an edge: 8 u r l.
 * - The normal: 8 u l^2 on each axis.
 * - Products of a corner with edge x normal: 64 u r l^3.
 * - Distances to corners and to points of edges: 16 u r.
 * - The distance to the plane: 16 u r, plus l times the tilt of the computed normal. The tilt is
 *   at most 16 u l^2 / |n|.
 *
 * The code uses at least twice these bounds. Numbers whose fourth powers overflow or underflow are
 * scaled first. */
static const double huge_reach = 0x1p200, tiny_reach = 0x1p-200;
/* If r exceeds l times this factor, the error bounds above are too large compared with the
 * products. */
static const double far_ratio = 0x1p20;

static inline double greater_of(double a, double b) { return a > b ? a : b; }

static inline double norm_1(const double a[3]) { return fabs(a[0]) + fabs(a[1]) + fabs(a[2]); }

typedef struct relation {
    double corner[3][3]; /* relative to p */
    double edge[3][3];   /* edge k is from corner k to corner k + 1 */
    double reach, size;  /* r and l */
    /* corner k . edge k: distance of p behind corner k along edge k, times the edge's length */
    double along[3];
    double back[3]; /* corner k + 1 . edge k */
    double normal[3];
    double side[3]; /* positive if p is on the inner side of edge k */
} relation;

static void relate_to_point(const double p[3], const double triangle[3][3], relation *r)
{
    r->reach = r->size = 0;
    for (int i = 0; i < 3; i++) {
        int j = i == 2 ? 0 : i + 1;
        for (int k = 0; k < 3; k++) {
            r->corner[i][k] = triangle[i][k] - p[k];
            r->edge[i][k] = triangle[j][k] - triangle[i][k];
        }
        r->reach = greater_of(r->reach, norm_1(r->corner[i]));
        r->size = greater_of(r->size, norm_1(r->edge[i]));
    }
}

static void multiply_relation(relation *r)
{
    ebpo_vec3_cross(r->edge[0], r->edge[1], r->normal);
    for (int i = 0; i < 3; i++) {
        double outward[3];
        r->along[i] = ebpo_vec3_dot(r->corner[i], r->edge[i]);
        r->back[i] = ebpo_vec3_dot(r->corner[i == 2 ? 0 : i + 1], r->edge[i]);
        ebpo_vec3_cross(r->edge[i], r->normal, outward);
        r->side[i] = ebpo_vec3_dot(outward, r->corner[i]);
    }
}

/* Returns the distance of p from edge i. The nearest point is corner i plus a fraction t of the
 * edge. */
static double edge_distance(const relation *r, int i)
{
    double length2 = ebpo_vec3_dot(r->edge[i], r->edge[i]),
           t = length2 > 0 ? -r->along[i] / length2 : 0, q[3];
    t = t < 0 ? 0 : t > 1 ? 1 : t;
    for (int k = 0; k < 3; k++)
        q[k] = r->corner[i][k] + t * r->edge[i][k];
    return sqrt(ebpo_vec3_dot(q, q));
}

static ebpo_feature certain_feature(const relation *r)
{
    double flat = 0x1p-48 * r->reach * r->size,
           solid = 0x1p-44 * r->reach * r->size * r->size * r->size;
    bool inside = true;
    for (int i = 0; i < 3; i++) {
        int before = i == 0 ? 2 : i - 1;
        /* p is behind corner i along edge i, and beyond corner i along the preceding edge. */
        if (r->along[i] > flat && r->back[before] < -flat)
            return (ebpo_feature)(EBPO_NEAR_CORNER0 + i);
        if (r->along[i] < -flat && r->back[i] > flat && r->side[i] < -solid)
            return (ebpo_feature)(EBPO_NEAR_EDGE0 + i);
        inside = inside && r->side[i] > solid;
    }
    return inside ? EBPO_NEAR_INTERIOR : EBPO_NEAR_UNKNOWN;
}

/* Returns the distance of p from the triangle's plane, and its error bound. */
static double plane_distance(const relation *r, double *error)
{
    double length = sqrt(ebpo_vec3_dot(r->normal, r->normal));
    *error = 0x1p-47 * r->reach + 0x1p-46 * r->size * r->size * r->size / length;
    return fabs(ebpo_vec3_dot(r->normal, r->corner[0])) / length;
}

/* Bounds the distance of p from the triangle if the nearest feature is not certain. The distance
 * from the edges is an upper bound. There are two lower bounds. The distance from the triangle's
 * plane is a lower bound if the tilt of the computed plane is small. The distance from the edges,
 * minus the triangle's height, is always a lower bound, because no point of the triangle is farther
 * from the edges than this height. `plane`: distance from the plane. `error`: error of the distance
 * from the edges. */
static void bound_by_edges(const relation *r, double plane, double error, ebpo_distance_bounds *out)
{
    double edges = edge_distance(r, 0), length = sqrt(ebpo_vec3_dot(r->normal, r->normal));
    for (int i = 1; i < 3; i++) {
        double distance = edge_distance(r, i);
        edges = distance < edges ? distance : edges;
    }
    double height = length > 0 ? 2 * length / r->size + 0x1p-44 * r->size : 0x1p-44 * r->size;
    double low = edges - error - 4 * height,
           tilted = 0x1p-47 * r->reach + 0x1p-46 * r->size * r->size / length * r->reach;
    if (tilted < 0x1p-20 * r->reach)
        low = greater_of(low, plane < edges ? plane - tilted : edges - tilted);
    out->lo = low > 0 ? low : 0;
    out->hi = edges + error;
}

static void bound_relation(const relation *r, ebpo_distance_bounds *out)
{
    double error = 0x1p-47 * r->reach, d;
    out->feature = certain_feature(r);
    if (out->feature <= EBPO_NEAR_CORNER2) {
        const double *q = r->corner[out->feature];
        d = sqrt(ebpo_vec3_dot(q, q));
        error = 0x1p-49 * d;
    } else if (out->feature <= EBPO_NEAR_EDGE2) {
        d = edge_distance(r, (int)(out->feature - EBPO_NEAR_EDGE0));
    } else {
        double plane_error;
        d = plane_distance(r, &plane_error);
        if (out->feature != EBPO_NEAR_INTERIOR || !(plane_error < 0x1p-20 * r->reach)) {
            bound_by_edges(r, d, error, out);
            return;
        }
        error = plane_error;
    }
    out->lo = d > error ? d - error : 0;
    out->hi = d + error;
}

/* Multiplies p and the triangle by 2^-e, so that the largest absolute coordinate is in [1/2, 1).
 * Returns e. */
static int scale_all(const double p[3], const double triangle[3][3], double q[3], double t[3][3])
{
    double most = 0;
    int exponent;
    for (int k = 0; k < 3; k++) {
        most = greater_of(most, fabs(p[k]));
        for (int i = 0; i < 3; i++)
            most = greater_of(most, fabs(triangle[i][k]));
    }
    frexp(most, &exponent);
    for (int k = 0; k < 3; k++) {
        q[k] = ldexp(p[k], -exponent);
        for (int i = 0; i < 3; i++)
            t[i][k] = ldexp(triangle[i][k], -exponent);
    }
    return exponent;
}

static void bound_scaled(const double p[3], const double triangle[3][3], ebpo_distance_bounds *out)
{
    double q[3], t[3][3];
    int exponent = scale_all(p, triangle, q, t);
    relation r;
    relate_to_point(q, (const double(*)[3])t, &r);
    if (!(r.reach > tiny_reach * 0x1p-100) || !(r.size > tiny_reach || r.size == 0)) {
        /* The triangle is almost a point, so this stage knows only an upper bound. */
        *out = (ebpo_distance_bounds){
            0, ldexp(r.reach + 0x1p-1000, exponent) * (1 + 0x1p-50) + 0x1p-1074, EBPO_NEAR_UNKNOWN
        };
        out->feature = find_far_feature(p, triangle, out);
        return;
    }
    multiply_relation(&r);
    bound_relation(&r, out);
    /* Scaling to larger numbers is exact. Scaling to smaller numbers may have lost parts below
     * 2^-1074, so the bounds are widened. */
    out->feature = find_far_feature(p, triangle, NULL);
    out->lo = nextafter(ldexp(out->lo - 0x1p-1000, exponent), -INFINITY);
    out->lo = out->lo > 0 ? out->lo : 0;
    out->hi = nextafter(ldexp(out->hi + 0x1p-1000, exponent), INFINITY);
}

void ebpo_triangle_distance_bounds(const double p[3], const double triangle[3][3],
                                   ebpo_distance_bounds *out)
{
    relation r;
    relate_to_point(p, triangle, &r);
    if (!(r.reach < huge_reach) || !(r.reach > tiny_reach) || !(r.size > tiny_reach)) {
        bound_scaled(p, triangle, out);
        return;
    }
    multiply_relation(&r);
    bound_relation(&r, out);
    if (out->feature == EBPO_NEAR_UNKNOWN && r.reach > far_ratio * r.size)
        out->feature = find_far_feature(p, triangle, NULL);
}

/* --- integers of any size: the squared distance is a fraction of integers in a common unit --- */

/* The search for the nearest point, in integers. The nearest point is p + offset /
 * offset_denominator. The squared distance is square / denominator. Coordinates are in units of
 * 2^unit. */
typedef struct nearest {
    int unit;
    ebpo_vectorz p, corner[3], edge[3], normal; /* corners relative to p */
    mpz_t square, denominator;                  /* squared distance in squared units */
    ebpo_vectorz offset; /* nearest point minus p, times offset_denominator */
    mpz_t offset_denominator;
    ebpo_feature feature;
    mpz_t t, u;     /* scratch */
    ebpo_vectorz w; /* scratch */
} nearest;

static void nearest_init(nearest *n)
{
    ebpo_vectorz *all[] = { &n->p,       &n->corner[0], &n->corner[1], &n->corner[2], &n->edge[0],
                            &n->edge[1], &n->edge[2],   &n->normal,    &n->offset,    &n->w };
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++)
        ebpo_vectorz_init(all[i]);
    mpz_inits(n->square, n->denominator, n->offset_denominator, n->t, n->u, NULL);
}

static void nearest_clear(nearest *n)
{
    ebpo_vectorz *all[] = { &n->p,       &n->corner[0], &n->corner[1], &n->corner[2], &n->edge[0],
                            &n->edge[1], &n->edge[2],   &n->normal,    &n->offset,    &n->w };
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++)
        ebpo_vectorz_clear(all[i]);
    mpz_clears(n->square, n->denominator, n->offset_denominator, n->t, n->u, NULL);
}

static void set_points(nearest *n, const double p[3], const double triangle[3][3], int unit)
{
    n->unit = unit;
    for (int k = 0; k < 3; k++) {
        ebpo_set_integer(n->p.x[k], p[k], unit);
        for (int i = 0; i < 3; i++) {
            ebpo_set_integer(n->corner[i].x[k], triangle[i][k], unit);
            mpz_sub(n->corner[i].x[k], n->corner[i].x[k], n->p.x[k]);
        }
    }
    for (int i = 0; i < 3; i++)
        ebpo_vectorz_subtract(&n->edge[i], &n->corner[(i + 1) % 3], &n->corner[i]);
    ebpo_vectorz_cross(&n->normal, &n->edge[0], &n->edge[1]);
}

/* If the nearest point is in the interior, sets the result and returns true. */
static bool try_interior(nearest *n)
{
    ebpo_vectorz_dot(n->denominator, &n->normal, &n->normal);
    if (mpz_sgn(n->denominator) == 0)
        return false;
    for (int i = 0; i < 3; i++) {
        ebpo_vectorz_cross(&n->w, &n->edge[i], &n->normal);
        ebpo_vectorz_dot(n->t, &n->w, &n->corner[i]);
        if (mpz_sgn(n->t) <= 0)
            return false;
    }
    ebpo_vectorz_dot(n->t, &n->normal, &n->corner[0]);
    mpz_mul(n->square, n->t, n->t);
    for (int k = 0; k < 3; k++)
        mpz_mul(n->offset.x[k], n->normal.x[k], n->t);
    mpz_set(n->offset_denominator, n->denominator);
    n->feature = EBPO_NEAR_INTERIOR;
    return true;
}

/* Replaces the current nearest feature by `feature` if this corner or edge is nearer. If both are
 * equally near, keeps the feature with the lower number, so a corner rather than an edge. `square`
 * / `denominator`: squared distance of `feature`. `first`: true if there is no current feature.
 * *taken: true if the feature was replaced. */
static void offer_feature(nearest *n, bool first, const mpz_t square, const mpz_t denominator,
                          ebpo_feature feature, bool *taken)
{
    int sign = -1;
    *taken = false;
    if (!first) {
        mpz_t left, right;
        mpz_inits(left, right, NULL);
        mpz_mul(left, square, n->denominator);
        mpz_mul(right, n->square, denominator);
        sign = mpz_cmp(left, right);
        mpz_clears(left, right, NULL);
    }
    if (sign > 0 || (sign == 0 && feature >= n->feature))
        return;
    mpz_set(n->square, square);
    mpz_set(n->denominator, denominator);
    n->feature = feature;
    *taken = true;
}

static void offer_edge(nearest *n, int i)
{
    mpz_t along, length2, square;
    bool taken;
    mpz_inits(along, length2, square, NULL);
    ebpo_vectorz_dot(along, &n->corner[i], &n->edge[i]);
    mpz_neg(along, along); /* projection of p on the edge, times the edge's length */
    ebpo_vectorz_dot(length2, &n->edge[i], &n->edge[i]);
    if (mpz_sgn(along) > 0 && mpz_cmp(along, length2) < 0) {
        ebpo_vectorz_dot(square, &n->corner[i], &n->corner[i]);
        mpz_mul(square, square, length2);
        mpz_submul(square, along, along);
        offer_feature(n, false, square, length2, (ebpo_feature)(EBPO_NEAR_EDGE0 + i), &taken);
        if (taken) {
            for (int k = 0; k < 3; k++) {
                mpz_mul(n->offset.x[k], n->corner[i].x[k], length2);
                mpz_addmul(n->offset.x[k], n->edge[i].x[k], along);
            }
            mpz_set(n->offset_denominator, length2);
        }
    }
    mpz_clears(along, length2, square, NULL);
}

static void offer_corner(nearest *n, int i)
{
    mpz_t one, square;
    bool taken;
    mpz_inits(one, square, NULL);
    mpz_set_ui(one, 1);
    ebpo_vectorz_dot(square, &n->corner[i], &n->corner[i]);
    offer_feature(n, i == 0, square, one, (ebpo_feature)(EBPO_NEAR_CORNER0 + i), &taken);
    if (taken) {
        for (int k = 0; k < 3; k++)
            mpz_set(n->offset.x[k], n->corner[i].x[k]);
        mpz_set_ui(n->offset_denominator, 1);
    }
    mpz_clears(one, square, NULL);
}

static void find_nearest(nearest *n)
{
    if (try_interior(n))
        return;
    for (int i = 0; i < 3; i++)
        offer_corner(n, i);
    for (int i = 0; i < 3; i++)
        offer_edge(n, i);
}

static void nearest_by_integers(const double p[3], const double triangle[3][3],
                                ebpo_triangle_nearest *out)
{
    nearest n;
    nearest_init(&n);
    set_points(&n, p, triangle,
               ebpo_common_unit(&triangle[0][0], 9, ebpo_common_unit(p, 3, EBPO_UNIT_OF_ZEROS)));
    find_nearest(&n);
    out->feature = n.feature;
    out->distance = ebpo_round_root(n.square, n.denominator, n.unit);
    for (int k = 0; k < 3; k++) {
        mpz_addmul(n.offset.x[k], n.p.x[k], n.offset_denominator);
        out->point[k] = ebpo_round_quotient(n.offset.x[k], n.offset_denominator, n.unit);
    }
    if (n.feature <= EBPO_NEAR_CORNER2)
        memcpy(out->point, triangle[n.feature], sizeof out->point);
    nearest_clear(&n);
}

void ebpo_triangle_square_gmp(const double p[3], const double triangle[3][3], int unit,
                              mpz_t square, mpz_t denominator)
{
    nearest n;
    nearest_init(&n);
    set_points(&n, p, triangle, unit);
    find_nearest(&n);
    mpz_set(square, n.square);
    mpz_set(denominator, n.denominator);
    nearest_clear(&n);
}

static int compare_by_integers(const double p[3], const double a[3][3], const double b[3][3])
{
    nearest n, m;
    nearest_init(&n);
    nearest_init(&m);
    int unit =
        ebpo_common_unit(&b[0][0], 9,
                         ebpo_common_unit(&a[0][0], 9, ebpo_common_unit(p, 3, EBPO_UNIT_OF_ZEROS)));
    set_points(&n, p, a, unit);
    set_points(&m, p, b, unit);
    find_nearest(&n);
    find_nearest(&m);
    mpz_mul(n.t, n.square, m.denominator);
    mpz_mul(m.t, m.square, n.denominator);
    int sign = mpz_cmp(n.t, m.t);
    nearest_clear(&n);
    nearest_clear(&m);
    return (sign > 0) - (sign < 0);
}

static int compare_to_by_integers(const double p[3], const double triangle[3][3], double d)
{
    nearest n;
    nearest_init(&n);
    set_points(&n, p, triangle,
               ebpo_common_unit(&triangle[0][0], 9,
                                ebpo_common_unit(p, 3,
                                                 ebpo_common_unit(&d, 1, EBPO_UNIT_OF_ZEROS))));
    find_nearest(&n);
    ebpo_set_integer(n.t, d, n.unit);
    mpz_mul(n.t, n.t, n.t);
    mpz_mul(n.t, n.t, n.denominator);
    int sign = mpz_cmp(n.square, n.t);
    nearest_clear(&n);
    return (sign > 0) - (sign < 0);
}

static void unit_normal_by_integers(const double triangle[3][3], double normal[3])
{
    static const double origin[3];
    nearest n;
    nearest_init(&n);
    set_points(&n, origin, triangle, ebpo_common_unit(&triangle[0][0], 9, EBPO_UNIT_OF_ZEROS));
    ebpo_vectorz_dot(n.t, &n.normal, &n.normal);
    for (int k = 0; k < 3; k++) {
        mpz_mul(n.u, n.normal.x[k], n.normal.x[k]);
        double size = mpz_sgn(n.t) ? ebpo_round_root(n.u, n.t, 0) : 0;
        normal[k] = mpz_sgn(n.normal.x[k]) < 0 ? -size : size;
    }
    nearest_clear(&n);
}

/* --- double-double arithmetic first, then integers --- */

/* Beyond these limits, products of four coordinates or their rounding errors may overflow or
 * underflow. */
static const double max_reach = 0x1p120, least_size = 0x1p-120;

static bool in_pair_range(const double p[3], const double triangle[3][3])
{
    double reach = 0, size = 0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            double r = fabs(triangle[i][k] - p[k]),
                   l = fabs(triangle[i][k] - triangle[i == 2 ? 0 : i + 1][k]);
            reach = r > reach ? r : reach;
            size = l > size ? l : size;
        }
    return reach < max_reach && size > least_size;
}

/* Applies Ziv's test: returns true if the error bound determines the rounded distance. */
static bool rounds_certainly(const ebpo_measured *m, double *distance)
{
    double error = m->error * m->distance.head;
    double least = m->distance.head + (m->distance.tail - error),
           most = m->distance.head + (m->distance.tail + error);
    *distance = least;
    return m->error < 0x1p-56 && least == most;
}

/* Computes the distance if the nearest feature is a corner and the triangle is far away. Numbers
 * are scaled, so that no number overflows. Scaling may lose parts of small coordinates; these parts
 * are below 2^-1000 of the distance. */
static bool corner_by_pairs(const double p[3], const double triangle[3][3],
                            const ebpo_distance_bounds *bounds, ebpo_triangle_nearest *out)
{
    double q[3], t[3][3];
    ebpo_measured m;
    if (bounds->feature > EBPO_NEAR_CORNER2 || !(bounds->lo > 0x1p-900))
        return false;
    int exponent = scale_all(p, triangle, q, t);
    if (ldexp(bounds->lo, -exponent) < 0x1p-10)
        return false;
    ebpo_distance_pairs_best()->measure(q, (const double(*)[3])t, bounds->feature, NULL, &m);
    if (!rounds_certainly(&m, &out->distance))
        return false;
    out->distance = ldexp(out->distance, exponent);
    out->feature = bounds->feature;
    memcpy(out->point, triangle[out->feature], sizeof out->point);
    return true;
}

/* Computes the nearest point by double-double arithmetic. Returns false if this arithmetic is not
 * accurate enough. *known: true if the normal needs no further computation. */
static bool nearest_by_pairs(const double p[3], const double triangle[3][3],
                             const ebpo_distance_bounds *bounds, double *normal, bool *known,
                             ebpo_triangle_nearest *out)
{
    ebpo_measured m;
    *known = false;
    if (bounds->feature == EBPO_NEAR_UNKNOWN || !(bounds->lo > least_size))
        return false;
    if (!in_pair_range(p, triangle))
        return corner_by_pairs(p, triangle, bounds, out);
    *known = ebpo_distance_pairs_best()->measure(p, triangle, bounds->feature, normal, &m);
    if (!rounds_certainly(&m, &out->distance))
        return false;
    out->feature = bounds->feature;
    memcpy(out->point, m.point, sizeof out->point);
    return true;
}

void ebpo_triangle_nearest_exact(const double p[3], const double triangle[3][3],
                                 const ebpo_distance_bounds *bounds, double *normal,
                                 ebpo_triangle_nearest *out)
{
    ebpo_distance_bounds b;
    bool known;
    if (bounds)
        b = *bounds;
    else
        ebpo_triangle_distance_bounds(p, triangle, &b);
    if (!nearest_by_pairs(p, triangle, &b, normal, &known, out))
        nearest_by_integers(p, triangle, out);
    if (normal && !known)
        ebpo_triangle_unit_normal(triangle, normal);
}

int ebpo_triangle_distance_compare(const double p[3], const double a[3][3], const double b[3][3])
{
    ebpo_distance_bounds x, y;
    ebpo_triangle_distance_bounds(p, a, &x);
    ebpo_triangle_distance_bounds(p, b, &y);
    if (x.hi < y.lo)
        return -1;
    if (x.lo > y.hi)
        return 1;
    int sign;
    if (x.feature <= EBPO_NEAR_CORNER2 && y.feature <= EBPO_NEAR_CORNER2 &&
        compare_far_corners(p, a[x.feature], b[y.feature], &sign))
        return sign;
    double foot[3], c[3][3], d[3][3];
    memcpy(foot, p, sizeof foot);
    memcpy(c, a, sizeof c);
    memcpy(d, b, sizeof d);
    if (flatten_far(foot, c, x.feature, d, y.feature))
        return ebpo_triangle_distance_compare(foot, (const double(*)[3])c, (const double(*)[3])d);
    return compare_by_integers(p, a, b);
}

int ebpo_triangle_distance_compare_to(const double p[3], const double triangle[3][3], double d)
{
    ebpo_distance_bounds b;
    if (isinf(d))
        return -1;
    ebpo_triangle_distance_bounds(p, triangle, &b);
    return b.hi < d ? -1 : b.lo > d ? 1 : compare_to_by_integers(p, triangle, d);
}

void ebpo_triangle_unit_normal(const double triangle[3][3], double normal[3])
{
    if (!ebpo_distance_pairs_best()->unit_normal(triangle, normal))
        unit_normal_by_integers(triangle, normal);
}
