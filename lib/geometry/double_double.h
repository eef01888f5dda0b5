/* Double-double arithmetic: a value is head + tail, |tail| at most about half an ulp of head.
 * Errors of each operation are at most some 2^-104 of the sum of its operands' absolute values (of
 * the product of these), apart from overflow and underflow. Include strict_fp.h first. Source:
 * Dekker 1971, "A floating-point technique for extending the available precision". */
#ifndef EBPO_GEOMETRY_DOUBLE_DOUBLE_H
#define EBPO_GEOMETRY_DOUBLE_DOUBLE_H

#include <stdbool.h>

#include "geometry/expansion.h"

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

/* Head and tail may overlap by some bits: fit for further additions and products. */
static inline ebpo_pair ebpo_pair_multiply(ebpo_pair a, ebpo_pair b)
{
    ebpo_pair product = ebpo_two_product(a.head, b.head);
    product.tail += a.head * b.tail + a.tail * b.head;
    return product;
}

/* a / b, b not 0: to some 2^-100. */
static inline ebpo_pair ebpo_pair_divide(ebpo_pair a, ebpo_pair b)
{
    double first = a.head / b.head;
    ebpo_pair rest = ebpo_pair_subtract(a, ebpo_pair_multiply(b, ebpo_pair_of(first)));
    return ebpo_pair_add(ebpo_pair_of(first), ebpo_pair_of(rest.head / b.head));
}

/* a / b as two doubles that differ by one step at most, the exact quotient rounded to nearest being
 * one of them; equal, where there is no doubt. `error`: how far a and b are off together, as a part
 * of themselves. False where the quotient is so large or small that this does not hold. */
static inline bool ebpo_pair_quotient(ebpo_pair a, ebpo_pair b, double error, double out[2])
{
    double q = a.head / b.head;
    if (!(fabs(q) >= 0x1p-900 && fabs(q) <= 0x1p900 && error <= 0x1p-56))
        return false;
    ebpo_pair back = ebpo_two_product(q, b.head);
    double rest = ((a.head - back.head) - back.tail) + (a.tail - q * b.tail);
    double correction = rest / b.head, margin = fabs(q) * (error + 0x1p-100);
    out[0] = q + (correction - margin);
    out[1] = q + (correction + margin);
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

/* b - a, exact. */
static inline void ebpo_pair_differences(const double a[3], const double b[3], ebpo_pair out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = ebpo_two_difference(b[k], a[k]);
}

#endif
