/* What ray_close.c asks of double-double arithmetic.
 *
 * Error bounds: as in predicates.c; each holds for the computed permanent (the sum of absolute
 * values), the slack covers underflow, and an overflow makes the bound infinite or not a number, so
 * that no comparison succeeds. */
#include "core/strict_fp.h"

#ifdef __FMA__
#define EBPO_PRODUCTS_BY_FMA
#endif

#include "geometry/expansion.h"
#include "geometry/ray_pairs.h"

/* A normal and the sum of absolute values behind each component. */
typedef struct plane_normal {
    ebpo_pair x[3];
    double permanent[3];
} plane_normal;

static inline plane_normal ray_pairs_cross(const ebpo_pair f[3], const ebpo_pair g[3])
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

/* n . y. Errors: some 12 * 2^-106 of the permanent in n, 12 more in products and sums; 2^-97 leaves
 * a margin. */
static inline ebpo_bounded ray_pairs_dot(const plane_normal *n, const ebpo_pair y[3])
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

static void ray_pairs_plane(const ebpo_segment *ray, const double triangle[3][3],
                            ebpo_plane_pairs *out)
{
    ebpo_pair f[3], g[3], to_plane[3], d[3];
    for (int k = 0; k < 3; k++) {
        f[k] = ebpo_two_difference(triangle[1][k], triangle[0][k]);
        g[k] = ebpo_two_difference(triangle[2][k], triangle[0][k]);
        to_plane[k] = ebpo_two_difference(triangle[0][k], ray->origin[k]);
        d[k] = ebpo_pair_of(ray->direction[k]);
    }
    plane_normal n = ray_pairs_cross(f, g);
    ebpo_bounded a = ray_pairs_dot(&n, to_plane), b = ray_pairs_dot(&n, d);
    double error = a.error / fabs(a.x.head) + b.error / fabs(b.x.head);
    out->numerator = a;
    out->denominator = b;
    out->has_quotient = ebpo_pair_quotient(a.x, b.x, error, out->quotient);
}

static void ray_pairs_edge(const double d[3], const ebpo_pair a[3], const double from[3],
                           const double to[3], ebpo_bounded *out)
{
    ebpo_pair direction[3], e[3];
    for (int k = 0; k < 3; k++) {
        direction[k] = ebpo_pair_of(d[k]);
        e[k] = ebpo_two_difference(to[k], from[k]);
    }
    plane_normal n = ray_pairs_cross(a, e);
    *out = ray_pairs_dot(&n, direction);
}

const ebpo_ray_pairs EBPO_KERNEL(ebpo_ray_pairs) = { ray_pairs_plane, ray_pairs_edge };
