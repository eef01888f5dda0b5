/* Computes the ends of the segment that two crossing faces have in common.
 *
 * Exact signs (geometry/predicates.h) decide which edges pierce the other face, so each end is
 * computed from the correct edge. The point where an edge pierces a plane is computed in
 * double-double arithmetic: each number is an ebpo_pair, the sum of two doubles. If
 * coordinates are too large or too small for the error bounds of double-double arithmetic, the
 * point is computed exactly with GMP and rounded once.
 * The coordinates of the points have the same bits for any order of the faces and of their corners.
 * Bounds: docs/develop/collision.md, "Contact of a crossing pair". The functions are pure and can
 * be called from any thread. */
#include "core/strict_fp.h"

#include "extras/collide/face_pairs.h"

#include <math.h>
#include <string.h>

#include "geometry/expansion.h"
#include "geometry/integer_vectors.h"
#include "geometry/triangle_pair.h"

/* An edge with its ends on different sides of a plane, and three points of the plane. The two ends
 * and the three points are sorted by their coordinates, so that results do not depend on the order
 * of corners. */
typedef struct piercing {
    const double *end[2], *plane[3];
} piercing;

/* Sorts n corners by their coordinates. */
static void sort_corners(const double **corner, int n)
{
    for (int i = 1; i < n; i++)
        for (int j = i; j > 0 && ebpo_corner_order(corner[j - 1], corner[j]) > 0; j--) {
            const double *last = corner[j - 1];
            corner[j - 1] = corner[j];
            corner[j] = last;
        }
}

/* Returns the edge of `face` between the corners `from` and `to`, and the plane through the three
 * points `plane`, in sorted order. */
static piercing piercing_of(const double face[3][3], int from, int to, const double plane[3][3])
{
    piercing p = { { face[from], face[to] }, { plane[0], plane[1], plane[2] } };
    sort_corners(p.end, 2);
    sort_corners(p.plane, 3);
    return p;
}

/* --- the point, in double-double arithmetic --- */

/* Sets *height to the signed distance of `point` from a plane, times the length of the plane's
 * normal. `origin` is a point of the plane. normal[k] is the difference of two products, and
 * magnitude[k] is the sum of the absolute values of the two products. For the error bound, returns
 * the sum over k of magnitude[k] * |point[k] - origin[k]|. */
static double height_over(const ebpo_pair normal[3], const double magnitude[3],
                          const double *origin, const double *point, ebpo_pair *height)
{
    ebpo_pair d[3];
    double sum = 0;
    ebpo_pair_differences(origin, point, d);
    *height = ebpo_pair_dot(normal, d);
    for (int k = 0; k < 3; k++)
        sum += magnitude[k] * fabs(d[k].head);
    return sum;
}

/* Sets *share to the position of the piercing point as a fraction of the edge. This is height[0] /
 * (height[0] - height[1]); height[i] is the height of end i over the plane. Returns false if the
 * error of *share may be too large. */
static bool share_of_edge(const piercing *p, ebpo_pair *share)
{
    ebpo_pair e[3], f[3], normal[3], height[2]; /* e, f: two edges of the face in the plane */
    double magnitude[3], most = 0;
    ebpo_pair_differences(p->plane[0], p->plane[1], e);
    ebpo_pair_differences(p->plane[0], p->plane[2], f);
    ebpo_pair_cross(e, f, normal);
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        magnitude[k] = fabs(e[u].head * f[v].head) + fabs(e[v].head * f[u].head);
    }
    for (int i = 0; i < 2; i++)
        most = fmax(most, height_over(normal, magnitude, p->plane[0], p->end[i], &height[i]));
    ebpo_pair difference = ebpo_pair_subtract(height[0], height[1]);
    *share = ebpo_pair_divide(height[0], difference);
    return most <= 0x1p30 * fabs(difference.head) && fabs(difference.head) >= 0x1p-600;
}

/* Returns false if coordinates are so large or so small that the error bounds are not valid. */
static bool is_ordinary(const piercing *p)
{
    const double *const all[] = { p->end[0], p->end[1], p->plane[0], p->plane[1], p->plane[2] };
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 5; i++)
            if (fabs(all[i][k]) > 0x1p200)
                return false;
        double most = fmax(fabs(p->end[0][k]), fabs(p->end[1][k]));
        if (most != 0 && most < 0x1p-900)
            return false;
    }
    return true;
}

/* Computes the piercing point in double-double arithmetic. Returns false if its error may be too
 * large. */
static bool point_by_pairs(const piercing *p, double out[3])
{
    ebpo_pair share, d[3];
    if (!is_ordinary(p) || !share_of_edge(p, &share))
        return false;
    ebpo_pair_differences(p->end[0], p->end[1], d);
    for (int k = 0; k < 3; k++)
        out[k] = ebpo_pair_add(ebpo_pair_multiply(d[k], share), ebpo_pair_of(p->end[0][k])).head;
    return true;
}

/* --- the point, exact and rounded once --- */

/* A piercing in integers, which count multiples of 2^unit. */
typedef struct exact_piercing {
    ebpo_vectorz end[2];   /* ends of the edge */
    ebpo_vectorz plane[3]; /* plane[0]: a point of the plane; others: vectors from this point */
    ebpo_vectorz normal;   /* normal of the plane */
    mpz_t height[2];       /* heights of the ends over the plane, times the normal's length */
    mpz_t numerator;       /* an intermediate result */
} exact_piercing;

/* Sets the integers from a piercing, and computes the normal and the heights. */
static void set_exact(exact_piercing *e, const piercing *p, int unit)
{
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < 2; i++)
            ebpo_set_integer(e->end[i].x[k], p->end[i][k], unit);
        for (int i = 0; i < 3; i++)
            ebpo_set_integer(e->plane[i].x[k], p->plane[i][k], unit);
    }
    ebpo_vectorz_subtract(&e->plane[1], &e->plane[1], &e->plane[0]);
    ebpo_vectorz_subtract(&e->plane[2], &e->plane[2], &e->plane[0]);
    ebpo_vectorz_cross(&e->normal, &e->plane[1], &e->plane[2]);
    for (int i = 0; i < 2; i++) {
        ebpo_vectorz_subtract(&e->plane[1], &e->end[i], &e->plane[0]);
        ebpo_vectorz_dot(e->height[i], &e->normal, &e->plane[1]);
    }
}

/* Computes the point (end1 h0 - end0 h1) / (h0 - h1). h0 and h1 are the heights of the ends over
 * the plane, and have different signs. First makes h0 - h1 positive. */
static void exact_point(exact_piercing *e, int unit, double out[3])
{
    if (mpz_sgn(e->height[0]) < 0 || mpz_sgn(e->height[1]) > 0)
        for (int i = 0; i < 2; i++)
            mpz_neg(e->height[i], e->height[i]);
    for (int k = 0; k < 3; k++) {
        mpz_mul(e->numerator, e->end[1].x[k], e->height[0]);
        mpz_submul(e->numerator, e->end[0].x[k], e->height[1]);
        mpz_sub(e->normal.x[0], e->height[0], e->height[1]); /* the normal is not needed any more */
        out[k] = ebpo_round_quotient(e->numerator, e->normal.x[0], unit);
    }
}

/* Computes the piercing point exactly, and rounds it once. */
static void point_by_integers(const piercing *p, double out[3])
{
    exact_piercing e;
    ebpo_vectorz *all[] = {
        &e.end[0], &e.end[1], &e.plane[0], &e.plane[1], &e.plane[2], &e.normal
    };
    int unit = EBPO_UNIT_OF_ZEROS;
    for (int i = 0; i < 2; i++)
        unit = ebpo_common_unit(p->end[i], 3, unit);
    for (int i = 0; i < 3; i++)
        unit = ebpo_common_unit(p->plane[i], 3, unit);
    for (int i = 0; i < 6; i++)
        ebpo_vectorz_init(all[i]);
    mpz_inits(e.height[0], e.height[1], e.numerator, NULL);
    set_exact(&e, p, unit);
    exact_point(&e, unit, out);
    mpz_clears(e.height[0], e.height[1], e.numerator, NULL);
    for (int i = 0; i < 6; i++)
        ebpo_vectorz_clear(all[i]);
}

/* Computes the piercing point. */
static void compute_piercing(const piercing *p, double out[3])
{
    if (!point_by_pairs(p, out))
        point_by_integers(p, out);
}

/* --- which edge pierces --- */

/* An edge of a face that intersects the plane of the other face. The edge begins at the corner that
 * is alone on one side of this plane. */
typedef struct edge {
    const double (*face)[3];  /* corners of the face that has the edge */
    const double (*plane)[3]; /* corners of the other face */
    int from, to;             /* corners of `face` at which the edge begins and ends */
    bool ends_in_plane;       /* corner `to` is in the plane */
} edge;

/* Returns the corner or edge of the face on which the piercing point is. */
static ebpo_feature feature_of(const edge *e)
{
    if (e->ends_in_plane)
        return (ebpo_feature)(EBPO_NEAR_CORNER0 + e->to);
    int next = e->from == 2 ? 0 : e->from + 1;
    return (ebpo_feature)(EBPO_NEAR_EDGE0 + (e->to == next ? e->from : e->to));
}

/* Computes the point where an edge intersects the other face's plane. */
static void end_of(const edge *e, double out[3])
{
    if (e->ends_in_plane) {
        memcpy(out, e->face[e->to], 3 * sizeof *out);
        return;
    }
    piercing p = piercing_of(e->face, e->from, e->to, e->plane);
    compute_piercing(&p, out);
}

/* Returns one of two edges with the same piercing point: an edge that ends at this point, or, if no
 * edge ends there, the edge whose ends come first in the order of coordinates. */
static const edge *choose_edge(const edge *a, const edge *b)
{
    if (a->ends_in_plane || b->ends_in_plane)
        return a->ends_in_plane ? a : b;
    piercing p = piercing_of(a->face, a->from, a->to, a->plane),
             q = piercing_of(b->face, b->from, b->to, b->plane);
    int order = ebpo_corner_order(p.end[0], q.end[0]);
    return (order != 0 ? order : ebpo_corner_order(p.end[1], q.end[1])) <= 0 ? a : b;
}

/* Sets an end of the segment. If order < 0, the end is the point where A's edge pierces B. If order
 * > 0, the end is the point where B's edge pierces A. If order is 0, both points are equal. */
static void set_end(const edge *a, const edge *b, int order, ebpo_contact_end *out)
{
    end_of(order < 0 ? a : order > 0 ? b : choose_edge(a, b), out->point);
    out->on_a = order <= 0 ? feature_of(a) : EBPO_NEAR_INTERIOR;
    out->on_b = order >= 0 ? feature_of(b) : EBPO_NEAR_INTERIOR;
}

void ebpo_triangle_contact(const double a[3][3], const double b[3][3], ebpo_contact_end out[2])
{
    ebpo_prepared_pair t;
    ebpo_pair_kind kind;
    if (!ebpo_prepare_pair(a, b, &t, &kind))
        return;
    /* of_a: the edges of A from corner t.a[0] to the corners t.a[1] and t.a[2]; of_b likewise */
    edge of_a[2], of_b[2];
    for (int i = 0; i < 2; i++) {
        of_a[i] = (edge){ a, b, t.a[0], t.a[i + 1], t.side_a[t.a[i + 1]] == 0 };
        of_b[i] = (edge){ b, a, t.b[0], t.b[i + 1], t.side_b[t.b[i + 1]] == 0 };
    }
    /* The direction of the common line is the cross product of the two planes' normals, which
     * ebpo_prepare_pair may have flipped. A line in this direction enters A through the edge
     * of_a[1] and leaves it through of_a[0]. It enters B through of_b[0] and leaves it through
     * of_b[1]. `out` has the direction of the original normals. Flipping one normal reverses the
     * direction. */
    bool reversed = t.flipped_a != t.flipped_b;
    set_end(&of_a[1], &of_b[0], ebpo_compare_ends(a, b, &t, 2, 1), &out[reversed]);
    set_end(&of_a[0], &of_b[1], -ebpo_compare_ends(a, b, &t, 1, 2), &out[!reversed]);
}
