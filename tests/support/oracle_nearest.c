/* The oracle: nearest faces and winding numbers. */
#include "oracle_parts.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>

/* --- exact --- */

/* out = squared distance of the origin to the segment a[i], a[i + 1]. */
static void segment_distance(oracle *o, int i, oracle_fraction *out)
{
    int j = (i + 1) % 3;
    mpz_t *along = &o->s[0], *length = &o->s[1];
    oracle_dot(*along, o->a[i], o->edge[i]);
    mpz_neg(*along, *along);
    oracle_dot(*length, o->edge[i], o->edge[i]);
    mpz_set_ui(out->den, 1);
    if (mpz_sgn(*along) <= 0) {
        oracle_dot(out->num, o->a[i], o->a[i]);
    } else if (mpz_cmp(*along, *length) >= 0) {
        oracle_dot(out->num, o->a[j], o->a[j]);
    } else {
        oracle_dot(out->num, o->a[i], o->a[i]);
        mpz_mul(out->num, out->num, *length);
        mpz_submul(out->num, *along, *along);
        mpz_set(out->den, *length);
    }
}

/* Returns true if the projection of the origin on the plane of the face is in the face. */
static bool above_face(oracle *o)
{
    for (int i = 0; i < 3; i++) {
        oracle_cross(o->v[0], o->a[i], o->a[(i + 1) % 3]);
        oracle_dot(o->s[0], o->v[0], o->normal);
        if (mpz_sgn(o->s[0]) < 0)
            return false;
    }
    return true;
}

/* Computes the squared distance of o->p to the face, in the unit squared. */
static void face_distance(oracle *o, uint32_t face, oracle_fraction *out)
{
    oracle_load(o, face);
    if (!o->flat[face] && above_face(o)) {
        oracle_dot(out->num, o->normal, o->a[0]);
        mpz_mul(out->num, out->num, out->num);
        oracle_dot(out->den, o->normal, o->normal);
        return;
    }
    segment_distance(o, 0, out);
    for (int i = 1; i < 3; i++) {
        segment_distance(o, i, &o->other);
        if (oracle_fraction_compare(o, &o->other, out) < 0)
            oracle_fraction_swap(&o->other, out);
    }
}

static void set_point(oracle *o, const double p[3])
{
    oracle_choose_unit(o, p, 3);
    for (int k = 0; k < 3; k++)
        oracle_set(o->p[k], p[k], o->e);
}

double oracle_face_distance(oracle *o, const double p[3], uint32_t face)
{
    set_point(o, p);
    face_distance(o, face, &o->one);
    return oracle_round(o->one.num, o->one.den, 2 * o->e, true);
}

int oracle_distance_compare(oracle *o, double d)
{
    if (isinf(d))
        return -1;
    /* compares best / 4^-e with d^2 = m^2 4^f */
    int f = d == 0 ? o->e : oracle_low_bit(d), low = f < o->e ? f : o->e;
    oracle_set(o->s[0], d, low);
    mpz_mul(o->s[0], o->s[0], o->s[0]);
    mpz_mul(o->s[0], o->s[0], o->best.den);
    mpz_mul_2exp(o->s[1], o->best.num, 2 * (mp_bitcnt_t)(o->e - low));
    return mpz_cmp(o->s[1], o->s[0]);
}

/* --- all faces in order --- */

typedef struct ranked {
    oracle *o;
    oracle_fraction value;
    uint32_t face;
} ranked;

static int compare_ranked(const void *x, const void *y)
{
    const ranked *a = x, *b = y;
    int sign = oracle_fraction_compare(a->o, &a->value, &b->value);
    return sign ? sign : (a->face > b->face) - (a->face < b->face);
}

static void *some(size_t count, size_t size)
{
    void *space = malloc((count ? count : 1) * size);
    if (!space)
        abort();
    return space;
}

oracle_near *oracle_order(oracle *o, const double p[3], double radius, uint32_t *count)
{
    ranked *all = some(o->face_count, sizeof *all);
    oracle_near *out = some(o->face_count, sizeof *out);
    *count = 0;
    set_point(o, p);
    for (uint32_t f = 0; f < o->face_count; f++) {
        face_distance(o, f, &o->best);
        if (oracle_distance_compare(o, radius) > 0)
            continue;
        ranked *r = &all[(*count)++];
        *r = (ranked){ .o = o, .face = f };
        mpz_init_set(r->value.num, o->best.num);
        mpz_init_set(r->value.den, o->best.den);
    }
    qsort(all, *count, sizeof *all, compare_ranked);
    for (uint32_t i = 0; i < *count; i++) {
        out[i].face = all[i].face;
        out[i].distance = oracle_round(all[i].value.num, all[i].value.den, 2 * o->e, true);
        mpz_clears(all[i].value.num, all[i].value.den, NULL);
    }
    free(all);
    return out;
}

/* --- excluding faces that are certainly farther; lengths in units of 2^scale --- */

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Computes weights of a point of the triangle near the nearest point to the origin. The validity of
 * the bounds does not depend on their precision. Ericson 2005, 5.1.5. */
static void near_weights(double a[3][3], double w[3])
{
    double ab[3], ac[3];
    for (int k = 0; k < 3; k++)
        ab[k] = a[1][k] - a[0][k], ac[k] = a[2][k] - a[0][k];
    double d1 = -dot(ab, a[0]), d2 = -dot(ac, a[0]), d3 = -dot(ab, a[1]), d4 = -dot(ac, a[1]),
           d5 = -dot(ab, a[2]), d6 = -dot(ac, a[2]);
    double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
    w[0] = 1, w[1] = w[2] = 0;
    if (d1 <= 0 && d2 <= 0)
        return;
    if (d3 >= 0 && d4 <= d3) {
        w[0] = 0, w[1] = 1;
    } else if (vc <= 0 && d1 >= 0 && d3 <= 0) {
        w[1] = d1 / (d1 - d3);
    } else if (d6 >= 0 && d5 <= d6) {
        w[0] = 0, w[2] = 1;
        return;
    } else if (vb <= 0 && d2 >= 0 && d6 <= 0) {
        w[2] = d2 / (d2 - d6);
    } else if (va <= 0 && d4 >= d3 && d5 >= d6) {
        w[2] = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        w[1] = 1 - w[2];
        w[0] = 0;
        return;
    } else {
        w[1] = vb / (va + vb + vc), w[2] = vc / (va + vb + vc);
    }
    if (w[0] != 0)
        w[0] = 1 - w[1] - w[2];
}

/* Computes low <= distance <= high for the origin, for any rounding: high is the distance of a
 * point of the triangle, low the distance of a plane before the triangle. */
static void face_bounds(const double corner[9], const double p[3], double *low, double *high)
{
    double a[3][3], w[3], q[3], size = 0;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            a[i][k] = corner[3 * i + k] - p[k];
        size = fmax(size, fabs(a[i][0]) + fabs(a[i][1]) + fabs(a[i][2]));
    }
    *low = 0, *high = INFINITY;
    if (!(size > 0x1p-400 && size < 0x1p400))
        return;
    near_weights(a, w);
    if (!(w[0] >= -1e-13 && w[1] >= -1e-13 && w[2] >= -1e-13 &&
          fabs(w[0] + w[1] + w[2] - 1) < 1e-13))
        w[0] = 1, w[1] = w[2] = 0;
    for (int k = 0; k < 3; k++)
        q[k] = w[0] * a[0][k] + w[1] * a[1][k] + w[2] * a[2][k];
    double length = sqrt(dot(q, q)), margin = 1e-12 * size;
    *high = length + margin;
    if (length > 0x1p-450)
        *low = fmin(dot(q, a[0]), fmin(dot(q, a[1]), dot(q, a[2]))) / length - margin;
}

static double box_squared(const double corner[9], const double p[3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        double low = corner[k], high = corner[k];
        for (int i = 1; i < 3; i++) {
            double x = corner[3 * i + k];
            low = x < low ? x : low;
            high = x > high ? x : high;
        }
        double below = low - p[k], above = p[k] - high,
               d = below > 0   ? below
                   : above > 0 ? above
                               : 0;
        sum += d * d;
    }
    return sum;
}

/* Writes candidates to o->found, and returns their number. Every face at the minimum distance is
 * among the candidates. */
static uint32_t candidates(oracle *o, const double p[3])
{
    double q[3], best = INFINITY;
    uint32_t count = 0, kept = 0;
    for (int k = 0; k < 3; k++)
        q[k] = ldexp(p[k], -o->scale);
    for (uint32_t f = 0; f < o->face_count; f++) {
        double low, high;
        if (box_squared(o->corner[f], q) * (1 - 1e-12) - 0x1p-900 > best * best)
            continue;
        face_bounds(o->corner[f], q, &low, &high);
        if (low > best)
            continue;
        best = fmin(best, high);
        o->found[count] = f;
        o->low[count++] = low;
    }
    for (uint32_t i = 0; i < count; i++)
        if (!(o->low[i] > best))
            o->found[kept++] = o->found[i];
    return kept;
}

void oracle_find_nearest(oracle *o, const double p[3], oracle_nearest *out)
{
    uint32_t count = candidates(o, p), ties = 0;
    set_point(o, p);
    for (uint32_t i = 0; i < count; i++) {
        face_distance(o, o->found[i], &o->one);
        int sign = ties ? oracle_fraction_compare(o, &o->one, &o->best) : -1;
        if (sign < 0) {
            oracle_fraction_swap(&o->one, &o->best);
            ties = 0;
        }
        if (sign <= 0)
            o->found[ties++] = o->found[i];
    }
    out->on = mpz_sgn(o->best.num) == 0;
    out->distance = oracle_round(o->best.num, o->best.den, 2 * o->e, true);
    out->faces = o->found;
    out->count = ties;
}

/* --- winding numbers --- */

/* Returns the sign of direction . (b x c) in floating point; 2 when it is not certain. */
static int fast_sign(const double d[3], const double b[3], const double c[3])
{
    double rb = fabs(b[0]) + fabs(b[1]) + fabs(b[2]), rc = fabs(c[0]) + fabs(c[1]) + fabs(c[2]);
    double bound = 1e-12 * (fabs(d[0]) + fabs(d[1]) + fabs(d[2])) * rb * rc;
    double v = d[0] * (b[1] * c[2] - b[2] * c[1]) + d[1] * (b[2] * c[0] - b[0] * c[2]) +
               d[2] * (b[0] * c[1] - b[1] * c[0]);
    if (!(bound > 0x1p-400 && bound < 0x1p400))
        return 2;
    return v > bound ? 1 : v < -bound ? -1 : 2;
}

/* Computes the signs of direction . (a[i] x a[i + 1]) exactly; with the face loaded. */
static void exact_signs(oracle *o, int sign[3])
{
    for (int i = 0; i < 3; i++) {
        oracle_cross(o->v[0], o->a[i], o->a[(i + 1) % 3]);
        oracle_dot(o->s[0], o->v[0], o->direction);
        sign[i] = mpz_sgn(o->s[0]);
    }
}

/* Returns 1 if the ray leaves through the face, -1 if it enters, 0 if it does not intersect the
 * face, and 2 if it intersects an edge or a vertex, or is in the plane. */
static int crossing(oracle *o, uint32_t face, const double p[3], const double d[3])
{
    double a[3][3];
    int sign[3];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            a[i][k] = o->corner[face][3 * i + k] - p[k];
    for (int i = 0; i < 3; i++)
        sign[i] = fast_sign(d, a[i], a[(i + 1) % 3]);
    for (int i = 0; i < 3; i++)
        if (sign[i] != 2 && sign[(i + 1) % 3] == -sign[i])
            return 0;
    oracle_load(o, face);
    exact_signs(o, sign);
    bool negative = sign[0] < 0 || sign[1] < 0 || sign[2]<0, positive = sign[0]> 0 || sign[1] > 0 ||
                    sign[2] > 0;
    if (negative && positive)
        return 0; /* the line misses the face */
    if (!negative && !positive)
        return 2; /* within the plane */
    oracle_dot(o->s[0], o->normal, o->a[0]);
    int ahead = mpz_sgn(o->s[0]) * (positive ? 1 : -1);
    if (ahead <= 0)
        /* the face is behind; not 0 where the line intersects the face, as the point is not on it
         */
        return 0;
    if (sign[0] == 0 || sign[1] == 0 || sign[2] == 0)
        return 2;
    return positive ? 1 : -1;
}

static bool behind(const double box[6], const double p[3], const double d[3])
{
    for (int k = 0; k < 3; k++)
        if (d[k] > 0 ? box[3 + k] < p[k] : box[k] > p[k])
            return true;
    return false;
}

static bool count_crossings(oracle *o, const double p[3], const double d[3], int32_t *sum)
{
    double q[3];
    *sum = 0;
    for (int k = 0; k < 3; k++) {
        q[k] = ldexp(p[k], -o->scale);
        mpz_set_si(o->direction[k], (long)d[k]);
    }
    for (uint32_t f = 0; f < o->face_count; f++) {
        if (o->flat[f] || behind(o->box[f], p, d))
            continue;
        int c = crossing(o, f, q, d);
        if (c == 2)
            return false;
        *sum += c;
    }
    return true;
}

int32_t oracle_winding(oracle *o, const double p[3])
{
    uint64_t state = 1;
    int32_t sum = 0;
    for (int k = 0; k < 3; k++)
        if (p[k] < o->min[k] || p[k] > o->max[k])
            return 0; /* a ray away from the mesh hits nothing */
    set_point(o, p);
    for (;;) {
        double d[3];
        for (int k = 0; k < 3;
             k++) { /* towards the nearer side of the mesh's box: fewer faces to test */
            state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
            d[k] =
                (double)(1 + (state >> 40) % 1000) * (p[k] - o->min[k] > o->max[k] - p[k] ? 1 : -1);
        }
        if (count_crossings(o, p, d, &sum))
            return sum;
    }
}

void oracle_normal(oracle *o, uint32_t face, double out[3])
{
    for (int k = 0; k < 3; k++) {
        mpz_set_ui(o->p[k], 0);
        out[k] = 0;
    }
    if (o->flat[face])
        return;
    o->e = o->exponent;
    oracle_load(o, face);
    oracle_dot(o->s[0], o->normal, o->normal);
    for (int k = 0; k < 3; k++) {
        mpz_mul(o->s[1], o->normal[k], o->normal[k]);
        out[k] = copysign(oracle_round(o->s[1], o->s[0], 0, true), mpz_sgn(o->normal[k]));
    }
}
