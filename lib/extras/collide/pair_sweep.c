/* Computes the last time at which two faces (triangles) have a common point, if one face moves
 * along a direction.
 *
 * Projected along the direction, both faces are convex polygons. The height of a point of a face is
 * the point's coordinate along the direction. In the overlap of the polygons, the difference of the
 * heights of both faces is a concave function. So this difference is greatest at a corner of a
 * polygon, or at a point where edges of both polygons cross. The exact time is a fraction of
 * integers (GMP). A bound in doubles follows from separating axes: the direction, the normals, and
 * the vector products of edges of both faces, and of edges and the direction. See
 * docs/develop/collision.md, "Separation distance along a direction". All functions are pure and
 * can be called from any thread. */
#include "core/strict_fp.h"

#include "extras/collide/face_pairs.h"

#include <math.h>

#include "geometry/integer_vectors.h"
#include "geometry/vec3.h"

void ebpo_sweep_time_init(ebpo_sweep_time *t)
{
    mpz_inits(t->numerator, t->denominator, NULL);
    t->unit = 0;
    t->ever = false;
}

void ebpo_sweep_time_clear(ebpo_sweep_time *t) { mpz_clears(t->numerator, t->denominator, NULL); }

int ebpo_sweep_time_compare(const ebpo_sweep_time *x, const ebpo_sweep_time *y)
{
    mpz_t left, right;
    if (!x->ever || !y->ever)
        return x->ever - y->ever;
    mpz_inits(left, right, NULL);
    mpz_mul(left, x->numerator, y->denominator);
    mpz_mul(right, y->numerator, x->denominator);
    if (x->unit > y->unit)
        mpz_mul_2exp(left, left, (unsigned)(x->unit - y->unit));
    else
        mpz_mul_2exp(right, right, (unsigned)(y->unit - x->unit));
    int order = mpz_cmp(left, right);
    mpz_clears(left, right, NULL);
    return order;
}

double ebpo_sweep_time_round(const ebpo_sweep_time *t)
{
    mpz_t size;
    if (!t->ever)
        return -INFINITY;
    mpz_init(size);
    mpz_abs(size, t->numerator);
    double out = ebpo_round_quotient(size, t->denominator, t->unit);
    mpz_clear(size);
    return mpz_sgn(t->numerator) < 0 ? -out : out;
}

/* --- in integers --- */

/* Two faces in integers: face 0 moves, face 1 does not. */
typedef struct sweep {
    ebpo_vectorz d;            /* direction */
    ebpo_vectorz corner[2][3]; /* corners of both faces */
    ebpo_vectorz u, v, w;      /* temporary values: two edges, and a vector between the faces */
    ebpo_vectorz n, m;         /* temporary values: a normal, and the result of a vector product */
    mpz_t top, bottom;         /* the time top / bottom */
    mpz_t share;               /* position on an edge, as a share of the edge, times `bottom` */
    ebpo_sweep_time *best;     /* the last time so far */
} sweep;

static void sweep_init(sweep *s)
{
    ebpo_vectorz *all[] = { &s->d, &s->u, &s->v, &s->w, &s->n, &s->m };
    for (int i = 0; i < 6; i++) {
        ebpo_vectorz_init(all[i]);
        ebpo_vectorz_init(&s->corner[i / 3][i % 3]);
    }
    mpz_inits(s->top, s->bottom, s->share, NULL);
}

static void sweep_clear(sweep *s)
{
    ebpo_vectorz *all[] = { &s->d, &s->u, &s->v, &s->w, &s->n, &s->m };
    for (int i = 0; i < 6; i++) {
        ebpo_vectorz_clear(all[i]);
        ebpo_vectorz_clear(&s->corner[i / 3][i % 3]);
    }
    mpz_clears(s->top, s->bottom, s->share, NULL);
}

/* Computes the triple product x . (y x z); overwrites `m`. */
static void triple_product(sweep *s, mpz_t out, const ebpo_vectorz *x, const ebpo_vectorz *y,
                           const ebpo_vectorz *z)
{
    ebpo_vectorz_cross(&s->m, y, z);
    ebpo_vectorz_dot(out, x, &s->m);
}

/* Keeps the time top / bottom if it is later than the last time so far. reversed: the time was
 * computed for a motion of face 1, so its sign is changed. */
static void keep_later_time(sweep *s, bool reversed)
{
    if (mpz_sgn(s->bottom) < 0) {
        mpz_neg(s->top, s->top);
        mpz_neg(s->bottom, s->bottom);
    }
    if (reversed)
        mpz_neg(s->top, s->top);
    if (s->best->ever) {
        mpz_mul(s->share, s->top, s->best->denominator);
        mpz_submul(s->share, s->best->numerator, s->bottom);
        if (mpz_sgn(s->share) <= 0)
            return;
    }
    mpz_set(s->best->numerator, s->top);
    mpz_set(s->best->denominator, s->bottom);
    s->best->ever = true;
}

/* Returns true if share / bottom is in 0 .. 1; bottom must not be 0. */
static bool is_share(const sweep *s)
{
    int sign = mpz_sgn(s->bottom);
    return mpz_sgn(s->share) * sign >= 0 && mpz_cmp(s->share, s->bottom) * sign <= 0;
}

/* Returns the corner after corner i of face `which`. */
static const ebpo_vectorz *next_corner(const sweep *s, int which, int i)
{
    return &s->corner[which][i == 2 ? 0 : i + 1];
}

/* Sets n to the normal of face `which`. Returns false if the face is parallel to the direction or
 * has no area. */
static bool find_normal(sweep *s, int which)
{
    ebpo_vectorz_subtract(&s->u, &s->corner[which][1], &s->corner[which][0]);
    ebpo_vectorz_subtract(&s->v, &s->corner[which][2], &s->corner[which][0]);
    ebpo_vectorz_cross(&s->n, &s->u, &s->v);
    ebpo_vectorz_dot(s->share, &s->n, &s->d);
    return mpz_sgn(s->share) != 0;
}

/* Returns true if the projection of face `which` contains the projection of the corner. */
static bool is_over(sweep *s, const ebpo_vectorz *corner, int which)
{
    int signs[3] = { 0, 0, 0 };
    for (int k = 0; k < 3; k++) {
        ebpo_vectorz_subtract(&s->u, next_corner(s, which, k), &s->corner[which][k]);
        ebpo_vectorz_subtract(&s->v, corner, &s->corner[which][k]);
        triple_product(s, s->share, &s->d, &s->u, &s->v);
        signs[mpz_sgn(s->share) + 1]++;
    }
    return signs[0] == 0 || signs[2] == 0;
}

/* Keeps the last of the times at which the other face contains a corner of face `which`. The other
 * face must have an area and must not be parallel to the direction. */
static void corners_and_face(sweep *s, int which)
{
    (void)find_normal(s, !which);
    for (int i = 0; i < 3; i++) {
        if (!is_over(s, &s->corner[which][i], !which))
            continue;
        ebpo_vectorz_subtract(&s->w, &s->corner[!which][0], &s->corner[which][i]);
        ebpo_vectorz_dot(s->top, &s->n, &s->w);
        ebpo_vectorz_dot(s->bottom, &s->n, &s->d);
        keep_later_time(s, which == 1);
    }
}

/* Keeps the time t at which edge i of face 0 intersects edge j of face 1, if the projections of the
 * edges cross. Solves w = t d + x u - y v by Cramer's rule, where u and v are the edges, and w is
 * the vector between their first corners. */
static void two_edges(sweep *s, int i, int j)
{
    const ebpo_vectorz *p = &s->corner[0][i], *q = &s->corner[1][j];
    ebpo_vectorz_subtract(&s->u, next_corner(s, 0, i), p);
    ebpo_vectorz_subtract(&s->v, next_corner(s, 1, j), q);
    ebpo_vectorz_subtract(&s->w, q, p);
    triple_product(s, s->bottom, &s->d, &s->u, &s->v);
    if (mpz_sgn(s->bottom) == 0)
        return;
    triple_product(s, s->share, &s->d, &s->w, &s->v);
    if (!is_share(s))
        return;
    triple_product(s, s->share, &s->d, &s->w, &s->u);
    if (!is_share(s))
        return;
    triple_product(s, s->top, &s->w, &s->u, &s->v);
    keep_later_time(s, false);
}

/* Keeps the time t at which corner i of face `which` is on edge j of the other face: w = t d - x v,
 * where v is the edge, and w is the vector from the corner to the first corner of the edge. */
static void corner_and_edge(sweep *s, int which, int i, int j)
{
    const ebpo_vectorz *p = &s->corner[which][i], *q = &s->corner[!which][j];
    ebpo_vectorz_subtract(&s->v, next_corner(s, !which, j), q);
    ebpo_vectorz_subtract(&s->w, q, p);
    ebpo_vectorz_cross(&s->n, &s->d, &s->v);
    ebpo_vectorz_dot(s->bottom, &s->n, &s->n);
    ebpo_vectorz_dot(s->share, &s->w, &s->n);
    if (mpz_sgn(s->bottom) == 0 || mpz_sgn(s->share) != 0)
        return;
    triple_product(s, s->share, &s->n, &s->w, &s->d);
    if (!is_share(s))
        return;
    triple_product(s, s->top, &s->n, &s->w, &s->v);
    keep_later_time(s, which == 1);
}

/* Keeps the time t at which corner i of face 0 is equal to corner j of face 1, if their projections
 * are equal: w = t d, where w is the vector between the corners. */
static void two_corners(sweep *s, int i, int j)
{
    ebpo_vectorz_subtract(&s->w, &s->corner[1][j], &s->corner[0][i]);
    ebpo_vectorz_cross(&s->n, &s->w, &s->d);
    for (int k = 0; k < 3; k++)
        if (mpz_sgn(s->n.x[k]) != 0)
            return;
    ebpo_vectorz_dot(s->top, &s->w, &s->d);
    ebpo_vectorz_dot(s->bottom, &s->d, &s->d);
    keep_later_time(s, false);
}

/* Finds the last time of contact of both faces. */
static void inspect_faces(sweep *s)
{
    bool upright[2] = { !find_normal(s, 0), !find_normal(s, 1) }; /* parallel to the direction, or
                                                                   * without area */
    for (int which = 0; which < 2; which++)
        if (!upright[!which])
            corners_and_face(s, which);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            two_edges(s, i, j);
            if (!upright[0] && !upright[1])
                continue;
            corner_and_edge(s, 0, i, j);
            corner_and_edge(s, 1, i, j);
            two_corners(s, i, j);
        }
}

void ebpo_sweep_last(const double a[3][3], const double b[3][3], const double direction[3],
                     ebpo_sweep_time *out)
{
    sweep s = { .best = out };
    int unit = ebpo_common_unit(b[0], 9, ebpo_common_unit(a[0], 9, EBPO_UNIT_OF_ZEROS)),
        along = ebpo_common_unit(direction, 3, EBPO_UNIT_OF_ZEROS);
    if (unit == EBPO_UNIT_OF_ZEROS)
        unit = 0;
    sweep_init(&s);
    for (int k = 0; k < 3; k++) {
        ebpo_set_integer(s.d.x[k], direction[k], along);
        for (int i = 0; i < 3; i++) {
            ebpo_set_integer(s.corner[0][i].x[k], a[i][k], unit);
            ebpo_set_integer(s.corner[1][i].x[k], b[i][k], unit);
        }
    }
    out->ever = false;
    out->unit = unit - along;
    inspect_faces(&s);
    sweep_clear(&s);
}

/* --- bounds --- */

/* The interval 0 .. most that contains all times of contact from 0 to the caller's limit. Vectors n
 * restrict the interval one after another: at a time t of contact, t (n . d) is between the least
 * and the greatest difference of y and x along n, where x and y are points of the two faces. */
typedef struct time_bounds {
    double x[3][3];  /* corners of the moving face, relative to its first corner */
    double y[3][3];  /* corners of the other face, relative to the same corner */
    double norm;     /* upper bound of the 1-norms of x and y */
    const double *d; /* [3] direction of the motion */
    double most;     /* negative: there is no time of contact */
} time_bounds;

/* Restricts the interval by the vector n. */
static void bound_by(time_bounds *b, const double n[3])
{
    double size = fabs(n[0]) + fabs(n[1]) + fabs(n[2]);
    if (!(size > 0x1p-600 && size < 0x1p600) || b->most < 0)
        return;
    double c = ebpo_vec3_dot(n, b->d), sign = c < 0 ? -1 : 1, slack = 0x1p-48 * size * b->norm;
    double x_lo = INFINITY, x_hi = -INFINITY, y_lo = INFINITY, y_hi = -INFINITY;
    for (int i = 0; i < 3; i++) {
        double x = sign * ebpo_vec3_dot(n, b->x[i]), y = sign * ebpo_vec3_dot(n, b->y[i]);
        x_lo = fmin(x_lo, x);
        x_hi = fmax(x_hi, x);
        y_lo = fmin(y_lo, y);
        y_hi = fmax(y_hi, y);
    }
    double least = y_lo - x_hi - slack, greatest = y_hi - x_lo + slack;
    double c_lo = fabs(c) - 0x1p-48 * size, c_hi = fabs(c) + 0x1p-48 * size;
    if (least > b->most * c_hi * (1 + 0x1p-50) ||
        greatest < (c_lo < 0 ? b->most * c_lo * (1 + 0x1p-50) : 0))
        b->most = -1;
    else if (c_lo > 0)
        b->most = fmin(b->most, greatest / c_lo * (1 + 0x1p-50));
}

/* Restricts the interval by the vector product of x and y. */
static void bound_by_cross(time_bounds *b, const double x[3], const double y[3])
{
    double n[3];
    ebpo_vec3_cross(x, y, n);
    bound_by(b, n);
}

double ebpo_sweep_max(const double a[3][3], const double b[3][3], const double direction[3],
                      double limit)
{
    time_bounds w = { .d = direction, .most = limit };
    double edge[2][3][3];
    for (int i = 0; i < 3; i++) {
        double x = 0, y = 0;
        for (int k = 0; k < 3; k++) {
            w.x[i][k] = a[i][k] - a[0][k];
            w.y[i][k] = b[i][k] - a[0][k];
            x += fabs(w.x[i][k]);
            y += fabs(w.y[i][k]);
        }
        w.norm = fmax(w.norm, fmax(x, y));
    }
    if (!(w.norm > 0x1p-250 && w.norm < 0x1p250))
        return limit;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            edge[0][i][k] = w.x[i == 2 ? 0 : i + 1][k] - w.x[i][k];
            edge[1][i][k] = w.y[i == 2 ? 0 : i + 1][k] - w.y[i][k];
        }
    bound_by(&w, direction);
    for (int f = 0; f < 2; f++)
        bound_by_cross(&w, edge[f][0], edge[f][1]);
    for (int i = 0; i < 6; i++)
        bound_by_cross(&w, direction, edge[i / 3][i % 3]);
    for (int i = 0; i < 9; i++)
        bound_by_cross(&w, edge[0][i / 3], edge[1][i % 3]);
    return w.most;
}
