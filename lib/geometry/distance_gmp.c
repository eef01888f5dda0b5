/* Distance to a triangle without rounding: coordinates as integers in a common power of two, the
 * squared distance as a fraction of integers. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include <gmp.h>

#include "geometry/distance_parts.h"
#include "geometry/integer_vectors.h"

/* The nearest point is p + numerator / denominator, the squared distance square / denominator2. */
typedef struct nearest {
    int unit;
    ebpo_vectorz p, corner[3], edge[3], normal; /* corners relative to p */
    mpz_t square, denominator;                  /* squared distance in squared units */
    ebpo_vectorz offset;                        /* nearest point less p, times offset_denominator */
    mpz_t offset_denominator;
    ebpo_feature feature;
    mpz_t t, u;
    ebpo_vectorz w;
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

/* Takes corner or edge when it is nearer than what was found (of equal ones: the corner). */
static void offer(nearest *n, bool first, const mpz_t square, const mpz_t denominator,
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
    mpz_neg(along, along); /* projection of p on the edge, times its length */
    ebpo_vectorz_dot(length2, &n->edge[i], &n->edge[i]);
    if (mpz_sgn(along) > 0 && mpz_cmp(along, length2) < 0) {
        ebpo_vectorz_dot(square, &n->corner[i], &n->corner[i]);
        mpz_mul(square, square, length2);
        mpz_submul(square, along, along);
        offer(n, false, square, length2, (ebpo_feature)(EBPO_NEAR_EDGE0 + i), &taken);
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
    offer(n, i == 0, square, one, (ebpo_feature)(EBPO_NEAR_CORNER0 + i), &taken);
    if (taken) {
        for (int k = 0; k < 3; k++)
            mpz_set(n->offset.x[k], n->corner[i].x[k]);
        mpz_set_ui(n->offset_denominator, 1);
    }
    mpz_clears(one, square, NULL);
}

static void find(nearest *n)
{
    if (try_interior(n))
        return;
    for (int i = 0; i < 3; i++)
        offer_corner(n, i);
    for (int i = 0; i < 3; i++)
        offer_edge(n, i);
}

void ebpo_triangle_nearest_gmp(const double p[3], const double triangle[3][3],
                               ebpo_triangle_nearest *out)
{
    nearest n;
    nearest_init(&n);
    set_points(&n, p, triangle,
               ebpo_common_unit(&triangle[0][0], 9, ebpo_common_unit(p, 3, EBPO_UNIT_OF_ZEROS)));
    find(&n);
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
    find(&n);
    mpz_set(square, n.square);
    mpz_set(denominator, n.denominator);
    nearest_clear(&n);
}

int ebpo_triangle_distance_compare_gmp(const double p[3], const double a[3][3],
                                       const double b[3][3])
{
    nearest n, m;
    nearest_init(&n);
    nearest_init(&m);
    int unit =
        ebpo_common_unit(&b[0][0], 9,
                         ebpo_common_unit(&a[0][0], 9, ebpo_common_unit(p, 3, EBPO_UNIT_OF_ZEROS)));
    set_points(&n, p, a, unit);
    set_points(&m, p, b, unit);
    find(&n);
    find(&m);
    mpz_mul(n.t, n.square, m.denominator);
    mpz_mul(m.t, m.square, n.denominator);
    int sign = mpz_cmp(n.t, m.t);
    nearest_clear(&n);
    nearest_clear(&m);
    return (sign > 0) - (sign < 0);
}

int ebpo_triangle_distance_compare_to_gmp(const double p[3], const double triangle[3][3], double d)
{
    nearest n;
    nearest_init(&n);
    set_points(&n, p, triangle,
               ebpo_common_unit(&triangle[0][0], 9,
                                ebpo_common_unit(p, 3,
                                                 ebpo_common_unit(&d, 1, EBPO_UNIT_OF_ZEROS))));
    find(&n);
    ebpo_set_integer(n.t, d, n.unit);
    mpz_mul(n.t, n.t, n.t);
    mpz_mul(n.t, n.t, n.denominator);
    int sign = mpz_cmp(n.square, n.t);
    nearest_clear(&n);
    return (sign > 0) - (sign < 0);
}

void ebpo_triangle_unit_normal_gmp(const double triangle[3][3], double normal[3])
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
