/* The squared distance of two faces as a fraction of integers: the least over corners and faces,
 * and over edges whose inner points are nearest. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "geometry/distance.h"
#include "geometry/distance_parts.h"
#include "geometry/integer_vectors.h"
#include "extras/collide/pair_distance.h"
#include "geometry/triangle_pair.h"

typedef struct fraction {
    mpz_t square, denominator; /* of units */
} fraction;

static void fraction_init(fraction *f) { mpz_inits(f->square, f->denominator, NULL); }

static void fraction_clear(fraction *f) { mpz_clears(f->square, f->denominator, NULL); }

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

/* Takes the lesser one; a denominator of 0: none so far. */
static void take_lesser(fraction *best, const fraction *other)
{
    if (mpz_sgn(best->denominator) != 0 && fraction_compare(other, best) >= 0)
        return;
    mpz_set(best->square, other->square);
    mpz_set(best->denominator, other->denominator);
}

/* --- edges --- */

typedef struct edges {
    ebpo_vectorz from[2], along[2], between, normal, part;
    mpz_t length2, share;
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

static void set_edge(edges *e, int of, const double from[3], const double to[3], int unit)
{
    for (int k = 0; k < 3; k++) {
        ebpo_set_integer(e->from[of].x[k], from[k], unit);
        ebpo_set_integer(e->along[of].x[k], to[k], unit);
    }
    ebpo_vectorz_subtract(&e->along[of], &e->along[of], &e->from[of]);
}

/* Where the lines are nearest is between the ends of edge `of`. */
static bool within_edge(edges *e, int of)
{
    ebpo_vectorz_cross(&e->part, &e->between, &e->along[!of]);
    ebpo_vectorz_dot(e->share, &e->part, &e->normal);
    return mpz_sgn(e->share) >= 0 && mpz_cmp(e->share, e->length2) <= 0;
}

/* False: parallel, or an end is nearer. */
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

/* Farther than `hi` for certain. */
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

static void take_edges(fraction *best, const double a[3][3], const double b[3][3], double hi,
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
                take_lesser(best, &f);
        }
    }
    fraction_clear(&f);
    edges_clear(&e);
}

/* --- faces --- */

static void take_corners(fraction *best, const double corner[3][3], const double face[3][3],
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
        take_lesser(best, &f);
    }
    fraction_clear(&f);
}

static int unit_of(const double a[3][3], const double b[3][3], int unit)
{
    return ebpo_common_unit(&b[0][0], 9, ebpo_common_unit(&a[0][0], 9, unit));
}

static void squared_distance(const double a[3][3], const double b[3][3], int unit, fraction *out)
{
    if (ebpo_triangle_pair(a, b) != EBPO_PAIR_APART) {
        mpz_set_ui(out->square, 0);
        mpz_set_ui(out->denominator, 1);
        return;
    }
    ebpo_pair_distance_bounds bounds; /* what is farther is not the least */
    ebpo_triangles_distance_bounds(a, b, &bounds);
    mpz_set_ui(out->denominator, 0);
    take_corners(out, a, b, bounds.hi, unit);
    take_corners(out, b, a, bounds.hi, unit);
    take_edges(out, a, b, bounds.hi, unit);
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
