#include "core/strict_fp.h"

#include "geometry/distance_far.h"

#include <math.h>
#include <string.h>

/* A number, and a bound of its error; 0 without error is exact. */
typedef struct near {
    double x, error;
} near;

/* Roundings of the errors themselves, and of what is below the normal doubles. */
static const double more = 1 + 0x1p-40, rounding = 0x1p-52, lost = 0x1p-1060;

static near multiply(near a, near b)
{
    near out = { a.x * b.x, 0 };
    if ((a.x == 0 && a.error == 0) || (b.x == 0 && b.error == 0))
        return (near){ 0, 0 };
    out.error =
        (fabs(a.x) * b.error + fabs(b.x) * a.error + a.error * b.error + fabs(out.x) * rounding) *
            more +
        lost;
    return out;
}
static near add(near a, near b)
{
    near out = { a.x + b.x, (a.error + b.error) * more };
    out.error += fabs(out.x) * rounding;
    return out;
}
static near minus(near a) { return (near){ -a.x, a.error }; }

static near dot(const near a[3], const near b[3])
{
    return add(add(multiply(a[0], b[0]), multiply(a[1], b[1])), multiply(a[2], b[2]));
}
static void cross(const near a[3], const near b[3], near out[3])
{
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        out[k] = add(multiply(a[u], b[v]), minus(multiply(a[v], b[u])));
    }
}
static int sign_of(near a) { return a.x > a.error ? 1 : a.x < -a.error ? -1 : 0; }
static bool is_nothing(near a) { return a.x == 0 && a.error == 0; }

/* to - from, times 2^-exponent. */
static near difference(double to, double from, int exponent)
{
    double d = to - from;
    near out = { isfinite(d) ? ldexp(d, -exponent) : ldexp(to, -exponent) - ldexp(from, -exponent),
                 0 };
    if (d != 0)
        out.error = fabs(out.x) * rounding + lost;
    return out;
}

/* So that no coordinate's difference is above 2. */
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
    near corner[3][3], edge[3][3]; /* in units of their own: corners seen from p */
    near along[3], back[3];        /* corner k . edge k; corner k + 1 . edge k */
    int exponent, edge_exponent;
} far_triangle;

/* False: two corners are equal, and which of them is nearest is not told here. */
static bool relate(const double p[3], const double triangle[3][3], far_triangle *t)
{
    bool apart = true;
    t->exponent = exponent_of(triangle, 3, p);
    t->edge_exponent = exponent_of(triangle, 3, triangle[0]);
    for (int i = 0; i < 3; i++) {
        bool any = false;
        for (int k = 0; k < 3; k++) {
            t->corner[i][k] = difference(triangle[i][k], p[k], t->exponent);
            t->edge[i][k] = difference(triangle[(i + 1) % 3][k], triangle[i][k], t->edge_exponent);
            any = any || !is_nothing(t->edge[i][k]);
        }
        apart = apart && any;
    }
    for (int i = 0; i < 3; i++) {
        t->along[i] = dot(t->corner[i], t->edge[i]);
        t->back[i] = dot(t->corner[(i + 1) % 3], t->edge[i]);
    }
    return apart;
}

static ebpo_feature feature_of(const far_triangle *t)
{
    near normal[3], outward[3];
    bool inside = true;
    cross(t->edge[0], t->edge[1], normal);
    for (int i = 0; i < 3; i++) {
        const near *along = &t->along[i], *before = &t->back[(i + 2) % 3];
        /* behind the corner along both of its edges, or right beside it */
        if ((sign_of(*along) > 0 || is_nothing(*along)) &&
            (sign_of(*before) < 0 || is_nothing(*before)))
            return (ebpo_feature)(EBPO_NEAR_CORNER0 + i);
        cross(t->edge[i], normal, outward);
        int side = sign_of(dot(outward, t->corner[i]));
        if (side < 0 && sign_of(*along) < 0 && sign_of(t->back[i]) > 0)
            return (ebpo_feature)(EBPO_NEAR_EDGE0 + i);
        inside = inside && side > 0;
    }
    return inside ? EBPO_NEAR_INTERIOR : EBPO_NEAR_UNKNOWN;
}

static double length(const near a[3])
{
    return sqrt(a[0].x * a[0].x + a[1].x * a[1].x + a[2].x * a[2].x);
}

/* The nearest corner is at most the triangle's size farther than the nearest point. */
static void bound(const far_triangle *t, ebpo_feature feature, ebpo_distance_bounds *out)
{
    double least = INFINITY, size = 0;
    for (int i = 0; i < 3; i++) {
        least = fmin(least, length(t->corner[i]));
        size = fmax(size, length(t->edge[i]));
    }
    if (feature <= EBPO_NEAR_CORNER2) {
        least = length(t->corner[feature]);
        size = 0;
    }
    double low = least * (1 - 0x1p-48) -
                 ldexp(size, t->edge_exponent - t->exponent) * (1 + 0x1p-40) - 0x1p-1000,
           high = least * (1 + 0x1p-48) + 0x1p-1000;
    out->feature = feature;
    out->lo = low > 0 ? fmax(nextafter(ldexp(low, t->exponent), -INFINITY), 0) : 0;
    out->hi = nextafter(ldexp(high, t->exponent), INFINITY);
    /* what overflows may not have before it was rounded */
    out->lo = fmin(out->lo, 0x1.fffffffffffffp1023);
}

ebpo_feature ebpo_far_feature(const double p[3], const double triangle[3][3],
                              ebpo_distance_bounds *out)
{
    far_triangle t;
    ebpo_feature feature = EBPO_NEAR_UNKNOWN;
    if (relate(p, triangle, &t))
        feature = feature_of(&t);
    if (out && t.exponent - t.edge_exponent > 20)
        bound(&t, feature, out);
    return feature;
}

/* |p - a|^2 - |p - b|^2 = (a - b) . ((a - p) + (b - p)) */
bool ebpo_far_corners_compare(const double p[3], const double a[3], const double b[3], int *sign)
{
    const double both[2][3] = { { a[0], a[1], a[2] }, { b[0], b[1], b[2] } };
    int apart = exponent_of((const double(*)[3])both, 1, b),
        away = exponent_of((const double(*)[3])both, 2, p);
    near step[3], middle[3];
    for (int k = 0; k < 3; k++) {
        step[k] = difference(a[k], b[k], apart);
        middle[k] = add(difference(a[k], p[k], away), difference(b[k], p[k], away));
    }
    near d = dot(step, middle);
    *sign = sign_of(d);
    return *sign || is_nothing(d);
}

/* The corners that a feature has; the others become copies of them. */
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

bool ebpo_far_flatten(double p[3], double a[3][3], ebpo_feature of_a, double b[3][3],
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
