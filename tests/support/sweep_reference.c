#include "sweep_reference.h"

#include <math.h>

/* --- vectors of integers --- */

typedef struct whole {
    mpz_t x[3];
} whole;

static void whole_init(whole *v) { mpz_inits(v->x[0], v->x[1], v->x[2], NULL); }
static void whole_clear(whole *v) { mpz_clears(v->x[0], v->x[1], v->x[2], NULL); }

static void subtract(whole *out, const whole *a, const whole *b)
{
    for (int k = 0; k < 3; k++)
        mpz_sub(out->x[k], a->x[k], b->x[k]);
}

static void cross(whole *out, const whole *a, const whole *b)
{
    for (int k = 0; k < 3; k++) {
        int u = (k + 1) % 3, v = (k + 2) % 3;
        mpz_mul(out->x[k], a->x[u], b->x[v]);
        mpz_submul(out->x[k], a->x[v], b->x[u]);
    }
}

static void dot(mpz_t out, const whole *a, const whole *b)
{
    mpz_mul(out, a->x[0], b->x[0]);
    mpz_addmul(out, a->x[1], b->x[1]);
    mpz_addmul(out, a->x[2], b->x[2]);
}

static bool is_none(const whole *v)
{
    return !mpz_sgn(v->x[0]) && !mpz_sgn(v->x[1]) && !mpz_sgn(v->x[2]);
}

/* --- the hull --- */

typedef struct hull {
    whole d, point[9], u, v, n, m;
    mpz_t top, bottom, first, second, rest;
    bool found;
    mpq_t most, time;
} hull;

static void take(hull *h)
{
    mpz_set(mpq_numref(h->time), h->top);
    mpz_set(mpq_denref(h->time), h->bottom);
    mpq_canonicalize(h->time);
    if (h->found && mpq_cmp(h->time, h->most) <= 0)
        return;
    mpq_set(h->most, h->time);
    h->found = true;
}

/* Returns true if share / bottom >= 0. */
static bool not_negative(const hull *h, const mpz_t share)
{
    return mpz_sgn(share) * mpz_sgn(h->bottom) >= 0;
}

/* Tries a corner of the hull: p = t d */
static void try_one(hull *h, const whole *p)
{
    cross(&h->n, p, &h->d);
    if (!is_none(&h->n))
        return;
    dot(h->top, p, &h->d);
    dot(h->bottom, &h->d, &h->d);
    take(h);
}

/* Tries an edge of the hull: p + x u = t d */
static void try_two(hull *h, const whole *p, const whole *q)
{
    subtract(&h->u, q, p);
    cross(&h->n, &h->d, &h->u);
    dot(h->rest, p, &h->n);
    if (is_none(&h->n) || mpz_sgn(h->rest) != 0)
        return;
    dot(h->bottom, &h->n, &h->n);
    cross(&h->m, p, &h->d);
    dot(h->first, &h->m, &h->n);
    mpz_sub(h->rest, h->bottom, h->first);
    if (!not_negative(h, h->first) || !not_negative(h, h->rest))
        return;
    cross(&h->m, p, &h->u);
    dot(h->top, &h->m, &h->n);
    take(h);
}

/* Tries a triangle of the hull: p + x u + y v = t d, so t (d . n) = p . n, x = -(d . p cross v) /
 * (d . n), ... */
static void try_three(hull *h, const whole *p, const whole *q, const whole *r)
{
    subtract(&h->u, q, p);
    subtract(&h->v, r, p);
    cross(&h->n, &h->u, &h->v);
    dot(h->bottom, &h->d, &h->n);
    if (mpz_sgn(h->bottom) == 0)
        return;
    cross(&h->m, p, &h->v);
    dot(h->first, &h->d, &h->m);
    mpz_neg(h->first, h->first);
    cross(&h->m, &h->u, p);
    dot(h->second, &h->d, &h->m);
    mpz_neg(h->second, h->second);
    mpz_sub(h->rest, h->bottom, h->first);
    mpz_sub(h->rest, h->rest, h->second);
    if (!not_negative(h, h->first) || !not_negative(h, h->second) || !not_negative(h, h->rest))
        return;
    dot(h->top, p, &h->n);
    take(h);
}

static void try_all(hull *h)
{
    for (int i = 0; i < 9; i++) {
        try_one(h, &h->point[i]);
        for (int j = i + 1; j < 9; j++) {
            try_two(h, &h->point[i], &h->point[j]);
            for (int k = j + 1; k < 9; k++)
                try_three(h, &h->point[i], &h->point[j], &h->point[k]);
        }
    }
}

/* Returns true if some points may be beyond the known maximum along the direction. */
static bool may_be_later(hull *h)
{
    for (int i = 0; i < 9; i++) {
        dot(mpq_numref(h->time), &h->point[i], &h->d);
        dot(mpq_denref(h->time), &h->d, &h->d);
        mpq_canonicalize(h->time);
        if (mpq_cmp(h->time, h->most) > 0)
            return true;
    }
    return false;
}

/* --- from doubles --- */

static int least_unit(const double *x, int n, int unit)
{
    for (int i = 0; i < n; i++) {
        int e;
        if (x[i] == 0)
            continue;
        (void)frexp(x[i], &e);
        unit = e - 53 < unit ? e - 53 : unit;
    }
    return unit;
}

static void set_whole(mpz_t out, double x, int unit)
{
    int e;
    mpz_set_d(out, ldexp(frexp(x, &e), 53));
    if (x != 0)
        mpz_mul_2exp(out, out, (mp_bitcnt_t)(e - 53 - unit));
}

static void set_points(hull *h, const double a[3][3], const double b[3][3], int unit)
{
    mpz_t x;
    mpz_init(x);
    for (int i = 0; i < 9; i++)
        for (int k = 0; k < 3; k++) {
            set_whole(h->point[i].x[k], b[i / 3][k], unit);
            set_whole(x, a[i % 3][k], unit);
            mpz_sub(h->point[i].x[k], h->point[i].x[k], x);
        }
    mpz_clear(x);
}

/* Multiplies t by 2^steps. */
static void scale(mpq_t t, int steps)
{
    if (steps >= 0)
        mpq_mul_2exp(t, t, (mp_bitcnt_t)steps);
    else
        mpq_div_2exp(t, t, (mp_bitcnt_t)-steps);
}

static void each(hull *h, void (*vector)(whole *))
{
    whole *const all[] = { &h->d, &h->u, &h->v, &h->n, &h->m };
    for (int i = 0; i < 5; i++)
        vector(all[i]);
    for (int i = 0; i < 9; i++)
        vector(&h->point[i]);
}

bool sweep_reference(const double a[3][3], const double b[3][3], const double direction[3],
                     bool any, mpq_t t)
{
    hull h;
    int unit = least_unit(b[0], 9, least_unit(a[0], 9, 0)), along = least_unit(direction, 3, 0);
    each(&h, whole_init);
    mpz_inits(h.top, h.bottom, h.first, h.second, h.rest, NULL);
    mpq_inits(h.most, h.time, NULL);
    for (int k = 0; k < 3; k++)
        set_whole(h.d.x[k], direction[k], along);
    set_points(&h, a, b, unit);
    h.found = any;
    mpq_set(h.most, t);
    scale(h.most, along - unit);
    mpq_t before;
    mpq_init(before);
    mpq_set(before, h.most);
    if (!any || may_be_later(&h))
        try_all(&h);
    bool better = h.found && (!any || mpq_cmp(h.most, before) > 0);
    if (better) {
        mpq_set(t, h.most);
        scale(t, unit - along);
    }
    each(&h, whole_clear);
    mpz_clears(h.top, h.bottom, h.first, h.second, h.rest, NULL);
    mpq_clears(h.most, h.time, before, NULL);
    return better;
}
