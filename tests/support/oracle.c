/* The oracle: its mesh, its integers, rounding. */
#include "oracle_parts.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void *space(size_t count, size_t size)
{
    void *block = calloc(count + 1, size);
    if (!block) {
        fprintf(stderr, "out of memory in the oracle\n");
        abort();
    }
    return block;
}

/* --- integers --- */

int oracle_low_bit(double x)
{
    int e;
    if (x == 0)
        return INT_MAX;
    int64_t m = (int64_t)ldexp(frexp(x, &e), 53);
    return e - 53 + __builtin_ctzll((uint64_t)m);
}

void oracle_set(mpz_t z, double x, int e)
{
    int at;
    if (x == 0) {
        mpz_set_ui(z, 0);
        return;
    }
    int64_t m = (int64_t)ldexp(frexp(x, &at), 53);
    int zeros = __builtin_ctzll((uint64_t)m);
    mpz_set_si(z, m / ((int64_t)1 << zeros));
    mpz_mul_2exp(z, z, (mp_bitcnt_t)(at - 53 + zeros - e));
}

void oracle_choose_unit(oracle *o, const double *p, int count)
{
    o->e = o->exponent;
    for (int i = 0; i < count; i++) {
        int low = oracle_low_bit(p[i]);
        if (low < o->e)
            o->e = low;
    }
}

void oracle_cross(mpz_t *out, mpz_t *a, mpz_t *b)
{
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        mpz_mul(out[k], a[i], b[j]);
        mpz_submul(out[k], a[j], b[i]);
    }
}

void oracle_dot(mpz_t out, mpz_t *a, mpz_t *b)
{
    mpz_mul(out, a[0], b[0]);
    mpz_addmul(out, a[1], b[1]);
    mpz_addmul(out, a[2], b[2]);
}

void oracle_load(oracle *o, uint32_t face)
{
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            size_t at = 3 * (size_t)o->faces[3 * (size_t)face + (size_t)i] + (size_t)k;
            mpz_mul_2exp(o->a[i][k], o->integer[at], (mp_bitcnt_t)(o->exponent - o->e));
            mpz_sub(o->a[i][k], o->a[i][k], o->p[k]);
        }
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            mpz_sub(o->edge[i][k], o->a[(i + 1) % 3][k], o->a[i][k]);
    oracle_cross(o->normal, o->edge[0], o->edge[1]);
}

int oracle_fraction_compare(oracle *o, const oracle_fraction *a, const oracle_fraction *b)
{
    mpz_mul(o->s[10], a->num, b->den);
    mpz_mul(o->s[11], b->num, a->den);
    return mpz_cmp(o->s[10], o->s[11]);
}

void oracle_fraction_swap(oracle_fraction *a, oracle_fraction *b)
{
    mpz_swap(a->num, b->num);
    mpz_swap(a->den, b->den);
}

/* --- rounding --- */

/* Rounds m * 2^e, slightly more when `sticky`, to the nearest double, ties to even. m has more than
 * 60 bits. */
static double round_integer(const mpz_t m, int e, bool sticky)
{
    int top = (int)mpz_sizeinbase(m, 2) + e, low = top - 53 < -1074 ? -1074 : top - 53;
    mp_bitcnt_t drop = (mp_bitcnt_t)(low - e);
    mpz_t kept;
    mpz_init(kept);
    mpz_tdiv_q_2exp(kept, m, drop);
    bool half = mpz_tstbit(m, drop - 1);
    bool rest = sticky || mpz_scan1(m, 0) < drop - 1;
    if (half && (rest || mpz_odd_p(kept)))
        mpz_add_ui(kept, kept, 1);
    /* at most 2^53: exact, and ldexp is exact or overflows */
    double value = ldexp(mpz_get_d(kept), low);
    mpz_clear(kept);
    return value;
}

double oracle_round(const mpz_t num, const mpz_t den, int exponent, bool root)
{
    if (mpz_sgn(num) == 0)
        return 0;
    enum { BITS = 70 };
    int want = root ? 2 * BITS : BITS;
    int shift = want + (int)mpz_sizeinbase(den, 2) - (int)mpz_sizeinbase(num, 2);
    if (shift < 0)
        shift = 0;
    if (root && (exponent - shift) % 2 != 0)
        shift++;
    mpz_t q, r;
    mpz_inits(q, r, NULL);
    mpz_mul_2exp(q, num, (mp_bitcnt_t)shift);
    mpz_tdiv_qr(q, r, q, den);
    bool sticky = mpz_sgn(r) != 0;
    int e = exponent - shift;
    if (root) {
        mpz_sqrtrem(q, r, q);
        sticky |= mpz_sgn(r) != 0;
        e /= 2;
    }
    /* Far below the smallest double there may be too few bits to drop, so numbers below 2^-1074 are
     * rounded separately. */
    if ((int)mpz_sizeinbase(q, 2) + e < -1074) {
        mpz_clears(q, r, NULL);
        return 0;
    }
    double value = round_integer(q, e, sticky);
    mpz_clears(q, r, NULL);
    return value;
}

double oracle_volume(oracle *o)
{
    mpz_t sum, den, one;
    mpz_inits(sum, den, one, NULL);
    o->e = o->exponent;
    for (int k = 0; k < 3; k++)
        mpz_set_ui(o->p[k], 0);
    for (uint32_t f = 0; f < o->face_count; f++) {
        oracle_load(o, f);
        oracle_dot(one, o->a[0], o->normal);
        mpz_add(sum, sum, one);
    }
    mpz_set_ui(den, 6);
    int sign = mpz_sgn(sum);
    mpz_abs(sum, sum);
    double value = sign * oracle_round(sum, den, 3 * o->exponent, false);
    mpz_clears(sum, den, one, NULL);
    return value;
}

/* --- making --- */

static void copy_mesh(oracle *o, const ebpo_mesh *mesh)
{
    o->vertex_count = (uint32_t)mesh->vertex_count;
    o->face_count = (uint32_t)mesh->face_count;
    o->xyz = space(mesh->vertex_count, 3 * sizeof *o->xyz);
    o->faces = space(mesh->face_count, 3 * sizeof *o->faces);
    if (mesh->face_count) /* the array may be missing */
        memcpy(o->faces, mesh->faces, mesh->face_count * 3 * sizeof *o->faces);
    for (size_t i = 0; i < 3 * mesh->vertex_count; i++)
        o->xyz[i] = mesh->xyz32 ? (double)mesh->xyz32[i] : mesh->xyz64[i];
}

static void measure(oracle *o)
{
    double largest = 0;
    for (int k = 0; k < 3; k++)
        o->min[k] = INFINITY, o->max[k] = -INFINITY;
    o->exponent = INT_MAX;
    for (size_t f = 0; f < o->face_count; f++)
        for (size_t k = 0; k < 3; k++) {
            o->box[f][k] = INFINITY, o->box[f][3 + k] = -INFINITY;
            for (size_t i = 0; i < 3; i++) {
                double x = o->xyz[3 * (size_t)o->faces[3 * f + i] + k];
                o->box[f][k] = fmin(o->box[f][k], x);
                o->box[f][3 + k] = fmax(o->box[f][3 + k], x);
                largest = fmax(largest, fabs(x));
            }
            o->min[k] = fmin(o->min[k], o->box[f][k]);
            o->max[k] = fmax(o->max[k], o->box[f][3 + k]);
        }
    for (size_t i = 0; i < 3 * (size_t)o->vertex_count; i++) {
        int low = oracle_low_bit(o->xyz[i]);
        if (low < o->exponent)
            o->exponent = low;
    }
    if (o->exponent == INT_MAX)
        o->exponent = 0;
    if (largest > 0)
        frexp(largest, &o->scale);
}

static void init_scratch(oracle *o)
{
    for (int k = 0; k < 3; k++) {
        mpz_inits(o->p[k], o->normal[k], o->direction[k], NULL);
        for (int i = 0; i < 3; i++)
            mpz_inits(o->a[i][k], o->edge[i][k], NULL);
        for (int i = 0; i < 6; i++)
            mpz_init(o->v[i][k]);
    }
    for (int i = 0; i < 12; i++)
        mpz_init(o->s[i]);
    mpz_inits(o->best.num, o->best.den, o->one.num, o->one.den, o->other.num, o->other.den, NULL);
    o->found = space(o->face_count, sizeof *o->found);
    o->low = space(o->face_count, sizeof *o->low);
    o->hits = space(o->face_count, sizeof *o->hits);
    o->items = space(o->face_count, sizeof *o->items);
}

oracle *oracle_make(const ebpo_mesh *mesh)
{
    oracle *o = space(1, sizeof *o);
    copy_mesh(o, mesh);
    o->corner = space(o->face_count, sizeof *o->corner);
    o->box = space(o->face_count, sizeof *o->box);
    measure(o);
    o->integer = space(3 * (size_t)o->vertex_count, sizeof *o->integer);
    for (size_t i = 0; i < 3 * (size_t)o->vertex_count; i++) {
        mpz_init(o->integer[i]);
        oracle_set(o->integer[i], o->xyz[i], o->exponent);
    }
    init_scratch(o);
    o->flat = space(o->face_count, sizeof *o->flat);
    o->e = o->exponent;
    for (uint32_t f = 0; f < o->face_count; f++) {
        oracle_load(o, f);
        o->flat[f] =
            mpz_sgn(o->normal[0]) == 0 && mpz_sgn(o->normal[1]) == 0 && mpz_sgn(o->normal[2]) == 0;
        for (size_t i = 0; i < 9; i++)
            o->corner[f][i] =
                ldexp(o->xyz[3 * (size_t)o->faces[3 * (size_t)f + i / 3] + i % 3], -o->scale);
    }
    return o;
}

void oracle_free(oracle *o)
{
    if (!o)
        return;
    for (size_t i = 0; i < 3 * (size_t)o->vertex_count; i++)
        mpz_clear(o->integer[i]);
    for (uint32_t i = 0; i < o->item_capacity; i++)
        mpz_clears(o->items[i].t.num, o->items[i].t.den, NULL);
    for (int k = 0; k < 3; k++) {
        mpz_clears(o->p[k], o->normal[k], o->direction[k], NULL);
        for (int i = 0; i < 3; i++)
            mpz_clears(o->a[i][k], o->edge[i][k], NULL);
        for (int i = 0; i < 6; i++)
            mpz_clear(o->v[i][k]);
    }
    for (int i = 0; i < 12; i++)
        mpz_clear(o->s[i]);
    mpz_clears(o->best.num, o->best.den, o->one.num, o->one.den, o->other.num, o->other.den, NULL);
    void *blocks[] = { o->faces, o->xyz,   o->corner, o->box,  o->integer,
                       o->flat,  o->found, o->low,    o->hits, o->items };
    for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++)
        free(blocks[i]);
    free(o);
}
