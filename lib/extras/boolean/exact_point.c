/* Computes points and planes in integers of any size. Every new point is the intersection of a
 * plane and the line through two points. So its coordinates are fractions of integers with a
 * common denominator.
 *
 * Each point also has its coordinates rounded to the nearest double. Rounding keeps the order, so
 * if two rounded coordinates differ, the exact ones compare in the same way. Equal points have
 * equal rounded coordinates, which are the key of the hash table. A turn (the orientation of three
 * points) is first computed in doubles with an error bound, and in integers only if its sign is not
 * certain. */
#include "core/strict_fp.h"

#include "extras/boolean/exact_point.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/hash.h"
#include "geometry/integer_vectors.h"
#include "geometry/predicates.h"

void ebpo_exact_point_init(ebpo_exact_point *p)
{
    for (int k = 0; k < 4; k++)
        mpz_init(p->x[k]);
}

void ebpo_exact_point_clear(ebpo_exact_point *p)
{
    for (int k = 0; k < 4; k++)
        mpz_clear(p->x[k]);
}

void ebpo_exact_point_swap(ebpo_exact_point *p, ebpo_exact_point *q)
{
    ebpo_exact_point other = *p;
    *p = *q;
    *q = other;
}

void ebpo_exact_plane_init(ebpo_exact_plane *p)
{
    for (int k = 0; k < 4; k++)
        mpz_init(p->n[k]);
}

void ebpo_exact_plane_clear(ebpo_exact_plane *p)
{
    for (int k = 0; k < 4; k++)
        mpz_clear(p->n[k]);
}

void ebpo_exact_point_set(ebpo_exact_point *out, const double x[3], int unit)
{
    for (int k = 0; k < 3; k++) {
        ebpo_set_integer(out->x[k], x[k], unit);
        out->at[k] = x[k] + 0.0;
    }
    mpz_set_ui(out->x[3], 1);
    out->exact = true;
}

/* --- planes --- */

void ebpo_exact_plane_through(ebpo_exact_plane *out, const ebpo_exact_point corner[3])
{
    ebpo_vectorz a, b, c;
    ebpo_vectorz_init(&a);
    ebpo_vectorz_init(&b);
    ebpo_vectorz_init(&c);
    for (int k = 0; k < 3; k++) {
        mpz_sub(a.x[k], corner[1].x[k], corner[0].x[k]);
        mpz_sub(b.x[k], corner[2].x[k], corner[0].x[k]);
    }
    ebpo_vectorz_cross(&c, &a, &b);
    mpz_set_ui(out->n[3], 0);
    for (int k = 0; k < 3; k++) {
        mpz_swap(out->n[k], c.x[k]);
        mpz_submul(out->n[3], out->n[k], corner[0].x[k]);
    }
    ebpo_vectorz_clear(&a);
    ebpo_vectorz_clear(&b);
    ebpo_vectorz_clear(&c);
}

/* Computes a b - c d. */
static void set_minor(mpz_t out, const mpz_t a, const mpz_t b, const mpz_t c, const mpz_t d)
{
    mpz_mul(out, a, b);
    mpz_submul(out, c, d);
}

void ebpo_exact_plane_along(ebpo_exact_plane *out, int axis, const ebpo_exact_point *p,
                            const ebpo_exact_point *q)
{
    int u = axis == 2 ? 0 : axis + 1, v = axis == 0 ? 2 : axis - 1;
    mpz_set_ui(out->n[axis], 0);
    set_minor(out->n[u], p->x[v], q->x[3], p->x[3], q->x[v]);
    set_minor(out->n[v], p->x[3], q->x[u], p->x[u], q->x[3]);
    set_minor(out->n[3], p->x[u], q->x[v], p->x[v], q->x[u]);
}

/* Computes the signed distance of the point from the plane, times a positive factor. Its sign says
 * on which side of the plane the point is. */
static void set_height(mpz_t out, const ebpo_exact_plane *plane, const ebpo_exact_point *p)
{
    mpz_mul(out, plane->n[3], p->x[3]);
    for (int k = 0; k < 3; k++)
        mpz_addmul(out, plane->n[k], p->x[k]);
}

int ebpo_exact_side(const ebpo_exact_plane *plane, const ebpo_exact_point *p)
{
    mpz_t height;
    mpz_init(height);
    set_height(height, plane, p);
    int sign = mpz_sgn(height);
    mpz_clear(height);
    return sign;
}

/* --- intersections --- */

/* Returns true if `rounded` is exactly x / w * 2^unit. */
static bool is_double(const mpz_t x, const mpz_t w, double rounded, int unit)
{
    mpz_t value, other;
    int least = ebpo_common_unit(&rounded, 1, unit);
    mpz_inits(value, other, NULL);
    ebpo_set_integer(value, rounded, least);
    mpz_mul(value, value, w);
    mpz_mul_2exp(other, x, (mp_bitcnt_t)(unit - least));
    bool equal = mpz_cmp(value, other) == 0;
    mpz_clears(value, other, NULL);
    return equal;
}

/* Divides the homogeneous coordinates by their greatest common divisor, and makes x[3] positive. */
static void reduce_point(ebpo_exact_point *p)
{
    mpz_t divisor;
    mpz_init(divisor);
    mpz_abs(divisor, p->x[3]);
    for (int k = 0; k < 3 && mpz_cmp_ui(divisor, 1) != 0; k++)
        mpz_gcd(divisor, divisor, p->x[k]);
    if (mpz_sgn(p->x[3]) < 0)
        mpz_neg(divisor, divisor);
    if (mpz_cmp_ui(divisor, 1) != 0)
        for (int k = 0; k < 4; k++)
            mpz_divexact(p->x[k], p->x[k], divisor);
    mpz_clear(divisor);
}

static void round_point(ebpo_exact_point *p, int unit)
{
    /* The four numbers of p->x have no common divisor. So if x[3] is divisible by a
     * prime other than 2, at least one fraction x[k] / x[3] keeps this prime in its denominator,
     * and is not a double. */
    p->exact = mpz_popcount(p->x[3]) == 1;
    for (int k = 0; k < 3; k++) {
        p->at[k] = ebpo_round_quotient(p->x[k], p->x[3], unit) + 0.0;
        p->exact = p->exact && is_double(p->x[k], p->x[3], p->at[k], unit);
    }
}

void ebpo_exact_intersect(ebpo_exact_point *out, const ebpo_exact_plane *plane,
                          const ebpo_exact_point *p, const ebpo_exact_point *q, int unit)
{
    mpz_t above, below;
    mpz_inits(above, below, NULL);
    set_height(above, plane, p);
    set_height(below, plane, q);
    for (int k = 0; k < 4; k++)
        set_minor(out->x[k], p->x[k], below, q->x[k], above);
    mpz_clears(above, below, NULL);
    reduce_point(out);
    round_point(out, unit);
}

/* --- comparisons --- */

int ebpo_exact_compare(const ebpo_exact_point *p, const ebpo_exact_point *q, int k)
{
    mpz_t difference;
    if (p->at[k] != q->at[k])
        return p->at[k] < q->at[k] ? -1 : 1;
    if (p->exact && q->exact)
        return 0;
    mpz_init(difference);
    set_minor(difference, p->x[k], q->x[3], q->x[k], p->x[3]);
    int sign = mpz_sgn(difference);
    mpz_clear(difference);
    return sign;
}

int ebpo_exact_order(const ebpo_exact_point *p, const ebpo_exact_point *q)
{
    int order = 0;
    for (int k = 0; k < 3 && order == 0; k++)
        order = ebpo_exact_compare(p, q, k);
    return order;
}

/* Computes the turn in doubles from rounded coordinates. Returns its sign if the error cannot
 * change it, and otherwise EBPO_SIGN_UNKNOWN. Let m be the largest absolute value of the
 * coordinates on an axis. The error of each rounded coordinate is at most
 * 2^-53 m + 2^-1075. The error of a computed difference of two coordinates is below
 * 2^-51 (m + 2^-1000). most_u and most_v are m + 2^-1000 for the axes u and v. The sum of the
 * errors of all products and roundings is below `bound`. */
static int filter_turn(int u, int v, const double a[3], const double b[3], const double c[3])
{
    double bu = b[u] - a[u], bv = b[v] - a[v], cu = c[u] - a[u], cv = c[v] - a[v];
    double most_u = fmax(fabs(a[u]), fmax(fabs(b[u]), fabs(c[u]))) + 0x1p-1000;
    double most_v = fmax(fabs(a[v]), fmax(fabs(b[v]), fabs(c[v]))) + 0x1p-1000;
    double turn = bu * cv - bv * cu;
    double bound =
        0x1p-48 * ((fabs(bu) + fabs(cu)) * most_v + (fabs(bv) + fabs(cv)) * most_u) + 0x1p-900;
    if (!(fabs(turn) > bound && fabs(turn) <= 0x1p1000))
        return EBPO_SIGN_UNKNOWN;
    return turn > 0 ? 1 : -1;
}

int ebpo_exact_turn(int axis, const ebpo_exact_point *a, const ebpo_exact_point *b,
                    const ebpo_exact_point *c)
{
    int u = axis == 2 ? 0 : axis + 1, v = axis == 0 ? 2 : axis - 1;
    ebpo_exact_plane line;
    int sign = filter_turn(u, v, a->at, b->at, c->at);
    if (sign != EBPO_SIGN_UNKNOWN)
        return sign;
    if (a->exact && b->exact && c->exact) {
        const double at[3][2] = { { a->at[u], a->at[v] },
                                  { b->at[u], b->at[v] },
                                  { c->at[u], c->at[v] } };
        return ebpo_orient2d(at[0], at[1], at[2]);
    }
    ebpo_exact_plane_init(&line);
    ebpo_exact_plane_along(&line, axis, a, b);
    sign = ebpo_exact_side(&line, c);
    ebpo_exact_plane_clear(&line);
    return sign;
}

/* Subtracts the number `at` from coordinate k of p, and multiplies the difference by the
 * denominator p->x[3]. The result is an integer in units of 2^unit. p has the unit `point_unit`;
 * unit <= point_unit, and `at` is a multiple of 2^unit. */
static void set_difference(mpz_t out, const ebpo_exact_point *p, int k, double at, int point_unit,
                           int unit)
{
    mpz_t value;
    mpz_init(value);
    ebpo_set_integer(value, at, unit);
    mpz_mul_2exp(out, p->x[k], (mp_bitcnt_t)(point_unit - unit));
    mpz_submul(out, value, p->x[3]);
    mpz_clear(value);
}

int ebpo_exact_side_of_double(const ebpo_exact_point *p, int k, int unit)
{
    mpz_t difference;
    mpz_init(difference);
    set_difference(difference, p, k, p->at[k], unit, ebpo_common_unit(&p->at[k], 1, unit));
    int sign = mpz_sgn(difference);
    mpz_clear(difference);
    return sign;
}

double ebpo_exact_distance(const ebpo_exact_point *p, const double at[3], int unit)
{
    double length = 0;
    int least = ebpo_common_unit(at, 3, unit);
    mpz_t difference;
    mpz_init(difference);
    for (int k = 0; k < 3; k++) {
        set_difference(difference, p, k, at[k], unit, least);
        length = hypot(length, ebpo_round_quotient(difference, p->x[3], least));
    }
    mpz_clear(difference);
    return length;
}

/* --- sets --- */

static uint64_t hash_point(const double at[3])
{
    uint64_t bits[3];
    memcpy(bits, at, sizeof bits);
    return ebpo_hash_three(bits);
}

/* Returns the table entry of a point that is equal to p, or a free entry. */
static uint32_t *find_point(const ebpo_point_set *set, const ebpo_exact_point *p)
{
    uint64_t i, mask = set->table_size - 1;
    EBPO_HASH_FIND(i, hash_point(p->at), mask,
                   !set->table[i] || ebpo_exact_order(&set->point[set->table[i] - 1], p) == 0);
    return &set->table[i];
}

static bool enlarge_set(ebpo_point_set *set)
{
    uint64_t size = set->table_size ? 2 * set->table_size : 64;
    uint32_t *table = ebpo_alloc_zero(size, sizeof *table);
    if (!table)
        return false;
    free(set->table);
    set->table = table;
    set->table_size = size;
    for (uint64_t i = 0; i < set->count; i++) {
        uint64_t at, mask = size - 1;
        EBPO_HASH_FIND(at, hash_point(set->point[i].at), mask, !table[at]);
        table[at] = (uint32_t)i + 1;
    }
    return true;
}

bool ebpo_point_set_add(ebpo_point_set *set, ebpo_exact_point *p, uint32_t *number)
{
    if ((2 * set->count >= set->table_size && !enlarge_set(set)) || set->count >> 31)
        return false;
    uint32_t *entry = find_point(set, p);
    if (*entry == 0) {
        if (!ebpo_grow(&set->point, &set->capacity, set->count + 1, sizeof *set->point))
            return false;
        if (set->count == set->made)
            ebpo_exact_point_init(&set->point[set->made++]);
        ebpo_exact_point_swap(&set->point[set->count++], p);
        *entry = (uint32_t)set->count;
    }
    *number = *entry - 1;
    return true;
}

void ebpo_point_set_empty(ebpo_point_set *set)
{
    if (set->table_size > 1024 && set->count < set->table_size / 64) {
        free(set->table); /* clearing a large table each time for a small set would be slow */
        set->table = NULL;
        set->table_size = 0;
    }
    if (set->table)
        memset(set->table, 0, set->table_size * sizeof *set->table);
    set->count = 0;
}

void ebpo_point_set_free(ebpo_point_set *set)
{
    for (uint64_t i = 0; i < set->made; i++)
        ebpo_exact_point_clear(&set->point[i]);
    free(set->point);
    free(set->table);
    *set = (ebpo_point_set){ 0 };
}
