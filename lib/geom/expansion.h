/* Exact arithmetic on doubles: a value is an unevaluated sum of doubles that do not overlap, the
 * smallest first, without zeros. Exact as long as nothing overflows or underflows: callers keep
 * exponents in range (see predicates_expansion.c). An array of n = 0 components is 0. Include
 * strict_fp.h first. Source: Shewchuk 1997, section 2: TWO-SUM, SPLIT, TWO-PRODUCT,
 * FAST-EXPANSION-SUM and SCALE-EXPANSION. */
#ifndef EBPO_GEOM_EXPANSION_H
#define EBPO_GEOM_EXPANSION_H

#include <math.h>

/* A double and what rounding left of it: head + tail is exact. */
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

/* Halves of at most 26 bits. */
static inline ebpo_pair ebpo_split(double a)
{
    double c = 0x1.0000002p27 * a;
    double high = c - (c - a);
    return (ebpo_pair){ high, a - high };
}

static inline ebpo_pair ebpo_two_product(double a, double b)
{
    double head = a * b;
#ifdef EBPO_PRODUCTS_BY_FMA /* the same while nothing overflows or underflows, and faster */
    return (ebpo_pair){ head, __builtin_fma(a, b, -head) };
#else
    ebpo_pair p = ebpo_split(a), q = ebpo_split(b);
    double rest = ((head - p.head * q.head) - p.tail * q.head) - p.head * q.tail;
    return (ebpo_pair){ head, p.tail * q.tail - rest };
#endif
}

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

/* out = e + f; `out` has room for n + m and is neither of them. Returns the number of components.
 */
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

/* out = e * factor; `out` has room for 2 n and is not e. */
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

#endif
