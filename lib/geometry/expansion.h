/* Computes exactly with doubles. A value is an expansion, that is, an unevaluated sum of doubles.
 * These doubles are its components. The bits of the components do not overlap. Components are
 * sorted by absolute value and are not 0. Results are exact as long as nothing overflows or
 * underflows; callers keep exponents in range (see predicates.c). An expansion of n = 0 components
 * is 0. Include strict_fp.h first. Source: Shewchuk 1997, section 2: TWO-SUM, SPLIT, TWO-PRODUCT,
 * FAST-EXPANSION-SUM and SCALE-EXPANSION. */
#ifndef EBPO_GEOMETRY_EXPANSION_H
#define EBPO_GEOMETRY_EXPANSION_H

#include <math.h>
#include <stdbool.h>

/* A double and its rounding error: head + tail is exact. */
typedef struct ebpo_pair {
    double head, tail;
} ebpo_pair;

static inline ebpo_pair ebpo_two_sum(double a, double b)
{
    double head = a + b;
    double b_part = head - a, a_part = head - b_part;
    return (ebpo_pair){ head, (a - a_part) + (b - b_part) };
}

static inline ebpo_pair ebpo_two_difference(double a, double b) { return ebpo_two_sum(a, -b); }

/* Splits a double into two doubles of at most 26 bits each. */
static inline ebpo_pair ebpo_split(double a)
{
    double c = 0x1.0000002p27 * a;
    double high = c - (c - a);
    return (ebpo_pair){ high, a - high };
}

static inline ebpo_pair ebpo_two_product(double a, double b)
{
    double head = a * b;
#ifdef EBPO_PRODUCTS_BY_FMA /* faster, with equal results if nothing overflows or underflows */
    return (ebpo_pair){ head, __builtin_fma(a, b, -head) };
#else
    ebpo_pair p = ebpo_split(a), q = ebpo_split(b);
    double rest = ((head - p.head * q.head) - p.tail * q.head) - p.head * q.tail;
    return (ebpo_pair){ head, p.tail * q.tail - rest };
#endif
}

/* Appends x to an expansion of n components. Does nothing if x is 0. Returns the number of
 * components. */
static inline int ebpo_expansion_push(double *out, int n, double x)
{
    if (x != 0)
        out[n++] = x;
    return n;
}

static inline int ebpo_expansion_of_pair(double *out, ebpo_pair pair)
{
    return ebpo_expansion_push(out, ebpo_expansion_push(out, 0, pair.tail), pair.head);
}

/* Computes out = e + f; `out` has capacity n + m and is neither e nor f. Returns the number of
 * components. */
static inline int ebpo_expansion_sum(double *out, const double *e, int n, const double *f, int m)
{
    int i = 0, j = 0, length = 0;
    double carry = 0;
    while (i < n || j < m) {
        double next = j >= m || (i < n && fabs(e[i]) < fabs(f[j])) ? e[i++] : f[j++];
        ebpo_pair sum = ebpo_two_sum(carry, next);
        length = ebpo_expansion_push(out, length, sum.tail);
        carry = sum.head;
    }
    return ebpo_expansion_push(out, length, carry);
}

/* Computes out = e * factor; `out` has capacity 2 n and is not e. */
static inline int ebpo_expansion_scale(double *out, const double *e, int n, double factor)
{
    int length = 0;
    double carry = 0;
    for (int i = 0; i < n; i++) {
        ebpo_pair product = ebpo_two_product(e[i], factor);
        ebpo_pair low = ebpo_two_sum(carry, product.tail);
        ebpo_pair high = ebpo_two_sum(product.head, low.head);
        length = ebpo_expansion_push(out, length, low.tail);
        length = ebpo_expansion_push(out, length, high.tail);
        carry = high.head;
    }
    return ebpo_expansion_push(out, length, carry);
}

static inline void ebpo_expansion_negate(double *e, int n)
{
    for (int i = 0; i < n; i++)
        e[i] = -e[i];
}

static inline int ebpo_expansion_sign(const double *e, int n)
{
    return n == 0 ? 0 : e[n - 1] > 0 ? 1 : -1;
}

/* Reduces the number of components, in place: each component becomes the rounded sum of itself and
 * all smaller components. This is Shewchuk's COMPRESS. */
static inline int ebpo_expansion_compress(double *e, int n)
{
    if (n == 0)
        return 0;
    int bottom = n - 1, top = 0;
    double sum = e[n - 1];
    for (int i = n - 2; i >= 0; i--) {
        ebpo_pair pair = ebpo_two_sum(sum, e[i]);
        sum = pair.head;
        if (pair.tail != 0) {
            e[bottom--] = sum;
            sum = pair.tail;
        }
    }
    e[bottom] = sum;
    for (int i = bottom + 1; i < n; i++) {
        ebpo_pair pair = ebpo_two_sum(e[i], sum);
        sum = pair.head;
        if (pair.tail != 0)
            e[top++] = pair.tail;
    }
    e[top++] = sum;
    return top;
}

/* Computes out = e * f, where f has at most two components and e at most 16. `out` has capacity 4
 * n. */
static inline int ebpo_expansion_times(double *out, const double *e, int n, const double *f, int m)
{
    double low[32], high[32];
    if (m == 0)
        return 0;
    if (m == 1)
        return ebpo_expansion_scale(out, e, n, f[0]);
    int low_n = ebpo_expansion_scale(low, e, n, f[0]);
    int high_n = ebpo_expansion_scale(high, e, n, f[1]);
    return ebpo_expansion_sum(out, low, low_n, high, high_n);
}

/* A difference as an expansion of at most two components. */
typedef struct ebpo_difference {
    int n;
    double x[2];
} ebpo_difference;

static inline ebpo_difference ebpo_difference_of(ebpo_pair pair)
{
    ebpo_difference d = { 0 };
    d.n = ebpo_expansion_of_pair(d.x, pair);
    return d;
}

/* Computes out = p * q - r * s; capacity 16. */
static inline int ebpo_expansion_minor(double *out, ebpo_difference p, ebpo_difference q,
                                       ebpo_difference r, ebpo_difference s)
{
    double left[8], right[8];
    int left_n = ebpo_expansion_times(left, p.x, p.n, q.x, q.n);
    int right_n = ebpo_expansion_times(right, r.x, r.n, s.x, s.n);
    ebpo_expansion_negate(right, right_n);
    return ebpo_expansion_sum(out, left, left_n, right, right_n);
}

/* Double-double arithmetic: a value is head + tail, |tail| at most about half an ulp of head. The
 * error of a sum is at most some 2^-104 of the sum of the operands' absolute values. The error of a
 * product is at most some 2^-104 of the product. Overflow and underflow are not included in these
 * bounds. Include strict_fp.h first. Source: Dekker 1971, "A floating-point technique for extending
 * the available precision". */

static inline ebpo_pair ebpo_pair_of(double x) { return (ebpo_pair){ x, 0 }; }

static inline ebpo_pair ebpo_pair_add(ebpo_pair a, ebpo_pair b)
{
    ebpo_pair sum = ebpo_two_sum(a.head, b.head);
    double tail = sum.tail + (a.tail + b.tail), head = sum.head + tail;
    return (ebpo_pair){ head, tail - (head - sum.head) };
}

static inline ebpo_pair ebpo_pair_subtract(ebpo_pair a, ebpo_pair b)
{
    return ebpo_pair_add(a, (ebpo_pair){ -b.head, -b.tail });
}

/* Returns the product. The bits of head and tail may overlap; that is allowed in further additions
 * and products. */
static inline ebpo_pair ebpo_pair_multiply(ebpo_pair a, ebpo_pair b)
{
    ebpo_pair product = ebpo_two_product(a.head, b.head);
    product.tail += a.head * b.tail + a.tail * b.head;
    return product;
}

/* Returns a / b to a relative error of some 2^-100; b is not 0. */
static inline ebpo_pair ebpo_pair_divide(ebpo_pair a, ebpo_pair b)
{
    double first = a.head / b.head;
    ebpo_pair rest = ebpo_pair_subtract(a, ebpo_pair_multiply(b, ebpo_pair_of(first)));
    return ebpo_pair_add(ebpo_pair_of(first), ebpo_pair_of(rest.head / b.head));
}

/* Computes ebpo_pair_quotient's two doubles from q = a.head / b.head, without its checks. */
static inline void ebpo_pair_quotient_near(ebpo_pair a, ebpo_pair b, double error, double q,
                                           double *least, double *greatest)
{
    ebpo_pair back = ebpo_two_product(q, b.head);
    double rest = ((a.head - back.head) - back.tail) + (a.tail - q * b.tail);
    double correction = rest / b.head, margin = fabs(q) * (error + 0x1p-100);
    *least = q + (correction - margin);
    *greatest = q + (correction + margin);
}

/* Returns true if a quotient q (ebpo_pair_quotient_near) is neither too large nor too small. */
static inline bool ebpo_pair_quotient_in_range(double q, double error)
{
    return fabs(q) >= 0x1p-900 && fabs(q) <= 0x1p900 && error <= 0x1p-56;
}

/* Computes two doubles. At least one of them is the exact a / b, rounded to nearest. The two
 * doubles are equal if the rounding is certain, and otherwise adjacent. `error`: sum of the
 * relative errors of a and b. Returns false if the quotient is too large or too small. */
static inline bool ebpo_pair_quotient(ebpo_pair a, ebpo_pair b, double error, double out[2])
{
    double q = a.head / b.head;
    if (!ebpo_pair_quotient_in_range(q, error))
        return false;
    ebpo_pair_quotient_near(a, b, error, q, &out[0], &out[1]);
    return out[0] == out[0] && out[1] == out[1];
}

/* --- vectors --- */

static inline ebpo_pair ebpo_pair_dot(const ebpo_pair a[3], const ebpo_pair b[3])
{
    return ebpo_pair_add(ebpo_pair_add(ebpo_pair_multiply(a[0], b[0]),
                                       ebpo_pair_multiply(a[1], b[1])),
                         ebpo_pair_multiply(a[2], b[2]));
}

static inline void ebpo_pair_cross(const ebpo_pair a[3], const ebpo_pair b[3], ebpo_pair out[3])
{
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        out[k] = ebpo_pair_subtract(ebpo_pair_multiply(a[u], b[v]), ebpo_pair_multiply(a[v], b[u]));
    }
}

/* Computes b - a, exactly. */
static inline void ebpo_pair_differences(const double a[3], const double b[3], ebpo_pair out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = ebpo_two_difference(b[k], a[k]);
}

#endif
