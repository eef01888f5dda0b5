/* From the nearest double, where the winding number is known, three axis-parallel segments lead to
 * the point; what they cross is counted in integers. */
#include "core/strict_fp.h"

#include "extras/collide/exact_winding.h"

#include <math.h>

#include "geometry/integer_vectors.h"

/* Points in units of 2^unit / denominator. */
typedef struct path {
    const ebpo_posed_solid *solid;
    const mpq_t *x;
    double w[3];
    mpz_t denominator, number[4]; /* number: scratch */
    ebpo_vectorz at[4];           /* w, then one coordinate after the other of x */
    ebpo_vectorz corner[3];
    int32_t crossed;
} path;

static void make_path(path *p)
{
    mpz_init_set_ui(p->denominator, 1);
    for (int i = 0; i < 4; i++)
        mpz_init(p->number[i]);
    for (int i = 0; i < 4; i++)
        ebpo_vectorz_init(&p->at[i]);
    for (int i = 0; i < 3; i++) {
        ebpo_vectorz_init(&p->corner[i]);
        mpz_lcm(p->denominator, p->denominator, mpq_denref(p->x[i]));
    }
}

static void clear_path(path *p)
{
    mpz_clear(p->denominator);
    for (int i = 0; i < 4; i++)
        mpz_clear(p->number[i]);
    for (int i = 0; i < 4; i++)
        ebpo_vectorz_clear(&p->at[i]);
    for (int i = 0; i < 3; i++)
        ebpo_vectorz_clear(&p->corner[i]);
}

/* unit: 0 or less, so that x is a whole number. */
static void set_points(path *p, const double t[3][3], int unit)
{
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            ebpo_set_integer(p->corner[i].x[k], t[i][k], unit);
            mpz_mul(p->corner[i].x[k], p->corner[i].x[k], p->denominator);
        }
    for (int k = 0; k < 3; k++) {
        ebpo_set_integer(p->number[0], p->w[k], unit);
        mpz_mul(p->number[0], p->number[0], p->denominator);
        mpz_divexact(p->number[1], p->denominator, mpq_denref(p->x[k]));
        mpz_mul(p->number[1], p->number[1], mpq_numref(p->x[k]));
        mpz_mul_2exp(p->number[1], p->number[1], (mp_bitcnt_t)-unit);
        for (int i = 0; i < 4; i++)
            mpz_set(p->at[i].x[k], p->number[i > k]);
    }
}

/* Orientation of a, b, c seen against the axis. */
static int turn_of(path *p, int axis, const ebpo_vectorz *a, const ebpo_vectorz *b,
                   const ebpo_vectorz *c)
{
    int u = axis == 2 ? 0 : axis + 1, v = axis == 0 ? 2 : axis - 1;
    mpz_sub(p->number[0], b->x[u], a->x[u]);
    mpz_sub(p->number[1], c->x[v], a->x[v]);
    mpz_mul(p->number[0], p->number[0], p->number[1]);
    mpz_sub(p->number[2], b->x[v], a->x[v]);
    mpz_sub(p->number[3], c->x[u], a->x[u]);
    mpz_submul(p->number[0], p->number[2], p->number[3]);
    return mpz_sgn(p->number[0]);
}

/* As in geometry/crossing.c: the side of the shifted point of a line and of the plane. */
static int side_of_line(path *p, int axis, int i, const ebpo_vectorz *at)
{
    const ebpo_vectorz *a = &p->corner[i], *b = &p->corner[i == 2 ? 0 : i + 1];
    int u = axis == 2 ? 0 : axis + 1, v = axis == 0 ? 2 : axis - 1;
    int sign = turn_of(p, axis, a, b, at);
    if (sign != 0)
        return sign;
    int by_u = mpz_cmp(a->x[v], b->x[v]), by_v = mpz_cmp(b->x[u], a->x[u]);
    int first = u < v ? by_u : by_v, second = u < v ? by_v : by_u;
    sign = first ? first : second;
    return (sign > 0) - (sign < 0);
}

static int side_of_plane(path *p, const ebpo_vectorz *at)
{
    const ebpo_vectorz *a = &p->corner[0];
    mpz_t sum;
    mpz_init(sum);
    for (int k = 0; k < 3; k++) {
        (void)turn_of(p, k, a, &p->corner[1], &p->corner[2]);
        mpz_sub(p->number[1], at->x[k], a->x[k]);
        mpz_addmul(sum, p->number[0], p->number[1]);
    }
    int sign = mpz_sgn(sum);
    mpz_clear(sum);
    for (int k = 0; k < 3 && sign == 0; k++)
        sign = turn_of(p, k, a, &p->corner[1], &p->corner[2]);
    return sign;
}

/* Of the corners, along the axis from one point to another above it. */
static int crossing(path *p, int axis, const ebpo_vectorz *from, const ebpo_vectorz *to)
{
    int turn = side_of_line(p, axis, 0, from);
    if (turn == 0 || side_of_line(p, axis, 1, from) != turn ||
        side_of_line(p, axis, 2, from) != turn || side_of_plane(p, from) == turn ||
        side_of_plane(p, to) != turn)
        return 0;
    return -turn;
}

static bool take(void *user, const ebpo_triangles *triangles)
{
    path *p = user;
    for (uint64_t i = 0; i < triangles->count; i++) {
        double t[3][3];
        int unit = 0;
        for (int c = 0; c < 3; c++)
            ebpo_posing_apply(&p->solid->posing, triangles->corners[i][c], t[c]);
        unit = ebpo_common_unit(&t[0][0], 9, ebpo_common_unit(p->w, 3, unit));
        set_points(p, (const double(*)[3])t, unit);
        for (int k = 0; k < 3; k++) {
            int up = mpz_cmp(p->at[k + 1].x[k], p->at[k].x[k]);
            if (up > 0)
                p->crossed += crossing(p, k, &p->at[k], &p->at[k + 1]);
            else if (up < 0)
                p->crossed -= crossing(p, k, &p->at[k + 1], &p->at[k]);
        }
    }
    return true;
}

ebpo_status ebpo_exact_winding(const ebpo_posed_solid *s, ebpo_context *context, const mpq_t x[3],
                               int32_t *winding, ebpo_error *error)
{
    path p = { .solid = s, .x = x };
    double low[3], high[3], corner[2][3];
    ebpo_posed_sides sides;
    bool there = true;
    mpq_t w;
    mpq_init(w);
    for (int k = 0; k < 3; k++) {
        p.w[k] = mpq_get_d(x[k]);
        mpq_set_d(w, p.w[k]);
        there &= mpq_equal(w, x[k]) != 0;
        corner[0][k] = nextafter(p.w[k], -INFINITY);
        corner[1][k] = nextafter(p.w[k], INFINITY);
    }
    mpq_clear(w);
    ebpo_status status = ebpo_posed_solid_sides(s, context, p.w, &sides, error);
    *winding = sides.above;
    if (status != EBPO_OK || there)
        return status;
    make_path(&p);
    ebpo_unpose_box(s, corner[0], corner[1], low, high);
    status = ebpo_triangles_in_box(context, low, high, take, &p, error);
    *winding += p.crossed;
    clear_path(&p);
    return status;
}
