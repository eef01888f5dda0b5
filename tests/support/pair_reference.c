#include "pair_reference.h"

#include <gmp.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* --- vectors of integers --- */

typedef mpz_t zector[3];

static void z_init(zector v) { mpz_inits(v[0], v[1], v[2], NULL); }
static void z_clear(zector v) { mpz_clears(v[0], v[1], v[2], NULL); }

static void z_sub(zector out, zector a, zector b)
{
    for (int k = 0; k < 3; k++)
        mpz_sub(out[k], a[k], b[k]);
}

static void z_dot(mpz_t out, zector a, zector b)
{
    mpz_mul(out, a[0], b[0]);
    mpz_addmul(out, a[1], b[1]);
    mpz_addmul(out, a[2], b[2]);
}

static void z_cross(zector out, zector a, zector b)
{
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        mpz_mul(out[k], a[u], b[v]);
        mpz_submul(out[k], a[v], b[u]);
    }
}

static bool z_none(zector v) { return !mpz_sgn(v[0]) && !mpz_sgn(v[1]) && !mpz_sgn(v[2]); }

/* --- the pair: coordinates in a common power of two, so that all are integers --- */

enum { CORNERS_MAX = 64 };

typedef struct work {
    zector corner[2][3], edge[2][3], normal[2], n, w, x, y;
    mpz_t nn, s, t, den;
    /* the corners of the intersection that were found: points[i] / weight[i] */
    zector points[CORNERS_MAX];
    mpz_t weight[CORNERS_MAX];
    int count, unit;
} work;

static work *shared;

static void make_shared(void)
{
    work *k = shared = calloc(1, sizeof *shared);
    if (!k)
        abort();
    for (int of = 0; of < 2; of++) {
        for (int i = 0; i < 3; i++) {
            z_init(k->corner[of][i]);
            z_init(k->edge[of][i]);
        }
        z_init(k->normal[of]);
    }
    z_init(k->n);
    z_init(k->w);
    z_init(k->x);
    z_init(k->y);
    mpz_inits(k->nn, k->s, k->t, k->den, NULL);
    for (int i = 0; i < CORNERS_MAX; i++) {
        z_init(k->points[i]);
        mpz_init(k->weight[i]);
    }
}

static int lowest_bit(double x)
{
    int e;
    if (x == 0)
        return 1100;
    frexp(x, &e);
    return e - 53;
}

static void to_integer(mpz_t out, double x, int unit)
{
    int e;
    double f = frexp(x, &e);
    mpz_set_d(out, f * 0x1p53);
    if (x != 0)
        mpz_mul_2exp(out, out, (mp_bitcnt_t)(e - 53 - unit));
}

static work *begin(const double a[3][3], const double b[3][3])
{
    if (!shared)
        make_shared();
    work *k = shared;
    k->unit = 1100;
    k->count = 0;
    for (int i = 0; i < 9; i++) {
        int p = lowest_bit(a[i / 3][i % 3]), q = lowest_bit(b[i / 3][i % 3]);
        k->unit = p < k->unit ? p : k->unit;
        k->unit = q < k->unit ? q : k->unit;
    }
    for (int i = 0; i < 9; i++) {
        to_integer(k->corner[0][i / 3][i % 3], a[i / 3][i % 3], k->unit);
        to_integer(k->corner[1][i / 3][i % 3], b[i / 3][i % 3], k->unit);
    }
    for (int of = 0; of < 2; of++) {
        for (int i = 0; i < 3; i++)
            z_sub(k->edge[of][i], k->corner[of][(i + 1) % 3], k->corner[of][i]);
        z_cross(k->normal[of], k->edge[of][0], k->edge[of][1]);
    }
    return k;
}

/* --- corners of the intersection --- */

/* Adds the point x + y * s / den. */
static void add_point(work *k, zector x, zector y, mpz_t s, mpz_t den)
{
    if (k->count == CORNERS_MAX)
        abort();
    for (int i = 0; i < 3; i++) {
        mpz_mul(k->points[k->count][i], x[i], den);
        mpz_addmul(k->points[k->count][i], y[i], s);
    }
    mpz_set(k->weight[k->count], den);
    if (mpz_sgn(den) < 0) {
        for (int i = 0; i < 3; i++)
            mpz_neg(k->points[k->count][i], k->points[k->count][i]);
        mpz_neg(k->weight[k->count], den);
    }
    k->count++;
}

/* Computes the signs of the three areas that the point makes with the edges of a face; the point is
 * in its plane. */
static void areas(work *k, int of, zector point, mpz_t weight, int sign[3])
{
    for (int i = 0; i < 3; i++) {
        for (int c = 0; c < 3; c++) {
            mpz_mul(k->y[c], k->corner[of][i][c], weight);
            mpz_sub(k->y[c], point[c], k->y[c]);
        }
        z_cross(k->x, k->edge[of][i], k->y);
        z_dot(k->t, k->x, k->normal[of]);
        sign[i] = mpz_sgn(k->t);
    }
}

static bool last_within(work *k, int of)
{
    int sign[3];
    areas(k, of, k->points[k->count - 1], k->weight[k->count - 1], sign);
    return sign[0] >= 0 && sign[1] >= 0 && sign[2] >= 0;
}

/* Adds the point where edge i of face `of` intersects the plane of the other face, or corner i if
 * it is in this plane. */
static void pierce(work *k, int of, int i)
{
    if (z_none(k->normal[!of]))
        return;
    z_sub(k->w, k->corner[of][i], k->corner[!of][0]);
    z_dot(k->s, k->normal[!of], k->w);
    z_dot(k->den, k->normal[!of], k->edge[of][i]);
    mpz_neg(k->den, k->den);
    if (mpz_sgn(k->s) == 0) {
        mpz_set_ui(k->den, 1);
    } else {
        if (mpz_sgn(k->den) == 0 || mpz_sgn(k->s) != mpz_sgn(k->den) ||
            mpz_cmpabs(k->s, k->den) > 0)
            return;
    }
    add_point(k, k->corner[of][i], k->edge[of][i], k->s, k->den);
    if (!last_within(k, !of))
        k->count--;
}

/* Adds corner i of face `of`, if it is on edge j of the other. */
static void on_edge(work *k, int of, int i, int j)
{
    z_sub(k->w, k->corner[of][i], k->corner[!of][j]);
    z_cross(k->n, k->w, k->edge[!of][j]);
    if (!z_none(k->n))
        return;
    z_dot(k->s, k->w, k->edge[!of][j]);
    z_dot(k->t, k->edge[!of][j], k->edge[!of][j]);
    if (mpz_sgn(k->s) < 0 || mpz_cmp(k->s, k->t) > 0)
        return;
    /* an edge that is a point */
    if (mpz_sgn(k->t) == 0 && !z_none(k->w))
        return;
    mpz_set_ui(k->s, 0);
    mpz_set_ui(k->den, 1);
    add_point(k, k->corner[of][i], k->w, k->s, k->den);
}

static void edges_intersect(work *k, int i, int j)
{
    z_cross(k->n, k->edge[0][i], k->edge[1][j]);
    if (z_none(k->n))
        return;
    z_sub(k->w, k->corner[1][j], k->corner[0][i]);
    z_dot(k->s, k->w, k->n);
    if (mpz_sgn(k->s) != 0)
        return;
    z_dot(k->nn, k->n, k->n);
    z_cross(k->x, k->w, k->edge[0][i]);
    z_dot(k->t, k->x, k->n);
    z_cross(k->x, k->w, k->edge[1][j]);
    z_dot(k->s, k->x, k->n);
    if (mpz_sgn(k->s) < 0 || mpz_sgn(k->t) < 0 || mpz_cmp(k->s, k->nn) > 0 ||
        mpz_cmp(k->t, k->nn) > 0)
        return;
    add_point(k, k->corner[0][i], k->edge[0][i], k->s, k->nn);
}

static void find_common(work *k)
{
    for (int i = 0; i < 3; i++) {
        pierce(k, 0, i);
        pierce(k, 1, i);
        for (int j = 0; j < 3; j++) {
            edges_intersect(k, i, j);
            on_edge(k, 0, i, j);
            on_edge(k, 1, i, j);
        }
    }
}

/* Returns true if the mean of the found points, an inner point of the intersection, is in the
 * interior of face `of`. */
static bool mean_within(work *k, int of, zector sum, mpz_t weight)
{
    int sign[3];
    if (z_none(k->normal[of]))
        return false;
    areas(k, of, sum, weight, sign);
    return sign[0] > 0 && sign[1] > 0 && sign[2] > 0;
}

int reference_pair_kind(const double a[3][3], const double b[3][3])
{
    work *k = begin(a, b);
    zector sum;
    mpz_t weight;
    find_common(k);
    if (!k->count)
        return 0;
    z_init(sum);
    mpz_init_set_ui(weight, 1);
    for (int i = 0; i < k->count; i++) {
        for (int c = 0; c < 3; c++) {
            mpz_mul(sum[c], sum[c], k->weight[i]);
            mpz_addmul(sum[c], k->points[i][c], weight);
        }
        mpz_mul(weight, weight, k->weight[i]);
    }
    mpz_mul_ui(weight, weight, (unsigned)k->count);
    int kind = 1;
    if (mean_within(k, 0, sum, weight) && mean_within(k, 1, sum, weight)) {
        z_cross(k->n, k->normal[0], k->normal[1]);
        kind = z_none(k->n) ? 3 : 2;
    }
    z_clear(sum);
    mpz_clear(weight);
    return kind;
}

/* --- contact --- */

/* Returns the lowest feature of a face that contains point i, which is on the face. */
static int feature_at(work *k, int of, int i)
{
    int sign[3];
    areas(k, of, k->points[i], k->weight[i], sign);
    for (int c = 0; c < 3; c++)
        if (sign[c] == 0 && sign[(c + 2) % 3] == 0)
            return c;
    for (int c = 0; c < 3; c++)
        if (sign[c] == 0)
            return 3 + c;
    return 6;
}

/* Returns true if |x - point i| <= 0.51 ulp(x) + 2^-60 most on each axis. */
static bool close_to(work *k, int i, const double *x, const double most[3])
{
    bool close = true;
    mpq_t exact, given, off;
    mpq_inits(exact, given, off, NULL);
    for (int c = 0; c < 3; c++) {
        mpz_set(mpq_numref(exact), k->points[i][c]);
        mpz_set(mpq_denref(exact), k->weight[i]);
        mpq_canonicalize(exact);
        if (k->unit >= 0)
            mpq_mul_2exp(exact, exact, (mp_bitcnt_t)k->unit);
        else
            mpq_div_2exp(exact, exact, (mp_bitcnt_t)-k->unit);
        mpq_set_d(given, x[c]);
        mpq_sub(off, given, exact);
        mpq_abs(off, off);
        double size = fabs(x[c]);
        mpq_set_d(given, 0.51 * (nextafter(size, INFINITY) - size));
        mpq_set_d(exact, ldexp(most[c], -60));
        mpq_add(given, given, exact);
        close &= mpq_cmp(off, given) <= 0;
    }
    mpq_clears(exact, given, off, NULL);
    return close;
}

/* Returns the found point that is least (-1) or greatest (1) along k->n. */
static int extreme(work *k, int which)
{
    int best = 0;
    mpz_t p, q;
    mpz_inits(p, q, NULL);
    for (int i = 1; i < k->count; i++) {
        z_dot(p, k->n, k->points[i]);
        z_dot(q, k->n, k->points[best]);
        mpz_mul(p, p, k->weight[best]);
        mpz_mul(q, q, k->weight[i]);
        if (mpz_cmp(p, q) * which > 0)
            best = i;
    }
    mpz_clears(p, q, NULL);
    return best;
}

const char *reference_pair_contact(const double a[3][3], const double b[3][3],
                                   const reference_end end[2], const double most[3])
{
    work *k = begin(a, b);
    find_common(k);
    for (int e = 0; e < 2; e++) {
        z_cross(k->n, k->normal[0], k->normal[1]);
        int i = extreme(k, e ? 1 : -1);
        if (!close_to(k, i, end[e].point, most))
            return e ? "the second end is elsewhere" : "the first end is elsewhere";
        if (feature_at(k, 0, i) != end[e].on_a)
            return "the feature of A differs";
        if (feature_at(k, 1, i) != end[e].on_b)
            return "the feature of B differs";
    }
    return NULL;
}
