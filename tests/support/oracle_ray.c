/* The oracle: rays and boxes. */
#include "oracle_parts.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>

/* --- rays; the origin is o->p, so that corners are relative to it --- */

static void keep_least(oracle *o, bool *any, oracle_fraction *best, oracle_fraction *t)
{
    if (!*any || oracle_fraction_compare(o, t, best) < 0)
        oracle_fraction_swap(t, best);
    *any = true;
}

static bool is_zero(mpz_t *a)
{
    return mpz_sgn(a[0]) == 0 && mpz_sgn(a[1]) == 0 && mpz_sgn(a[2]) == 0;
}

/* Intersects with a segment along the line of the ray: t of both ends, cut at 0. */
static void intersect_along(oracle *o, int i, bool *any, oracle_fraction *best)
{
    oracle_cross(o->v[2], o->a[i], o->direction);
    if (!is_zero(o->v[2]))
        return;
    oracle_dot(o->s[0], o->a[i], o->direction);
    oracle_dot(o->s[1], o->a[(i + 1) % 3], o->direction);
    if (mpz_sgn(o->s[0]) < 0 && mpz_sgn(o->s[1]) < 0)
        return;
    mpz_set(o->one.num, mpz_cmp(o->s[0], o->s[1]) < 0 ? o->s[0] : o->s[1]);
    if (mpz_sgn(o->one.num) < 0)
        mpz_set_ui(o->one.num, 0);
    oracle_dot(o->one.den, o->direction, o->direction);
    keep_least(o, any, best, &o->one);
}

/* Intersects edge i with the ray, both in space: t = (a x u) . c / c^2, position on the edge s = (a
 * x d) . c / c^2, c = d x u. */
static void intersect_edge(oracle *o, int i, bool *any, oracle_fraction *best)
{
    oracle_cross(o->v[0], o->direction, o->edge[i]);
    if (is_zero(o->v[0])) {
        intersect_along(o, i, any, best);
        return;
    }
    oracle_dot(o->s[0], o->v[0], o->a[i]);
    if (mpz_sgn(o->s[0]) != 0)
        return; /* the lines are skew */
    oracle_dot(o->one.den, o->v[0], o->v[0]);
    oracle_cross(o->v[1], o->a[i], o->edge[i]);
    oracle_dot(o->one.num, o->v[1], o->v[0]);
    oracle_cross(o->v[1], o->a[i], o->direction);
    oracle_dot(o->s[1], o->v[1], o->v[0]);
    if (mpz_sgn(o->one.num) >= 0 && mpz_sgn(o->s[1]) >= 0 && mpz_cmp(o->s[1], o->one.den) <= 0)
        keep_least(o, any, best, &o->one);
}

/* Returns true if the origin is in the face, whose plane contains it. */
static bool origin_in_face(oracle *o)
{
    for (int i = 0; i < 3; i++) {
        oracle_cross(o->v[0], o->a[i], o->a[(i + 1) % 3]);
        oracle_dot(o->s[0], o->v[0], o->normal);
        if (mpz_sgn(o->s[0]) < 0)
            return false;
    }
    return true;
}

/* Handles a face without area, or parallel to the ray. */
static bool intersect_within_plane(oracle *o, uint32_t face, oracle_fraction *t)
{
    bool any = false;
    if (!o->flat[face]) {
        oracle_dot(o->s[0], o->normal, o->a[0]);
        if (mpz_sgn(o->s[0]) != 0)
            return false;
        if (origin_in_face(o)) {
            mpz_set_ui(t->num, 0);
            mpz_set_ui(t->den, 1);
            return true;
        }
    }
    for (int i = 0; i < 3; i++)
        intersect_edge(o, i, &any, t);
    return any;
}

static bool intersect_face(oracle *o, uint32_t face, oracle_fraction *t, int *side, int *facing)
{
    oracle_load(o, face);
    oracle_dot(t->den, o->normal, o->direction);
    *side = 0;
    *facing = -mpz_sgn(t->den);
    if (mpz_sgn(t->den) == 0)
        return intersect_within_plane(o, face, t);
    int towards = mpz_sgn(t->den);
    bool inner = true;
    for (int i = 0; i < 3; i++) {
        oracle_cross(o->v[0], o->a[i], o->a[(i + 1) % 3]);
        oracle_dot(o->s[0], o->v[0], o->direction);
        int sign = mpz_sgn(o->s[0]) * towards;
        if (sign < 0)
            return false;
        inner &= sign > 0;
    }
    oracle_dot(t->num, o->normal, o->a[0]);
    if (towards < 0) {
        mpz_neg(t->num, t->num);
        mpz_neg(t->den, t->den);
    }
    if (mpz_sgn(t->num) < 0)
        return false;
    if (inner)
        *side = -towards;
    return true;
}

/* Returns the sign of t 2^e - t_max. */
static int compare_to_end(oracle *o, const oracle_fraction *t, int e, double t_max)
{
    if (isinf(t_max))
        return -1;
    int low = t_max == 0 ? e : oracle_low_bit(t_max);
    if (low > e)
        low = e;
    oracle_set(o->s[0], t_max, low);
    mpz_mul(o->s[0], o->s[0], t->den);
    mpz_mul_2exp(o->s[1], t->num, (mp_bitcnt_t)(e - low));
    return mpz_cmp(o->s[1], o->s[0]);
}

static int by_t(const void *x, const void *y, void *user)
{
    const oracle_ray_item *a = x, *b = y;
    int sign = oracle_fraction_compare(user, &a->t, &b->t);
    return sign ? sign : a->face < b->face ? -1 : 1;
}

static oracle_ray_item *item(oracle *o, uint32_t i)
{
    if (i == o->item_capacity) {
        mpz_inits(o->items[i].t.num, o->items[i].t.den, NULL);
        o->item_capacity++;
    }
    return &o->items[i];
}

static bool passes_by(const double box[6], const double origin[3], const double direction[3])
{
    for (int k = 0; k < 3; k++)
        if ((direction[k] >= 0 && box[3 + k] < origin[k]) ||
            (direction[k] <= 0 && box[k] > origin[k]))
            return true;
    return false;
}

void oracle_ray(oracle *o, const double origin[3], const double direction[3], double t_max,
                const oracle_hit **hits, uint32_t *count)
{
    int unit = INT_MAX;
    uint32_t n = 0;
    oracle_choose_unit(o, origin, 3);
    for (int k = 0; k < 3; k++) {
        int low = oracle_low_bit(direction[k]);
        unit = low < unit ? low : unit;
        oracle_set(o->p[k], origin[k], o->e);
    }
    for (int k = 0; k < 3; k++)
        oracle_set(o->direction[k], direction[k], unit);
    for (uint32_t f = 0; f < o->face_count; f++) {
        oracle_ray_item *at = item(o, n);
        if (passes_by(o->box[f], origin, direction) ||
            !intersect_face(o, f, &at->t, &at->side, &at->facing))
            continue;
        if (compare_to_end(o, &at->t, o->e - unit, t_max) > 0)
            continue;
        at->face = f;
        n++;
    }
    qsort_r(o->items, n, sizeof *o->items, by_t, o);
    for (uint32_t i = 0; i < n; i++) {
        o->hits[i].face = o->items[i].face;
        o->hits[i].side = o->items[i].side;
        o->hits[i].facing = o->items[i].facing;
        o->hits[i].t = oracle_round(o->items[i].t.num, o->items[i].t.den, o->e - unit, false);
    }
    *hits = o->hits;
    *count = n;
}

/* --- boxes; corners are relative to o->p = min, o->direction = max - min --- */

/* Returns true if the projections on the axis have a gap. */
static bool separates(oracle *o, mpz_t *axis)
{
    mpz_t *low = &o->s[2], *high = &o->s[3];
    mpz_set_ui(*low, 0);
    mpz_set_ui(*high, 0);
    for (int k = 0; k < 3; k++) {
        if (mpz_sgn(axis[k]) < 0)
            mpz_addmul(*low, axis[k], o->direction[k]);
        else
            mpz_addmul(*high, axis[k], o->direction[k]);
    }
    int above = 0, below = 0;
    for (int i = 0; i < 3; i++) {
        oracle_dot(o->s[0], axis, o->a[i]);
        above += mpz_cmp(o->s[0], *high) > 0;
        below += mpz_cmp(o->s[0], *low) < 0;
    }
    return above == 3 || below == 3;
}

/* Tests separating axes of two convex polytopes; flat ones are limits of thick ones, so the same
 * axes are sufficient. */
static bool intersects_box(oracle *o, uint32_t face)
{
    oracle_load(o, face);
    if (separates(o, o->normal))
        return false;
    mpz_t *axis = o->v[1];
    for (int k = 0; k < 3; k++) {
        for (int j = 0; j < 3; j++)
            mpz_set_ui(axis[j], j == k);
        bool apart = separates(o, axis);
        for (int i = 0; i < 3 && !apart; i++) {
            oracle_cross(o->v[0], axis, o->edge[i]);
            apart = separates(o, o->v[0]);
        }
        if (apart)
            return false;
    }
    return true;
}

void oracle_box(oracle *o, const double min[3], const double max[3], const uint32_t **faces,
                uint32_t *count)
{
    double both[6] = { min[0], min[1], min[2], max[0], max[1], max[2] };
    oracle_choose_unit(o, both, 6);
    for (int k = 0; k < 3; k++) {
        oracle_set(o->p[k], min[k], o->e);
        oracle_set(o->direction[k], max[k], o->e);
        mpz_sub(o->direction[k], o->direction[k], o->p[k]);
    }
    *count = 0;
    for (uint32_t f = 0; f < o->face_count; f++) {
        const double *box = o->box[f];
        bool apart = false;
        for (int k = 0; k < 3; k++)
            apart |= box[k] > max[k] || box[3 + k] < min[k];
        if (!apart && intersects_box(o, f))
            o->found[(*count)++] = f;
    }
    *faces = o->found;
}
