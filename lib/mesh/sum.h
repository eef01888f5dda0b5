/* Compensated summation (Neumaier 1974): sums of millions of terms that keep nearly all digits, in a fixed order. */
#ifndef EBPO_MESH_SUM_H
#define EBPO_MESH_SUM_H

#include <math.h>

typedef struct ebpo_sum {
    double sum, lost;
} ebpo_sum;

static inline void ebpo_sum_add(ebpo_sum *s, double x)
{
    double t = s->sum + x;
    s->lost += fabs(s->sum) >= fabs(x) ? (s->sum - t) + x : (x - t) + s->sum;
    s->sum = t;
}

static inline void ebpo_sum_merge(ebpo_sum *s, const ebpo_sum *other)
{
    ebpo_sum_add(s, other->sum);
    ebpo_sum_add(s, other->lost);
}

static inline double ebpo_sum_value(const ebpo_sum *s)
{
    return s->sum + s->lost;
}

#endif
