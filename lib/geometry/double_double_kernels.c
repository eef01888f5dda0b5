/* Provides double-double arithmetic for distances and rays, compiled once for each instruction set.
 *
 * On processors with FMA one instruction computes the rounding error of a product. On other
 * processors the factors are split (expansion.h). Both methods give the same value if no number
 * overflows or underflows.
 *
 * Errors of distances are bounded relative to the distance. Errors of rays are bounded relative to
 * the computed permanent, which is the sum of the absolute values of all products (as in
 * predicates.c). If the bound is too large to decide, the caller uses exact arithmetic. So all
 * builds give the same decisions and results. */
#include "core/strict_fp.h"

#ifdef __FMA__
#define EBPO_PRODUCTS_BY_FMA
#endif

#include <math.h>
#include <string.h>

#include "geometry/double_double_kernels.h"

/* --- distances: triangle_distance.c --- */

/* Returns the square root to a relative error of about 2^-100; x > 0. */
static inline ebpo_pair pair_root(ebpo_pair x)
{
    double first = sqrt(x.head);
    ebpo_pair rest = ebpo_pair_subtract(x, ebpo_two_product(first, first));
    return ebpo_pair_add(ebpo_pair_of(first), ebpo_pair_of(rest.head / (2 * first)));
}

/* Returns the square root of a / b to a relative error of about 2^-100, by one Newton step from the
 * estimate `first`, which is accurate to 2^-50. The error of the step is half of the square of the
 * estimate's error. Compared with pair_root and ebpo_pair_divide, this saves one root and two
 * quotients. */
static inline ebpo_pair root_of_quotient(ebpo_pair a, ebpo_pair b, double first)
{
    ebpo_pair back = ebpo_pair_multiply(b, ebpo_two_product(first, first));
    double rest = ebpo_pair_subtract(a, back).head;
    return (ebpo_pair){ first, rest / (2 * first * b.head) };
}

/* Returns the 1-norm: the sum of the absolute components, rounded. */
static inline double norm_1(const ebpo_pair a[3])
{
    return fabs(a[0].head) + fabs(a[1].head) + fabs(a[2].head);
}

/* A triangle's edges e and f from corner 0, and its normal n = e x f. */
typedef struct pair_plane {
    ebpo_pair e[3], f[3], n[3];
    ebpo_pair length2; /* |n|^2 */
    double size;       /* at least |n| */
} pair_plane;

static inline void make_plane(const double triangle[3][3], pair_plane *out)
{
    ebpo_pair_differences(triangle[0], triangle[1], out->e);
    ebpo_pair_differences(triangle[0], triangle[2], out->f);
    out->size = norm_1(out->e) * norm_1(out->f);
    ebpo_pair_cross(out->e, out->f, out->n);
    out->length2 = ebpo_pair_dot(out->n, out->n);
}

/* Computes the distance of p from a corner. */
static inline void to_corner(const double p[3], const double corner[3], ebpo_measured *out)
{
    ebpo_pair d[3];
    ebpo_pair_differences(p, corner, d);
    out->distance = pair_root(ebpo_pair_dot(d, d));
    out->error = 0x1p-95;
    memcpy(out->point, corner, sizeof out->point);
}

/* Computes the distance of p from the edge's line: |(from - p) x edge| / |edge|. */
static inline void to_edge(const double p[3], const double from[3], const double to[3],
                           ebpo_measured *out)
{
    ebpo_pair a[3], e[3], w[3];
    ebpo_pair_differences(p, from, a);
    ebpo_pair_differences(from, to, e);
    ebpo_pair_cross(a, e, w);
    ebpo_pair area2 = ebpo_pair_dot(w, w), length2 = ebpo_pair_dot(e, e);
    double first = sqrt(area2.head / length2.head), t = -ebpo_pair_dot(a, e).head / length2.head;
    out->distance = root_of_quotient(area2, length2, first);
    out->error = 0x1p-94 * (1 + norm_1(a) / first);
    for (int k = 0; k < 3; k++)
        out->point[k] = t < 0.5 ? from[k] + t * e[k].head : to[k] - (1 - t) * e[k].head;
}

/* Computes the distance of p from the triangle's plane: |(corner - p) . normal| / |normal|. */
static inline void to_plane(const double p[3], const double triangle[3][3], const pair_plane *plane,
                            ebpo_measured *out)
{
    ebpo_pair a[3];
    ebpo_pair_differences(p, triangle[0], a);
    ebpo_pair height = ebpo_pair_dot(a, plane->n);
    double length = sqrt(plane->length2.head), first = fabs(height.head) / length,
           share = height.head / plane->length2.head;
    out->distance = root_of_quotient(ebpo_pair_multiply(height, height), plane->length2, first);
    out->error = 0x1p-94 * (1 + plane->size / length + norm_1(a) * plane->size / fabs(height.head));
    for (int k = 0; k < 3; k++)
        out->point[k] = p[k] + plane->n[k].head * share;
}

/* Computes the normal of length 1, or 0 for a triangle without area. Returns false if a component
 * is not accurate enough. */
static inline bool normal_of(const pair_plane *plane, double normal[3])
{
    const ebpo_pair *e = plane->e, *f = plane->f, *n = plane->n;
    bool sure = plane->size > 0x1p-200 && plane->size < 0x1p200;
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        double products = fabs(e[u].head * f[v].head) + fabs(e[v].head * f[u].head);
        bool nothing = (e[u].head == 0 || f[v].head == 0) && (e[v].head == 0 || f[u].head == 0);
        /* The error of a component is 2^-96 of `products`. If each of its two products has a factor
         * of 0, the component is exactly 0. */
        sure = sure && (nothing || (fabs(n[k].head) > 0x1p-40 * products && products > 0x1p-800));
    }
    if (!sure)
        return false;
    double length = plane->length2.head > 0 ? pair_root(plane->length2).head : 1;
    for (int k = 0; k < 3; k++)
        normal[k] = n[k].head / length;
    return true;
}

static bool to_feature(const double p[3], const double triangle[3][3], ebpo_feature feature,
                       double *normal, ebpo_measured *out)
{
    int i = (int)feature - EBPO_NEAR_EDGE0;
    pair_plane plane;
    if (feature > EBPO_NEAR_EDGE2 || normal)
        make_plane(triangle, &plane);
    if (feature <= EBPO_NEAR_CORNER2)
        to_corner(p, triangle[feature], out);
    else if (feature <= EBPO_NEAR_EDGE2)
        to_edge(p, triangle[i], triangle[i == 2 ? 0 : i + 1], out);
    else
        to_plane(p, triangle, &plane, out);
    return !normal || normal_of(&plane, normal);
}

static bool unit_normal(const double triangle[3][3], double normal[3])
{
    pair_plane plane;
    make_plane(triangle, &plane);
    return normal_of(&plane, normal);
}

const ebpo_distance_pairs EBPO_KERNEL(ebpo_distance_pairs) = { to_feature, unit_normal };

/* --- rays: ray_triangle.c --- */

/* Error bounds include EBPO_RAY_SLACK, which covers underflow. An overflow makes a bound infinite
 * or NaN; then no comparison with this bound succeeds. */

/* A normal and, for each component, the sum of the absolute values of its products. */
typedef struct plane_normal {
    ebpo_pair x[3];
    double permanent[3];
} plane_normal;

static inline plane_normal cross_bounded(const ebpo_pair f[3], const ebpo_pair g[3])
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

/* Returns n . y with an error bound. The error of n is some 12 * 2^-106 of the permanent, and the
 * products and sums have an error of the same size. The bound of 2^-97 of the permanent is larger
 * than the sum of both errors. */
static inline ebpo_bounded dot_bounded(const plane_normal *n, const ebpo_pair y[3])
{
    ebpo_pair first = ebpo_pair_multiply(n->x[0], y[0]), second = ebpo_pair_multiply(n->x[1], y[1]);
    ebpo_bounded out = {
        ebpo_pair_add(ebpo_pair_add(first, second), ebpo_pair_multiply(n->x[2], y[2])), 0
    };
    double a = fabs(y[0].head), b = fabs(y[1].head), c = fabs(y[2].head);
    double permanent = n->permanent[0] * a + n->permanent[1] * b + n->permanent[2] * c;
    out.error = 0x1p-97 * permanent + EBPO_RAY_SLACK * (1 + a + b + c);
    return out;
}

/* Computes numerator and denominator of t (ebpo_plane_pairs). */
static inline void plane_fraction(const double origin[3], const double direction[3],
                                  const double triangle[3][3], ebpo_bounded *numerator,
                                  ebpo_bounded *denominator)
{
    ebpo_pair f[3], g[3], to_plane[3], d[3];
    for (int k = 0; k < 3; k++) {
        f[k] = ebpo_two_difference(triangle[1][k], triangle[0][k]);
        g[k] = ebpo_two_difference(triangle[2][k], triangle[0][k]);
        to_plane[k] = ebpo_two_difference(triangle[0][k], origin[k]);
        d[k] = ebpo_pair_of(direction[k]);
    }
    plane_normal n = cross_bounded(f, g);
    *numerator = dot_bounded(&n, to_plane);
    *denominator = dot_bounded(&n, d);
}

static void intersect_plane(const ebpo_segment *ray, const double triangle[3][3],
                            ebpo_plane_pairs *out)
{
    ebpo_bounded a, b;
    plane_fraction(ray->origin, ray->direction, triangle, &a, &b);
    double error = a.error / fabs(a.x.head) + b.error / fabs(b.x.head);
    out->numerator = a;
    out->denominator = b;
    out->has_quotient = ebpo_pair_quotient(a.x, b.x, error, out->quotient);
}

/* The loop has no branches, so that compilers use vectors. */
static void intersect_four_planes(const ebpo_ray_four *restrict in, ebpo_plane_four *restrict out)
{
    for (int i = 0; i < 4; i++) {
        double origin[3], direction[3], triangle[3][3];
        for (int k = 0; k < 3; k++) {
            origin[k] = in->origin[k][i];
            direction[k] = in->direction[k][i];
            for (int corner = 0; corner < 3; corner++)
                triangle[corner][k] = in->triangle[corner][k][i];
        }
        ebpo_bounded a, b;
        plane_fraction(origin, direction, (const double(*)[3])triangle, &a, &b);
        out->numerator[i] = a.x.head;
        out->numerator_error[i] = a.error;
        out->error[i] = a.error / fabs(a.x.head) + b.error / fabs(b.x.head);
        double q = a.x.head / b.x.head;
        ebpo_pair_quotient_near(a.x, b.x, out->error[i], q, &out->least[i], &out->greatest[i]);
        out->rounded[i] = q;
    }
}

static void edge_side(const double d[3], const ebpo_pair a[3], const double from[3],
                      const double to[3], ebpo_bounded *out)
{
    ebpo_pair direction[3], e[3];
    for (int k = 0; k < 3; k++) {
        direction[k] = ebpo_pair_of(d[k]);
        e[k] = ebpo_two_difference(to[k], from[k]);
    }
    plane_normal n = cross_bounded(a, e);
    *out = dot_bounded(&n, direction);
}

const ebpo_ray_pairs EBPO_KERNEL(ebpo_ray_pairs) = { intersect_plane, intersect_four_planes,
                                                     edge_side };
